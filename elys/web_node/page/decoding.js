// Pictures as they come, JPEG or H.264 (Annex B), made into what a canvas draws.

/** Whether this browser decodes the H.264 that render nodes make; only on a page that is local or encrypted. */
export async function canDecodeH264() {
  if (!("VideoDecoder" in self)) return false;
  try {
    return (await VideoDecoder.isConfigSupported({ codec: "avc1.42c028", optimizeForLatency: true })).supported;
  } catch {
    return false;
  }
}

export class PictureDecoder {
  #decoder = null;
  #codec = "";
  #waiting = [];

  /** What to draw, to be closed when that is done; null for what cannot be decoded, so that a keyframe is needed. */
  async decode(about, data) {
    if (about.encoding === "jpeg") {
      try {
        return await createImageBitmap(new Blob([data], { type: "image/jpeg" }));
      } catch {
        return null;
      }
    }
    return this.#decodeVideo(about, data);
  }

  #decodeVideo(about, data) {
    if (about.keyframe) {
      const codec = codecOf(data);
      if (!codec) return Promise.resolve(null);
      if (this.#decoder?.state !== "configured" || codec !== this.#codec) this.#configure(codec);
    }
    if (this.#decoder?.state !== "configured") return Promise.resolve(null);
    return new Promise((resolve) => {
      this.#waiting.push(resolve);
      try {
        const type = about.keyframe ? "key" : "delta";
        this.#decoder.decode(new EncodedVideoChunk({ type, timestamp: about.picture * 1000, data }));
      } catch {
        this.#fail();
      }
    });
  }

  #configure(codec) {
    this.#fail();
    this.#codec = codec;
    const output = (frame) => {
      const resolve = this.#waiting.shift();
      resolve ? resolve(frame) : frame.close();
    };
    this.#decoder = new VideoDecoder({ output, error: () => this.#fail() });
    // The encoder says nothing of colours: they are those of swscale, BT.601 from 16 to 235.
    const colorSpace = { matrix: "smpte170m", primaries: "bt709", transfer: "iec61966-2-1", fullRange: false };
    this.#decoder.configure({ codec, optimizeForLatency: true, colorSpace });
  }

  #fail() {
    const decoder = this.#decoder;
    this.#decoder = null;
    if (decoder && decoder.state !== "closed") decoder.close();
    for (const resolve of this.#waiting.splice(0)) resolve(null);
  }
}

/** The codec string of a stream, from the sequence parameter set in its keyframe (ITU-T H.264, 7.3.2.1.1). */
export function codecOf(data) {
  for (let at = 0; at + 6 < data.length; at++)
    if (data[at] === 0 && data[at + 1] === 0 && data[at + 2] === 1 && (data[at + 3] & 31) === 7)
      return "avc1." + [...data.slice(at + 4, at + 7)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  return "";
}
