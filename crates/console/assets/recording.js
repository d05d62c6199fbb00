// @ts-check
// The time line of a run: what is recorded of it, and what was seen of it while it goes on. A tick of either is shown through
// the same store as the newest one.

import { Flights } from "./flights.js";
import { cellsIn } from "./layers.js";
import { History } from "./history.js";
import { hasGuessedNames, orderNames } from "./palette.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Awaited} Awaited */
/** @typedef {import("./types/messages.js").Cut} Cut */
/** @typedef {import("./types/messages.js").Flight} Flight */
/** @typedef {import("./types/messages.js").HeldProcess} HeldProcess */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").Standing} Standing */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/**
 * An epoch that is recorded; `ticks` is its last tick so far, `number` tells it from a recording that took its place, and
 * `epochs` are all that have one.
 * @typedef {{run: string, epoch: number, seed: number, tick_s: number, duration_s: number, field_m: [number, number],
 *   body_m: number, display_unit: "m" | "ft", obstacles: [number, number][], layers: WorldFrame["layers"], static_world?: WorldFrame["static_world"], ticks: number, is_finished: boolean, number: number, epochs: number[]}} Recorded
 */
/**
 * @typedef {{tick: number, robots: RobotFrame[], guests_mm: number[], guest_numbers: number[], guest_moods: WorldFrame["guest_moods"], cuts: Cut[], faults: HeldProcess[],
 *   awaiting: Awaited[], expectations: Standing[], sites: WorldFrame["sites"],
 *   layers: WorldFrame["layers"], measures?: Record<string, number>}} RecordedTick
 */
/** A panel and its tick. @typedef {{tick: number, robot: string, panel: Panel}} RecordedPanel */
/** A stay in an emotion or behavior, up to the tick `end`, which is null if it goes on. @typedef {{robot: string, kind: "emotion" | "behavior", state: string, begin: number, end: number | null}} RecordedStay */
/** Ticks before `end`; `earlier_flights` are of commands that the first ones show, too, and `spans` are with samples. @typedef {{end: number, ticks: RecordedTick[], spans: RecordedStay[], panels: RecordedPanel[], earlier_flights: Flight[], flights: Flight[],
 *   log: LogRecord[]}} Chunk */

/** Ticks in a chunk: few, because a seek waits for a whole one. */
const CHUNK = 32;
/** Most numbers of guests' places and cells of layers that are kept; the least recently used chunks are dropped first. */
const MAX_NUMBERS = 12_000_000;
/** Most chunks that are kept. */
const MAX_CHUNKS = 2000;
/** Ticks of which charts and log are read at once. */
const READ_AT_ONCE = 4096;
/** About as many ticks of an epoch are in charts. */
const SAMPLES = 3000;
/** Lines of earlier epochs are read as long as there are fewer. */
const ENOUGH_LINES = 10_000;
/** How often it is asked what has been recorded since; after a request that takes long, later. */
const FOLLOW_MS = 1000;
/** The same while the clock stands and something before its tick has not been seen. */
const FOLLOW_GAP_MS = 150;
/** In this time a run that has begun has recorded something. */
const BEGINNING_MS = 5000;
/** How fast a run that went as fast as it could is watched again. */
const SEEN = 5;
/** Least time between two frames. */
const FRAME_MS = 33;
/** The factor of playback at speed "max". */
const FASTEST = 200;

