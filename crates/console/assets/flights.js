// @ts-check
// Where commands are: a function of the tick that is shown, so that the plan agrees with the log at every tick.

/** @typedef {import("./types/messages.js").Flight} Flight */
/** @typedef {import("./types/messages.js").Fate} Fate */

/**
 * A command as it is drawn.
 * @typedef {object} Shown
 * @property {string} from
 * @property {string} to
 * @property {string} text of the command, with why it was lost; empty if its sending is not known
 * @property {boolean} isNamed whether its text is written beside it: once for commands with the same text of one sender to several robots,
 *   as those of a broadcast are, and once for those to one robot that share a fate
 * @property {Fate} fate up to the tick that is shown
 * @property {number} progress part of the way that it has gone
 * @property {number} faded 0 in the tick that decided its fate, 1 when that is no longer shown
 */
/** What became of a copy, when, and why it was lost. @typedef {{tick: number, fate: Fate, because?: string | null}} End */
/** @typedef {{from: string, to: string, text: string, sent: number, ends: End[]}} Command */

/** How long it is shown what became of a command, in simulated time. The server tells of as long a time before a range of ticks. */
export const TOLD_S = 2;
/** After this time a command is half way to its target: how long it will take is not known. */
const HALF_WAY_S = 2;
/** Where a lost one is shown. */
const LOST_AT = 0.5;
/** Most commands that are known. */
const MAX_COMMANDS = 4096;

export class Flights {
  constructor() {
    /** By sender, target and number, the newest last. @type {Map<string, Command>} */
    this.commands = new Map();
  }

  /** Takes in what happened to commands, in any order and as often as it is told. @param {Flight[]} flights */
  push(flights) {
    for (const { tick, from, to, seq, command, fate, because } of flights) {
      const key = JSON.stringify([from, to, seq]);
      const known = this.commands.get(key) ?? { from, to, text: "", sent: -Infinity, ends: [] };
      this.commands.set(key, known);
      known.text ||= command ?? "";
      if (fate === "sent") known.sent = tick;
      else if (!known.ends.some((end) => end.tick === tick && end.fate === fate)) known.ends.push({ tick, fate, because });
    }

    for (const key of this.commands.keys()) {
      if (this.commands.size <= MAX_COMMANDS) break;
      this.commands.delete(key);
    }
  }

  /**
   * The commands under way in a tick, and those whose fate it or a tick shortly before has decided.
   * @param {number} tick
   * @param {number} tick_s length of a tick
   * @returns {Shown[]}
   */
  at(tick, tick_s) {
    const shown = [];
    for (const { from, to, text, sent, ends } of this.commands.values()) {
      const past = ends.filter((end) => end.tick <= tick);
      const last = past.reduce((/** @type {End | null} */ newest, end) => (newest && newest.tick > end.tick ? newest : end), null);
      const age_s = (tick - (last?.tick ?? sent)) * tick_s;
      if (sent > tick || age_s === Infinity || (last && age_s >= TOLD_S)) continue;

      const progress = !last ? age_s / (age_s + HALF_WAY_S) : last.fate === "dropped" ? LOST_AT : 1;
      const words = text && last?.because ? `${text}, ${last.because}` : text;
      shown.push({ from, to, text: words, fate: last?.fate ?? "sent", progress, faded: last ? age_s / TOLD_S : 0, isNamed: false });
    }
    nameOnce(shown);
    return shown;
  }
}

/** Has the newest of commands that would show the same text named. @param {Shown[]} shown the newest last */
function nameOnce(shown) {
  /** The robot to which the named command with this text of a sender goes, and the fates that are named. @type {Map<string, {to: string, fates: Set<Fate>}>} */
  const named = new Map();
  for (const flight of [...shown].reverse()) {
    const { from, to, text, fate } = flight;
    const key = JSON.stringify([from, text]);
    const known = named.get(key) ?? { to, fates: new Set() };
    named.set(key, known);
    flight.isNamed = known.to === to && !known.fates.has(fate);
    if (flight.isNamed) known.fates.add(fate);
  }
}
