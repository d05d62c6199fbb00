// @ts-check
// Colors for names that the robots choose. A robot has that of its place in the roster. An emotion or a behavior has that of
// the space-time diagrams, whose style sheet the server has from the crate `pictures`: `palette.rs` there has the same names,
// and the same rule for others: each has the next free color, in the order in which they first occurred in the epoch.

import { rank } from "./roster.js";
import { onThemeChange } from "./theme.js";

/** Told apart by most eyes, in light and in dark (after the schemes of Tol, 2021, made calmer). */
const ROBOTS = ["#4477aa", "#d8902a", "#3a9d6e", "#8a6bbf", "#c2587f", "#3d9fb5", "#8a7a3a", "#808a96"];

/** Names with a color of their own, and the number of all colors. The other colors are for other names. */
const STATES = {
  emotion: { names: ["HAPPY", "CONFIDENT", "CONCERNED", "FRUSTRATED", "ANGRY", "DISCOURAGED", "HOPEFUL"], colors: 15, prefix: "e" },
  behavior: {
    names: ["SERVE", "INTERCEPT", "EXCHANGE", "GO_BACK", "WAIT", "REFILL", "AWAIT_GO_HOME", "GO_HOME"],
    colors: 14,
    prefix: "b",
  },
};

/** Ways in which an area is hatched where there are more names than colors; the first one is not at all. */
const HATCHINGS = 4;
/** Distance of the lines of a hatching. */
const HATCH_PX = 5;

/** Colors of the style sheet by class, of an area and of text on it. @type {Map<string, {fill: string, ink: string}>} */
const known = new Map();
onThemeChange(() => known.clear());

/** @param {string} robot */
export function robotColor(robot) {
  return ROBOTS[rank(robot) % ROBOTS.length];
}

/**
 * The colors of an emotion or a behavior, for what is not in a diagram: read from the style sheet of diagrams, once each.
 * @param {"emotion" | "behavior"} kind
 * @param {string} name
 * @param {boolean} isOnPaper whether it is for a picture that is saved
 */
export function stateColors(kind, name, isOnPaper = false) {
  const area = stateClass(kind, name);
  if (isOnPaper) return { fill: printedFill(area), ink: printedFill(`on-${area}`) };
  const before = known.get(area);
  if (before) return before;

  const colors = { fill: fillOf(area), ink: fillOf(`on-${area}`) };
  known.set(area, colors);

  return colors;
}

/**
 * The style of a badge: its color, and at its left the lines of an area that is hatched.
 * @param {"emotion" | "behavior"} kind
 * @param {string} name
 */
export function badgeStyle(kind, name) {
  const { fill, ink } = stateColors(kind, name);
  const { hatching } = stateLook(kind, name);
  if (!hatching) return `background:${fill};color:${ink}`;
  const lines = `repeating-linear-gradient(${[0, 135, 90, 45][hatching]}deg, transparent 0 2px, var(--surface) 2px 4px)`;
  return `background:${lines} 0 0 / 14px 100% no-repeat, ${fill};color:${ink};padding-left:18px`;
}

/** The rules of diagrams for paper. Those for dark pages are below a condition. @returns {CSSStyleRule[]} */
export function printedRules() {
  const sheet = [...document.styleSheets].find(({ href }) => href?.endsWith("/diagram.css"));
  return [...(sheet?.cssRules ?? [])].flatMap((rule) => (rule instanceof CSSStyleRule ? [rule] : []));
}

/** @param {string} name of a class */
function printedFill(name) {
  return printedRules().find(({ selectorText }) => selectorText === `.cars-diagram .${name}`)?.style.fill ?? "";
}

/** @param {string} name of a class */
function fillOf(name) {
  const diagram = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  diagram.setAttribute("class", "cars-diagram");
  diagram.setAttribute("width", "0");
  diagram.setAttribute("height", "0");
  const area = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  area.setAttribute("class", name);
  diagram.append(area);
  document.body.append(diagram);

  const { fill } = getComputedStyle(area);
  diagram.remove();
  return fill;
}

/**
 * Names without a color of their own, in the order in which they first occurred, as far as it is known.
 * @type {Record<"emotion" | "behavior", string[]>}
 */
let others = { emotion: [], behavior: [] };
/** Whether the place of one of them is a guess: the page does not see every tick of a run in progress. */
let isGuessed = false;

/** Whether the recording has to be asked for the order of names. */
export function hasGuessedNames() {
  return isGuessed;
}

/**
 * Takes the order of names from a recording.
 * @param {Record<"emotion" | "behavior", string[]>} recorded all names of each kind
 */
export function orderNames({ emotion, behavior }) {
  const without = (/** @type {"emotion" | "behavior"} */ kind, /** @type {string[]} */ names) =>
    names.filter((name) => !STATES[kind].names.includes(name));
  others = { emotion: without("emotion", emotion), behavior: without("behavior", behavior) };
  isGuessed = false;
}

/**
 * How an area of an emotion or a behavior looks: the class of its color, and its hatching, of which 0 is none.
 * @param {"emotion" | "behavior"} kind
 * @param {string} name
 */
export function stateLook(kind, name) {
  const { names, colors, prefix } = STATES[kind];
  const known = names.indexOf(name);
  if (known >= 0) return { area: `${prefix}${known}`, hatching: 0 };

  const further = colors - names.length;
  const most = further * HATCHINGS;
  let place = others[kind].indexOf(name);
  if (place < 0) {
    place = others[kind].length;
    if (place < most) {
      others[kind].push(name);
      isGuessed = true;
    }
  }
  place = Math.min(place, most - 1);

  return { area: `${prefix}${names.length + (place % further)}`, hatching: Math.floor(place / further) };
}

/**
 * The class of an area in the color of an emotion or a behavior; text on it has this class after `on-`.
 * @param {"emotion" | "behavior"} kind
 * @param {string} name
 */
export function stateClass(kind, name) {
  return stateLook(kind, name).area;
}

/**
 * The lines over an area that is hatched, as the data of a path: 1 is rising, 2 upright, 3 falling.
 * @param {number} hatching
 * @param {number} left
 * @param {number} top
 * @param {number} width
 * @param {number} height
 */
export function hatchingPath(hatching, left, top, width, height) {
  const slant = [0, height, 0, -height][hatching];
  let path = "";
  for (let x = Math.ceil((left - height) / HATCH_PX) * HATCH_PX; x <= left + width + height; x += HATCH_PX) {
    const [one, other] = [left, left + width].map((edge) => Math.min(1, Math.max(0, (edge - x) / slant)));
    const isWithin = x > left && x < left + width;
    const [begin, end] = slant === 0 ? [0, isWithin ? 1 : 0] : [Math.min(one, other), Math.max(one, other)];
    if (end - begin > 0.01) path += `M${x + slant * begin} ${top + height * (1 - begin)}L${x + slant * end} ${top + height * (1 - end)}`;
  }

  return path;
}