export class Player {
  /**
   * @param {Store} store
   * @param {{failed: (reason: string) => void}} client
   */
  constructor(store, client) {
    this.store = store;
    this.client = client;
    /** The newest epoch that is recorded. @type {Recorded | null} */
    this.newest = null;
    /** The epoch that is shown, if it is recorded. @type {Recorded | null} */
    this.header = null;
    /** The epoch that was chosen and is not shown yet. @type {number | null} */
    this.choosing = null;
    /** Why nothing is recorded. */
    this.missing = "";
    /** Since when. */
    this.missingAt_ms = 0;
    /** The last tick of the newest epoch that charts and log have from its recording. */
    this.readTo = -1;
    /** The newest tick when the page was connected; negative once the commands that were sent before are known. */
    this.connectedAt = -1;
    /** The recording of which the log has the epochs before. */
    this.earlierOf = 0;
    /** The epoch whose names are in order. */
    this.namesOf = "";
    /** Chunks of the epoch that is shown by number, in order of their last use. @type {Map<number, Promise<Chunk>>} */
    this.chunks = new Map();
    this.numbers = 0;
    /** Position of playback, in ticks, with a fraction. */
    this.position = 0;
    /** The chosen tick. */
    this.chosen = -1;
    this.isPlaying = false;
    /** @type {number | null} */
    this.factor = 5;
    this.seeks = 0;
    this.playedAt_ms = 0;
    this.isFollowing = false;

    store.on("live-epoch", () => this.restart());
  }

  get isRecording() {
    return this.store.mode === "recording";
  }

  /** Whether the newest tick of a run in progress is shown. */
  get isLive() {
    return this.store.mode === "live" && !this.store.isBack;
  }

  /** Whether the epoch in progress is shown, or an earlier tick of it. */
  get isOfLive() {
    const { live } = this.store;
    return live !== null && (this.isLive || this.epoch === live.epoch);
  }

  /** Whether something of the past is not there. A run that has just begun has recorded nothing yet. */
  get isWanting() {
    return this.missing !== "" && (this.first > 0 || performance.now() - this.missingAt_ms > BEGINNING_MS);
  }

  /** Whether it is known what is recorded. */
  get isKnown() {
    return this.newest !== null || this.missing !== "";
  }

  /** The epoch that is shown. */
  get epoch() {
    return this.store.frame?.epoch ?? this.header?.epoch ?? 0;
  }

  /** All epochs that can be shown. */
  get epochs() {
    const live = this.store.live?.epoch;
    return [...new Set([...(this.newest?.epochs ?? []), ...(live === undefined ? [] : [live])])];
  }

  /** The epoch that is shown, or that was chosen last and is being fetched. */
  get wantedEpoch() {
    if (this.choosing !== null) return this.choosing;
    if (this.isRecording) return this.newest?.epoch;
    return this.isLive ? this.store.live?.epoch : this.epoch;
  }

  get tick_s() {
    return this.store.frame?.tick_s ?? this.header?.tick_s ?? 0;
  }

  /** The tick that is shown. */
  get tick() {
    return this.isLive ? (this.store.live?.tick ?? -1) : this.chosen;
  }

  /** The first tick of the epoch that can be shown. */
  get first() {
    return this.header ? 0 : Math.min(this.store.memory.first, this.last);
  }

  /** The last tick of the epoch that can be shown. */
  get last() {
    return Math.max(this.recorded, this.isOfLive ? (this.store.live?.tick ?? 0) : 0);
  }

  /** The planned last tick of the epoch. */
  get end() {
    const { duration_s = 0 } = this.header ?? this.store.frame ?? {};
    return Math.max(1, this.last, Math.round(duration_s / (this.tick_s || 1)));
  }

  /** First and last second of the epoch so far, at least a second apart. @returns {[number, number]} */
  range_s() {
    const first_s = this.first * this.tick_s;
    return [first_s, Math.max(first_s + 1, this.last * this.tick_s)];
  }

  /** The last tick of the epoch that is recorded. */
  get recorded() {
    return this.header?.ticks ?? (this.isRecording ? 0 : -1);
  }

  /** @param {number} tick that is shown first, as far as the run has it */
  async open(tick) {
    try {
      await this.learn();
      if (!this.header) throw new Error(this.missing);
      await this.seek(tick);
      await this.read(this.header, this.store.history);
      await this.learnNames();
      await this.readEarlier(this.header);
    } catch (error) {
      this.client.failed(reasonOf(error));
    }
  }

