// @ts-check
// What tells the robots of a run apart: the order of the roster, which is the same in every page, and short labels.

/** @type {string[]} */
let order = [];
/** @type {Map<string, string>} */
let labels = new Map();

/** @param {string[]} names of all robots of the run, in the order of the roster */
export function setRoster(names) {
  order = names;
  labels = labelsOf(names);
}

/** Place in the roster. A name that is not in it has the first one. @param {string} name */
export function rank(name) {
  return Math.max(0, order.indexOf(name));
}

/** One to three letters that no other robot has. @param {string} name */
export function initials(name) {
  return labels.get(name) ?? [...name].slice(0, 2).join("");
}

/**
 * The first two letters, as in the paper, or else the first one with the number at the end of the name or with another letter.
 * @param {string[]} names
 * @returns {Map<string, string>}
 */
export function labelsOf(names) {
  const first = (/** @type {string} */ name) => [...name][0]?.toUpperCase() ?? "";
  /** @type {Set<string>} */
  const taken = new Set();
  /** @type {Map<string, string>} */
  const found = new Map();

  for (const name of names) {
    const letters = [...name].slice(1);
    const number = name.match(/\d{1,2}$/)?.[0];
    const choices = [...(number ? [number] : []), ...letters, ...(letters.length ? [] : [""])];
    const isFree = (/** @type {string} */ rest) => !taken.has((first(name) + rest).toLowerCase());

    let rest = choices.find(isFree);
    for (let count = 1; rest === undefined; count += 1) rest = [String(count)].find(isFree);
    taken.add((first(name) + rest).toLowerCase());
    found.set(name, first(name) + rest);
  }

  return found;
}
