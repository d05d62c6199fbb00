// @ts-check
// Feet or meters for display and input. All values inside the page are in SI units.

import { keep, kept } from "./kept.js";

/** @typedef {"m" | "ft"} Unit */

/** Meters in an international foot. */
const FOOT_M = 0.3048;

/**
 * Formats a number without trailing zeros.
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

/** Most decimals of a time, which are nanoseconds. */
const MAX_DECIMALS = 9;

/**
 * How many decimals tell the times of two ticks apart, at least 1.
 * @param {number | undefined} tick_s length of a tick
 * @returns {number}
 */
function decimals(tick_s) {
  const nanos = Math.round((tick_s ?? 0) * 1e9);
  let decimals = MAX_DECIMALS;
  for (let unit = 10; decimals > 1 && nanos % unit === 0; unit *= 10) decimals -= 1;
  return decimals;
}

/**
 * Formats simulated time, with the decimals that the length of a tick needs.
 * @param {number} time_s
 * @param {number} [tick_s]
 * @returns {string}
 */
export function seconds(time_s, tick_s) {
  return `${time_s.toFixed(decimals(tick_s))} s`;
}

/**
 * The text of a scenario with lengths and speeds in the chosen unit, where that says exactly the same.
 * @param {string} text
 * @param {Units} units
 */
export function inUnit(text, { unit, unit_m }) {
  if (unit === "m") return text;
  return text.replace(/"(-?[\d.]+(?:e-?\d+)?) m(\/s)?"/g, (whole, number, per = "") => {
    const typed = short(Number(number) / unit_m, 4);
    return Number(typed) * unit_m === Number(number) ? `"${typed} ${unit}${per}"` : whole;
  });
}

/** The unit of the scenario, or the chosen one, kept in the browser's local storage if that is allowed. */
export class Units {
  constructor() {
    const chosen = kept("cars-units");
    this.isChosen = chosen === "ft" || chosen === "m";
    /** @type {Unit} */
    this.unit = chosen === "ft" ? "ft" : "m";
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  /** @param {Unit} unit */
  choose(unit) {
    this.isChosen = true;
    keep("cars-units", unit);
    this.show(unit);
  }

  /** The unit of the scenario that is shown, which holds where nobody has chosen. @param {Unit} unit */
  suggest(unit) {
    if (!this.isChosen && unit !== this.unit) this.show(unit);
  }

  /** @param {Unit} unit */
  show(unit) {
    this.unit = unit;
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
