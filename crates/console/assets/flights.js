// @ts-check
// Animates commands. A frame may state the sending and the fate of a command at once; the animation takes longer.

/** @typedef {import("./types/messages.js").Flight} Flight */
/** @typedef {import("./types/messages.js").Fate} Fate */

/**
 * A command as it is drawn.
 * @typedef {object} Airborne
 * @property {string} from
 * @property {string} to
 * @property {string} text of the command, empty if the frame with its sending was skipped
 * @property {Fate} fate the latest one that a frame stated
 * @property {number} progress 0 at the sender, 1 at the target
 * @property {number} fallen 0 while it flies, 1 when a lost one is no longer visible
 * @property {number} landed 0 while it flies, 1 when the mark at the target is no longer visible
 */

const FLIGHT_MS = 900;
const FALL_MS = 900;
const LANDING_MS = 500;
/** Progress at which a lost command falls. */
const HALF_WAY = 0.5;
/** Progress at which a command stays while its fate is not decided. */
const BEFORE_TARGET = 0.85;
const MOST_AIRBORNE = 64;
/** A command whose fate no frame states is removed after this time. */
const FORGOTTEN_MS = 60000;

export class Flights {
  constructor() {
    /** @type {Map<string, Airborne & {age_ms: number}>} */
    this.airborne = new Map();
  }

  clear() {
    this.airborne.clear();
  }

  /** @param {Flight[]} flights in order of time */
  push(flights) {
    for (const { from, to, seq, command, fate } of flights) {
      const key = JSON.stringify([from, to, seq]);
      const known = this.airborne.get(key);
      if (known) {
        known.fate = fate;
        known.text ||= command ?? "";
        continue;
      }
      const text = command ?? "";
      this.airborne.set(key, { from, to, text, fate, progress: 0, fallen: 0, landed: 0, age_ms: 0 });
    }

    for (const key of this.airborne.keys()) {
      if (this.airborne.size <= MOST_AIRBORNE) break;
      this.airborne.delete(key);
    }
  }

  /**
   * @param {number} passed_ms wall clock since the last call
   * @param {boolean} isCalm whether a command is where it ends at once
   */
  advance(passed_ms, isCalm) {
    for (const [key, flight] of this.airborne) {
      flight.age_ms += passed_ms;
      step(flight, passed_ms, isCalm);
      if (flight.fallen >= 1 || flight.landed >= 1 || flight.age_ms > FORGOTTEN_MS) this.airborne.delete(key);
    }
  }

  /** Whether any command has to be drawn again. */
  get isMoving() {
    return [...this.airborne.values()].some((flight) => flight.fate !== "sent" || flight.progress < BEFORE_TARGET);
  }
}

/**
 * @param {Airborne} flight
 * @param {number} passed_ms
 * @param {boolean} isCalm
 */
function step(flight, passed_ms, isCalm) {
  const isLost = flight.fate === "dropped";
  const end = isLost ? Math.max(HALF_WAY, flight.progress) : flight.fate === "delivered" ? 1 : BEFORE_TARGET;
  if (isCalm) flight.progress = end;
  if (flight.progress < end) flight.progress = Math.min(end, flight.progress + passed_ms / FLIGHT_MS);
  else if (isLost) flight.fallen += passed_ms / FALL_MS;
  else if (flight.fate === "delivered") flight.landed += passed_ms / LANDING_MS;
}
