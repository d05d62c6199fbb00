// @ts-check
// The log: the lines of the log file, filtered. It scrolls to the newest line unless the reader has scrolled up.

import { seconds } from "./units.js";
import { html, render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */
/** @typedef {{epoch: number, tick: number}} Moment */

/** Most rows in the page. */
const MAX_ROWS = 2000;
/** Most rows while the reader has scrolled up; then no rows are removed. */
const MAX_ROWS_READING = 4000;
const NEAR_END_PX = 12;
/** Every kind; the type check keeps the list complete. @type {Record<import("./types/messages.js").LogKind, true>} */
const ALL_KINDS = { run: true, membership: true, emotion: true, behavior: true, command: true, network: true, say: true, site: true, layer: true, verdict: true, late: true };
/** What the medium did to a command: of the kind `command`, and of the network, too. */
const FATE = /^command \d+ of .+ (was lost on the way|is held back until|comes twice)/;
/** Where a robot joined. */
const PLACE = /at (-?[\d.]+) m, (-?[\d.]+) m$/;
const KINDS = Object.keys(ALL_KINDS);

export class LogView {
  /**
   * @param {HTMLElement} place
   * @param {Store} store
   * @param {import("./units.js").Units} units
   * @param {(line: LogRecord) => void} seek
   */
  constructor(place, store, units, seek) {
    this.store = store;
    this.units = units;
    units.listeners.push(() => this.rebuild());
    this.seek = seek;
    this.robot = "";
    this.kind = "";
    /** Number of lines so far that are in the page or were filtered out. */
    this.seen = 0;
    /** The last moment that is shown: in the past, the tick that is. @type {Moment | null} */
    this.until = null;
    /** The moment of the line that was clicked: the lines after it stay. @type {Moment | null} */
    this.picked = null;
    /** The row that was reached by keys: that of the newest tick is not marked. @type {Element | null} */
    this.reached = null;
    /** The lines of the rows. @type {WeakMap<Element, LogRecord>} */
    this.lines = new WeakMap();
    this.edits = 0;
    this.isFollowing = true;
    this.waiting = 0;
    /** Epoch of the last row. @type {number | null} */
    this.epoch = null;
    /** The last scroll position. */
    this.top_px = 0;
    this.bar = document.createElement("div");
    this.bar.className = "log-bar";
    this.rows = document.createElement("div");
    this.rows.className = "log-rows";
    this.rows.dataset.testid = "log";
    this.rows.tabIndex = 0;
    this.rows.setAttribute("role", "log");
    this.rows.setAttribute("aria-label", "Log");
    this.rows.addEventListener("click", (event) => this.click(event));
    this.rows.addEventListener("keydown", (event) => this.key(event));
    this.rows.addEventListener("scroll", () => this.scrolled(), { passive: true });
    place.append(this.bar, this.rows);
  }

  /** Only scrolling up stops following: rows may also grow when they are laid out. */
  scrolled() {
    const { scrollTop, clientHeight, scrollHeight } = this.rows;
    const isAtEnd = scrollHeight - scrollTop - clientHeight < NEAR_END_PX;
    const isUp = scrollTop < this.top_px - 1;
    this.top_px = scrollTop;
    if (isAtEnd && !this.isFollowing && this.waiting > 0) return this.rebuild();

    if (isAtEnd) this.isFollowing = true;
    else if (isUp) this.isFollowing = false;
    this.renderBar();
  }

  /** Scrolls twice, because rows get their final height when they come into view. */
  toEnd() {
    const go = () => {
      if (!this.isFollowing) return;
      this.rows.scrollTop = this.rows.scrollHeight;
      this.top_px = this.rows.scrollTop;
    };

    go();
    requestAnimationFrame(go);
  }

  /** Renders all rows again, after a change of filter or time. */
  rebuild() {
    this.edits = this.store.logEdits;
    this.rows.replaceChildren();
    this.reached = null;
    this.epoch = null;
    this.seen = this.store.logCount - this.store.log.length;
    this.waiting = 0;
    this.isFollowing = true;
    this.render();
  }

  render() {
    const { store } = this;
    if (store.logCount < this.seen || store.logEdits !== this.edits) return this.rebuild();

    const first = store.logCount - store.log.length;
    const fresh = store.log.slice(Math.max(0, this.seen - first)).filter((line) => this.isShown(line));
    this.seen = store.logCount;
    if (fresh.length) this.append(fresh);
    this.renderBar();
  }

  /**
   * Shows the lines up to a moment of the past; without one, all. After a click the lines stay.
   * @param {Moment | null} moment
   */
  showUntil(moment) {
    if (moment && this.picked && isAlike(moment, this.picked)) return this.mark(this.picked);
    this.picked = null;
    this.mark(null);
    if (isAlike(moment, this.until)) return;

    const from = this.until;
    const isForward = moment !== null && from !== null && isAfter(moment, from) && moment.epoch === from.epoch;
    // Lines that arrived since are taken in first: else they would be added here, and again when they are rendered.
    if (isForward) this.render();
    this.until = moment;
    if (!isForward) return this.rebuild();

    this.append(this.store.log.filter((line) => isAfter(line, from) && this.isShown(line)));
    this.renderBar();
  }

  /** Shows the tick of the line. Who marks text for copying does not seek. @param {MouseEvent} event */
  click(event) {
    const line = this.lines.get(/** @type {Element} */ (event.target).closest(".line") ?? this.rows);
    const marked = getSelection();
    if (!line || (marked?.isCollapsed === false && this.rows.contains(marked.anchorNode))) return;
    this.pick(line);
  }

  /** Enter shows the tick of the last line in view; then the arrows show those of the lines around it. @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
    const marked = [...this.rows.querySelectorAll(".line.picked")];
    /** @type {Element | null | undefined} */
    let row;
    if (event.key === "Enter") row = this.lastInView();
    else if (event.key === "ArrowUp") row = this.neighbor(marked.at(0) ?? this.reached, "previousElementSibling");
    else if (event.key === "ArrowDown") row = this.neighbor(marked.at(-1) ?? this.reached, "nextElementSibling");
    const line = row && this.lines.get(row);
    if (!row || !line) return;

    event.preventDefault();
    row.scrollIntoView({ block: "nearest" });
    this.reached = row;
    this.pick(line);
  }

  /** The last line that is seen as a whole. */
  lastInView() {
    const { bottom } = this.rows.getBoundingClientRect();
    const isWhole = (/** @type {Element} */ row) => this.lines.has(row) && row.getBoundingClientRect().bottom <= bottom + 1;
    return [...this.rows.children].filter(isWhole).at(-1);
  }

  /**
   * The next line in a direction, over divisions.
   * @param {Element | null} row
   * @param {"previousElementSibling" | "nextElementSibling"} way
   */
  neighbor(row, way) {
    let next = row?.[way];
    while (next && !this.lines.has(next)) next = next[way];
    return next;
  }

  /** Shows the tick of a line; the lines after it stay. @param {LogRecord} line */
  pick(line) {
    this.picked = { epoch: line.epoch, tick: line.tick };
    this.isFollowing = false;
    this.seek(line);
  }

  /** Marks the lines of a moment. @param {Moment | null} moment */
  mark(moment) {
    for (const row of this.rows.querySelectorAll(".line.picked")) row.classList.remove("picked");
    if (!moment) return;
    for (const row of this.rows.children) {
      const line = this.lines.get(row);
      if (line && isAlike(line, moment)) row.classList.add("picked");
    }
  }

  /** @param {LogRecord} line */
  isShown(line) {
    const isOfKind = this.kind === "" || line.kind === this.kind || (this.kind === "network" && FATE.test(line.text));
    return (!this.until || !isAfter(line, this.until)) && (this.robot === "" || line.source === this.robot) && isOfKind;
  }

  /** @param {LogRecord[]} lines */
  append(lines) {
    const { rows } = this;
    const room = this.isFollowing ? Infinity : MAX_ROWS_READING - rows.childElementCount;
    const kept = lines.slice(0, Math.max(0, room)).slice(-MAX_ROWS);
    this.waiting += this.isFollowing ? 0 : lines.length;
    rows.append(...kept.flatMap((line) => this.withEpoch(line)));
    if (!this.isFollowing) return;

    const tooMany = rows.childElementCount - MAX_ROWS;

    for (let i = 0; i < tooMany; i += 1) rows.firstElementChild?.remove();
    this.toEnd();
  }

  /** A row, below a division if it begins another epoch. @param {LogRecord} line */
  withEpoch(line) {
    const isNext = this.epoch !== null && line.epoch !== this.epoch;
    this.epoch = line.epoch;
    const element = row(line, this.units);
    this.lines.set(element, line);
    return isNext ? [division(line.epoch), element] : [element];
  }

  /** To be called when the tab is shown again: a hidden element does not scroll. */
  shown() {
    this.toEnd();
  }

  renderBar() {
    const robots = (this.store.frame?.robots ?? []).map((robot) => robot.name);
    const choose = (/** @type {"robot" | "kind"} */ key) => (/** @type {Event} */ event) => {
      this[key] = /** @type {HTMLSelectElement} */ (event.target).value;
      this.rebuild();
    };

    const missed = this.store.logMissed;

    render(
      html`
        <label class="field inline"><span>From</span>
          <select data-testid="log-filter-robot" @change=${choose("robot")}>
            <option value="">all</option>
            ${["simulator", ...robots].map((name) => html`<option value=${name}>${name}</option>`)}
          </select></label>
        <label class="field inline"><span>Kind</span>
          <select data-testid="log-filter-kind" @change=${choose("kind")}>
            <option value="">all</option>
            ${KINDS.map((kind) => html`<option value=${kind}>${kind}</option>`)}
          </select></label>
        <span class="spacer"></span>
        <span class="muted" ?hidden=${missed === 0} title="this browser was too slow for them; they are in the log file">
          ${missed} lines not shown</span>
        <button type="button" class="jump" ?hidden=${this.isFollowing} data-testid="log-follow" @click=${() => this.rebuild()}>
          ↓ ${this.waiting > 0 ? `${this.waiting} new` : "newest"}</button>`,
      this.bar,
    );
  }
}

