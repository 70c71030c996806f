// The page: puts its parts together, and says how things stand.

import { Game } from "./game.js";
import { leadByHand } from "./hand.js";
import { Inspector, translated } from "./inspector.js";
import { startLanguage, tr } from "./language.js";
import { Link } from "./link.js";
import { Time } from "./time.js";
import { Tree } from "./tree.js";
import { View } from "./view.js";

const ROLES = ["viewer", "player", "editor", "owner"];
const SILENCE = 1500; // [ms] without a status, of which four come a second, after which the host counts as hung
const LOOK_INTERVAL = 250;

const byId = (id) => document.getElementById(id);
const may = (role, needed) => ROLES.indexOf(role) >= ROLES.indexOf(needed);

const link = new Link();
const view = new View(link);
const tree = new Tree(link);
const inspector = new Inspector(link);
const time = new Time(link);
const game = new Game(link, view.canvas);
let role = "viewer";
let session = { connected: true, renderer: true };
let lostAt = 0;
let chosenName = "";

function start() {
  wireChoosing();
  wireView();
  wireGame();
  wireKeys();
  wireTabs();
  wireLogin();
  link.addEventListener("welcome", ({ detail }) => {
    role = detail.role;
    allow();
  });
  link.addEventListener("link", ({ detail }) => {
    session = detail;
    tell();
  });
  link.addEventListener("down", () => (lostAt ||= performance.now()));
  link.addEventListener("open", () => (lostAt = 0));
  link.addEventListener("close", tell);
  link.addEventListener("status", allow);
  link.addEventListener("refused", ({ detail }) => refuse(detail));
  time.addEventListener("refused", ({ detail }) => refuse(detail));
  document.addEventListener("languagechange", () => {
    allow();
    tell();
  });
  setInterval(tell, LOOK_INTERVAL);
}

/** What the role may do is switched on, and nothing else; the web node refuses it anyhow. */
function allow() {
  const isLive = time.status?.kind === "simulation";
  const mayEdit = may(role, "editor") && isLive;
  byId("role").textContent = tr(role);
  inspector.allow(mayEdit);
  byId("undo").disabled = byId("redo").disabled = !mayEdit;
  byId("game").disabled = !may(role, "player") || !isLive || Boolean(time.status?.is_rewound);
  if (game.isOn && byId("game").disabled) game.stop();
  time.allow(may(role, "editor"));
}

function choose(entity, name = "", { reveal = false } = {}) {
  chosenName = name;
  view.selection = entity ? [entity] : [];
  view.touch();
  inspector.inspect(entity);
  tree.select(entity, { reveal });
  byId("chosen").hidden = !entity;
  if (entity) byId("chosen").textContent = name || `#${entity}`;
}

function wireChoosing() {
  leadByHand(view, {
    isGame: () => game.isOn,
    choose: async (x, y) => {
      if (!view.shown) return;
      const found = await view.pick(x, y);
      if (found.accepted) choose(found.entity, found.name, { reveal: true });
      else refuse(found);
    },
  });
  tree.addEventListener("choose", ({ detail }) => choose(detail));
  link.addEventListener("entity", ({ detail }) => {
    if (detail.entity !== inspector.entity || !detail.entity) return;
    const kinds = Object.keys(detail.components ?? {}).filter((name) => name !== "Transform");
    byId("chosen").textContent = [detail.name || chosenName || `#${detail.entity}`, ...kinds].join(" · ");
  });
  byId("undo").addEventListener("click", () => inspector.edit({ type: "undo" }, ""));
  byId("redo").addEventListener("click", () => inspector.edit({ type: "redo" }, ""));
}

function wireView() {
  byId("frame").addEventListener("click", () => view.reset({ framed: true }));
  byId("camera").addEventListener("click", () => view.reset({ framed: false }));
  byId("quality").addEventListener("change", () => {
    view.quality = byId("quality").value;
    view.touch();
  });
  byId("figures-switch").addEventListener("click", showFigures);
}

function showFigures() {
  const figures = byId("figures");
  figures.hidden = !figures.hidden;
  byId("figures-switch").ariaPressed = !figures.hidden;
  tell();
}

function wireGame() {
  byId("game").addEventListener("click", () => (game.isOn ? game.stop() : startGame()));
  game.addEventListener("change", () => {
    byId("game").ariaPressed = game.isOn;
    byId("game-note").hidden = !game.isOn;
    byId("view").classList.toggle("playing-game", game.isOn);
  });
}

function startGame() {
  if (byId("game").disabled) return;
  game.start();
  if (!time.status.playing) time.toggle();
}

function wireKeys() {
  addEventListener("keydown", (event) => {
    const isTyping = event.target.matches("input:not([type=range], [type=checkbox]), select, dialog *");
    if (game.isOn || isTyping) return;
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
      event.preventDefault();
      return byId(event.shiftKey ? "redo" : "undo").click();
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const keys = { ",": () => time.step(-1), ".": () => time.step(1), f: () => byId("frame").click(), c: () => byId("camera").click(), p: startGame, a: showFigures };
    const isButton = event.target.matches("button, summary, [type=checkbox]");
    if (event.key === " " && !isButton) {
      event.preventDefault();
      time.toggle();
    } else if (keys[event.key]) keys[event.key]();
  });
}

