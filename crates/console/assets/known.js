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
const FACES = ["happy", "sad", "surprised", "disgusted", "angry", "fearful", "neutral"];
const MOST_COMMANDS = 3;
/** Lines of the log that are searched for a robot's commands. */
const MOST_SEARCHED = 400;
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
  const none = isBegun ? "none" : "none yet";
  const heading = `${Math.round((((robot.direction_rad * 180) / Math.PI) % 360 + 360) % 360)}°`;

  /** @type {Widget[]} */
  const widgets = [
    { widget: "badge", label: "emotion", text: robot.emotion_state || none, tone: "neutral" },
    { widget: "badge", label: "behavior", text: robot.behavior_state || none, tone: "neutral" },
  ];
  if (intensity !== null) widgets.splice(1, 0, { widget: "bar", label: "intensity", value: intensity, min: 0, max: 1 });
  if (typeof face === "string" && FACES.includes(face)) {
    widgets.unshift({ widget: "face", face: /** @type {import("./types/messages.js").Face} */ (face), intensity: intensity ?? 1 });
  }

  const facts = [["heading", robot.speed_mps > 0 ? heading : "stands"], ["incarnation", String(robot.generation)]];
  if (className) facts.unshift(["class", className]);
  widgets.push({ widget: "table", rows: facts });
  const words = commands.map(({ time_s, tick_s, source, text }) => `${seconds(time_s, tick_s)}  ${sentence(robot.name, source, text)}`);
  widgets.push({ widget: "text", label: "last commands", text: words.join("\n") || none });

  const rows = Object.entries(state_variables).map(([name, value]) => [name, show(value)]);
  return { widgets, details: rows.length ? [{ widget: "table", rows }] : [] };
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
  for (let i = low - 1; i >= 0 && i >= low - MOST_SEARCHED && found.length < MOST_COMMANDS; i -= 1) {
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
