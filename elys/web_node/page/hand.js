// Mouse, fingers and keys on the view: turn, move, come nearer, choose.

const STILL = 5; // [pixels] within which a press is a click
const SHORT = 500; // [ms] within which it is one
const KEY_TURN = 0.03; // view heights for a press of an arrow
const NOTCH = 100; // [pixels] of a wheel that counts pixels

/** Lets a hand lead the camera of a view. `choose(x, y)` hears of clicks, `isGame()` whether hands play the game. */
export function leadByHand(view, { choose, isGame }) {
  const canvas = view.canvas;
  const pointers = new Map();
  let press = null;
  let pinch = null;

  const lead = (move) => {
    const orbit = view.led();
    if (!orbit) return;
    move(orbit);
    view.touch();
  };
  const height = () => canvas.getBoundingClientRect().height;

  canvas.addEventListener("pointerdown", (event) => {
    if (isGame()) return;
    canvas.focus({ focusVisible: false });
    capture(canvas, event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    press = pointers.size === 1 ? { x: event.clientX, y: event.clientY, at: event.timeStamp, button: event.button } : null;
    pinch = null;
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before || isGame()) return;
    const now = { x: event.clientX, y: event.clientY };
    if (press && Math.hypot(now.x - press.x, now.y - press.y) > STILL) press = null;
    pointers.set(event.pointerId, now);
    if (pointers.size === 2) return lead((orbit) => (pinch = pinchBy(orbit, pointers, pinch, height())));
    if (press) return;
    const [x, y] = [(now.x - before.x) / height(), (now.y - before.y) / height()];
    const moves = event.shiftKey || event.buttons & 6; // the middle or the right button
    lead((orbit) => (moves ? orbit.pan(x, y) : orbit.turn(x, y)));
  });
  const lift = (event) => {
    pointers.delete(event.pointerId);
    pinch = null;
    const isClick = press && press.button === 0 && event.type === "pointerup" && event.timeStamp - press.at < SHORT;
    press = null;
    if (isClick && !isGame()) choose(event.clientX, event.clientY);
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (isGame()) return;
    const notches = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / NOTCH : event.deltaY / 3;
    lead((orbit) => orbit.zoom(-Math.min(Math.max(notches, -5), 5)));
  }, { passive: false });

  canvas.addEventListener("keydown", (event) => {
    if (isGame() || event.ctrlKey || event.metaKey || event.altKey) return;
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
    const near = { "+": 1, "=": 1, "-": -1 }[event.key] ?? 0;
    if (!x && !y && !near) return;
    event.preventDefault();
    lead((orbit) => {
      if (near) orbit.zoom(near);
      else event.shiftKey ? orbit.pan(x * KEY_TURN, y * KEY_TURN) : orbit.turn(x * KEY_TURN, y * KEY_TURN);
    });
  });
}

/** Two fingers: their distance is how near, their middle where. Returns where they are now. */
function pinchBy(orbit, pointers, before, height) {
  const [a, b] = [...pointers.values()];
  const now = { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, gap: Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1) };
  if (before) {
    orbit.pan((now.x - before.x) / height, (now.y - before.y) / height);
    orbit.zoom(Math.log(now.gap / before.gap) / -Math.log(0.88));
  }
  return now;
}

function capture(element, pointer) {
  try {
    element.setPointerCapture(pointer);
  } catch { /* the pointer is gone already */ }
}