  /** Learns what is recorded. */
  async learn() {
    /** @type {Recorded | {missing: string}} */
    const answer = await get("recording");
    const { live } = this.store;
    const missing = "missing" in answer ? answer.missing : "";
    const isOther = "seed" in answer && answer.epoch === live?.epoch && answer.seed !== live.seed;
    if ("missing" in answer || isOther) {
      if (!this.missing) this.missingAt_ms = performance.now();
      this.missing = missing || "the folder has the recording of another run";
      this.newest = null;
      if (this.isLive && this.choosing === null) this.header = null;
      return;
    }

    this.missing = "";
    this.newest = answer;
    if (answer.epoch === this.wantedEpoch) this.header = answer;
    await this.complete(answer);
  }

  /** Learns in which order emotions and behaviors occurred, by which those without a color of their own have one. */
  async learnNames() {
    const { header } = this;
    const of = header ? `${header.number} ${header.epoch}` : "";
    if (!header || (!hasGuessedNames() && this.namesOf === of)) return;
    const names = await get("recording/names", new URLSearchParams({ epoch: String(header.epoch) }));
    if (this.header !== header) return;
    this.namesOf = of;
    orderNames(names);
    this.store.emit("live");
  }

  /** Takes in the end of an epoch that was chosen before it was written. @param {Recorded} newest */
  async complete(newest) {
    const { header } = this;
    if (!header || header.epoch === newest.epoch || header.epochs.at(-1) !== header.epoch) return;
    const whole = await get("recording", new URLSearchParams({ epoch: String(header.epoch) }));
    if ("missing" in whole || this.header !== header) return;
    this.header = whole;
    this.forgetChunks();
  }

  /** A new epoch of a run in progress has begun: what is recorded is of the one before, and is not read on. */
  restart() {
    this.readTo = -1;
    if (!this.isLive && this.header) return;
    this.header = null;
    this.forgetChunks();
    if (this.store.isBack) this.live();
  }

  /** The page is connected to a run in progress, perhaps again: everything that is recorded is read. */
  connected() {
    this.readTo = -1;
    this.connectedAt = Infinity;
    this.earlierOf = 0;
    if (!this.isFollowing) this.follow();
  }

  /** Reads on while the run goes on. */
  async follow() {
    this.isFollowing = true;
    for (;;) {
      const begun_ms = performance.now();
      try {
        if (this.store.isConnected && !document.hidden) await this.catchUp();
      } catch (error) {
        // The console ends, or a chunk is damaged: the page says so while it lasts.
        this.missing = reasonOf(error);
      }
      const taken_ms = performance.now() - begun_ms;
      await this.rest(3 * taken_ms);
    }
  }

  /** Waits until it is asked again what has been recorded. @param {number} least_ms */
  async rest(least_ms) {
    const begun_ms = performance.now();
    const pause = (/** @type {number} */ ms) => new Promise((resolve) => setTimeout(resolve, ms));
    await pause(Math.max(FOLLOW_GAP_MS, least_ms));
    while (!this.hasGap && performance.now() - begun_ms < FOLLOW_MS) await pause(FOLLOW_GAP_MS);
  }

  /** Whether the clock stands, and the record will tell something that this page has not seen. */
  get hasGap() {
    const { live, liveHistory, phase } = this.store;
    return phase !== "running" && this.newest !== null && this.newest.epoch === live?.epoch && this.readTo < live.tick && liveHistory.hasGap;
  }

  /** Takes in what has been recorded since. */
  async catchUp() {
    const before = this.newest;
    await this.learn();
    const { newest, store } = this;
    store.emit("live");

    // What was asked for may have been between what was recorded and what the page saw.
    const wanted = Math.floor(this.position);
    if (store.isBack && !this.isPlaying && this.chosen !== wanted && wanted <= this.recorded) await this.show(wanted);
    if (!newest || newest.epoch !== store.live?.epoch) return;

    if (before && before.number !== newest.number && before.epoch >= newest.epoch) {
      // Another run of the same name.
      store.forgetLog();
      this.connected();
      this.forgetChunks();
    }
    await this.refill(newest);
    await this.learnNames();
    if (this.earlierOf === newest.number) return;
    this.earlierOf = newest.number;
    await this.readEarlier(newest);
  }

