// @ts-check
// The state of the page. Only this module changes it; views subscribe to topics and read.

import { History } from "./history.js";

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").Panel} Panel */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./types/messages.js").Status} Status */
/** @typedef {import("./connection.js").Broadcast} Broadcast */
/** What listeners subscribe to. @typedef {"connection" | "frame" | "panel" | "log" | "epoch"} Topic */

/** Most log lines that are kept for scrolling back and filtering. */
const MOST_LINES = 10000;
/** Most panels; a bound on names that are not in the roster. */
const MOST_PANELS = 512;
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
    this.isConnected = false;
    this.isSimulatorPresent = false;
    /** @type {WorldFrame | null} */
    this.frame = null;
    /** When the frame arrived, in the time of `performance.now()`. */
    this.frameAt_ms = 0;
    /** The newest status that answered a request. @type {Status | null} */
    this.status = null;
    /** @type {Map<string, Panel>} */
    this.panels = new Map();
    /** @type {LogRecord[]} */
    this.log = [];
    /** Number of lines so far, including those no longer kept. */
    this.logCount = 0;
    /** Number of lines that the server dropped because this browser was too slow. */
    this.logMissed = 0;
    this.history = new History();
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
        this.hello(message.mode, message.run, message.version);
        break;
      case "simulator":
        this.setSimulator(message.present);
        this.emit("connection");
        break;
      case "frame":
        this.show(message.frame);
        break;
      case "panel":
        if (this.panels.size < MOST_PANELS || this.panels.has(message.robot)) {
          this.panels.set(message.robot, message.panel);
          this.emit("panel");
        }
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
    this.log = [];
    this.logCount = 0;
    this.logMissed = 0;
    this.emit("connection");
    this.emit("log");
  }

  /**
   * Replaces the frame. A new epoch clears the history.
   * @param {WorldFrame} frame
   */
  show(frame) {
    const last = this.frame;
    const isNew = !last || frame.epoch !== last.epoch || frame.run !== last.run;
    this.frame = frame;
    this.frameAt_ms = performance.now();

    if (this.mode === "live") {
      if (isNew || frame.tick < last.tick) this.history.clear();
      this.history.add(frame.time_s, frame.robots);
    }

    if (isNew) this.emit("epoch");
    this.emit("frame");
  }

  /**
   * Applies the status of an answer, which arrives before the next frame.
   * @param {Status} status
   */
  applyStatus(status) {
    this.status = status;
    const frame = this.frame;
    if (frame && frame.epoch === status.epoch && frame.tick === status.tick) {
      this.frame = { ...frame, phase: status.phase, speed: status.speed, awaiting: status.awaiting, flights: [] };
      this.frameAt_ms = performance.now();
    }

    this.emit("frame");
  }

  /**
   * Replaces all panels, where a recording is shown at another tick.
   * @param {Map<string, Panel>} panels
   */
  setPanels(panels) {
    this.panels = panels;
    this.emit("panel");
  }

  /** @param {LogRecord[]} lines */
  addLines(lines) {
    this.log.push(...lines);
    this.logCount += lines.length;
    if (this.log.length > MOST_LINES) this.log.splice(0, this.log.length - MOST_LINES);
    this.emit("log");
  }

  /**
   * Whether the status or the log is newer than the frame. The simulator limits its frames per second, so the last one
   * before a pause may be missing.
   */
  get isBehind() {
    const { frame } = this;
    if (!frame) return false;

    const newest = [this.status, this.log.at(-1)].filter((one) => !!one);
    const isNextEpoch = newest.some(({ epoch }) => epoch > frame.epoch);
    const isLaterTick = newest.some(({ epoch, tick }) => epoch === frame.epoch && tick > frame.tick);

    return isNextEpoch || (isLaterTick && frame.phase !== "running");
  }

  /** Name of the recorded run of which this is a replay. */
  get replayOf() {
    return this.frame?.replay_of ?? this.status?.replay_of ?? null;
  }

  get phase() {
    return this.frame?.phase ?? this.status?.phase ?? null;
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
   * for each robot; only late ones are listed. In a recording, the robots for which the clock was held in the tick.
   * @returns {import("./types/messages.js").Awaited[]}
   */
  awaiting() {
    if (this.mode === "recording") return this.frame?.awaiting ?? [];
    if (!this.isLive) return [];
    const since_s = this.frame ? (performance.now() - this.frameAt_ms) / 1000 : 0;
    const awaiting = this.frame?.awaiting ?? this.status?.awaiting ?? [];
    const late = this.phase === "gathering" ? awaiting : awaiting.filter((awaited) => awaited.since_s >= LATE_S);
    return late.map((awaited) => ({ ...awaited, since_s: awaited.since_s + since_s }));
  }
}
