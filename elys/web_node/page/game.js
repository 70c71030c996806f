// Keyboard and mouse for the running game, while the view has them; Escape gives them back.

const MOST_CHANGES = 200;
const NOTCH = 100; // [pixels] of a wheel that counts pixels

/** What KeyboardEvent.code calls a key, by its place on an American keyboard, as ELYS does (common/input_names.py). */
const NAMED = {
  Space: "space", Quote: "apostrophe", Comma: "comma", Minus: "minus", Period: "period", Slash: "slash", Semicolon: "semicolon",
  Equal: "equal", BracketLeft: "left_bracket", Backslash: "backslash", BracketRight: "right_bracket", Backquote: "grave_accent",
  IntlBackslash: "world_1", IntlRo: "world_2", Enter: "enter", Tab: "tab", Backspace: "backspace", Insert: "insert", Delete: "delete",
  ArrowRight: "right", ArrowLeft: "left", ArrowDown: "down", ArrowUp: "up", PageUp: "page_up", PageDown: "page_down", Home: "home",
  End: "end", CapsLock: "caps_lock", ScrollLock: "scroll_lock", NumLock: "num_lock", PrintScreen: "print_screen", Pause: "pause",
  NumpadDecimal: "kp_decimal", NumpadDivide: "kp_divide", NumpadMultiply: "kp_multiply", NumpadSubtract: "kp_subtract",
  NumpadAdd: "kp_add", NumpadEnter: "kp_enter", NumpadEqual: "kp_equal", ShiftLeft: "left_shift", ControlLeft: "left_control",
  AltLeft: "left_alt", MetaLeft: "left_super", ShiftRight: "right_shift", ControlRight: "right_control", AltRight: "right_alt",
  MetaRight: "right_super", ContextMenu: "menu",
};
const BUTTONS = ["mouse_left", "mouse_middle", "mouse_right", "mouse_4", "mouse_5"]; // by MouseEvent.button

export function nameOf(code) {
  const simple = /^(?:Key([A-Z])|Digit(\d)|(F\d{1,2}))$/.exec(code);
  if (simple) return (simple[1] ?? simple[2] ?? simple[3]).toLowerCase();
  const pad = /^Numpad(\d)$/.exec(code);
  return pad ? `kp_${pad[1]}` : NAMED[code] ?? "";
}

export class Game extends EventTarget {
  #link;
  #canvas;
  #changes = [];
  #moved = {};
  #text = "";
  #isDirty = false;
  isOn = false;

  constructor(link, canvas) {
    super();
    this.#link = link;
    this.#canvas = canvas;
    canvas.addEventListener("keydown", (event) => this.#key(event, true));
    canvas.addEventListener("keyup", (event) => this.#key(event, false));
    canvas.addEventListener("blur", () => this.stop());
    canvas.addEventListener("mousedown", (event) => this.#button(event, true));
    addEventListener("mouseup", (event) => this.#button(event, false));
    canvas.addEventListener("mousemove", (event) => {
      this.#move("pointer_x", event.movementX);
      this.#move("pointer_y", event.movementY);
    });
    canvas.addEventListener("wheel", (event) => this.#move("wheel_y", -event.deltaY / NOTCH), { passive: true });
    link.addEventListener("close", () => this.#set(false));
  }

  /** Lends keyboard and mouse to the game. */
  start() {
    this.#canvas.focus();
    this.#set(true);
  }

  /** Gives them back; all that is held is let go. */
  stop() {
    if (!this.isOn) return;
    this.#changes = [];
    this.#moved = {};
    this.#text = "";
    this.#link.send({ type: "keys", lets_go: true });
    this.#set(false);
  }

  #set(isOn) {
    if (this.isOn === isOn) return;
    this.isOn = isOn;
    this.dispatchEvent(new Event("change"));
  }

  #key(event, isDown) {
    if (!this.isOn) return;
    if (isDown && event.code === "Escape") return this.stop();
    const name = nameOf(event.code);
    if (!name) return;
    event.preventDefault();
    event.stopPropagation();
    if (isDown && event.key.length === 1 && !event.ctrlKey && !event.metaKey) this.#text = (this.#text + event.key).slice(0, 200);
    if (!event.repeat) this.#change(name, isDown);
    else this.#touch();
  }

  #button(event, isDown) {
    const name = BUTTONS[event.button];
    if (!this.isOn || !name) return;
    this.#change(name, isDown);
  }

  #change(name, isDown) {
    if (this.#changes.length < MOST_CHANGES) this.#changes.push([name, isDown]);
    this.#touch();
  }

  #move(name, distance) {
    if (!this.isOn || !distance) return;
    this.#moved[name] = (this.#moved[name] ?? 0) + distance;
    this.#touch();
  }

  #touch() {
    if (this.#isDirty) return;
    this.#isDirty = true;
    requestAnimationFrame(() => {
      this.#isDirty = false;
      if (!this.isOn) return;
      this.#link.send({ type: "keys", changes: this.#changes, moved: this.#moved, text: this.#text });
      this.#changes = [];
      this.#moved = {};
      this.#text = "";
    });
  }
}
