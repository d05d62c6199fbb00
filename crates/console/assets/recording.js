// @ts-check
// A recorded run: fetched in pieces, played through the same store as a live one.

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").RecordingHeader} RecordingHeader */
/** @typedef {import("./types/messages.js").RecordedTick} RecordedTick */
/** @typedef {import("./types/messages.js").Flight} Flight */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {{ticks: RecordedTick[], flights: Flight[], log: LogRecord[]}} Piece */

/** Ticks in a piece. */
const PIECE = 128;
/** Numbers kept of guests' places; the pieces used longest ago go first. */
const MOST_NUMBERS = 12_000_000;
/** No more pictures a second than eyes can use. */
const FRAME_MS = 33;
/** As fast as it goes, for a recording. */
const FASTEST = 200;

export class Player {
  /**
   * @param {Store} store
   * @param {{failed: (reason: string) => void, sought: () => void}} client
   */
  constructor(store, client) {
    this.store = store;
    this.client = client;
    /** @type {(RecordingHeader & {ticks: number}) | null} */
    this.header = null;
    /** By number; those used last come last. @type {Map<number, Promise<Piece>>} */
    this.pieces = new Map();
    this.numbers = 0;
    /** Where the playing is, in ticks; between two of them while it plays. */
    this.position = 0;
    this.tick = -1;
    this.isPlaying = false;
    /** @type {number | null} */
    this.factor = 5;
    this.seeks = 0;
    this.wasAt_ms = 0;
  }

  get last() {
    return this.header?.ticks ?? 0;
  }

  async open() {
    try {
      this.header = await get("recording");
      await this.seek(0);
      await this.readAll();
    } catch (error) {
      this.client.failed(String(error instanceof Error ? error.message : error));
    }
  }

  /** Charts and the log want the whole run: every piece once, in order. */
  async readAll() {
    if (!this.header) return;
    for (let number = 0; number * PIECE <= this.last; number += 1) {
      const { ticks, log } = await this.piece(number);
      for (const { tick, robots } of ticks) this.store.history.add(tick * this.header.tick_s, robots);
      this.store.addLines(log);
      this.store.emit("frame");
    }
  }

  /**
   * @param {number} number
   * @returns {Promise<Piece>}
   */
  piece(number) {
    const known = this.pieces.get(number);
    if (known) {
      this.pieces.delete(number);
      this.pieces.set(number, known);
      return known;
    }
    const query = new URLSearchParams({ from: String(number * PIECE), count: String(PIECE) });
    const fetched = get("recording/ticks", query).then((/** @type {Piece} */ piece) => {
      this.numbers += numbersIn(piece);
      this.makeRoom(number);
      return piece;
    });
    this.pieces.set(number, fetched);
    // What could not be had may be asked for again.
    fetched.catch(() => this.pieces.delete(number));
    return fetched;
  }

  /** @param {number} kept */
  async makeRoom(kept) {
    for (const [number, piece] of this.pieces) {
      if (this.numbers <= MOST_NUMBERS) return;
      if (number === kept) continue;
      this.pieces.delete(number);
      this.numbers -= numbersIn(await piece);
    }
  }

  /**
   * Shows a tick; a newer wish overtakes an older one that is still being fetched.
   * @param {number} tick
   */
  async seek(tick) {
    this.position = tick;
    await this.show(tick, false);
    this.client.sought();
  }

  /**
   * @param {number} tick
   * @param {boolean} isPlayed whether what happened on the way is shown
   */
  async show(tick, isPlayed) {
    const header = this.header;
    if (!header) return;
    const wish = ++this.seeks;
    const piece = await this.piece(Math.floor(tick / PIECE));
    const record = piece.ticks.find((one) => one.tick === tick) ?? piece.ticks.at(-1);
    if (wish !== this.seeks || !record) return;
    const flights = isPlayed ? piece.flights.filter((flight) => flight.tick > this.tick && flight.tick <= tick) : [];
    this.tick = record.tick;
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
    for (let i = 0; i + 1 < guests_mm.length; i += 2) guests.push([guests_mm[i] / 1000, guests_mm[i + 1] / 1000]);
    return {
      ...header,
      tick: record.tick,
      time_s: record.tick * header.tick_s,
      duration_s: this.last * header.tick_s,
      speed: this.factor,
      phase: this.isPlaying ? "running" : record.tick >= this.last ? "ended" : "paused",
      awaiting: [],
      guests,
      flights,
      cuts: [],
      robots: record.robots.map(({ missed, blocked, ...robot }) => ({
        ...robot,
        blocked: blocked ?? false,
        generation: 1,
        presence: missed ? "gone" : "here",
      })),
    };
  }

  toggle() {
    if (this.isPlaying) return this.pause();
    if (this.position >= this.last) this.position = 0;
    this.isPlaying = true;
    this.wasAt_ms = performance.now();
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
      const passed_s = Math.min(0.5, (now_ms - this.wasAt_ms) / 1000);
      this.wasAt_ms = now_ms;
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

/** @param {Piece} piece */
function numbersIn(piece) {
  return piece.ticks.reduce((sum, tick) => sum + tick.guests_mm.length, 0);
}

/**
 * @param {string} path
 * @param {URLSearchParams} query
 */
async function get(path, query = new URLSearchParams()) {
  const url = new URL(path, location.href);
  url.search = new URLSearchParams([...new URLSearchParams(location.search), ...query]).toString();
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`The recording cannot be read: ${(await answer.text()) || answer.statusText}`);
  return answer.json();
}
