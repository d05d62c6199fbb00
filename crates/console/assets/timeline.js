// @ts-check
// The time line at the bottom of the page: the epoch that is shown, from 0 to its planned end, with the emotions of the robots
// and marks of what stands out. A place on it is always the same tick, unless a person has a part of it shown, and its controls
// never move.

import { visible } from "./bands.js";
import { ICONS } from "./icons.js";
import { stateClass } from "./palette.js";
import { initials } from "./roster.js";
import { seconds } from "./units.js";
import { WhyView } from "./why.js";
import { TimeWindow, timeView, zoomByWheel } from "./window.js";
import { html, nothing, render, svg } from "./vendor/lit-html.js";

/** @typedef {import("./recording.js").Player} Player */

/** All of the lane is time. */
const SIDES = { left_px: 0, right_px: 0 };
/** Length of the part that is shown after a press of a key, of that before. @type {Record<string, number>} */
const ZOOMS = { "+": 0.5, "=": 0.5, "-": 2, 0: 1e9 };

/** Least distance between two marks. */
const MARK_PX = 7;
/** Most strips. Of more robots, the chosen ones have a strip. */
const MAX_STRIPS = 8;
/** Height of all strips together where there are many, and of one where there are few. */
const STRIPS_PX = 40;
const STRIP_PX = 12;
/** A strip of this height has room for the letters of its robot. */
const LETTERS_PX = 10;

export class TimelineView {
  /**
   * @param {HTMLElement} place
   * @param {Player} player
   * @param {TimeWindow} shown by charts and bands
   * @param {import("./crosshair.js").Crosshair} crosshair
   * @param {{chosen: () => string | null, isShown: (robot: string) => boolean}} choice which robots have strips if there are many
   */
  constructor(place, player, shown, crosshair, choice) {
    this.place = place;
    this.player = player;
    this.shown = shown;
    this.choice = choice;
    /** The part of the time line that is shown. */
    this.range = new TimeWindow(() => [0, player.end * player.tick_s]);
    /** What the strips show, to draw nothing twice. */
    this.drawn = "";
    /** The history that they are of. @type {import("./history.js").History | null} */
    this.drawnOf = null;

    render(
      html`<div class="timeline-bar"></div>
        <div class="why" data-testid="why" role="group" aria-label="What decided the run" hidden></div>
        <div class="marks" data-testid="marks"></div>
        <div class="lane" data-testid="timeline">
          <div class="lane-parts"></div>
          <svg class="strips cars-diagram" data-testid="strips" preserveAspectRatio="none" aria-hidden="true"></svg>
          <div class="letters" aria-hidden="true"></div>
          <input type="range" data-testid="scrub" aria-label="Tick" min="0" step="1" />
        </div>`,
      place,
    );
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (place.querySelector(`.${name}`));
    this.bar = part("timeline-bar");
    this.marks = part("marks");
    this.lane = part("lane");
    this.letters = part("letters");
    this.parts = part("lane-parts");
    this.strips = /** @type {SVGSVGElement} */ (place.querySelector(".strips"));
    this.input = /** @type {HTMLInputElement} */ (place.querySelector("input"));
    this.input.addEventListener("input", () => this.seek());
    /** Whether a pointer holds the handle, which then moves with nothing else. */
    this.isHeld = false;
    this.input.addEventListener("pointerdown", () => (this.isHeld = true));
    this.input.addEventListener("change", () => (this.isHeld = false));
    for (const end of /** @type {const} */ (["pointerup", "pointercancel"])) window.addEventListener(end, () => (this.isHeld = false));

    const { lane, range } = this;
    this.why = new WhyView(part("why"), player, range, crosshair);
    crosshair.join({ ...timeView(lane, range, SIDES, () => player.tick_s), hasCursor: false });
    zoomByWheel(lane, range, SIDES);
    lane.addEventListener("dblclick", () => range.reset());
    this.input.addEventListener("keydown", ({ key, ctrlKey, metaKey }) => {
      if (key in ZOOMS && !ctrlKey && !metaKey) range.zoom(ZOOMS[key], (crosshair.tick ?? player.tick) * player.tick_s);
    });
  }

