// @ts-check
// Wires the page: messages go into the store, the store tells the views, people's wishes go to the connection.

import { Bands } from "./bands.js";
import { Charts } from "./charts.js";
import { Connection } from "./connection.js";
import { Controls, renderAwaiting } from "./controls.js";
import { Editor } from "./editor.js";
import { LogView } from "./log.js";
import { Notices } from "./notices.js";
import { Panels } from "./panels.js";
import { Plan } from "./plan.js";
import { Player } from "./recording.js";
import { renderScrub } from "./scrub.js";
import { SetupView } from "./setup.js";
import { Store } from "./store.js";
import { tabs } from "./tabs.js";
import { Units } from "./units.js";
import { Voice } from "./voice.js";

/** @typedef {import("./types/messages.js").Control} Control */

/**
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} type
 * @returns {T}
 */
function element(id, type) {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`the page has no ${id}`);
  return found;
}
const box = (/** @type {string} */ id) => element(id, HTMLElement);

const store = new Store();
const units = new Units();
const notices = new Notices(box("notice"));
const connection = new Connection((message) => store.apply(message), (isOpen) => store.link(isOpen));
const player = new Player(store, { failed: (reason) => notices.refusal(reason), sought: () => plan.flights.clear() });

/** @param {Control} control */
async function ask(control) {
  const answer = await connection.control(control);
  if (answer.answer === "done") store.applyStatus(answer);
  return answer;
}

/**
 * @param {Control} control
 * @param {string} note
 */
async function act(control, note = "") {
  notices.tell(await ask(control), note);
}

const isRecording = () => store.mode === "recording";
const controls = new Controls(box("bar"), store, {
  control: (control) => act(control, control.do === "init" ? "The next epoch is ready at tick 0." : ""),
  speed: (factor) => {
    if (!isRecording()) return act({ do: "speed", factor });
    player.factor = factor;
    if (!player.isPlaying) player.seek(player.tick);
  },
  toggle: () => {
    if (isRecording()) player.toggle();
    else act({ do: store.phase === "running" ? "pause" : "start" });
  },
  step: () => (isRecording() ? player.step(1) : act({ do: "step", n: 1 })),
});

const editor = new Editor({
  changed: () => setup.moved(),
  say: (text) => notices.note(text),
  body_m: () => setup.body_m,
  hasFault: (field) => setup.faults().has(field),
});
const setup = new SetupView(box("panel-setup"), { store, units, editor, notices, ask });
const plan = new Plan(element("plan", HTMLCanvasElement), store, units, editor, choose);
setup.onChange = () => {
  plan.touch();
  box("hint").hidden = editor.draft === null;
  box("legend").hidden = editor.draft !== null;
};
const panels = new Panels(box("panels"), store, units, {
  send: (to, command) => act({ do: "command", to, command }, `${command} goes to ${to} with the next tick.`),
  choose,
});
const log = new LogView(box("panel-log"), store);
const charts = new Charts({ select: box("chart-select"), chart: box("chart") }, store);
const bands = new Bands(box("bands"), store);
const voice = new Voice(store);

/** A robot is shown both on the plan and among the panels. @param {string | null} robot */
function choose(robot) {
  const chosen = robot === plan.chosen ? null : robot;
  plan.chosen = panels.chosen = chosen;
  plan.touch();
  panels.render();
  if (chosen) document.querySelector(`[data-testid="panel-${CSS.escape(chosen)}"]`)?.scrollIntoView({ block: "nearest" });
}

let openTab = "log";
const tabList = tabs(box("tabs"), (name) => {
  openTab = name;
  document.body.dataset.tab = name;
  setup.open(name === "setup");
  if (name === "log") log.shown();
  if (name === "charts") [charts, bands].forEach((view) => view.render());
});

// Views are drawn at most once a picture, and those that are costly to lay out less often.
const stale = new Set();
const OFTEN_MS = 60;
const SELDOM_MS = 200;
/** @type {Map<string, {every_ms: number, last_ms: number, draw: () => void}>} */
const views = new Map([
  ["bar", { every_ms: OFTEN_MS, last_ms: 0, draw: drawBar }],
  ["panels", { every_ms: SELDOM_MS / 2, last_ms: 0, draw: () => panels.render() }],
  ["log", { every_ms: OFTEN_MS, last_ms: 0, draw: drawLog }],
  ["charts", { every_ms: SELDOM_MS, last_ms: 0, draw: drawCharts }],
]);

