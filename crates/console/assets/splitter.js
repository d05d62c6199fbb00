// @ts-check
// Borders between panes: they are moved by the pointer and by keys, and stay where they were put, whatever is shown. What is kept
// is a share of the page, so that a window of another size is divided in the same way.

import { keep, kept } from "./kept.js";

/** By how much an arrow key moves a border, and its ends; percent. The style sheet has the least sizes of panes. */
const STEP = 2;
const ENDS = /** @type {const} */ ([5, 95]);

/**
 * @param {HTMLElement} bar between two panes of its grid
 * @param {[before: HTMLElement, after: HTMLElement]} panes whose shares are the variables `--ID-before` and `--ID-after` of the grid
 */
export function splitter(bar, [before, after]) {
  const grid = /** @type {HTMLElement} */ (bar.parentElement);
  const isUpright = bar.getAttribute("aria-orientation") === "vertical";
  const size = (/** @type {HTMLElement} */ pane) => (isUpright ? pane.offsetWidth : pane.offsetHeight);
  const share = () => (100 * size(before)) / Math.max(1, size(before) + size(after));

  /** @param {number | null} percent of the first pane; null for what the page chooses */
  const put = (percent) => {
    const shares = percent === null ? ["", ""] : [`${percent}fr`, `${100 - percent}fr`];
    ["before", "after"].forEach((side, i) => grid.style.setProperty(`--${bar.id}-${side}`, shares[i]));
  };
  /** @param {number | null} percent */
  const move = (percent) => {
    const within = percent === null ? null : Math.min(ENDS[1], Math.max(ENDS[0], percent));
    put(within);
    keep(`cars-${bar.id}`, within === null ? null : within.toFixed(2));
  };

  bar.addEventListener("pointerdown", (event) => event.button === 0 && bar.setPointerCapture(event.pointerId));
  bar.addEventListener("pointermove", (event) => {
    if (!bar.hasPointerCapture(event.pointerId)) return;
    const box = before.getBoundingClientRect();
    const half = (isUpright ? bar.offsetWidth : bar.offsetHeight) / 2;
    const pixels = isUpright ? event.clientX - box.left : event.clientY - box.top;
    move((100 * (pixels - half)) / (size(before) + size(after)));
  });
  bar.addEventListener("dblclick", () => move(null));
  bar.addEventListener("keydown", (event) => {
    const [less, more] = isUpright ? ["ArrowLeft", "ArrowRight"] : ["ArrowUp", "ArrowDown"];
    /** @type {Record<string, () => number | null>} */
    const keys = { [less]: () => share() - STEP, [more]: () => share() + STEP, Home: () => ENDS[0], End: () => ENDS[1], Enter: () => null };
    if (!(event.key in keys)) return;
    event.preventDefault();
    move(keys[event.key]());
  });
  new ResizeObserver(() => bar.setAttribute("aria-valuenow", share().toFixed(0))).observe(before);

  const chosen = Number(kept(`cars-${bar.id}`) ?? NaN);
  if (chosen >= ENDS[0] && chosen <= ENDS[1]) put(chosen);
}
