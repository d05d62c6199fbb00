// @ts-check
// What can be told of a robot without its panel: from its published state, from the simulator and from the log.

import { presence } from "./presence.js";
import { seconds, short } from "./units.js";

/** @typedef {import("./types/messages.js").Awaited} Awaited */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").Widget} Widget */

/** State variables that say how a robot feels, if it publishes them; every robot in any language may. */
const INTENSITY = "intensity";
const FACE = "facial_expression";
/** What each component of an emotion means, in the order in which people read them: its name, its meaning, and its scale. */
const COMPONENTS = /** @type {[string, string, "" | "share" | "sign"][]} */ ([
  ["valence", "pleasant above 0, unpleasant below", "sign"],
  ["intensity", "how strongly it is felt", "share"],
  ["urgency", "how pressing the need behind it is", "share"],
  ["action_tendency", "what it inclines the robot to do", ""],
  ["facial_expression", "what the face shows", ""],
  ["duration", "how long such a state usually lasts", ""],
  ["duration_s", "seconds since this episode began", ""],
  ["focality", "what it is about", ""],
  ["agency", "who is responsible", ""],
  ["goal_congruence", "1: nothing is in the way of the goal, -1: it is prevented", "sign"],
  ["novelty", "how far the situation is from what was predicted", "share"],
  ["controllability", "share of what the robot could do that it still can", "share"],
  ["modifiability", "1: another agent acts on it, 0: none does, 0.5: unknown", "share"],
  ["certainty", "how recent what is known of it is", "share"],
  ["external_norms", "how far the robot does what it owes others", "share"],
  ["internal_standards", "how far it does what it expects of itself", "share"],
  ["mood", "the slow mean of what is felt", "sign"],
  ["caution", "the trait of its personality: how fast urgency rises", "share"],
  ["causal_chain", "the beliefs and goals behind it", ""],
]);
const SHARES = ["very low", "low", "medium", "high", "very high"];
const FACES = ["happy", "sad", "surprised", "disgusted", "angry", "fearful", "neutral"];
const MAX_COMMANDS = 3;
/** Lines of the log that are searched for a robot's commands. */
const MAX_SEARCHED = 400;
/** What a robot sends to another one, as the log has it. */
const SENT = /^-> (.+?): (.*)$/s;

/**
 * How strongly a robot feels, 0 to 1, if its state or its panel says so.
 * @param {RobotFrame} robot
 * @param {Panel | undefined} panel
 * @returns {number | null}
 */
export function intensityOf(robot, panel) {
  const own = robot.state_variables[INTENSITY];
  if (typeof own === "number" && Number.isFinite(own)) return Math.min(1, Math.max(0, own));

  const widgets = Array.isArray(panel?.widgets) ? panel.widgets : [];
  const face = widgets.find((widget) => widget?.widget === "face");
  return face?.widget === "face" && Number.isFinite(face.intensity) ? Math.min(1, Math.max(0, face.intensity)) : null;
}

/**
 * What keeps a robot from going on, in words, and how bad it is; the worse is the greater.
 * @param {RobotFrame} robot
 * @param {Awaited[]} awaiting
 * @param {number} blocked_s for how long its moves have been refused
 */
export function heldUp(robot, awaiting, blocked_s) {
  const { word, since, tone } = presence(robot, awaiting);
  if (tone === "bad") return { words: `${word} ${since}`.trim(), badness: 3e9 };
  if (tone === "warning") return { words: `${word} ${since}`.trim(), badness: 2e9 + parseFloat(since || "0") };
  if (!robot.blocked) return { words: "", badness: 0 };

  return { words: blocked_s > 0 ? `blocked ${short(blocked_s, 1)} s` : "blocked", badness: 1e9 + blocked_s };
}

/**
 * The panel of a robot that sends none, or an empty one; what is less important comes last and is folded.
 * @param {RobotFrame} robot
 * @param {{className: string, commands: LogRecord[], isBegun: boolean}} more `isBegun`: whether there was a tick
 * @returns {{widgets: Widget[], details: Widget[]}}
 */
export function generic(robot, { className, commands, isBegun }) {
  const { state_variables } = robot;
  const face = state_variables[FACE];
  const intensity = intensityOf(robot, undefined);
  // A robot that has none once the run has begun, such as one without emotions, has no badge of it.
  const badge = (/** @type {string} */ label, /** @type {string} */ text) =>
    /** @type {Widget[]} */ (text || !isBegun ? [{ widget: "badge", label, text: text || "none yet", tone: "neutral" }] : []);
  const heading = `${Math.round((((robot.direction_rad * 180) / Math.PI) % 360 + 360) % 360)}°`;

  /** @type {Widget[]} */
  const widgets = badge("emotion", robot.emotion_state);
  if (intensity !== null) widgets.push({ widget: "bar", label: "intensity", value: intensity, min: 0, max: 1 });
  widgets.push(...badge("behavior", robot.behavior_state));
  if (typeof face === "string" && FACES.includes(face)) {
    widgets.unshift({ widget: "face", face: /** @type {import("./types/messages.js").Face} */ (face), intensity: intensity ?? 1 });
  }

  const facts = [["heading", robot.speed_mps > 0 ? heading : "stands"], ["incarnation", String(robot.generation)]];
  if (className) facts.unshift(["class", className]);
  widgets.push({ widget: "table", rows: facts });
  const words = commands.map(({ time_s, tick_s, source, text }) => `${seconds(time_s, tick_s)}  ${sentence(robot.name, source, text)}`);
  widgets.push({ widget: "text", label: "last commands", text: words.join("\n") || (isBegun ? "none" : "none yet") });

  const rows = Object.entries(state_variables).map(([name, value]) => [name, show(value)]);
  return { widgets, details: rows.length ? [{ widget: "table", rows }] : [] };
}

