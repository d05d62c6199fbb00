// @ts-check
// Wires the page: messages go into the store, the store notifies the views, user actions go to the connection.

import { Bands } from "./bands.js";
import { Charts } from "./charts.js";
import { Connection } from "./connection.js";
import { Controls, renderAwaiting } from "./controls.js";
import { Crosshair } from "./crosshair.js";
import { DiagramView } from "./diagram.js";
import { Editor } from "./editor.js";
import { renderFailed } from "./failed.js";
import { renderGuide } from "./guide.js";
import { Hover } from "./hover.js";
import { Interventions } from "./interventions.js";
import { classesIn } from "./known.js";
import { renderLayers } from "./layers.js";
import { renderEmotions } from "./legend.js";
import { LogView } from "./log.js";
import { Notices } from "./notices.js";
import { Panels } from "./panels.js";
import { inPixels, picture } from "./picture.js";
import { Plan } from "./plan.js";
import { Player } from "./recording.js";
import { setRoster } from "./roster.js";
import { SetupView } from "./setup.js";
import { download, readLink, share } from "./share.js";
import { renderKinds } from "./sites.js";
import { splitter } from "./splitter.js";
import { Store } from "./store.js";
import { renderStranger } from "./stranger.js";
import { tabs } from "./tabs.js";
import { onThemeChange } from "./theme.js";
import { TimelineView } from "./timeline.js";
import { seconds, Units } from "./units.js";
import { renderVerdicts } from "./verdicts.js";
import { Voice } from "./voice.js";
import { TimeWindow } from "./window.js";

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
store.on("epoch", () => setRoster((store.frame?.robots ?? []).map((robot) => robot.name)));
const units = new Units();
const notices = new Notices(box("notice"));
const connection = new Connection(
  (message) => store.apply(message),
  (isOpen) => store.setConnected(isOpen),
  (stranger) => store.setStranger(stranger),
);
const player = new Player(store, {
  failed: (reason) => notices.refusal(reason),
});

/** What moves the clock of the run is seen. @type {Control["do"][]} */
const GO_LIVE = ["init", "load", "start", "step"];

/** Sends a request and applies the status in its answer. @param {Control} control */
async function request(control) {
  const answer = await connection.control(control);
  if (answer.answer === "done" && GO_LIVE.includes(control.do)) player.live();
  if (answer.answer === "done") store.applyStatus(answer);
  return answer;
}

/**
 * Sends a request, shows its outcome, and resolves with whether it was accepted.
 * @param {Control} control
 * @param {string} note shown if it succeeds
 */
async function act(control, note = "") {
  const answer = await request(control);
  notices.show(answer, note);
  return answer.answer !== "refused";
}

/**
 * @param {string} to
 * @param {string} command
 */
async function sendCommand(to, command) {
  const answer = await connection.command(to, command);
  if (answer.answer === "done") store.applyStatus(answer);
  notices.show(answer, `${command} goes to ${to} with the next tick.`);
}

/** Has a run that has failed go on, and resolves with whether it will. The console ends with its answer, or before it. */
async function resume() {
  const answer = await connection.resume();
  const isAccepted = answer.answer !== "refused" || !store.isConnected;
  if (!isAccepted) notices.show(answer);
  return isAccepted;
}

const isRecording = () => store.mode === "recording";
const controls = new Controls(box("bar"), store, {
  control: (control) => act(control, control.do === "init" && !store.replayOf ? "The next epoch is ready at tick 0." : ""),
  speed: async (factor) => {
    if (!isRecording()) return act({ do: "speed", factor });
    player.factor = factor;
    if (!player.isPlaying) player.seek(player.tick);
    return true;
  },
  toggle: () => {
    if (isRecording()) player.toggle();
    else act({ do: store.phase === "running" ? "pause" : "start" });
  },
  help: () => element("help", HTMLDialogElement).showModal(),
  draft: () => (setup.isChanged ? setup : null),
  step: () => (isRecording() ? player.step(1) : act({ do: "step", n: 1 })),
});

