// @ts-check
// Feet or meters: what is shown and typed. Everything inside the page is in SI units.

/** @typedef {"m" | "ft"} Unit */

/** Meters in an international foot. */
const FOOT_M = 0.3048;

/**
 * A number for people: no more digits than say something, and none that are zero at the end.
 * @param {number} value
 * @param {number} digits most digits after the point
 * @returns {string}
 */
export function short(value, digits = 2) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e7 || (size > 0 && size < 1e-4)) return value.toExponential(2);
  return String(Number(value.toFixed(digits)));
}

/**
 * Simulated time for people.
 * @param {number} time_s
 * @returns {string}
 */
export function seconds(time_s) {
  return `${time_s.toFixed(1)} s`;
}

/** The unit that the reader chose, kept by the browser where it may. */
export class Units {
  constructor() {
    /** @type {Unit} */
    this.unit = remembered() === "ft" ? "ft" : "m";
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  /** @param {Unit} unit */
  choose(unit) {
    this.unit = unit;
    try {
      localStorage.setItem("cars-units", unit);
    } catch {
      // A browser that keeps nothing still shows the unit until the page is closed.
    }
    this.listeners.forEach((listener) => listener());
  }

  /** Meters in one unit of length. */
  get unit_m() {
    return this.unit === "ft" ? FOOT_M : 1;
  }

  /** @param {number} length_m */
  length(length_m, digits = 1) {
    return `${(length_m / this.unit_m).toFixed(digits)} ${this.unit}`;
  }

  /** @param {number} speed_mps */
  speed(speed_mps) {
    return `${(speed_mps / this.unit_m).toFixed(2)} ${this.unit}/s`;
  }
}

/** @returns {string | null} */
function remembered() {
  try {
    return localStorage.getItem("cars-units");
  } catch {
    return null;
  }
}
