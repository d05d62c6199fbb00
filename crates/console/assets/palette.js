// @ts-check
// Colors for names that the robots choose: the same name has the same color while the page is open.

/**
 * Told apart by most eyes, in light and in dark (after the schemes of Tol, 2021, made calmer). Robots tend to begin with a
 * pleasant emotion, so that green comes first there and red late.
 */
const COLORS = {
  robot: ["#4477aa", "#d8902a", "#3a9d6e", "#8a6bbf", "#c2587f", "#3d9fb5", "#8a7a3a", "#808a96"],
  emotion: ["#3a9d6e", "#4f86c0", "#d8922e", "#c9524a", "#8a6bbf", "#3d9fb5", "#a8763e", "#c2587f", "#7f8b3c", "#808a96"],
  behavior: ["#5b77a8", "#8d74b8", "#3f98a8", "#a8805a", "#b36a92", "#76834a", "#6d7f8e", "#9a6a6a", "#5a8f7b", "#857a9c"],
};

/** @type {Map<string, string>} */
const given = new Map();
const count = { robot: 0, emotion: 0, behavior: 0 };

/**
 * @param {"robot" | "emotion" | "behavior"} kind
 * @param {string} name
 */
export function colorOf(kind, name) {
  const key = `${kind} ${name}`;
  const known = given.get(key);
  if (known) return known;

  const color = COLORS[kind][count[kind]++ % COLORS[kind].length];
  given.set(key, color);

  return color;
}
