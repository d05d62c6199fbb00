// @ts-check
// The state of the page. Only this module changes it; views subscribe to topics and read.

import { Flights } from "./flights.js";
import { History } from "./history.js";
import { Marks } from "./marks.js";
import { Memory } from "./memory.js";

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./types/messages.js").TickPanel} TickPanel */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./types/messages.js").Status} Status */
/** @typedef {import("./connection.js").Broadcast} Broadcast */
/** What listeners subscribe to; "live" is of a run in progress, whatever is shown.
 * @typedef {"connection" | "frame" | "panel" | "log" | "epoch" | "live" | "live-epoch"} Topic */

/** Most log lines that are kept for scrolling back and filtering. */
const MAX_LINES = 10000;
/** Most panels; a bound on names that are not in the roster. */
const MAX_PANELS = 512;
/** Time without a report after which the simulator, too, calls a robot late. */
const LATE_S = 0.5;

export class Store {
  constructor() {
    /** @type {"live" | "recording" | null} */
    this.mode = null;
    this.run = "";
    this.version = "";
    /** Where the simulator of a run in progress is expected. */
    this.endpoint = "";
    /** What has taken the address of this page, see `connection.js`. @type {import("./connection.js").Stranger | null} */
    this.stranger = null;
    /** Whether first steps are explained. */
    this.hasGuide = false;
    /** Why the run has failed. @type {import("./connection.js").Failed | null} */
    this.failed = null;
    this.isConnected = false;
    this.isSimulatorPresent = false;
    /** What is shown. @type {WorldFrame | null} */
    this.frame = null;
    /** The newest frame of a run in progress. @type {WorldFrame | null} */
    this.live = null;
    /** Whether an earlier tick of a run in progress is shown. */
    this.isBack = false;
    /** What was seen of the run in progress. */
    this.memory = new Memory();
    /** When the newest frame arrived, in the time of `performance.now()`. */
    this.frameAt_ms = 0;
    /** The newest status that answered a request. @type {Status | null} */
    this.status = null;
    /** The panels of the tick that is shown. @type {Map<string, Panel>} */
    this.panels = new Map();
    /** Those of the newest frame of a run in progress. @type {Map<string, Panel>} */
    this.livePanels = this.panels;
    /** What is known of commands, for the tick that is shown. */
    this.flights = new Flights();
    /** Of the run in progress. */
    this.liveFlights = this.flights;
    /** Panels whose frame comes next. @type {Map<string, TickPanel>} */
    this.earlyPanels = new Map();
    /** Robots that have shown a panel. @type {Set<string>} */
    this.displaying = new Set();
    /** @type {LogRecord[]} */
    this.log = [];
    /** How often lines were inserted before others. */
    this.logEdits = 0;
    /** The last line that a recording had. Lines up to its tick may arrive once more. @type {LogRecord | null} */
    this.recordedLine = null;
    this.marks = new Marks();
    /** Number of lines so far, including those no longer kept. */
    this.logCount = 0;
    /** Number of lines that the server dropped because this browser was too slow. */
    this.logMissed = 0;
    /** Of the epoch that is shown. */
    this.history = new History();
    /** Of the epoch in progress. */
    this.liveHistory = this.history;
    /** @type {Map<Topic, (() => void)[]>} */
    this.listeners = new Map();
  }

  /**
   * @param {Topic} topic
   * @param {() => void} listener
   */
  on(topic, listener) {
    this.listeners.set(topic, [...(this.listeners.get(topic) ?? []), listener]);
  }

  /** @param {Topic} topic */
  emit(topic) {
    this.listeners.get(topic)?.forEach((listener) => listener());
  }

  /** @param {boolean} isConnected */
  setConnected(isConnected) {
    this.isConnected = isConnected;
    // Whether there is a simulator is known when the server has said so.
    if (!isConnected) this.setSimulator(false);
    this.emit("connection");
  }