  /** The ticks at both ends. @returns {[number, number]} */
  ends() {
    const { end, tick_s } = this.player;
    if (this.range.isWhole) return [0, end];
    const [from, to] = this.range.range_s().map((time_s) => time_s / tick_s);
    return [from, to];
  }

  /** Shows the tick of the slider, or the nearest one that there is. */
  seek() {
    const { player, input } = this;
    player.isPlaying = false;
    player.seek(Number(input.value));
  }

  render() {
    const { player, place } = this;
    const { store, tick, tick_s, end } = player;
    const isShown = store.frame !== null && (player.header !== null || store.live !== null);
    place.hidden = !isShown;
    if (!isShown) return;

    this.renderBar();
    this.why.render();
    this.lane.style.height = `${Math.min(STRIPS_PX, STRIP_PX * this.robots().length)}px`;
    render(this.drawMarks(), this.marks);
    render(this.drawParts(), this.parts);
    const [from, to] = this.ends();
    this.input.min = String(Math.round(from));
    this.input.max = String(Math.round(to));
    if (!this.isHeld) this.input.value = String(Math.max(player.first, tick));
    this.input.classList.toggle("beyond", tick < Math.round(from) || tick > Math.round(to));
    this.input.setAttribute("aria-valuetext", `tick ${tick}, ${seconds(tick * tick_s, tick_s)}; the run is at tick ${player.last} of ${end}`);
  }

  renderBar() {
    const { player } = this;
    const { store, isLive, isOver } = player;
    const isStill = isLive && !isOver;
    const word = isOver ? "Watch again" : player.isPlaying ? "Pause" : "Play";
    const hint = isOver ? "from its beginning, as it is recorded" : "play the past from here on";
    const step = store.mode === "recording" ? "one tick (.)" : "one tick of the past";

    render(
      html`
        <div class="timeline-buttons" role="group" aria-label="Shown time">
          <button type="button" class="play ${isStill ? "" : "primary"}" data-testid=${isOver ? "watch-again" : "play"} title=${hint}
            ?disabled=${isStill} @click=${() => (isOver ? player.watchAgain() : player.toggle())}>
            ${player.isPlaying ? ICONS.pause : ICONS.start}<span>${word}</span></button>
          <button type="button" data-testid="step" title=${step} ?disabled=${isLive} @click=${() => player.step(1)}>${ICONS.step}<span>Step</span></button>
          ${store.mode === "live"
            ? html`<button type="button" class="live ${isLive ? "" : "primary"}" data-testid="live" title="the newest tick (L)"
                ?disabled=${isLive} @click=${() => player.live()}>Back to now</button>`
            : nothing}
        </div>
        <p class="when" data-testid="when">${this.when()}</p>
        ${note(player)}
        ${this.range.isWhole ? nothing : html`<button type="button" class="whole" data-testid="timeline-whole" title="double click, or 0" @click=${() => this.range.reset()}>Whole run</button>`}
        ${epochs(player)}`,
      this.bar,
    );
  }

  /** Which time is shown, and where the run is. */
  when() {
    const { store, epoch, tick, tick_s, end, isLive } = this.player;
    const { live } = store;
    const time = (/** @type {number} */ tick) => seconds(tick * tick_s, tick_s);
    if (isLive || !live) return html`<b>${time(tick)}</b> of ${time(end)}`;

    const isSame = live.epoch === epoch;
    const where = `${isSame ? "" : `epoch ${live.epoch}, `}${seconds(live.time_s, live.tick_s)}`;
    const what = store.isLive ? "the run is at" : "the run ended at";
    return html`<b>past: ${isSame ? "" : `epoch ${epoch}, `}${time(tick)}</b>, ${what} ${where}`;
  }

  /** What can be shown of the epoch, and what charts and bands show of it. */
  drawParts() {
    const { first, last, end, tick_s } = this.player;
    const [begin, stop] = this.ends();
    const place = (/** @type {number} */ from, /** @type {number} */ to) => {
      const [left, right] = [from, to].map((tick) => Math.min(1, Math.max(0, (tick - begin) / (stop - begin))));
      return `left:${100 * left}%;width:${100 * (right - left)}%`;
    };
    const [from, to] = this.shown.range_s().map((time_s) => time_s / tick_s);
    return html`
      <div class="unseen" .style=${place(0, first)}></div>
      <div class="seen" data-testid="timeline-run" data-first=${first} data-last=${last} .style=${place(first, last)}></div>
      <div class="coming" .style=${place(last, end)}></div>
      ${this.shown.isWhole ? nothing : html`<div class="span" data-testid="span" .style=${place(from, to)}></div>`}`;
  }

