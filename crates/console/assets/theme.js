// @ts-check
// The colors of the style sheet for canvases; they follow light and dark mode.

/** @typedef {Record<"field" | "outside" | "grid" | "edge" | "obstacle" | "obstacleEdge" | "guest" | "guestFill" | "robot" | "robotText"
 *   | "absent" | "absentFill" | "accent" | "warning" | "bad" | "muted" | "text" | "font" | "skin" | "ink", string>} Theme */

/** Names in the style sheet. @type {[keyof Theme, string][]} */
const NAMES = [
  ["field", "--field"],
  ["outside", "--outside"],
  ["grid", "--grid"],
  ["edge", "--edge"],
  ["obstacle", "--obstacle"],
  ["obstacleEdge", "--obstacle-edge"],
  ["guest", "--guest"],
  ["guestFill", "--guest-fill"],
  ["robot", "--robot"],
  ["robotText", "--robot-text"],
  ["absent", "--absent"],
  ["absentFill", "--absent-fill"],
  ["accent", "--accent"],
  ["warning", "--warning"],
  ["bad", "--bad"],
  ["muted", "--muted"],
  ["text", "--text"],
  ["font", "--font"],
  ["skin", "--skin"],
  ["ink", "--ink"],
];

/** @returns {Theme} */
export function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const entries = NAMES.map(([key, name]) => [key, style.getPropertyValue(name).trim()]);
  return Object.fromEntries(entries);
}

/** @param {() => void} listener */
export function onThemeChange(listener) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", listener);
}
