// @ts-check
// The colors of the style sheet for canvases, which follow light and dark mode, and for pictures that are saved, which are light.

/** @typedef {Record<"field" | "outside" | "grid" | "edge" | "obstacle" | "obstacleEdge" | "layer" | "guest" | "guestFill" | "robot" | "robotText"
 *   | "absent" | "absentFill" | "accent" | "warning" | "bad" | "muted" | "text" | "font" | "skin" | "ink", string> & {isOnPaper: boolean}} Theme */

/** Names in the style sheet. @type {[string, string][]} */
const NAMES = [
  ["field", "--field"],
  ["outside", "--outside"],
  ["grid", "--grid"],
  ["edge", "--edge"],
  ["obstacle", "--obstacle"],
  ["obstacleEdge", "--obstacle-edge"],
  ["layer", "--layer"],
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

/** @param {boolean} isOnPaper whether it is that of pictures that are saved @returns {Theme} */
export function readTheme(isOnPaper = false) {
  const place = document.body.appendChild(document.createElement("div"));
  place.className = isOnPaper ? "on-paper" : "";
  place.style.setProperty("forced-color-adjust", "none");
  const style = getComputedStyle(place);
  const entries = NAMES.map(([key, name]) => {
    const value = style.getPropertyValue(name).trim();
    // A color of the system has a name, which canvases off the screen do not know.
    if (!/^[A-Z][A-Za-z]+$/.test(value)) return [key, value];
    place.style.color = value;
    return [key, style.color];
  });
  place.remove();
  return Object.fromEntries([...entries, ["isOnPaper", isOnPaper]]);
}

/** @param {() => void} listener */
export function onThemeChange(listener) {
  for (const what of ["prefers-color-scheme: dark", "forced-colors: active"]) matchMedia(`(${what})`).addEventListener("change", listener);
}