/**
 * The components of a robot's emotion, with words and meanings; empty for a robot that publishes none.
 * @param {RobotFrame} robot
 * @returns {{name: string, value: string, meaning: string}[]}
 */
export function componentsOf({ state_variables }) {
  if (typeof state_variables.valence !== "number") return [];

  return COMPONENTS.flatMap(([name, meaning, scale]) => {
    const value = state_variables[name];
    if (value === undefined) return [];
    const word = typeof value === "number" ? wordFor(value, scale) : "";
    return [{ name: name.replaceAll("_", " "), value: `${show(value)}${word && ` ${word}`}`, meaning }];
  });
}

/** @type {(value: number, scale: "" | "share" | "sign") => string} */
function wordFor(value, scale) {
  if (scale === "sign") return value > 0 ? "positive" : value < 0 ? "negative" : "";
  return scale === "share" ? SHARES[Math.min(4, Math.max(0, Math.floor(value * 5 + 1e-9)))] : "";
}

/**
 * The place of an emotion and of the mood in the tree of affective states (the paper's Figure 1), from the root down; `others` are
 * the emotions of the same kind that the robot has had.
 * @param {RobotFrame} robot
 * @param {Map<string, number>} had each emotion with its valence
 * @returns {{depth: number, text: string, isHere: boolean}[]}
 */
export function placeOf({ emotion_state, state_variables }, had) {
  const { valence, mood } = state_variables;
  if (typeof valence !== "number") return [];

  const kind = valence < 0 ? "negative" : "positive";
  const moodKind = typeof mood !== "number" || mood === 0 ? "" : mood < 0 ? "negative" : "positive";
  const others = [...had].filter(([name, other]) => other < 0 === valence < 0 && name !== emotion_state);
  const node = (/** @type {number} */ depth, /** @type {string} */ text, isHere = false) => ({ depth, text, isHere });

  return [
    node(0, "personality"),
    node(1, `${kind} affect`),
    node(2, `${kind} mood`, kind === moodKind),
    node(2, `${kind} emotion`),
    node(3, emotion_state, true),
    ...others.map(([name]) => node(3, name)),
    ...(moodKind && kind !== moodKind ? [node(1, `${moodKind} affect`), node(2, `${moodKind} mood`, true)] : []),
  ];
}

/** @type {(name: string, source: string, text: string) => string} */
function sentence(name, source, text) {
  const [, to, command] = text.match(SENT) ?? ["", "", text];
  return to === name ? `from ${source}: ${command}` : `to ${to}: ${command}`;
}

/** @param {unknown} value */
function show(value) {
  return typeof value === "number" ? String(Number(value.toPrecision(5))) : value === true ? "yes" : value === false ? "no" : String(value);
}

/**
 * The last commands that a robot sent or was sent, the newest first.
 * @param {LogRecord[]} log
 * @param {string} robot
 * @param {number} epoch
 * @param {number} tick that is shown
 */
export function lastCommands(log, robot, epoch, tick) {
  let end = log.length;
  // A recording has the lines of the whole run.
  let low = 0;
  while (low < end) {
    const middle = (low + end) >> 1;
    if (log[middle].epoch < epoch || (log[middle].epoch === epoch && log[middle].tick <= tick)) low = middle + 1;
    else end = middle;
  }

  /** @type {LogRecord[]} */
  const found = [];
  for (let i = low - 1; i >= 0 && i >= low - MAX_SEARCHED && found.length < MAX_COMMANDS; i -= 1) {
    const line = log[i];
    const to = line.kind === "command" && line.epoch === epoch ? line.text.match(SENT)?.[1] : undefined;
    if (to !== undefined && (to === robot || line.source === robot)) found.push(line);
  }

  return found;
}

/**
 * The class of each robot, in the text of a scenario as the simulator writes it.
 * @param {string} scenario
 * @returns {Map<string, string>}
 */
export function classesIn(scenario) {
  const value = (/** @type {string} */ table, /** @type {string} */ key) => table.match(new RegExp(`^${key} = "([^"\\\\]*)"$`, "m"))?.[1] ?? "";
  const tables = scenario.split(/^\[\[robot\]\]$/m).slice(1);

  return new Map(tables.map((table) => [value(table, "name"), value(table, "class")]));
}