  drawMarks() {
    const { player } = this;
    const places = Math.max(1, Math.floor(this.marks.clientWidth / MARK_PX));
    return player.store.marks.of(player.epoch, ...this.ends(), places).map(
      ({ kind, tick, at, words }) => html`<button type="button" class="mark ${kind}" data-testid="mark-${kind}" data-tick=${tick}
        title=${words} aria-label=${words} tabindex="-1" .style=${`left:${100 * at}%`} @click=${() => player.seekIn(player.epoch, tick)}></button>`,
    );
  }

  /** The robots that have strips: if there are many, the chosen one and those of the charts. */
  robots() {
    const all = (this.player.store.frame?.robots ?? []).map(({ name }) => name);
    if (all.length <= MAX_STRIPS) return all;
    const chosen = this.choice.chosen();
    const others = all.filter((robot) => robot !== chosen && this.choice.isShown(robot));
    return [...(chosen ? [chosen] : []), ...others].slice(0, MAX_STRIPS);
  }

  /** Draws the emotions of the robots; less often than the rest. */
  renderStrips() {
    const { player, lane, strips } = this;
    const { history } = player.store;
    const width = lane.clientWidth;
    if (width === 0) return;

    const robots = this.robots();
    const [from_s, to_s] = this.ends().map((tick) => tick * player.tick_s);
    const drawn = [history.changes, width, from_s, to_s, ...robots].join("\n");
    if (drawn === this.drawn && history === this.drawnOf) return;
    this.drawn = drawn;
    this.drawnOf = history;

    const x = (/** @type {number} */ time_s) => (width * (time_s - from_s)) / (to_s - from_s);
    const rows = robots.map((robot, row) =>
      visible(history.states.get(robot)?.emotion ?? [], from_s, to_s, x, 1).map(
        (span) => svg`<rect class=${stateClass("emotion", span.state)} data-robot=${robot} data-state=${span.state}
          x=${x(span.from_s)} y=${row + 0.06} width=${Math.max(1, x(span.to_s) - x(span.from_s))} height="0.88"></rect>`,
      ),
    );
    strips.setAttribute("viewBox", `0 0 ${width} ${Math.max(1, robots.length)}`);
    render(rows, /** @type {any} */ (strips));
    render(lane.clientHeight / robots.length < LETTERS_PX ? nothing : robots.map((robot) => html`<span>${initials(robot)}</span>`), this.letters);
  }
}

/** The choice among epochs, if there are several. @param {Player} player */
function epochs(player) {
  const { epoch } = player;
  if (player.epochs.length < 2) return nothing;
  const choose = (/** @type {Event} */ event) => player.choose(Number(/** @type {HTMLSelectElement} */ (event.target).value));

  return html`<select data-testid="epoch" aria-label="Epoch" @change=${choose}>
    ${player.epochs.map((one) => html`<option value=${one} ?selected=${one === epoch} .selected=${one === epoch}>epoch ${one}</option>`)}
  </select>`;
}

/** What of the past is not there, or not yet. @param {Player} player */
function note(player) {
  const { newest, missing, store, first, tick_s } = player;
  if (store.mode !== "live") return nothing;
  const say = (/** @type {string} */ text, /** @type {string} */ why) =>
    html`<p class="past-note muted" data-testid="past-note" role="status" title=${why}>${text}</p>`;

  if (player.isWanting) return say(`Only what this page has seen, from ${seconds(first * tick_s, tick_s)} on: ${missing}.`, missing);
  const share = newest && newest.ticks > 0 ? player.readTo / newest.ticks : 1;
  if (share < 0.9 && newest && newest.epoch === store.live?.epoch) return say(`Reading what is recorded: ${Math.max(0, Math.floor(100 * share))} %`, "");
  return nothing;
}
