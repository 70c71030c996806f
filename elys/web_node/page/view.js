// The live view: asks for what is wanted, shows what comes, and lets the web node know when there is room for more.

import { canDecodeH264, PictureDecoder } from "./decoding.js";
import { Orbit } from "./orbit.js";

const MOST_PIXELS = { auto: 1.3e6, h264: 1.3e6, jpeg: 1.3e6, small: 2e5 };
const USUAL_DISTANCE = 8; // [m] around which one circles where nothing is seen in the middle
const MEASURED = 60; // pictures over which figures are taken

export class View extends EventTarget {
  #link;
  #canvas = document.getElementById("picture");
  #context = this.#canvas.getContext("2d", { alpha: false });
  #decoder = new PictureDecoder();
  #orbit = null; // until a hand leads
  #isFramed = false;
  #number = 0;
  #askedAt = new Map(); // by number of look: when [ms]
  #isDirty = false;
  #queue = Promise.resolve();
  #came = []; // [ms], bytes of the last pictures
  #waits = []; // [ms] from a look to its picture
  #h264 = false;
  #distance = 0;
  selection = [];
  quality = "auto";
  shown = null; // what is known of the picture that is seen
  shownAt = 0; // [ms]

  constructor(link) {
    super();
    this.#link = link;
    link.addEventListener("picture", ({ detail }) => this.#take(detail.about, detail.data));
    link.addEventListener("open", () => this.touch());
    new ResizeObserver(() => this.touch()).observe(this.#canvas);
    document.addEventListener("visibilitychange", () => this.touch());
    canDecodeH264().then((can) => {
      this.#h264 = can;
      this.touch();
    });
  }

  get canvas() {
    return this.#canvas;
  }

  /** The hand's camera; it begins where that of the picture stands. Null before there is any. */
  led() {
    if (!this.#orbit && this.shown) {
      this.#orbit = new Orbit();
      this.#orbit.take(this.shown.camera, this.#distance || USUAL_DISTANCE);
    }
    return this.#orbit;
  }

  /** All of the scene, or what its own camera sees. */
  reset({ framed }) {
    this.#orbit = null;
    this.#isFramed = framed;
    this.#distance = 0;
    this.touch();
  }

  /** What is wanted is something else now: it is asked for with the next frame of the screen. */
  touch() {
    if (this.#isDirty) return;
    this.#isDirty = true;
    const ask = () => {
      this.#isDirty = false;
      this.#ask();
    };
    document.hidden ? ask() : requestAnimationFrame(ask);
  }

  /** What stands at a place of the page: the answer has `entity`, 0 for nothing. */
  pick(x, y) {
    const [column, row] = this.#pixelAt(x, y);
    return this.#pickPixel(column, row);
  }

  /** Figures of the last pictures. */
  get figures() {
    const [first, last] = [this.#came[0], this.#came.at(-1)];
    const seconds = this.#came.length > 1 ? (last.at - first.at) / 1000 : 0;
    const bytes = this.#came.slice(1).reduce((sum, picture) => sum + picture.size, 0);
    const isFresh = last && performance.now() - last.at < 2000;
    const waits = [...this.#waits].sort((a, b) => a - b);
    return {
      rate: isFresh && seconds ? (this.#came.length - 1) / seconds : 0,
      bytes: isFresh && seconds ? bytes / seconds : 0,
      wait: waits.length ? waits[waits.length >> 1] : 0,
      encoding: this.shown?.encoding ?? "",
    };
  }

  #pixelAt(x, y) {
    const box = this.#canvas.getBoundingClientRect();
    const column = Math.floor(((x - box.left) / box.width) * this.shown.width);
    const row = Math.floor(((y - box.top) / box.height) * this.shown.height);
    return [Math.min(Math.max(column, 0), this.shown.width - 1), Math.min(Math.max(row, 0), this.shown.height - 1)];
  }

  async #pickPixel(x, y) {
    const { camera, width, height } = this.shown;
    const found = await this.#link.ask({ type: "pick", camera, width, height, x, y });
    return { ...found, camera };
  }

  #ask() {
    const box = this.#canvas.getBoundingClientRect();
    const density = Math.min(devicePixelRatio || 1, 2);
    let [width, height] = [box.width * density, box.height * density];
    if (width < 1 || height < 1) return;
    const shrink = Math.min(1, Math.sqrt(MOST_PIXELS[this.quality] / (width * height)));
    [width, height] = [width, height].map((edge) => Math.max(2, 2 * Math.round((edge * shrink) / 2)));
    const number = ++this.#number;
    this.#askedAt.set(number, performance.now());
    if (this.#askedAt.size > 200) this.#askedAt.delete(this.#askedAt.keys().next().value);
    this.#link.send({
      type: "look",
      number,
      camera: this.#orbit?.camera() ?? null,
      framed: this.#isFramed,
      width,
      height,
      selection: this.selection,
      encoding: this.#h264 && this.quality !== "jpeg" ? "h264" : "jpeg",
      is_seen: !document.hidden,
    });
  }

  /** One after the other: a stream has to be decoded in order. */
  #take(about, data) {
    this.#queue = this.#queue.then(async () => {
      const image = await this.#decoder.decode(about, data);
      this.#link.send({ type: "shown", picture: about.picture, lost: image === null });
      if (image) this.#show(about, data.byteLength, image);
    });
  }

  #show(about, size, image) {
    if (this.#canvas.width !== about.width || this.#canvas.height !== about.height) {
      this.#canvas.width = about.width;
      this.#canvas.height = about.height;
    }
    this.#canvas.classList.add("drawn");
    this.#context.drawImage(image, 0, 0); // one of an odd edge is a pixel larger than what is seen
    image.close();
    const isFirst = !this.shown;
    const now = performance.now();
    this.shown = about;
    this.shownAt = now;
    this.#came = [...this.#came.slice(1 - MEASURED), { at: now, size }];
    const askedAt = this.#askedAt.get(about.look);
    if (askedAt !== undefined) {
      this.#waits = [...this.#waits.slice(1 - MEASURED), now - askedAt];
      for (const number of this.#askedAt.keys()) if (number <= about.look) this.#askedAt.delete(number);
    }
    if (isFirst || !this.#distance) this.#findDistance();
    this.dispatchEvent(new CustomEvent("shown", { detail: about }));
  }

  /** Finds how far away that is which is seen in the middle: a hand's camera circles around it. */
  async #findDistance() {
    this.#distance = USUAL_DISTANCE;
    const { width, height } = this.shown;
    const found = await this.#pickPixel(width >> 1, height >> 1);
    if (!found.accepted || !found.entity || this.#orbit) return;
    this.#distance = Math.hypot(...found.position.map((place, axis) => place - found.camera.position[axis]));
  }
}
