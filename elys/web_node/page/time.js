// Play, pause, step, rate, and the bar of time: of a recording, or of what a live session keeps.

import { tr } from "./language.js";

const byId = (id) => document.getElementById(id);

export class Time extends EventTarget {
  #link;
  #may = false;
  #seeking = false; // a seek is under way
  #wanted = null; // [s] the newest place to go to, while one is
  #isHeld = false; // the bar is being dragged
  status = null;
  heardAt = 0; // [ms]

  constructor(link) {
    super();
    this.#link = link;
    link.addEventListener("status", ({ detail }) => this.#take(detail));
    byId("play").addEventListener("click", () => this.toggle());
    byId("step").addEventListener("click", () => this.step(1));
    byId("back").addEventListener("click", () => this.step(-1));
    byId("rate").addEventListener("change", () => this.#ask({ type: "set_rate", rate: Number(byId("rate").value) }));
    byId("loop").addEventListener("click", () => this.#ask({ type: "set_loop", loop: !this.status.loop }));
    byId("now").addEventListener("click", () => this.#seek(this.status.end_time));
    byId("fork").addEventListener("click", () => this.#ask({ type: "resume" }));
    const scrub = byId("scrub");
    scrub.addEventListener("pointerdown", () => (this.#isHeld = true));
    for (const name of ["pointerup", "pointercancel", "blur"]) scrub.addEventListener(name, () => (this.#isHeld = false));
    scrub.addEventListener("input", () => this.#seek(Number(scrub.value)));
    document.addEventListener("languagechange", () => this.draw());
  }

  /** Whether the role may command time. */
  allow(may) {
    this.#may = may;
    this.draw();
  }

  toggle() {
    if (this.status) this.#ask({ type: "set_playing", playing: !this.status.playing });
  }

  /** Ticks on, or back. What plays is paused first. */
  async step(count) {
    if (!this.status) return;
    if (this.status.playing) await this.#ask({ type: "set_playing", playing: false });
    await this.#ask({ type: "step_ticks", count });
  }

  async #ask(command) {
    if (!this.#may) return { accepted: false };
    const answer = await this.#link.ask({ type: "ask", command });
    if (!answer.accepted) this.dispatchEvent(new CustomEvent("refused", { detail: answer }));
    return answer;
  }

  /** Goes to a time [s]; of many the newest, when the one before has been answered. */
  async #seek(time) {
    this.#wanted = time;
    if (this.#seeking) return;
    this.#seeking = true;
    while (this.#wanted !== null) {
      const next = this.#wanted;
      this.#wanted = null;
      await this.#ask({ type: "seek", time: next });
    }
    this.#seeking = false;
  }

  #take(status) {
    this.status = status;
    this.heardAt = performance.now();
    this.draw();
  }

  draw() {
    const status = this.status;
    for (const id of ["play", "step", "back", "rate", "loop", "now", "fork", "scrub"]) byId(id).disabled = !status || !this.#may;
    if (!status) return;
    const canWind = status.end_time > status.start_time;
    const isReplay = status.kind === "replay";
    byId("scrub").disabled ||= !canWind;
    byId("back").disabled ||= !canWind;
    byId("loop").hidden = !isReplay;
    byId("loop").ariaPressed = status.loop;
    byId("now").hidden = byId("fork").hidden = !status.is_rewound;
    byId("play").querySelector("use").setAttribute("href", status.playing ? "#i-pause" : "#i-play");
    byId("play").ariaLabel = status.playing ? tr("Pause") : tr("Play");
    this.#drawBar(status);
    this.#drawRate(status);
    this.#drawState(status, isReplay);
  }

  #drawBar(status) {
    const scrub = byId("scrub");
    scrub.min = status.start_time;
    scrub.max = Math.max(status.end_time, status.start_time + 1e-6);
    if (!this.#isHeld) scrub.value = status.simulation_time;
    scrub.ariaValueText = `${status.simulation_time.toFixed(2)} s`;
    byId("clock").textContent = `${status.simulation_time.toFixed(2)} s · ${tr("tick {tick}", { tick: status.tick })}`;
  }

  #drawRate(status) {
    const rate = byId("rate");
    if (rate === document.activeElement) return;
    const known = [...rate.options].find((option) => Number(option.value) === status.rate);
    if (!known) rate.append(new Option(status.rate ? `${status.rate} ×` : tr("as fast as it can"), status.rate));
    rate.value = known ? known.value : String(status.rate);
  }

  #drawState(status, isReplay) {
    const state = byId("state");
    state.hidden = false;
    state.className = `chip ${status.is_rewound ? "rewound" : status.playing ? "playing" : ""}`;
    const doing = status.playing ? tr("playing") : tr("paused");
    state.textContent = status.is_rewound ? tr("the past, {doing}", { doing }) : isReplay ? tr("recording, {doing}", { doing }) : doing;
    byId("scene").textContent = status.scene;
    document.title = `ELYS · ${status.scene}`;
  }
}