const editor = new Editor({
  changed: (what) => setup.moved(what),
  note: (text) => notices.note(text),
  body_m: () => setup.body_m,
  hasFault: (field) => setup.faults().has(field),
});
const setup = new SetupView(box("panel-setup"), {
  store,
  units,
  editor,
  notices,
  request,
  askToEnd: (...what) => controls.askToEnd(...what),
});
const plan = new Plan(element("plan", HTMLCanvasElement), store, units, editor, choose);
setup.onChange = () => {
  plan.touch();
  box("hint").hidden = editor.draft === null;
  box("legend").hidden = editor.draft !== null;
  drawDraft();
};
element("plan", HTMLCanvasElement).addEventListener("keydown", (event) => editor.key(event), { capture: true });
new ResizeObserver(() => drawDraft()).observe(box("plan"));

/** Says that the plan shows a draft, and where its cursor is. */
function drawDraft() {
  box("draft").hidden = editor.draft === null || editor.isAsApplied;
  box("tab-setup").classList.toggle("changed", setup.isChanged);

  const { cursor } = editor;
  const mark = box("cursor");
  mark.hidden = editor.draft === null || cursor === null;
  if (!cursor) return;
  const frame = box("plan").getBoundingClientRect();
  const half_m = setup.body_m / 2;
  const from = plan.toClient(cursor.x - half_m, cursor.y + half_m);
  const to = plan.toClient(cursor.x + half_m, cursor.y - half_m);
  const side_px = Math.max(10, to.x - from.x);
  Object.assign(mark.style, { left: `${from.x - frame.left}px`, top: `${from.y - frame.top}px`, width: `${side_px}px`, height: `${side_px}px` });
  /** @type {HTMLElement} */ (mark.firstElementChild).textContent = editor.atCursor;
}

const guidePlace = document.createElement("section");
Object.assign(guidePlace, { id: "guide", className: "guide", hidden: true, ariaLabel: "First steps" });
guidePlace.dataset.testid = "guide";
box("plan-pane").querySelector("footer")?.before(guidePlace);

const interventions = new Interventions({ menu: box("panel-experiment"), effects: box("effects") }, store, {
  act: (control, note) => act(control, note),
  save: () => setup.save(),
  close: () => closeExperiment(),
  live: () => player.live(),
});

/** @param {string | null} robot that it is about */
function openExperiment(robot) {
  if (!interventions.isPossible) return;
  tabList.select("experiment");
  if (robot) interventions.about(robot);
  box("panel-experiment").querySelector("select")?.focus();
}

/** Shows the tab that was shown before. */
function closeExperiment() {
  tabList.select(tabBefore);
  /** @type {HTMLElement | null} */ (document.querySelector(".tabs [aria-selected=true]"))?.focus();
}

