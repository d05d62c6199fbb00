// @ts-check
// What stands out on the time line: exchanges, cuts, faults and epochs, known by their lines of the log.

import { seconds } from "./units.js";

/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {"exchange" | "cut" | "fault" | "epoch"} MarkKind */
/** Things at one place of the time line. @typedef {{kind: MarkKind, tick: number, at: number, words: string}} Mark */

/** Most lines that are kept for marks, the newest ones. */
const MAX_NOTED = 2000;
/** Most lines in the words of one mark. */
const MAX_WORDS = 6;
/** What is drawn where several things are at one place. @type {MarkKind[]} */
const BY_WEIGHT = ["fault", "cut", "epoch", "exchange"];

/**
 * @param {LogRecord} line
 * @returns {MarkKind | null}
 */
export function markOf({ kind, text }) {
  if (kind === "behavior") return /^behavior (.* -> )?EXCHANGE$/.test(text) ? "exchange" : null;
  if (kind === "network") return "cut";
  if (kind === "membership") return /^(fault|is lost|is back)/.test(text) ? "fault" : null;
  if (kind === "run") return /^(initialized|finished|stopped|aborted)/.test(text) ? "epoch" : null;
  return null;
}

/** The lines that have marks, in bounded memory. */
export class Marks {
  constructor() {
    /** By what tells them apart: a line may come twice. @type {Map<string, LogRecord>} */
    this.lines = new Map();
    /** Whether older ones were dropped. */
    this.isCut = false;
  }

  /** @param {LogRecord[]} lines in any order */
  add(lines) {
    for (const line of lines) {
      if (markOf(line) !== null) this.lines.set(JSON.stringify([line.epoch, line.tick, line.source, line.text]), line);
    }
    if (this.lines.size <= MAX_NOTED) return;

    const sorted = [...this.lines].sort(([, a], [, b]) => a.epoch - b.epoch || a.tick - b.tick);
    this.lines = new Map(sorted.slice(-MAX_NOTED));
    this.isCut = true;
  }

  clear() {
    this.lines.clear();
    this.isCut = false;
  }

  /** Takes only the lines of the last run of a log. @param {LogRecord[]} log */
  restart(log) {
    const begin = log.map(({ tick, text }) => tick === 0 && text.startsWith("initialized")).lastIndexOf(true);
    this.clear();
    this.add(log.slice(Math.max(0, begin)));
  }

  /**
   * The marks of an epoch. What would be drawn over another one is one mark with it.
   * @param {number} epoch
   * @param {number} first tick of the time line
   * @param {number} last tick of the time line
   * @param {number} places that can be told apart
   * @returns {Mark[]}
   */
  of(epoch, first, last, places) {
    const share = (/** @type {number} */ tick) => (tick - first) / Math.max(1, last - first);
    /** @type {Map<number, LogRecord[]>} */
    const found = new Map();
    for (const line of this.lines.values()) {
      if (line.epoch !== epoch || line.tick < first || line.tick > last) continue;
      const place = Math.round(places * share(line.tick));
      found.set(place, [...(found.get(place) ?? []), line]);
    }

    return [...found.values()].map((lines) => {
      lines.sort((a, b) => a.tick - b.tick);
      const kinds = lines.map(markOf);
      const kind = BY_WEIGHT.find((one) => kinds.includes(one)) ?? "epoch";
      const { tick } = lines[kinds.indexOf(kind)];
      return { kind, tick, at: share(tick), words: wordsOf(lines) };
    });
  }
}

/** @param {LogRecord[]} lines */
function wordsOf(lines) {
  const words = lines.slice(0, MAX_WORDS).map(({ tick, time_s, tick_s, source, text, kind, epoch }) => {
    const who = source === "simulator" ? "" : `${source} `;
    const what = kind === "run" ? `epoch ${epoch} ${text.replace(/, digest .*/, "")}` : `${who}${text}`;
    return `${seconds(time_s, tick_s)}, tick ${tick}: ${what}`;
  });
  const more = lines.length - words.length;
  return [...words, ...(more > 0 ? [`and ${more} more`] : [])].join("\n");
}