  /** @param {Recorded} epoch in progress */
  async refill(epoch) {
    if (this.connectedAt >= 0) await this.learnFlights(epoch);
    while (this.readTo < epoch.ticks) {
      const from = this.readTo + 1;
      const range = await samples(epoch, from);
      // A new epoch has begun, or everything is to be read again.
      if (this.readTo + 1 !== from || this.store.live?.epoch !== epoch.epoch) return;
      if (range.end <= from) return;

      this.readTo = range.end - 1;
      this.store.refill(from, range, epoch.tick_s);
      this.store.addRecorded(range.log);
      this.store.memory.forget(this.readTo);
      this.store.emit("live");
    }
  }

  /** Learns of commands that were sent before the page was connected. @param {Recorded} epoch in progress */
  async learnFlights(epoch) {
    const query = { from: epoch.ticks, count: 1, epoch: epoch.epoch };
    /** @type {Chunk} */
    const chunk = await ticks(query);
    const { live } = this.store;
    if (live?.epoch !== epoch.epoch) return;
    this.store.learnFlights([...chunk.earlier_flights, ...chunk.flights]);
    // Until then, some were sent between what is recorded and what the page saw.
    this.connectedAt = Math.min(this.connectedAt, live.tick);
    if (epoch.ticks >= this.connectedAt) this.connectedAt = -1;
  }

  /**
   * Reads an epoch that has ended, in order, for charts and log.
   * @param {Recorded} epoch
   * @param {History | null} history
   * @param {(() => boolean)} isWanted
   */
  async read(epoch, history, isWanted = () => true) {
    for (let from = 0; from <= epoch.ticks && isWanted(); ) {
      const range = await samples(epoch, from, history ? undefined : epoch.ticks + 1);
      if (range.end <= from) return;
      history?.record(range, epoch.tick_s);
      this.store.addRecorded(range.log);
      this.store.emit("live");
      from = range.end;
    }
  }

  /** Reads the log of the epochs before, the latest first. @param {Recorded} newest */
  async readEarlier(newest) {
    for (const epoch of [...newest.epochs].reverse()) {
      if (epoch === newest.epoch || this.store.log.length >= ENOUGH_LINES) continue;
      const earlier = await get("recording", new URLSearchParams({ epoch: String(epoch) }));
      if (!("missing" in earlier)) await this.read(earlier, null);
    }
  }

  /** Shows an epoch from its beginning. @param {number} epoch */
  async choose(epoch) {
    try {
      this.isPlaying = false;
      if (epoch === this.store.live?.epoch) return this.live();
      this.choosing = epoch;
      const header = await get("recording", new URLSearchParams({ epoch: String(epoch) }));
      if (this.choosing !== epoch) return;
      if ("missing" in header) throw new Error(header.missing);
      this.forgetChunks();
      this.header = header;
      this.store.history = new History();
      await this.seek(0);
      if (this.choosing === epoch) this.choosing = null;
      await this.read(header, this.store.history, () => this.header?.epoch === epoch);
      await this.learnNames();
    } catch (error) {
      if (this.choosing === epoch) this.choosing = null;
      this.client.failed(reasonOf(error));
    }
  }

  /** Shows the newest tick of a run in progress again. */
  live() {
    if (this.store.mode !== "live") return;
    this.seeks += 1;
    this.choosing = null;
    this.isPlaying = false;
    const { newest, store } = this;
    if (this.header !== newest) this.forgetChunks();
    this.header = newest?.epoch === store.live?.epoch ? newest : null;
    store.showLive();
  }

  forgetChunks() {
    this.chunks.clear();
    this.numbers = 0;
  }

