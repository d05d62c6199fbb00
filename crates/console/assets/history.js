// @ts-check
// The robots over simulated time, in bounded memory: the data of charts, bands and trails. What is recorded has spans of emotions
// and behaviors; those of the newest ticks, which are not recorded yet, are made of frames.

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */

/** A stay in a state; the last one of a list may go on after what is known. @typedef {{state: string, from_s: number, to_s: number, goesOn: boolean}} Span */
/** @typedef {Pick<RobotFrame, "name" | "location" | "presence" | "emotion_state" | "behavior_state" | "state_variables">} SampledRobot */
/** Places at the times of the history. @typedef {{x_m: (number | null)[], y_m: (number | null)[]}} Track */

/** Most samples; beyond, older ones are dropped where they are close together, so that the whole run stays visible. */
const MAX_SAMPLES = 6000;
/** Most numbers of all series together: with many robots there are fewer samples of each, and no robot is left out. */
const MAX_NUMBERS = 3_000_000;
const MAX_SPANS = 4000;
const KINDS = /** @type {const} */ (["emotion", "behavior"]);
/** Samples that are further apart than this many ticks have a gap between them: what was in between was not seen. */
const SEEN_TICKS = 10;
/** Most variables of all robots: a robot can publish any number of names. */
const MAX_VARIABLES = 16_384;
/** Whose the measures of a run are, in the place of a robot: no robot has such a name. */
export const THE_RUN = "the run";
/** Most names of emotions that are listed: a robot can have any. */
const MAX_EMOTIONS = 64;

export class History {
  constructor() {
    /** How often it has changed. */
    this.changes = 0;
    this.clear();
  }

  clear() {
    /** @type {number[]} */
    this.times_s = [];
    /** Values by variable and robot. @type {Map<string, Map<string, (number | null)[]>>} */
    this.variables = new Map();
    /** @type {Map<string, Track>} */
    this.tracks = new Map();
    /** @type {Map<string, {emotion: Span[], behavior: Span[]}>} */
    this.states = new Map();
    /** The emotions that robots have had. @type {Set<string>} */
    this.emotions = new Set();
    /** @type {number} */
    this.variableCount = 0;
    /** Whether a sample is none, but stands for a time of which nothing is known: 1 or 0. @type {(number | null)[]} */
    this.gaps = [];
    /** Until when all is known of which there are samples. @type {number} */
    this.known_s = -Infinity;
    /** How many variables of the last sample are not kept, because there are too many. @type {number} */
    this.dropped = 0;
    this.changes += 1;
  }

  /**
   * Adds a frame that was seen. There is a gap before it if the ticks before were not.
   * @param {number} time_s
   * @param {number} tick_s length of a tick
   * @param {SampledRobot[]} robots
   * @param {Parameters<History["add"]>[3]} [measures]
   */
  see(time_s, tick_s, robots, measures) {
    const before_s = this.times_s.at(-1) ?? -Infinity;
    const last_s = Math.max(this.known_s, before_s);
    const isBroken = before_s > -Infinity && time_s - last_s > (SEEN_TICKS + 0.5) * tick_s;
    this.add(time_s, robots, isBroken, measures);
    if (time_s <= last_s) return;
    for (const robot of robots) {
      for (const kind of KINDS) {
        // A frame has what a robot that is lost reported last.
        const state = robot.presence === "lost" ? "" : robot[`${kind}_state`];
        const last = isBroken ? undefined : this.spansOf(robot.name)[kind].at(-1);
        if (last?.goesOn) {
          last.to_s = time_s;
          last.goesOn = last.state === state;
        }
        if (state && !last?.goesOn) this.push(robot.name, kind, { state, from_s: time_s, to_s: time_s, goesOn: true });
      }
    }
  }

  /**
   * Adds ticks that are recorded, which follow on those before.
   * @param {Pick<import("./recording.js").Chunk, "ticks" | "spans" | "end">} range
   * @param {number} tick_s length of a tick
   */
  record({ ticks, spans, end }, tick_s) {
    for (const { tick, robots, measures } of ticks) this.add(tick * tick_s, robots, false, measures);
    this.known_s = (end - 1) * tick_s;
    for (const { robot, kind, state, begin, end: over } of spans) {
      const to_s = over === null ? this.known_s : over * tick_s;
      this.push(robot, kind, { state, from_s: begin * tick_s, to_s, goesOn: over === null });
    }
  }

  /**
   * Adds a sample; one that is not later than the last is ignored.
   * @param {number} time_s
   * @param {SampledRobot[]} robots
   * @param {boolean} isBroken whether nothing is known of the time before
   * @param {Record<string, number>} measures of the run
   */
  add(time_s, robots, isBroken = false, measures = {}) {
    const last_s = this.times_s.at(-1) ?? -Infinity;
    if (time_s <= last_s) return;
    this.changes += 1;

    if (isBroken) {
      this.times_s.push(last_s + (time_s - last_s) / 1000);
      this.gaps.push(1);
      this.align();
    }
    this.times_s.push(time_s);
    this.gaps.push(0);

    this.dropped = 0;
    for (const robot of robots) {
      this.place(robot);
      this.spansOf(robot.name);
      for (const [variable, value] of Object.entries(robot.state_variables)) {
        if (typeof value === "number") this.series(variable, robot.name)?.push(value);
      }
    }
    for (const [measure, value] of Object.entries(measures)) this.series(measure, THE_RUN)?.push(value);

    this.align();
    const most = Math.min(MAX_SAMPLES, MAX_NUMBERS / (this.variableCount + 2 * this.tracks.size));
    if (this.times_s.length > Math.max(2, most)) this.thin();
  }