function drawBar() {
  controls.render();
  renderAwaiting(box("awaiting"), store);
  if (isRecording()) renderScrub(box("scrub-bar"), player);
  const isSetUp = !isRecording();
  box("tab-setup").hidden = !isSetUp;
  if (!isSetUp && openTab === "setup") tabList.select("log");
  box("voice-label").hidden = isRecording();
  const isEmpty = store.frame === null && !isRecording() && !(store.isLive && store.status);
  box("empty").hidden = !isEmpty;
  box("empty-console").hidden = store.isLinked;
  box("empty-simulator").hidden = !store.isLinked;
  box("gone").hidden = isEmpty || isRecording() || store.isLive;
  box("gone").textContent = store.isLinked ? "The simulator is gone. The last picture stays." : "The console is not reachable. The last picture stays.";
  document.title = store.run ? `${store.run} · CARS` : "CARS";
}

function drawLog() {
  if (isRecording() && player.tick >= 0 && player.tick !== log.until) log.showUntil(player.tick);
  log.render();
}

function drawCharts() {
  if (openTab !== "charts") return;
  charts.render();
  bands.render();
}

/** @param {number} now_ms */
function draw(now_ms) {
  requestAnimationFrame(draw);
  for (const [name, view] of views) {
    if (!stale.has(name) || now_ms - view.last_ms < view.every_ms) continue;
    stale.delete(name);
    view.last_ms = now_ms;
    view.draw();
  }
}

const stain = (/** @type {string[]} */ ...names) => () => names.forEach((name) => stale.add(name));
store.on("frame", () => setup.phase());
store.on("frame", stain("bar", "panels", "log", "charts"));
store.on("panel", stain("panels"));
store.on("log", stain("log"));
store.on("link", stain("bar", "panels", "log"));
units.listeners.push(stain("panels"));
// Seconds of waiting pass without any message.
window.setInterval(() => store.awaiting().length > 0 && stain("bar", "panels")(), 500);

// A picture that is missing is painted when somebody asks how things stand. If it does not come, there is none yet.
const MOST_QUESTIONS = 8;
let questions = 0;
store.on("frame", () => store.isBehind || (questions = 0));
window.setInterval(() => {
  if (!store.isLive || !store.isBehind || questions >= MOST_QUESTIONS) return;
  questions += 1;
  ask({ do: "status" });
}, 250);

// Before the first picture, somebody may still be missing: the status tells.
store.on("link", () => {
  if (store.isLive && !store.frame && !store.status) ask({ do: "status" });
});
let isOpened = false;
store.on("link", () => {
  if (!isRecording() || isOpened) return;
  isOpened = true;
  player.open();
});

const unitChoice = element("units", HTMLSelectElement);
unitChoice.value = units.unit;
unitChoice.addEventListener("change", () => units.choose(unitChoice.value === "ft" ? "ft" : "m"));
const trails = element("trails", HTMLInputElement);
trails.addEventListener("change", () => {
  plan.hasTrails = trails.checked;
  plan.touch();
});
const speak = element("voice", HTMLInputElement);
speak.disabled = !voice.isPossible;
speak.addEventListener("change", () => voice.turn(speak.checked));
for (const [id, zoom] of /** @type {const} */ ([["zoom-in", 1.4], ["zoom-out", 1 / 1.4], ["zoom-all", 0]])) {
  box(id).addEventListener("click", () => {
    if (zoom) plan.camera.zoomBy(zoom);
    else plan.camera.reset();
    plan.touch();
  });
}

// For tests: where things are and how smoothly they are drawn.
Object.assign(window, {
  carsConsole: {
    toClient: (/** @type {number} */ x_m, /** @type {number} */ y_m) => plan.toClient(x_m, y_m),
    fps: () => plan.fps(),
    frame: () => store.frame,
  },
});

tabList.select("log");
stain("bar", "panels", "log")();
requestAnimationFrame(draw);
connection.open();
