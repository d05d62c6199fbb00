// @ts-check
// All that the page knows. Messages change it here and nowhere else; views listen and read.

import { History } from "./history.js";

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").Panel} Panel */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./types/messages.js").Status} Status */
/** @typedef {import("./connection.js").Broadcast} Broadcast */
/** What listeners can hear of. @typedef {"link" | "frame" | "panel" | "log" | "epoch"} Topic */

/** Lines kept for reading back and filtering. */
const MOST_LINES = 10000;
/** Panels kept; robots come from the roster, so this only bounds nonsense. */
const MOST_PANELS = 512;
/** From here on the simulator itself calls a robot late. */
const LATE_S = 0.5;

export class Store {
  constructor() {
    /** @type {"live" | "recording" | null} */
    this.mode = null;
    this.run = "";
    this.version = "";
    this.isLinked = false;
    this.isSimulatorPresent = false;
    /** @type {WorldFrame | null} */
    this.frame = null;
    /** Wall clock when the frame came, milliseconds. */
    this.frameAt_ms = 0;
    /** Of a simulator that has shown no picture yet. @type {Status | null} */
    this.status = null;
    /** @type {Map<string, Panel>} */
    this.panels = new Map();
    /** @type {LogRecord[]} */
    this.log = [];
    /** Lines that were ever added; tells a view what is new. */
    this.logCount = 0;
    /** Lines that this browser missed. */
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

  /** @param {boolean} isLinked */
  link(isLinked) {
    this.isLinked = isLinked;
    this.emit("link");
  }

  /** @param {Broadcast} message */
  apply(message) {
    switch (message.type) {
      case "hello":
        this.hello(message.mode, message.run, message.version);
        break;
      case "simulator":
        this.isSimulatorPresent = message.present;
        if (!message.present) this.status = null;
        this.emit("link");
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
   * After hello the server sends the last lines again.
   * @param {"live" | "recording"} mode
   * @param {string} run
   * @param {string} version
   */
  hello(mode, run, version) {
    if (run !== this.run) this.forget();
    this.mode = mode;
    this.run = run;
    this.version = version;
    this.log = [];
    this.logCount = 0;
    this.logMissed = 0;
    this.emit("link");
    this.emit("log");
  }

  forget() {
    this.frame = null;
    this.panels.clear();
    this.history.clear();
  }

  /**
   * The newest picture. Whatever belongs to another epoch is no longer of interest.
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
   * An answer of the simulator tells of its phase before the next picture does.
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

  /** @param {LogRecord[]} lines */
  addLines(lines) {
    this.log.push(...lines);
    this.logCount += lines.length;
    if (this.log.length > MOST_LINES) this.log.splice(0, this.log.length - MOST_LINES);
    this.emit("log");
  }

  /**
   * Whether something told of a later moment than the picture shows: the simulator paints so many pictures a second and
   * no more, so the last one before it comes to a halt may be missing.
   */
  get isBehind() {
    const { frame } = this;
    if (!frame) return false;
    const told = [this.status, this.log.at(-1)].filter((one) => !!one);
    const isNextEpoch = told.some(({ epoch }) => epoch > frame.epoch);
    const isLaterTick = told.some(({ epoch, tick }) => epoch === frame.epoch && tick > frame.tick);
    return isNextEpoch || (isLaterTick && frame.phase !== "running");
  }

  get phase() {
    return this.frame?.phase ?? this.status?.phase ?? null;
  }

  /** Whether there is somebody to control. */
  get isLive() {
    return this.mode === "live" && this.isLinked && this.isSimulatorPresent;
  }

  /**
   * For whom the clock waits, with seconds of wall clock as of now. In the middle of any tick it waits a little for
   * everybody; that is nothing to tell.
   * @returns {import("./types/messages.js").Awaited[]}
   */
  awaiting() {
    if (!this.isLive) return [];
    const since_s = this.frame ? (performance.now() - this.frameAt_ms) / 1000 : 0;
    const awaiting = this.frame?.awaiting ?? this.status?.awaiting ?? [];
    const late = this.phase === "gathering" ? awaiting : awaiting.filter((awaited) => awaited.since_s >= LATE_S);
    return late.map((awaited) => ({ ...awaited, since_s: awaited.since_s + since_s }));
  }
}