document.addEventListener("keydown", (event) => {
  const { target } = event;
  const isTyping = target instanceof HTMLElement && target.closest("input:not([type=range]), select, textarea, dialog[open]") !== null;
  if (event.key.toLowerCase() !== "e" || isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (openTab === "experiment") closeExperiment();
  else openExperiment(plan.chosen);
});
element("plan", HTMLCanvasElement).addEventListener("contextmenu", (event) => {
  if (editor.draft || !interventions.isPossible) return;
  const frame = box("plan").getBoundingClientRect();
  const robot = plan.robotAt(plan.camera.place(event.clientX - frame.left, event.clientY - frame.top));
  if (!robot) return;
  event.preventDefault();
  openExperiment(robot);
});
new Hover(box("hover"), plan);
const panels = new Panels(box("panels"), store, units, {
  send: sendCommand,
  choose,
});
store.on("epoch", async () => {
  if (!store.isLive) return;
  const answer = await connection.control({ do: "setup" });
  if (answer.answer === "setup") panels.classes = classesIn(answer.scenario);
  markStale("panels");
});
const log = new LogView(box("panel-log"), store, units, ({ epoch, tick }) => player.seekIn(epoch, tick));
const shownTime = new TimeWindow(() => player.range_s());
const crosshair = new Crosshair(player);
const seekTime = (/** @type {number} */ time_s) => player.seekTime(time_s);
const charts = new Charts({ select: box("chart-select"), chart: box("chart") }, store, shownTime, crosshair, {
  seek: seekTime,
  onChoose: () => {
    bands.render();
    markStale("strips");
  },
});
const bands = new Bands(box("bands"), store, shownTime, crosshair, { seek: seekTime, isShown: (robot) => charts.isShown(robot) });
const diagram = new DiagramView(box("panel-diagram"), player, crosshair);
const timeline = new TimelineView(box("timeline"), player, shownTime, crosshair, {
  chosen: () => plan.chosen,
  isShown: (robot) => charts.isShown(robot),
});
crosshair.listeners.push(drawPlanTime);
const voice = new Voice(store);

/** Marks a robot on the plan and among the panels, or removes its mark. @param {string | null} robot */
function choose(robot) {
  const chosen = robot === plan.chosen ? null : robot;
  plan.chosen = chosen;
  panels.chosen = chosen;
  plan.touch();
  panels.render();
  markStale("bar", "strips");

  if (!chosen) return;
  for (const part of ["line", "panel"]) {
    document.querySelector(`[data-testid="${part}-${CSS.escape(chosen)}"]`)?.scrollIntoView({ block: "nearest" });
  }
}

splitter(box("columns"), [box("plan-pane"), box("panels")]);
splitter(box("rows"), [box("panels"), box("deck")]);

let openTab = "log";
/** What is shown again when an experiment is closed. */
let tabBefore = "log";
const tabList = tabs(box("tabs"), (name) => {
  if (openTab !== "experiment") tabBefore = openTab;
  openTab = name;
  document.body.dataset.tab = name;
  setup.open(name === "setup");
  if (name === "log") drawLog();
  if (name === "log") log.shown();
  if (name === "charts") [charts, bands].forEach((view) => view.render());
  if (name === "diagram") diagram.render();
  if (name === "experiment") interventions.render();
});

// Views are rendered at most once per animation frame, and those with an expensive layout less often.
const stale = new Set();
const OFTEN_MS = 60;
const SELDOM_MS = 200;
/** @type {Map<string, {every_ms: number, last_ms: number, draw: () => void}>} */
const views = new Map([
  ["bar", { every_ms: OFTEN_MS, last_ms: 0, draw: drawBar }],
  ["panels", { every_ms: SELDOM_MS / 2, last_ms: 0, draw: () => panels.render() }],
  ["log", { every_ms: OFTEN_MS, last_ms: 0, draw: drawLog }],
  ["charts", { every_ms: SELDOM_MS, last_ms: 0, draw: drawCharts }],
  ["strips", { every_ms: SELDOM_MS, last_ms: 0, draw: () => timeline.renderStrips() }],
  ["diagram", { every_ms: OFTEN_MS, last_ms: 0, draw: () => openTab === "diagram" && diagram.render() }],
]);

function drawBar() {
  controls.render();
  renderAwaiting(box("awaiting"), store, (robot) => {
    act({ do: "late", robot, on_late: "continue" }, `The clock goes on without ${robot} when it is late.`);
  });
  interventions.render();
  renderStranger(box("stranger"), store);
  renderFailed(box("failed"), store, resume);
  renderGuide(guidePlace, store);
  renderVerdicts({ chip: box("verdicts-chip"), list: box("verdicts") }, store);

  timeline.render();
  crosshair.render();
  renderEmotions(box("emotions"), store);
  renderKinds(box("site-kinds"), store.frame?.sites ?? []);
  renderLayers(box("layers"), store.frame?.layers ?? [], plan.chosenLayer, (name) => {
    plan.chosenLayer = name;
    plan.touch();
    drawBar();
  });
  const { walls, sensing, guest_sample } = store.frame?.static_world ?? {};
  box("guest-sample").hidden = !guest_sample;
  box("guest-sample").textContent = `(one in ${guest_sample} is shown)`;
  box("legend-wall").hidden = !walls?.length;
  box("legend-view").hidden = !plan.chosen || !sensing?.field_of_view_rad;
  box("legend-rays").hidden = !plan.chosen || !sensing?.rays;
  document.body.dataset.time = isRecording() ? "recording" : player.isLive ? "live" : "past";
  const isPast = isRecording() || store.replayOf !== null;
  box("tab-setup").hidden = isPast;
  box("tab-experiment").hidden = !interventions.isPossible;
  if ((isPast && openTab === "setup") || (!interventions.isPossible && openTab === "experiment")) tabList.select("log");
  box("voice-label").hidden = isRecording();

  const isEmpty = store.frame === null && !store.failed && !isRecording() && !(store.isLive && store.status);
  box("empty").hidden = !isEmpty;
  box("empty-console").hidden = store.isConnected;
  box("empty-simulator").hidden = !store.isConnected;
  box("advice").textContent = `cars launch launch/hors_doeuvres.toml --run ${store.run} --listen ${store.endpoint} --no-console`;

  box("gone").hidden = isEmpty || isRecording() || store.isLive || store.stranger !== null || store.failed !== null;
  box("gone").textContent = store.isConnected
    ? `The simulator is disconnected. This is its last frame. If it was killed, this goes on after the last recorded tick: cars launch --resume ${store.run}`
    : "The console is not reachable. This is the last frame.";

  for (const mood of /** @type {const} */ (["waiting", "annoyed"])) {
    box(`${mood}-guests`).hidden = !store.frame?.guest_moods?.[mood]?.length;
  }
  document.title = store.run ? `${store.run} · CARS` : "CARS";
}

/** The time that the plan shows, and the time that is pointed at. */
function drawPlanTime() {
  const { frame } = store;
  const label = box("plan-time");
  label.hidden = frame === null || editor.draft !== null;
  if (!frame) return;
  const past = store.isBack ? "past: " : "";
  const pointed = crosshair.tick === null ? "" : ` · pointer ${crosshair.words}`;
  label.textContent = `${past}${seconds(frame.time_s, frame.tick_s)}${pointed}`;
}

function drawLog() {
  if (openTab !== "log") return;
  if (player.isLive) log.showUntil(null);
  else if (player.tick >= 0) log.showUntil({ epoch: player.epoch, tick: player.tick });
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
  if (editor.draft && editor.cursor) drawDraft();
  for (const [name, view] of views) {
    if (!stale.has(name) || now_ms - view.last_ms < view.every_ms) continue;
    stale.delete(name);
    view.last_ms = now_ms;
    view.draw();
  }
}

/** @param {string[]} names of views to render again */
function markStale(...names) {
  names.forEach((name) => stale.add(name));
}

store.on("frame", () => setup.phase());
store.on("frame", () => markStale("bar", "panels", "log", "charts", "strips", "diagram"));
store.on("live", () => markStale("bar", "charts", "strips", "diagram"));
shownTime.listeners.push(() => markStale("bar", "charts"));
timeline.range.listeners.push(() => markStale("bar", "strips"));
store.on("epoch", () => [shownTime, timeline.range].forEach((range) => range.reset()));
store.on("panel", () => markStale("panels"));
store.on("log", () => markStale("log"));
store.on("connection", () => markStale("bar", "panels", "log"));
units.listeners.push(() => markStale("panels"));
onThemeChange(() => markStale("panels", "charts"));
new ResizeObserver(() => markStale("bar", "strips")).observe(box("timeline"));

// The time that the clock has been waiting for a robot grows without any message.
window.setInterval(() => {
  if (store.awaiting().length > 0) markStale("bar", "panels");
}, 500);

// The simulator publishes a frame when it answers a status request. If none comes, there is no newer one.
const MAX_STATUS_REQUESTS = 8;
let statusRequests = 0;
store.on("frame", () => {
  if (!store.isBehind) statusRequests = 0;
});
window.setInterval(() => {
  if (!store.isLive || !store.isBehind || statusRequests >= MAX_STATUS_REQUESTS) return;

  statusRequests += 1;
  request({ do: "status" });
}, 250);

// There is no frame while robots have not joined: the status names them.
store.on("connection", () => {
  if (store.isLive && !store.frame && !store.status) request({ do: "status" });
});
let isOpened = false;
store.on("connection", () => {
  if (!store.isConnected) isOpened = isOpened && isRecording();
  if (isOpened || !store.isConnected || !store.mode) return;
  isOpened = true;
  if (!isRecording()) return player.connected();
  const { tick } = readLink(location.hash);
  player.open(tick ?? 0);
});

// As the keys of the bar at the top: not where one types.
document.addEventListener("keydown", (event) => {
  const { target } = event;
  const isTyping = target instanceof HTMLElement && target.closest("input:not([type=range]), select, textarea, dialog[open]") !== null;
  if (event.key.toLowerCase() !== "l" || isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  player.live();
});

/** Shows what a link leads to, if it is of this run. */
function follow() {
  const { run, tick, robot } = readLink(location.hash);
  if (run && run !== store.run) return notices.refusal(`The link is to the run ${run}; this is ${store.run}.`);

  const isKnown = store.frame?.robots.some((one) => one.name === robot) ?? false;
  if (robot && isKnown && robot !== plan.chosen) choose(robot);
  if (tick === null) return;
  if (tick < player.first) notices.note(`Tick ${tick} cannot be shown: ${player.missing}.`);
  else if (tick !== player.tick) player.step(tick - player.tick);
}
window.addEventListener("hashchange", follow);
let isFollowed = false;
for (const topic of /** @type {const} */ (["frame", "live"])) {
  store.on(topic, () => {
    if (isFollowed || !store.frame || !player.isKnown) return;
    isFollowed = true;
    follow();
  });
}

box("link").addEventListener("click", async () => {
  const tick = player.isLive ? null : player.tick;
  notices.note(await share({ run: store.run, tick, robot: plan.chosen }));
});
box("picture").addEventListener("click", async () => {
  const name = `${store.run}-tick-${store.frame?.tick ?? 0}.png`;
  download(await inPixels(picture(plan, store.panels)), name);
});
box("vector").addEventListener("click", () => {
  const svg = new Blob([picture(plan, store.panels)], { type: "image/svg+xml" });
  download(svg, `${store.run}-tick-${store.frame?.tick ?? 0}.svg`);
});
box("full-screen").addEventListener("click", () => {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.querySelector(".plan")?.requestFullscreen().catch(() => notices.refusal("This browser allows no full screen."));
});
box("keys").addEventListener("click", () => element("help", HTMLDialogElement).showModal());

const unitChoice = element("units", HTMLSelectElement);
unitChoice.value = units.unit;
units.listeners.push(() => (unitChoice.value = units.unit));
store.on("frame", () => units.suggest(store.frame?.display_unit ?? "m"));
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

// For tests: positions, the frame rate, what is shown and what is known.
Object.assign(window, {
  carsConsole: {
    toClient: (/** @type {number} */ x_m, /** @type {number} */ y_m) => plan.toClient(x_m, y_m),
    fps: () => plan.fps(),
    frame: () => store.frame,
    flights: () => (store.frame ? store.flights.at(store.frame.tick, store.frame.tick_s) : []),
    rays: () => plan.rays(),
    history: () => store.history,
    lines: () => store.log.length,
    log: () => store.log,
    unlikeLines: () => new Set(store.log.map((line) => JSON.stringify(line))).size,
    window: () => shownTime.range_s(),
    chartScale: () => [charts.plot?.scales.x.min, charts.plot?.scales.x.max],
  },
});

tabList.select("log");
markStale("bar", "panels", "log");
requestAnimationFrame(draw);
connection.open();