  /** @param {boolean} isPresent */
  setSimulator(isPresent) {
    this.isSimulatorPresent = isPresent;
    if (!isPresent) this.status = null;
  }

  /** @param {import("./connection.js").Stranger | null} stranger */
  setStranger(stranger) {
    this.stranger = stranger;
    this.emit("connection");
  }

  /** @param {Broadcast} message */
  apply(message) {
    switch (message.type) {
      case "hello":
        this.endpoint = message.endpoint ?? "";
        this.hasGuide = message.has_guide;
        this.hello(message.mode, message.run, message.version);
        break;
      case "failed":
        this.failed = message.failed;
        this.emit("connection");
        break;
      case "simulator":
        this.setSimulator(message.present);
        this.emit("connection");
        break;
      case "frame":
        this.receive(message.frame);
        break;
      case "panel":
        this.receivePanel(message.robot, message.panel);
        break;
      case "log":
        this.logMissed += message.dropped;
        this.addLines(message.lines);
        break;
    }
  }

  /**
   * A new connection: the server sends the last lines of the log again.
   * @param {"live" | "recording"} mode
   * @param {string} run
   * @param {string} version
   */
  hello(mode, run, version) {
    this.mode = mode;
    this.run = run;
    this.version = version;
    this.failed = null;
    this.log = [];
    this.logCount = 0;
    this.logMissed = 0;
    this.recordedLine = null;
    this.emit("connection");
    this.emit("log");
  }

  /**
   * A frame of a run in progress. A new epoch clears what was seen, and is shown.
   * @param {WorldFrame} frame
   */
  receive(frame) {
    const last = this.live;
    const isNew = !last || !isSameEpoch(frame, last);
    if (last && !isNew) frame.static_world = lasting(frame.static_world, last.static_world);
    const isBackward = isNew || frame.tick < last.tick;
    const isChanged = isNew || frame.phase !== last.phase || frame.speed !== last.speed;
    this.live = frame;
    this.frameAt_ms = performance.now();
    if (isBackward) this.forget();
    // The frame of a replay that has been moved has all that is under way.
    else if ((frame.jumps ?? 0) !== (last?.jumps ?? 0)) this.liveFlights = new Flights();
    // Another run of the name, or a replay that has been moved.
    if (last && compare(frame, last) < 0) this.marks.restart(this.log);

    this.livePanels = new Map([...this.earlyPanels].filter(([, panel]) => isOfTick(panel, frame)));
    if (!this.isBack) this.panels = this.livePanels;
    this.liveFlights.push(frame.flights ?? []);
    if (!this.isBack) this.flights = this.liveFlights;
    this.liveHistory.see(frame.time_s, frame.tick_s, frame.robots, frame.measures);
    this.memory.add(frame, this.livePanels, this.liveFlights);
    if (!this.isBack) this.emit("panel");
    if (!this.isBack) this.show(frame);
    else if (isChanged && this.frame) this.show({ ...this.frame, phase: frame.phase, speed: frame.speed, flights: [] });
    if (isNew) this.emit("live-epoch");
    this.emit("live");
  }

  /**
   * A panel is shown with the frame of its tick, which comes after it or is here already.
   * @param {string} robot
   * @param {TickPanel} panel
   */
  receivePanel(robot, panel) {
    if (!this.earlyPanels.has(robot) && this.earlyPanels.size >= MAX_PANELS) return;
    this.earlyPanels.set(robot, panel);
    if (panel.widgets.length > 0) this.displaying.add(robot);
    if (!this.live || !isOfTick(panel, this.live)) return;

    this.livePanels.set(robot, panel);
    if (!this.isBack) this.emit("panel");
  }

  /** Forgets what was seen of an epoch that is over. */
  forget() {
    const isShown = this.history === this.liveHistory && !this.isBack;
    this.liveHistory = new History();
    if (isShown) this.history = this.liveHistory;
    this.liveFlights = new Flights();
    this.memory.clear();
  }