function wireTabs() {
  const tabs = [byId("tab-tree"), byId("tab-inspector")];
  const show = (tab) => {
    document.body.classList.toggle("shows-inspector", tab === tabs[1]);
    for (const each of tabs) {
      each.ariaSelected = each === tab;
      each.tabIndex = each === tab ? 0 : -1;
    }
  };
  for (const tab of tabs) {
    tab.addEventListener("click", () => show(tab));
    tab.addEventListener("keydown", (event) => {
      if (!["ArrowLeft", "ArrowRight"].includes(event.key)) return;
      const other = tabs[tab === tabs[0] ? 1 : 0];
      other.focus();
      show(other);
    });
  }
}

function wireLogin() {
  const [dialog, wrong] = [byId("login"), byId("login-wrong")];
  link.addEventListener("login", () => dialog.open || dialog.showModal());
  dialog.addEventListener("cancel", (event) => event.preventDefault()); // nothing can be seen without
  dialog.querySelector("form").addEventListener("submit", async (event) => {
    event.preventDefault();
    const reason = await link.logIn(byId("secret").value);
    wrong.hidden = !reason;
    wrong.textContent = tr(reason);
    if (reason) return;
    byId("secret").value = "";
    dialog.close();
    link.retry();
  });
}

function refuse(answer) {
  byId("refusal").hidden = false;
  byId("refusal").textContent = answer.problem ? tr(answer.problem, translated(answer.values)) : tr(answer.reason ?? "");
}

/** Link, age and banner. */
function tell() {
  const now = performance.now();
  const silence = time.heardAt ? now - time.heardAt : 0;
  const isSilent = link.isOpen && session.connected && silence > SILENCE;
  const banner = bannerText(now, isSilent, silence);
  byId("banner").hidden = !banner;
  if (byId("banner").textContent !== banner) byId("banner").textContent = banner;
  const isLost = !link.isOpen || !session.connected;
  byId("link").className = `chip link ${isLost ? "lost" : isSilent || link.roundTrip > 250 ? "slow" : "good"}`;
  byId("link-text").textContent = isLost ? tr("lost") : `${link.roundTrip.toFixed(link.roundTrip < 10 ? 1 : 0)} ms`;
  byId("link").title = tr("The way there and back takes {time} ms", { time: link.roundTrip.toFixed(1) });
  byId("age").textContent = ageText(now, isLost);
  byId("waiting").textContent = waitingText();
  if (!byId("figures").hidden) drawFigures();
}

function bannerText(now, isSilent, silence) {
  if (lostAt && now - lostAt > 300) return tr("The web node does not answer: trying again. What is seen is {age} s old.", { age: seconds(now - view.shownAt) });
  if (link.isOpen && !session.connected) return tr("The session has ended or cannot be reached: waiting until it is back.");
  if (isSilent) return tr("The session has said nothing for {time} s.", { time: seconds(silence) });
  if (link.isOpen && !session.renderer) return tr("Nobody draws this session now: waiting for a render node.");
  return "";
}

const seconds = (milliseconds) => (milliseconds / 1000).toFixed(1);

/** How old what is seen is: when the picture left, half the way here, and the time since while the scene goes on. */
function ageText(now, isLost) {
  const shown = view.shown;
  if (!shown || shown.age < 0 || isLost) return "";
  if (time.status && !time.status.playing) return "";
  const age = shown.age + link.roundTrip / 2 + (now - view.shownAt);
  return tr("{age} ms old", { age: Math.round(age) });
}

function waitingText() {
  if (view.shown || byId("login").open) return "";
  return link.isOpen && session.renderer ? tr("waiting for the first picture …") : "";
}

function drawFigures() {
  const { rate, bytes, wait, encoding } = view.figures;
  const shown = view.shown;
  const rows = [
    [tr("pictures"), `${rate.toFixed(1)} /s`],
    [tr("size"), shown ? `${shown.width} × ${shown.height}` : ""],
    [tr("encoding"), { h264: "H.264", jpeg: "JPEG" }[encoding] ?? ""],
    [tr("data"), `${((bytes * 8) / 1e6).toFixed(2)} Mbit/s`],
    [tr("drawing"), shown ? `${shown.drawing.toFixed(0)} ms` : ""],
    [tr("hand to picture"), `${wait.toFixed(0)} ms`],
    [tr("round trip"), `${link.roundTrip.toFixed(1)} ms`],
    [tr("entities"), time.status ? time.status.entity_count.toLocaleString() : ""],
    [tr("times real time"), time.status ? time.status.realtime_factor.toFixed(2) : ""],
  ];
  byId("figures").replaceChildren(...rows.flatMap(([name, value]) => [described("dt", name), described("dd", value)]));
}

function described(tag, text) {
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}

start();
await startLanguage();
await link.start();
