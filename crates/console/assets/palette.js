// @ts-check
// Colors for names that the robots choose. A robot has that of its place in the roster. An emotion or a behavior has that of
// the space-time diagrams, whose style sheet the server has from the crate `diagram`: `palette.rs` there has the same names.

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
 */
export function stateColors(kind, name) {
  const area = stateClass(kind, name);
  const before = known.get(area);
  if (before) return before;

  const colors = { fill: fillOf(area), ink: fillOf(`on-${area}`) };
  known.set(area, colors);

  return colors;
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
 * The class of an area in the color of an emotion or a behavior; text on it has this class after `on-`.
 * @param {"emotion" | "behavior"} kind
 * @param {string} name
 */
export function stateClass(kind, name) {
  const { names, colors, prefix } = STATES[kind];
  const known = names.indexOf(name);
  const index = known >= 0 ? known : names.length + (fnv1a(name) % (colors - names.length));

  return `${prefix}${index}`;
}

/** FNV-1a, 32 bit, of the UTF-8 of a text. @param {string} text */
function fnv1a(text) {
  let hash = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(text)) hash = Math.imul(hash ^ byte, 0x01000193) >>> 0;

  return hash;
}