  /** @param {WorldFrame} frame */
  show(frame) {
    const isNew = !this.frame || !isSameEpoch(frame, this.frame);
    this.frame = frame;

    if (isNew) this.emit("epoch");
    this.emit("frame");
  }

  /**
   * Shows an earlier tick of a run in progress, or a tick of a recording.
   * @param {WorldFrame} frame
   * @param {Map<string, Panel>} panels
   * @param {Flights} flights
   */
  showPast(frame, panels, flights) {
    this.isBack = this.mode === "live";
    this.panels = panels;
    this.flights = flights;
    for (const robot of panels.keys()) this.displaying.add(robot);
    this.emit("panel");
    this.show(frame);
  }

  /** Shows the newest frame again. */
  showLive() {
    this.isBack = false;
    this.history = this.liveHistory;
    this.panels = this.livePanels;
    this.flights = this.liveFlights;
    this.emit("panel");
    if (this.live) this.show(this.live);
  }

  /** Takes in what a recording has of commands of the run in progress. @param {import("./types/messages.js").Flight[]} flights */
  learnFlights(flights) {
    this.liveFlights.push(flights);
    if (!this.isBack) this.emit("frame");
  }

  /**
   * Takes in ticks of the epoch in progress that have been recorded, in place of what was seen of them.
   * @param {number} from the first one
   * @param {import("./recording.js").Chunk} range
   * @param {number} tick_s length of a tick
   */
  refill(from, range, tick_s) {
    this.liveHistory.cutFrom(from * tick_s);
    this.liveHistory.record(range, tick_s);
    for (const { time_s, robots, measures } of this.memory.after(range.end - 1)) this.liveHistory.see(time_s, tick_s, robots, measures);
    if (this.live) this.liveHistory.see(this.live.time_s, this.live.tick_s, this.live.robots, this.live.measures);
  }

  /**
   * Applies the status of an answer, which arrives before the next frame.
   * @param {Status} status
   */
  applyStatus(status) {
    this.status = status;
    const { live } = this;
    if (live && live.epoch === status.epoch && live.tick === status.tick) {
      this.live = { ...live, phase: status.phase, speed: status.speed, awaiting: status.awaiting, flights: [] };
      this.frameAt_ms = performance.now();
      if (!this.isBack) this.frame = this.live;
    }

    this.emit("frame");
  }

  /** @param {LogRecord[]} lines */
  addLines(lines) {
    const last = this.recordedLine;
    if (last && lines.some((line) => compare(line, last) <= 0)) return this.mergeLines(lines, false);
    this.append(lines);
  }

  /**
   * Takes in lines of the record, of which some are known.
   * @param {LogRecord[]} lines in order
   */
  addRecorded(lines) {
    const last = lines.at(-1);
    if (last && compare(last, this.recordedLine) > 0) this.recordedLine = last;
    this.mergeLines(lines, true);
  }

  /** Forgets the log: another run has taken the name of this one. */
  forgetLog() {
    this.log = [];
    this.logCount = 0;
    this.logMissed = 0;
    this.recordedLine = null;
    this.marks.clear();
    this.emit("log");
  }

  /**
   * Adds those of the lines that are not known, each where it belongs.
   * @param {LogRecord[]} lines in order
   * @param {boolean} areRecorded whether they come before others of their tick: the order within a tick is that of the record
   */
  mergeLines(lines, areRecorded) {
    const [first] = lines;
    if (!first) return;
    const begin = this.log.findIndex((line) => compare(line, first) >= 0);
    const later = begin < 0 ? [] : this.log.slice(begin);
    /** @type {Map<string, number>} */
    const known = new Map();
    for (const line of later) known.set(keyOf(line), (known.get(keyOf(line)) ?? 0) + 1);
    const fresh = lines.filter((line) => {
      const count = known.get(keyOf(line)) ?? 0;
      known.set(keyOf(line), count - 1);
      return count <= 0;
    });
    if (later.length === 0 || fresh.length === 0) return this.append(fresh);

    const all = (areRecorded ? [...fresh, ...later] : [...later, ...fresh]).sort(compare);
    this.log.splice(begin, later.length, ...all);
    this.logEdits += 1;
    this.counted(fresh);
  }

