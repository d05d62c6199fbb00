// @ts-check
// Checks of an edited set-up that need no simulator.

import { short } from "./units.js";

/** @typedef {import("./types/messages.js").Setup} Setup */
/** @typedef {import("./types/messages.js").Range} Range */
/** @typedef {{x: number, y: number}} Place */
/** Reasons by field, as the simulator names fields. @typedef {Map<string, string>} Faults */

export const MAX_SEED = Number.MAX_SAFE_INTEGER;
const MAX_GUESTS = 4294967295;
/** Tolerance for rounding: bodies that touch do not overlap. */
const SLACK_M = 1e-9;

/**
 * Whether two bodies would overlap.
 * @param {Place} a
 * @param {Place} b
 * @param {number} body_m
 */
export function overlaps(a, b, body_m) {
  return Math.abs(a.x - b.x) < body_m - SLACK_M && Math.abs(a.y - b.y) < body_m - SLACK_M;
}

/**
 * Whether a body at this place is within the field.
 * @param {Place} place
 * @param {[number, number]} field_m
 * @param {number} body_m
 */
export function isWithin(place, field_m, body_m) {
  const least = body_m / 2 - SLACK_M;
  return place.x >= least && place.y >= least && place.x <= field_m[0] - least && place.y <= field_m[1] - least;
}

/**
 * What is wrong with a set-up, as far as the page can check it.
 * @param {Setup} setup
 * @param {number} body_m
 * @param {number} tick_s
 * @param {(length_m: number) => string} length formats a length
 * @returns {Faults}
 */
export function faultsOf(setup, body_m, tick_s, length) {
  /** @type {Faults} */
  const faults = new Map();
  const fault = (/** @type {string} */ field, /** @type {boolean} */ isWrong, /** @type {string} */ reason) => {
    if (isWrong && !faults.has(field)) faults.set(field, reason);
  };

  const { field_m, guests, seed, duration_s, log_file } = setup;
  const isField = field_m.every((size) => size >= body_m && size <= 1e5);

  fault("field_m", !isField, `Each side must be a length of at least ${length(body_m)}, the size of a body.`);
  fault("guests", !isWhole(guests, MAX_GUESTS), "The number of guests must be a whole number, 0 or more.");

  if (isField && Number.isFinite(guests)) {
    const places = Math.floor((field_m[0] * field_m[1]) / (body_m * body_m));
    const room = places - setup.obstacles.length - Object.keys(setup.robots).length;
    fault("guests", guests > room, `There is no room for so many guests: ${Math.max(0, room)} at most.`);
  }

  fault("guest_speed_mps", rangeFault(setup.guest_speed_mps) !== "", rangeFault(setup.guest_speed_mps));
  fault("guest_duration_s", rangeFault(setup.guest_duration_s) !== "", rangeFault(setup.guest_duration_s));
  fault("seed", !isWhole(seed, MAX_SEED), `The seed must be a whole number from 0 to ${MAX_SEED}.`);
  fault("duration_s", !(duration_s >= tick_s), `The run must last at least one tick, ${short(tick_s)} s.`);

  const isName = /^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$/.test(log_file.name);
  fault("log_file.name", log_file.enabled && !isName, "The name may have letters, digits, dots, dashes and underscores, and no folder.");
  if (isField) placeFaults(setup, body_m, fault);

  return faults;
}

/**
 * @param {Setup} setup
 * @param {number} body_m
 * @param {(field: string, isWrong: boolean, reason: string) => void} fault
 */
function placeFaults(setup, body_m, fault) {
  const { field_m, obstacles } = setup;
  const outside = obstacles.filter((place) => !isWithin(place, field_m, body_m)).length;
  fault("obstacles", outside > 0, `${outside} of them would extend beyond the field: remove them or enlarge the field.`);
  const robots = Object.entries(setup.robots);
  robots.forEach(([name, place], i) => {
    const field = `robots.${name}`;
    fault(field, !isWithin(place, field_m, body_m), `${name} would not be wholly within the field.`);
    fault(field, obstacles.some((other) => overlaps(place, other, body_m)), `${name} would stand on an obstacle.`);
    const other = robots.find(([, at], j) => j < i && overlaps(place, at, body_m));
    fault(field, other !== undefined, `${name} would stand on ${other?.[0]}.`);
  });
}

/** @param {Range} range */
function rangeFault({ min, mode, max }) {
  if (![min, mode, max].every(Number.isFinite)) return "All three must be numbers.";
  if (min < 0) return "The least value must not be negative.";
  if (min > mode) return "The least value must not exceed the most likely one.";
  return mode > max ? "The most likely value must not exceed the largest one." : "";
}

/**
 * @param {number} value
 * @param {number} most
 */
function isWhole(value, most) {
  return Number.isInteger(value) && value >= 0 && value <= most;
}