  /** @param {Pick<RobotFrame, "name" | "location">} robot */
  place({ name, location }) {
    const track = this.tracks.get(name) ?? { x_m: this.unknown(), y_m: this.unknown() };
    this.tracks.set(name, track);
    track.x_m.push(location.x);
    track.y_m.push(location.y);
  }

  /**
   * @param {string} variable
   * @param {string} robot
   * @returns {(number | null)[] | undefined} undefined if there are too many variables
   */
  series(variable, robot) {
    const robots = this.variables.get(variable) ?? new Map();
    let values = robots.get(robot);
    if (!values && this.variableCount >= MAX_VARIABLES) this.dropped += 1;
    if (!values && this.variableCount < MAX_VARIABLES) {
      this.variableCount += 1;
      values = this.unknown();
      this.variables.set(variable, robots.set(robot, values));
    }

    return values;
  }

  /** Gaps for all earlier samples. @returns {(number | null)[]} */
  unknown() {
    return new Array(this.times_s.length - 1).fill(null);
  }

  /** @param {string} robot */
  spansOf(robot) {
    const spans = this.states.get(robot) ?? { emotion: [], behavior: [] };
    this.states.set(robot, spans);
    return spans;
  }

  /**
   * Adds a span, in place of what was known of it.
   * @param {string} robot
   * @param {"emotion" | "behavior"} kind
   * @param {Span} span
   */
  push(robot, kind, span) {
    const spans = this.spansOf(robot)[kind];
    if (spans.at(-1)?.from_s === span.from_s) spans.pop();
    if (kind === "emotion" && this.emotions.size < MAX_EMOTIONS) this.emotions.add(span.state);
    spans.push(span);
    if (spans.length > MAX_SPANS) spans.shift();
  }

  /**
   * Forgets a time and all that is later, for samples that are more exact.
   * @param {number} time_s
   */
  cutFrom(time_s) {
    this.changes += 1;
    this.known_s = Math.min(this.known_s, time_s);
    const kept = this.indexAt(time_s, false) + 1;
    for (const values of [this.times_s, ...this.all()]) values.length = Math.min(values.length, kept);
    for (const { emotion, behavior } of this.states.values()) {
      for (const spans of [emotion, behavior]) {
        while ((spans.at(-1)?.from_s ?? -Infinity) >= time_s) spans.pop();
        const last = spans.at(-1);
        if (last) last.to_s = Math.min(last.to_s, time_s);
      }
    }
  }

  /** Whether there is a time of which nothing is known. */
  get hasGap() {
    return this.gaps.includes(1);
  }

  /** A series without a value in the last sample gets a gap there. */
  align() {
    const length = this.times_s.length;
    for (const values of this.all()) {
      if (values.length < length) values.push(null);
    }
  }

  thin() {
    // A gap stays: without it the samples around it would be joined.
    const samples = [...this.times_s.keys()].filter((i) => !this.gaps[i]);
    const spared = new Set(spread(samples.map((i) => this.times_s[i])).map((i) => samples[i]));
    const kept = [...this.times_s.keys()].filter((i) => this.gaps[i] || spared.has(i)).filter((i, at, all) => !this.gaps[i] || !this.gaps[all[at + 1]]);
    for (const values of [this.times_s, ...this.all()]) {
      kept.forEach((from, to) => (values[to] = values[from]));
      values.length = kept.length;
    }
  }

  /** Every list that is parallel to the times. @returns {(number | null)[][]} */
  all() {
    const series = [...this.variables.values()].flatMap((robots) => [...robots.values()]);
    const tracks = [...this.tracks.values()].flatMap((track) => [track.x_m, track.y_m]);
    return [this.gaps, ...series, ...tracks];
  }

  /**
   * Index of the last sample that is not later.
   * @param {number} time_s
   * @param {boolean} isIncluded whether one at this time counts
   */
  indexAt(time_s, isIncluded = true) {
    let low = 0;
    let high = this.times_s.length;

    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times_s[middle] < time_s || (isIncluded && this.times_s[middle] === time_s)) low = middle + 1;
      else high = middle;
    }

    return low - 1;
  }
}

/**
 * Chooses about half of the samples: those that are spread over the whole time, and the newest ones.
 * @param {number[]} times in order
 * @returns {number[]} their indices
 */
export function spread(times) {
  const recent = times.length - Math.ceil(times.length / 8);
  const least = (times[recent] - times[0]) / (times.length * (3 / 8));
  let last = -Infinity;
  return [...times.keys()].filter((i) => {
    const isKept = i >= recent || times[i] - last >= least;
    if (isKept) last = times[i];
    return isKept;
  });
}