/**
 * @param {Moment} one
 * @param {Moment} other
 */
function isAfter(one, other) {
  return one.epoch > other.epoch || (one.epoch === other.epoch && one.tick > other.tick);
}

/**
 * @param {Moment | null} one
 * @param {Moment | null} other
 */
function isAlike(one, other) {
  return one?.epoch === other?.epoch && one?.tick === other?.tick;
}

/** @param {number} epoch */
function division(epoch) {
  const element = document.createElement("div");
  element.className = "epoch";
  element.dataset.testid = "log-epoch";
  element.textContent = `epoch ${epoch}`;
  return element;
}

/**
 * A line as it is in the log file, but for the unit of places.
 * @param {LogRecord} line
 * @param {import("./units.js").Units} units
 */
function row(line, units) {
  const element = document.createElement("div");
  element.className = `line kind-${KINDS.includes(line.kind) ? line.kind : "run"}`;
  element.dataset.kind = line.kind;
  const part = (/** @type {string} */ name, /** @type {string} */ text) => {
    const span = document.createElement("span");
    span.className = name;
    span.textContent = text;
    return span;
  };

  element.append(
    part("time", `${seconds(line.time_s, line.tick_s).padStart(11)}  `),
    part("source", `${line.source.padEnd(12)} `),
    part("text", line.kind === "membership" ? line.text.replace(PLACE, (_, x, y) => `at ${units.length(+x, 2)}, ${units.length(+y, 2)}`) : line.text),
  );

  return element;
}