  /**
   * @param {number} number
   * @returns {Promise<Chunk>}
   */
  chunk(number) {
    const known = this.chunks.get(number);
    if (known) {
      this.chunks.delete(number);
      this.chunks.set(number, known);
      return known;
    }

    if (!this.store.isConnected) return Promise.reject(new Error("The console of this recording is not reachable."));
    /** @type {Promise<Chunk>} */
    const fetched = ticks({ from: number * CHUNK, count: CHUNK, epoch: this.header?.epoch ?? 0 }).then((chunk) => {
      if (this.chunks.get(number) !== fetched) return chunk;
      this.numbers += numbersIn(chunk);
      this.makeRoom(number);
      return chunk;
    });

    this.chunks.set(number, fetched);
    // A failed request may be repeated.
    fetched.catch(() => this.chunks.delete(number));

    return fetched;
  }

  /**
   * @param {number} number
   * @param {Chunk} chunk
   */
  drop(number, chunk) {
    if (this.chunks.delete(number)) this.numbers -= numbersIn(chunk);
  }

  /** @param {number} kept */
  async makeRoom(kept) {
    for (const [number, chunk] of this.chunks) {
      if (this.numbers <= MAX_NUMBERS && this.chunks.size <= MAX_CHUNKS) return;
      if (number !== kept) this.drop(number, await chunk);
    }
  }

  /**
   * Shows a tick, or the nearest one that there is, unless another one is requested while its chunk is fetched. Where the run
   * goes on, its newest tick is live.
   * @param {number} wanted
   */
  async seek(wanted) {
    const tick = Math.min(this.last, Math.max(this.first, wanted));
    if (this.isOfLive && tick >= this.last) return this.live();
    this.position = tick;
    try {
      await this.show(tick);
    } catch (error) {
      this.client.failed(reasonOf(error));
    }
  }

  /** Stops playback and shows the tick of a simulated time, as far as there is one. @param {number} time_s */
  seekTime(time_s) {
    this.isPlaying = false;
    return this.seek(Math.round(time_s / (this.tick_s || 1)));
  }

  /** Shows a moment that a line of the log names. @param {number} epoch @param {number} tick */
  async seekIn(epoch, tick) {
    this.isPlaying = false;
    if (epoch !== this.epoch) await this.choose(epoch);
    if (epoch === this.epoch) await this.seek(tick);
  }

  /** @param {number} tick */
  async show(tick) {
    const seek = ++this.seeks;
    if (this.isOfLive && (!this.header || tick > this.recorded)) return this.showSeen(tick);

    const { header } = this;
    if (!header) return;
    const number = Math.floor(tick / CHUNK);
    let chunk = await this.chunk(number);
    if (chunk.end <= tick && this.recorded >= tick && this.isOfLive) {
      // It was fetched when it had fewer ticks.
      this.drop(number, chunk);
      chunk = await this.chunk(number);
    }
    const record = chunk.ticks.find((one) => one.tick === tick) ?? chunk.ticks.at(-1);
    if (seek !== this.seeks || !record) return;

    this.chosen = record.tick;
    const panels = chunk.panels.filter((one) => one.tick === record.tick);
    this.store.showPast(this.frame(header, record), new Map(panels.map(({ robot, panel }) => [robot, panel])), flightsOf(chunk));
  }

  /** Shows what the page saw of a tick, or of one before. @param {number} tick */
  showSeen(tick) {
    const { live, memory } = this.store;
    const seen = memory.at(tick);
    if (!live || !seen) return;
    this.chosen = seen.frame.tick;
    this.store.showPast({ ...seen.frame, phase: live.phase, speed: live.speed, awaiting: [], flights: [] }, seen.panels, seen.flights);
  }

