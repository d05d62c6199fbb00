// @ts-check
// Smooth motion between frames: robots and guests glide from where they are drawn to their places in the newest frame.

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {{x: number, y: number}} Place */

const SHORTEST_MS = 30;
const LONGEST_MS = 1000;
/** Longest glide of a run without a set speed, where a longer one would look like lag. */
const LONGEST_UNPACED_MS = 150;
/** With more ticks between two frames there is no glide. */
const MAX_TICKS = 200;

export class Motion {
  constructor() {
    /** @type {WorldFrame | null} */
    this.to = null;
    /** Where the guests were drawn when the frame arrived: x and y in turn, meters. */
    this.from_m = new Float64Array(0);
    /** Where they are drawn now. */
    this.now_m = new Float64Array(0);
    /** @type {Map<string, Place>} */
    this.robotsFrom = new Map();
    /** @type {Map<string, Place>} */
    this.robotsNow = new Map();
    this.arrivedAt_ms = 0;
    this.length_ms = SHORTEST_MS;
    this.isMoving = false;
    /** How far the fastest robot or guest moves in the glide, meters. */
    this.farthest_m = 0;
  }

  /**
   * @param {WorldFrame} frame
   * @param {number} now_ms
   * @param {boolean} isCalm whether robots and guests jump to their places
   */
  push(frame, now_ms, isCalm) {
    const last = this.to;
    this.to = frame;
    const leap = last?.epoch === frame.epoch ? frame.tick - last.tick : Infinity;
    if (leap === 0) return;

    const hasNumbers = Boolean(frame.guest_numbers?.length || last?.guest_numbers?.length);
    const areSame = hasNumbers || last?.guests.length === frame.guests.length;
    const isGlide = !isCalm && leap > 0 && leap <= MAX_TICKS && areSame;
    this.from_m = isGlide && !hasNumbers ? this.now_m.slice() : flat(frame.guests);
    if (isGlide && last && hasNumbers) this.takePlaces(this.from_m, last, frame);
    this.robotsFrom = isGlide ? new Map(this.robotsNow) : new Map();
    if (hasNumbers || this.now_m.length !== this.from_m.length) this.now_m = this.from_m.slice();
    this.length_ms = isGlide ? length_ms(frame, leap, now_ms - this.arrivedAt_ms) : 0;
    this.arrivedAt_ms = now_ms;
    this.isMoving = true;
    this.farthest_m = isGlide ? this.farthest(frame) : 0;
  }

  /**
   * Sets where guests begin to glide that were on the field in the last frame, by their numbers. Those that have entered are where the
   * frame has them.
   * @param {Float64Array} from_m
   * @param {WorldFrame} last
   * @param {WorldFrame} frame
   */
  takePlaces(from_m, last, frame) {
    const before = new Map(last.guest_numbers?.map((number, i) => [number, i]));
    frame.guest_numbers?.forEach((number, i) => {
      const at = before.get(number);
      if (at === undefined) return;
      from_m[2 * i] = this.now_m[2 * at];
      from_m[2 * i + 1] = this.now_m[2 * at + 1];
    });
  }

  /** @param {WorldFrame} frame */
  farthest(frame) {
    let most = 0;
    frame.guests.forEach(([x, y], i) => {
      most = Math.max(most, Math.abs(x - this.from_m[2 * i]), Math.abs(y - this.from_m[2 * i + 1]));
    });
    for (const { name, location } of frame.robots) {
      const from = this.robotsFrom.get(name) ?? location;
      most = Math.max(most, Math.abs(location.x - from.x), Math.abs(location.y - from.y));
    }

    return most;
  }

  /**
   * How far anything moves in a time, meters; infinitely far if a glide ends in it.
   * @param {number} from_ms
   * @param {number} to_ms
   */
  travel_m(from_ms, to_ms) {
    if (!this.isMoving) return 0;
    if (to_ms >= this.arrivedAt_ms + this.length_ms) return Infinity;
    return (this.farthest_m * (to_ms - from_ms)) / this.length_ms;
  }

  /** Ends a glide: robots and guests are where the frame has them. */
  arrive() {
    this.advance(this.arrivedAt_ms + this.length_ms);
  }

  /**
   * Moves robots and guests to where they are drawn at a time.
   * @param {number} now_ms
   */
  advance(now_ms) {
    const frame = this.to;
    if (!frame || !this.isMoving) return;

    const part = this.length_ms > 0 ? Math.min(1, (now_ms - this.arrivedAt_ms) / this.length_ms) : 1;
    this.isMoving = part < 1;
    const { from_m, now_m } = this;
    frame.guests.forEach((guest, i) => {
      now_m[2 * i] = from_m[2 * i] + (guest[0] - from_m[2 * i]) * part;
      now_m[2 * i + 1] = from_m[2 * i + 1] + (guest[1] - from_m[2 * i + 1]) * part;
    });

    this.robotsNow = new Map(
      frame.robots.map(({ name, location }) => {
        const from = this.robotsFrom.get(name) ?? location;
        const x = from.x + (location.x - from.x) * part;
        return [name, { x, y: from.y + (location.y - from.y) * part }];
      }),
    );
  }
}

/**
 * Duration of a glide: about until the next frame arrives.
 * @param {WorldFrame} frame
 * @param {number} ticks that passed
 * @param {number} measured_ms since the last frame
 */
function length_ms(frame, ticks, measured_ms) {
  const paced_ms = frame.speed ? (1000 * frame.tick_s * ticks) / frame.speed : LONGEST_UNPACED_MS;
  return Math.min(LONGEST_MS, Math.max(SHORTEST_MS, Math.min(measured_ms, 1.25 * paced_ms)));
}

/** @param {[number, number][]} places */
function flat(places) {
  const all = new Float64Array(2 * places.length);
  places.forEach(([x, y], i) => {
    all[2 * i] = x;
    all[2 * i + 1] = y;
  });

  return all;
}
