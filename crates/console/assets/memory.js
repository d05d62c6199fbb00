// @ts-check
// What the page itself has seen of a run in progress, in bounded memory: the newest ticks, which no recording has yet, or
// all there is where the console does not have the run's folder.

import { spread } from "./history.js";
import { cellsIn } from "./layers.js";

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./flights.js").Flights} Flights */
/** A frame without its guests, whose places are packed, the panels of its tick, and what is known of commands around it.
 * @typedef {{frame: WorldFrame, guests_m: Float64Array, panels: Map<string, Panel>, flights: Flights}} Seen */

/** Most frames; beyond, older ones are dropped where they are close together, so that the whole time stays in reach. */
const MAX_FRAMES = 3000;
/** Most guests and robots in all frames. */
const MAX_BODIES = 500_000;
/** A robot has as much as this many guests. */
const ROBOT_WEIGHT = 10;
/** As many cells of a layer have as much as a guest. */
const CELLS_PER_GUEST = 16;

export class Memory {
  constructor() {
    /** In order of their ticks, all of one epoch. @type {Seen[]} */
    this.seen = [];
    this.bodies = 0;
  }

  clear() {
    this.seen = [];
    this.bodies = 0;
  }

  /**
   * @param {WorldFrame} frame
   * @param {Map<string, Panel>} panels of its tick; one that comes later is added by the caller
   * @param {Flights} flights
   */
  add(frame, panels, flights) {
    const last = this.seen.at(-1);
    if (last && frame.tick <= last.frame.tick) return;

    const guests_m = new Float64Array(frame.guests.flat());
    const seen = { frame: { ...frame, guests: [] }, guests_m, panels, flights };
    this.seen.push(seen);
    this.bodies += weight(seen);
    if (this.seen.length > MAX_FRAMES || this.bodies > MAX_BODIES) this.thin();
  }

  /** Drops about half of the frames, and not the newest ones. */
  thin() {
    const kept = new Set(spread(this.seen.map(({ frame }) => frame.tick)));
    this.keep((_, i) => kept.has(i));
  }

  /** Forgets what a recording has. @param {number} tick the last one that it has */
  forget(tick) {
    if (this.first <= tick) this.keep(({ frame }, i) => frame.tick > tick || i === this.seen.length - 1);
  }

  /** @param {(seen: Seen, index: number) => boolean} isKept */
  keep(isKept) {
    this.seen = this.seen.filter(isKept);
    this.bodies = this.seen.reduce((sum, seen) => sum + weight(seen), 0);
  }

  /** The oldest tick; infinite if there is none. */
  get first() {
    return this.seen[0]?.frame.tick ?? Infinity;
  }

  /**
   * The newest frame of a tick or before; the oldest one if all are later.
   * @param {number} tick
   * @returns {{frame: WorldFrame, panels: Map<string, Panel>, flights: Flights} | null}
   */
  at(tick) {
    const later = this.seen.findIndex(({ frame }) => frame.tick > tick);
    const seen = this.seen[later < 0 ? this.seen.length - 1 : Math.max(0, later - 1)];
    if (!seen) return null;

    const { frame, guests_m, panels, flights } = seen;
    /** @type {[number, number][]} */
    const guests = [];
    for (let i = 0; i < guests_m.length; i += 2) guests.push([guests_m[i], guests_m[i + 1]]);
    return { frame: { ...frame, guests }, panels, flights };
  }

  /** The frames after a tick, without guests. @param {number} tick */
  after(tick) {
    return this.seen.filter(({ frame }) => frame.tick > tick).map(({ frame }) => frame);
  }
}

/** @param {Seen} seen */
function weight({ frame, guests_m }) {
  return guests_m.length / 2 + ROBOT_WEIGHT * frame.robots.length + cellsIn(frame.layers) / CELLS_PER_GUEST;
}
