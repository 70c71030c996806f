// The way to the web node: the login, a WebSocket that is opened again whenever it ends, questions with their answers.

const SHORTEST = 250; // [ms] before it is opened again
const LONGEST = 4000;
const PING_INTERVAL = 1000; // [ms]
const FLOODED = 256 * 1024; // bytes that wait to leave, beyond which news are dropped: newer ones follow

export class Link extends EventTarget {
  #socket = null;
  #pause = SHORTEST;
  #questions = new Map();
  #number = 0;
  #least = [];
  isOpen = false;
  role = "viewer";
  roundTrip = 0; // [ms] the least of the last few
  received = 0; // bytes

  /** Logs in with the secret of the address, if it has one, and opens the way. */
  async start() {
    const given = new URLSearchParams(location.hash.slice(1)).get("secret");
    if (given) {
      history.replaceState(null, "", location.pathname + location.search); // not to be left standing, or bookmarked
      await this.logIn(given);
    }
    this.#open();
    setInterval(() => this.isOpen && this.send({ type: "ping", time: performance.now() }), PING_INTERVAL);
  }

  /** Gives a secret for a cookie; returns why it was refused, or "". */
  async logIn(secret) {
    const headers = { "Content-Type": "application/json" };
    try {
      const response = await fetch("login", { method: "POST", headers, body: JSON.stringify({ secret }) });
      return response.ok ? "" : (await response.json()).reason;
    } catch {
      return "the web node does not answer";
    }
  }

  /** Says something; returns whether it left. */
  send(message) {
    if (!this.isOpen || this.#socket.bufferedAmount > FLOODED) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  /** Asks, and resolves to the answer; one that says why there is none where the way ends. */
  ask(message) {
    const id = ++this.#number;
    if (!this.send({ ...message, id })) return Promise.resolve({ accepted: false, reason: "the way to the session is interrupted" });
    return new Promise((resolve) => this.#questions.set(id, resolve));
  }

  /** Opens the way as soon as may be: after a login. */
  async retry() {
    this.#pause = SHORTEST;
    if (!this.#socket) await this.#open();
  }

  async #open() {
    try {
      const known = await fetch("me");
      if (known.status === 401) return this.#tell("login");
      if (!known.ok) throw new Error(known.statusText);
      this.role = (await known.json()).role;
    } catch {
      return this.#again();
    }
    const socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.isOpen = true;
      this.#pause = SHORTEST;
      this.#tell("open");
    };
    socket.onmessage = ({ data }) => this.#take(data);
    socket.onclose = ({ code, reason }) => {
      this.isOpen = false;
      this.#socket = null;
      for (const answer of this.#questions.values()) answer({ accepted: false, reason: "the way to the session is interrupted" });
      this.#questions.clear();
      this.#tell("close", { code, reason });
      this.#again();
    };
    this.#socket = socket;
  }

  #again() {
    this.#tell("down");
    setTimeout(() => this.#socket || this.#open(), this.#pause * (0.75 + Math.random() / 2));
    this.#pause = Math.min(this.#pause * 2, LONGEST);
  }

  #take(data) {
    if (typeof data !== "string") {
      this.received += data.byteLength;
      const length = new DataView(data).getUint32(0, true);
      const about = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      return this.#tell("picture", { about, data: new Uint8Array(data, 4 + length) });
    }
    this.received += data.length;
    const message = JSON.parse(data);
    if (message.type === "answer") {
      const answer = this.#questions.get(message.id);
      this.#questions.delete(message.id);
      if (answer) answer(message);
      else this.#tell("refused", message);
    } else if (message.type === "pong") {
      this.#least = [...this.#least.slice(-9), performance.now() - message.time];
      this.roundTrip = Math.min(...this.#least);
    } else this.#tell(message.type, message);
  }

  #tell(type, detail = {}) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