  /** @param {LogRecord[]} lines */
  append(lines) {
    for (const line of lines) this.log.push(line);
    this.counted(lines);
  }

  /** @param {LogRecord[]} lines that were added */
  counted(lines) {
    this.logCount += lines.length;
    this.marks.add(lines);
    if (this.log.length > MAX_LINES) this.log.splice(0, this.log.length - MAX_LINES);
    this.emit("log");
  }

  /**
   * Whether the status or the log is newer than the frame. The simulator limits its frames per second, so the last one
   * before a pause may be missing.
   */
  get isBehind() {
    const frame = this.now;
    if (!frame) return false;

    const newest = [this.status, this.log.at(-1)].filter((one) => !!one);
    const isNextEpoch = newest.some(({ epoch }) => epoch > frame.epoch);
    const isLaterTick = newest.some(({ epoch, tick }) => epoch === frame.epoch && tick > frame.tick);

    return isNextEpoch || (isLaterTick && frame.phase !== "running");
  }

  /** The newest frame of a run in progress, or what a recording shows. */
  get now() {
    return this.mode === "recording" ? this.frame : this.live;
  }

  /** Whether a chosen tick is shown, and not the newest one. */
  get isChosenTick() {
    return this.mode === "recording" || this.isBack;
  }

  /** Name of the recorded run of which this is a replay. */
  get replayOf() {
    return this.now?.replay_of ?? this.status?.replay_of ?? null;
  }

  get phase() {
    return this.now?.phase ?? this.status?.phase ?? null;
  }

  /** Whether what is shown is not the state of now: there is no simulator any more. */
  get isPast() {
    return this.mode === "live" && !this.isLive;
  }

  /** Whether requests reach a simulator. */
  get isLive() {
    return this.mode === "live" && this.isConnected && this.isSimulatorPresent;
  }

  /**
   * The robots that the clock waits for, with seconds of wall clock as of now. In every tick the clock waits a short time
   * for each robot; only late ones are listed. In the past, the robots for which the clock was held in the tick.
   * @returns {import("./types/messages.js").Awaited[]}
   */
  awaiting() {
    if (this.isChosenTick) return this.frame?.awaiting ?? [];
    if (!this.isLive) return [];
    const since_s = this.frame ? (performance.now() - this.frameAt_ms) / 1000 : 0;
    const awaiting = this.frame?.awaiting ?? this.status?.awaiting ?? [];
    const late = this.phase === "gathering" ? awaiting : awaiting.filter((awaited) => awaited.since_s >= LATE_S);
    return late.map((awaited) => ({ ...awaited, since_s: awaited.since_s + since_s }));
  }
}

/**
 * What does not change in an epoch, of which only some frames tell: the same object as long as nothing of it is new.
 * @template T
 * @param {T | undefined} told
 * @param {T | undefined} known
 */
function lasting(told, known) {
  return told && JSON.stringify(told) !== JSON.stringify(known) ? told : known;
}

/**
 * @param {WorldFrame} one
 * @param {WorldFrame} other
 */
function isSameEpoch(one, other) {
  return one.run === other.run && one.epoch === other.epoch;
}

/**
 * @param {TickPanel} panel
 * @param {WorldFrame} frame
 */
function isOfTick(panel, frame) {
  return panel.epoch === frame.epoch && panel.tick === frame.tick;
}

/** @typedef {{epoch: number, tick: number}} Moment */
/**
 * Which one is of an earlier tick; negative if the first one is.
 * @param {Moment} one
 * @param {Moment | null} other without it, the first one is later
 */
function compare(one, other) {
  return other ? one.epoch - other.epoch || one.tick - other.tick : 1;
}

/** @param {LogRecord} line */
function keyOf({ epoch, tick, source, kind, text }) {
  return JSON.stringify([epoch, tick, source, kind, text]);
}
