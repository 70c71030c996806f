"""Forwards one TCP port, as `ssh -L` does: forwarder.py PORT HOST PORT_THERE. Says how many connections there were."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import sys


async def forward(port: int, host: str, port_there: int) -> None:
    numbers = itertools.count(1)

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(1 << 16):
                writer.write(data)
                await writer.drain()
        writer.close()

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        print(f"{next(numbers)} connections", flush=True)
        try:
            there_reader, there_writer = await asyncio.open_connection(host, port_there)
        except OSError:
            writer.close()
            return
        await asyncio.gather(pass_on(reader, there_writer), pass_on(there_reader, writer))

    server = await asyncio.start_server(connected, "0.0.0.0", port)
    print("forwarding", flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(forward(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
