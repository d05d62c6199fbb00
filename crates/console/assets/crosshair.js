// @ts-check
// One tick under the pointer, marked in all views of time at once: time line, chart, bands, diagram and plan.

import { seconds } from "./units.js";

/** @typedef {import("./recording.js").Player} Player */
/**
 * A view of time.
 * @typedef {object} TimeView
 * @property {HTMLElement} place in which lines are drawn, and in which the pointer points
 * @property {(event: PointerEvent) => number | null} tickAt the tick below the pointer; null where there is none
 * @property {(tick: number) => number | null} xOf how far from the left of the place a tick is, in pixels; null out of sight
 * @property {boolean} hasCursor whether the chosen tick is marked as well
 */

export class Crosshair {
  /** @param {Player} player */
  constructor(player) {
    this.player = player;
    /** The tick that is pointed at. @type {number | null} */
    this.tick = null;
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  /** @param {TimeView} view */
  join({ place, tickAt, xOf, hasCursor }) {
    place.addEventListener("pointermove", (event) => this.point(tickAt(event)));
    for (const end of /** @type {const} */ (["pointerleave", "pointercancel"])) place.addEventListener(end, () => this.point(null));

    const pointed = document.createElement("div");
    pointed.className = "crosshair";
    const chosen = document.createElement("div");
    chosen.className = "cursor";
    this.listeners.push(() => {
      draw(pointed, place, this.tick, xOf, this.words);
      if (hasCursor) draw(chosen, place, this.player.store.isChosenTick ? this.player.tick : null, xOf, "");
    });
  }

  /** @param {number | null} tick */
  point(tick) {
    if (tick === this.tick) return;
    this.tick = tick;
    this.render();
  }

  /** Draws the lines where they are now. */
  render() {
    this.listeners.forEach((listener) => listener());
  }

  /** The time that is pointed at. */
  get words() {
    const { tick_s } = this.player;
    return this.tick === null ? "" : seconds(this.tick * tick_s, tick_s);
  }
}

/**
 * @param {HTMLElement} line
 * @param {HTMLElement} place
 * @param {number | null} tick
 * @param {(tick: number) => number | null} xOf
 * @param {string} words
 */
function draw(line, place, tick, xOf, words) {
  const x = tick === null ? null : xOf(tick);
  if (x === null) return line.remove();
  if (line.parentElement !== place) place.append(line);
  line.style.left = `${x}px`;
  // Its own height is none of what is scrolled.
  line.style.height = "";
  line.style.height = `${place.scrollHeight}px`;
  line.dataset.words = words;
  line.classList.toggle("at-right", x > place.clientWidth / 2);
}