  /**
   * @param {Recorded} header
   * @param {RecordedTick} record
   * @returns {WorldFrame}
   */
  frame(header, record) {
    const { guests_mm } = record;
    const { live } = this.store;
    /** @type {[number, number][]} */
    const guests = [];

    for (let i = 0; i + 1 < guests_mm.length; i += 2) {
      guests.push([guests_mm[i] / 1000, guests_mm[i + 1] / 1000]);
    }

    return {
      ...header,
      tick: record.tick,
      time_s: record.tick * header.tick_s,
      duration_s: this.isRecording ? this.last * header.tick_s : header.duration_s,
      speed: live ? live.speed : this.factor,
      phase: live ? live.phase : this.isPlaying ? "running" : record.tick >= this.last ? "ended" : "paused",
      awaiting: record.awaiting,
      guests,
      guest_numbers: record.guest_numbers,
      guest_moods: record.guest_moods,
      flights: [],
      cuts: record.cuts,
      faults: record.faults,
      expectations: record.expectations,
      sites: record.sites,
      layers: header.layers?.map((layer) => record.layers?.find((now) => now.name === layer.name) ?? layer),
      measures: record.measures,
      robots: record.robots,
    };
  }

  toggle() {
    if (this.isPlaying) return this.pause();
    if (this.position >= this.last) this.position = this.first;
    this.isPlaying = true;
    this.playedAt_ms = performance.now();
    this.play();
  }

  /** Whether a run that is over is shown at its end, and can be seen again. */
  get isOver() {
    return this.isLive && this.store.live?.phase === "ended" && this.first < this.last;
  }

  /** Plays a run that is over from its beginning. */
  async watchAgain() {
    await this.seek(this.first);
    if (!this.isPlaying) this.toggle();
  }

  pause() {
    this.isPlaying = false;
    this.seek(this.tick);
  }

  /** @param {number} ticks forward, or back if negative */
  step(ticks) {
    this.isPlaying = false;
    this.seek(this.tick + ticks);
  }

  /** How fast it is played: a run in progress as fast as it goes, one that is over so that it can be seen. */
  get pace() {
    const { live } = this.store;
    if (live?.phase === "ended") return live.speed ?? SEEN;
    return (live ? live.speed : this.factor) ?? FASTEST;
  }

  async play() {
    while (this.isPlaying) {
      const now_ms = performance.now();
      const passed_s = Math.min(0.5, (now_ms - this.playedAt_ms) / 1000);
      this.playedAt_ms = now_ms;
      this.position = Math.min(this.last, this.position + (passed_s * this.pace) / this.tick_s);
      const tick = Math.floor(this.position);
      if (tick >= this.last) this.isPlaying = false;
      if (!this.isPlaying && this.isOfLive) return this.live();
      try {
        if (tick !== this.tick || !this.isPlaying) await this.show(tick);
      } catch (error) {
        this.isPlaying = false;
        this.client.failed(reasonOf(error));
      }
      await new Promise((resolve) => setTimeout(resolve, FRAME_MS));
    }
  }
}

/**
 * Ticks for charts, and the log of all ticks.
 * @param {Recorded} epoch
 * @param {number} from
 * @param {number} every how many ticks one is taken
 * @returns {Promise<Chunk>}
 */
function samples(epoch, from, every = Math.ceil((epoch.ticks + 1) / SAMPLES)) {
  return ticks({ from, count: READ_AT_ONCE, every, epoch: epoch.epoch });
}

/**
 * @param {Record<string, number>} query
 * @returns {Promise<Chunk>}
 */
function ticks(query) {
  return get("recording/ticks", new URLSearchParams(Object.entries(query).map(([name, value]) => [name, String(value)])));
}

/** What a chunk knows of commands. @param {Chunk} chunk */
function flightsOf({ earlier_flights, flights }) {
  const known = new Flights();
  known.push([...earlier_flights, ...flights]);
  return known;
}

/** @param {Chunk} chunk */
function numbersIn(chunk) {
  return chunk.ticks.reduce((sum, tick) => sum + tick.guests_mm.length + cellsIn(tick.layers), 0);
}

/** @param {unknown} error */
function reasonOf(error) {
  return String(error instanceof Error ? error.message : error);
}

/**
 * @param {string} path
 * @param {URLSearchParams} query
 */
async function get(path, query = new URLSearchParams()) {
  const url = new URL(path, location.href);
  url.search = query.toString();
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`The recording cannot be read: ${(await answer.text()) || answer.statusText}`);
  return answer.json();
}
