// Reads every message of an .mcap with the official reader for JavaScript. Usage: mcap_core.mjs FILE
import fs from 'fs';
import { createRequire } from 'module';
const require = createRequire(process.env.ELYS_NODE_MODULES + '/');
const { McapIndexedReader } = require('@mcap/core');
const { decompress } = require('fzstd');
const data = fs.readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(data.length),
  read: async (offset, length) => new Uint8Array(data.subarray(Number(offset), Number(offset + length))),
};
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: { zstd: (packed, size) => decompress(packed, new Uint8Array(Number(size))) },
});
const found = {};
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  const told = (found[channel.topic] ??= {
    count: 0, bytes: 0, encoding: channel.messageEncoding, schema: schema.name, schemaEncoding: schema.encoding, json: 0,
  });
  told.count += 1;
  told.bytes += message.data.byteLength;
  if (schema.encoding === 'jsonschema') JSON.parse(Buffer.from(schema.data).toString());
  if (channel.messageEncoding === 'json') {
    JSON.parse(Buffer.from(message.data).toString());
    told.json += 1;
  }
}
console.log(JSON.stringify(found));
