// @ts-check
// A recorded run: fetched in chunks, played through the same store as a live one.

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Awaited} Awaited */
/** @typedef {import("./types/messages.js").Cut} Cut */
/** @typedef {import("./types/messages.js").Flight} Flight */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./types/messages.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").Standing} Standing */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/**
 * What does not change; `ticks` is the last tick.
 * @typedef {{run: string, epoch: number, seed: number, tick_s: number, field_m: [number, number], body_m: number,
 *   obstacles: [number, number][], ticks: number}} RecordingHeader
 */
/**
 * @typedef {{tick: number, robots: RobotFrame[], guests_mm: number[], cuts: Cut[], awaiting: Awaited[],
 *   expectations: Standing[]}} RecordedTick
 */
/** A panel and the tick in which it arrived. @typedef {{tick: number, robot: string, panel: Panel}} RecordedPanel */
/** @typedef {{ticks: RecordedTick[], panels: RecordedPanel[], flights: Flight[], log: LogRecord[]}} Chunk */

/** Ticks in a chunk: few, because a seek waits for a whole one. */
const CHUNK = 32;
/** Most numbers of guests' places that are kept; the least recently used chunks are dropped first. */
const MOST_NUMBERS = 12_000_000;
/** Least time between two frames. */
const FRAME_MS = 33;
/** How long a panel is shown, simulated seconds. In a fast run panels arrive more seldom, and would show old states. */
const PANEL_S = 1;
/** The factor of playback at speed "max". */
const FASTEST = 200;

export class Player {
  /**
   * @param {Store} store
   * @param {{failed: (reason: string) => void, sought: () => void}} client
   */
  constructor(store, client) {
    this.store = store;
    this.client = client;
    /** @type {RecordingHeader | null} */
    this.header = null;
    /** By number, in order of their last use. @type {Map<number, Promise<Chunk>>} */
    this.chunks = new Map();
    this.numbers = 0;
    /** Position of playback, in ticks, with a fraction. */
    this.position = 0;
    this.tick = -1;
    this.isPlaying = false;
    /** @type {number | null} */
    this.factor = 5;
    this.seeks = 0;
    this.playedAt_ms = 0;
  }

  get last() {
    return this.header?.ticks ?? 0;
  }

  /** @param {number} tick that is shown first, as far as the run has it */
  async open(tick) {
    try {
      this.header = await get("recording");
      await this.seek(Math.min(this.last, tick));
      await this.readAll();
    } catch (error) {
      this.client.failed(String(error instanceof Error ? error.message : error));
    }
  }

  /** Reads the whole run once, in order, for charts and log. */
  async readAll() {
    if (!this.header) return;

    for (let number = 0; number * CHUNK <= this.last; number += 1) {
      const { ticks, log } = await this.chunk(number);
      for (const { tick, robots } of ticks) this.store.history.add(tick * this.header.tick_s, robots);
      this.store.addLines(log);
      this.store.emit("frame");
    }
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
    const query = new URLSearchParams({ from: String(number * CHUNK), count: String(CHUNK) });
    const fetched = get("recording/ticks", query).then((/** @type {Chunk} */ chunk) => {
      this.numbers += numbersIn(chunk);
      this.makeRoom(number);
      return chunk;
    });

    this.chunks.set(number, fetched);
    // A failed request may be repeated.
    fetched.catch(() => this.chunks.delete(number));

    return fetched;
  }

  /** @param {number} kept */
  async makeRoom(kept) {
    for (const [number, chunk] of this.chunks) {
      if (this.numbers <= MOST_NUMBERS) return;
      if (number === kept) continue;
      this.chunks.delete(number);
      this.numbers -= numbersIn(await chunk);
    }
  }

  /**
   * Shows a tick, unless another one is requested while its chunk is fetched.
   * @param {number} tick
   */
  async seek(tick) {
    this.position = tick;
    await this.show(tick, false);
    this.client.sought();
  }

  /**
   * @param {number} tick
   * @param {boolean} isPlayed whether the commands since the tick before are shown
   */
  async show(tick, isPlayed) {
    const header = this.header;
    if (!header) return;

    const seek = ++this.seeks;
    const chunk = await this.chunk(Math.floor(tick / CHUNK));
    const record = chunk.ticks.find((one) => one.tick === tick) ?? chunk.ticks.at(-1);
    if (seek !== this.seeks || !record) return;

    const flights = isPlayed ? chunk.flights.filter((flight) => flight.tick > this.tick && flight.tick <= tick) : [];
    this.tick = record.tick;
    this.store.setPanels(panelsAt(chunk, record.tick, header.tick_s));
    this.store.show(this.frame(header, record, flights));
  }

  /**
   * @param {RecordingHeader} header
   * @param {RecordedTick} record
   * @param {Flight[]} flights
   * @returns {WorldFrame}
   */
  frame(header, record, flights) {
    const { guests_mm } = record;
    /** @type {[number, number][]} */
    const guests = [];

    for (let i = 0; i + 1 < guests_mm.length; i += 2) {
      guests.push([guests_mm[i] / 1000, guests_mm[i + 1] / 1000]);
    }

    return {
      ...header,
      tick: record.tick,
      time_s: record.tick * header.tick_s,
      duration_s: this.last * header.tick_s,
      speed: this.factor,
      phase: this.isPlaying ? "running" : record.tick >= this.last ? "ended" : "paused",
      awaiting: record.awaiting,
      guests,
      flights,
      cuts: record.cuts,
      expectations: record.expectations,
      robots: record.robots,
    };
  }

  toggle() {
    if (this.isPlaying) return this.pause();
    if (this.position >= this.last) this.position = 0;
    this.isPlaying = true;
    this.playedAt_ms = performance.now();
    this.play();
  }

  pause() {
    this.isPlaying = false;
    this.seek(this.tick);
  }

  /** @param {number} ticks forward, or back if negative */
  step(ticks) {
    this.isPlaying = false;
    this.seek(Math.min(this.last, Math.max(0, this.tick + ticks)));
  }

  async play() {
    while (this.isPlaying && this.header) {
      const now_ms = performance.now();
      const passed_s = Math.min(0.5, (now_ms - this.playedAt_ms) / 1000);
      this.playedAt_ms = now_ms;
      this.position = Math.min(this.last, this.position + (passed_s * (this.factor ?? FASTEST)) / this.header.tick_s);
      const tick = Math.floor(this.position);
      if (tick >= this.last) this.isPlaying = false;
      try {
        if (tick !== this.tick || !this.isPlaying) await this.show(tick, true);
      } catch (error) {
        this.isPlaying = false;
        this.client.failed(String(error instanceof Error ? error.message : error));
      }
      await new Promise((resolve) => setTimeout(resolve, FRAME_MS));
    }
  }
}

/**
 * The newest panel of each robot at a tick of a chunk.
 * @param {Chunk} chunk
 * @param {number} tick
 * @param {number} tick_s
 */
function panelsAt(chunk, tick, tick_s) {
  const lifetime = Math.max(1, Math.round(PANEL_S / tick_s));
  /** @type {Map<string, Panel>} */
  const panels = new Map();
  for (const one of chunk.panels) {
    if (one.tick <= tick && one.tick > tick - lifetime) panels.set(one.robot, one.panel);
  }
  return panels;
}

/** @param {Chunk} chunk */
function numbersIn(chunk) {
  return chunk.ticks.reduce((sum, tick) => sum + tick.guests_mm.length, 0);
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
