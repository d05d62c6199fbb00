// @ts-check
// Colors for names that the robots choose. A robot has the same color while the page is open. An emotion or a behavior has that of
// the space-time diagrams, whose style sheet the server has from the crate `diagram`: `palette.rs` there has the same names.

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

/** @type {Map<string, string>} */
const given = new Map();

/** @param {string} robot */
export function robotColor(robot) {
  const known = given.get(robot);
  if (known) return known;

  const color = ROBOTS[given.size % ROBOTS.length];
  given.set(robot, color);

  return color;
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
