// @ts-check
// The space-time diagram of what is recorded, also while the run goes on: the server draws a window of it, a click seeks.

import { printedRules } from "./palette.js";
import { download } from "./share.js";
import { html, nothing, render } from "./vendor/lit-html.js";

/** Ticks of the first window. */
const FIRST_TICKS = 120;
const MIN_TICKS = 15;
/** The most that the server draws. */
const MAX_TICKS = 4096;
const MIN_WIDTH_PX = 300;
const MAX_WIDTH_PX = 4800;
/** Most width of a diagram that is saved, 180 mm, at the pixels of an inch in style sheets. */
const PAPER_PX = 680;
const DPI = 96;

export class DiagramView {
  /**
   * @param {HTMLElement} place
   * @param {import("./recording.js").Player} player
   * @param {import("./crosshair.js").Crosshair} crosshair
   */
  constructor(place, player, crosshair) {
    this.player = player;
    this.crosshair = crosshair;
    this.from = 0;
    this.ticks = FIRST_TICKS;
    this.hasQueries = false;
    /** The tick of playback when the window was last rendered. */
    this.followed = -1;
    /** The window that is shown or requested. */
    this.shown = "";
    this.reason = "";
    /** Points of the scale: pixels from the left, tick. @type {[number, number][]} */
    this.knots = [];

    this.bar = place.appendChild(document.createElement("div"));
    this.bar.className = "log-bar";
    this.picture = place.appendChild(document.createElement("div"));
    this.picture.className = "diagram";
    this.picture.dataset.testid = "diagram";
    // It scrolls, also by keys.
    this.picture.tabIndex = 0;
    this.picture.addEventListener("click", (event) => this.seek(event));
    new ResizeObserver(() => this.render()).observe(this.picture);
    crosshair.join({
      place: this.picture,
      hasCursor: true,
      tickAt: (event) => (this.svg ? this.tickAt(event) : null),
      xOf: (tick) => this.xOf(tick),
    });
  }

  /** What is drawn. @returns {SVGSVGElement | null} */
  get svg() {
    return this.picture.querySelector("svg");
  }

  /** The last tick that is recorded. */
  get last() {
    return this.player.recorded;
  }

  /** Shows the window, which follows the tick of playback. */
  render() {
    const { clientWidth } = this.picture;
    if (clientWidth === 0) return;
    if (!this.player.header) return this.explain();

    const tick = Math.min(this.last, this.player.tick);
    const isOutside = tick < this.from || tick >= this.from + this.ticks;
    // A window that was moved is ahead of playback, which follows.
    if (tick !== this.followed && isOutside) this.begin(tick - Math.floor(this.ticks / 4));
    this.followed = tick;
    this.renderBar();
    this.request(Math.min(MAX_WIDTH_PX, Math.max(MIN_WIDTH_PX, clientWidth - 16)));
  }

  /** Says why there is no diagram. */
  explain() {
    const { missing } = this.player;
    render(html`<p class="muted" data-testid="no-diagram">${missing ? `There is no diagram: ${missing}.` : "No tick is recorded yet."}</p>`, this.bar);
    this.picture.replaceChildren();
    this.shown = "";
  }

  /** Begins the window with a tick, as far as the run has one. @param {number} tick */
  begin(tick) {
    this.from = Math.max(0, Math.min(tick, this.last + 1 - this.ticks));
  }

  /** Moves the window, and playback with it. @param {number} ticks */
  move(ticks) {
    const before = this.from;
    this.begin(this.from + ticks);
    const tick = Math.min(this.last, Math.max(0, Math.min(this.last, this.player.tick) + this.from - before));
    this.player.isPlaying = false;
    this.player.seek(tick);
    this.render();
  }

  /** Makes the window longer or shorter; the tick of playback stays in it. @param {number} factor */
  zoom(factor) {
    const tick = Math.min(this.last, this.player.tick);
    const share = (tick - this.from) / this.ticks;
    this.ticks = Math.round(Math.min(MAX_TICKS, Math.max(MIN_TICKS, this.ticks * factor)));
    this.begin(Math.round(tick - share * this.ticks));
    this.render();
  }

  renderBar() {
    const toggle = (/** @type {Event} */ event) => {
      this.hasQueries = /** @type {HTMLInputElement} */ (event.target).checked;
      this.render();
    };
    const half = Math.max(1, Math.floor(this.ticks / 2));
    const end = Math.min(this.last, this.from + this.ticks - 1);

    render(
      html`
        <button type="button" data-testid="diagram-previous" ?disabled=${this.from === 0} @click=${() => this.move(-half)}>Earlier</button>
        <button type="button" data-testid="diagram-next" ?disabled=${end >= this.last} @click=${() => this.move(half)}>Later</button>
        <button type="button" data-testid="diagram-in" aria-label="Shorter time" ?disabled=${this.ticks <= MIN_TICKS}
          @click=${() => this.zoom(0.5)}>+</button>
        <button type="button" data-testid="diagram-out" aria-label="Longer time" ?disabled=${this.ticks > this.last || this.ticks >= MAX_TICKS}
          @click=${() => this.zoom(2)}>−</button>
        <label class="check"><input type="checkbox" data-testid="diagram-queries" .checked=${this.hasQueries} @change=${toggle} /><span>Lost queries</span></label>
        <button type="button" data-testid="diagram-save" title="what is shown, in light colors: a drawing of at most 180 mm" @click=${() => this.save()}>SVG</button>
        ${this.player.tick > this.last
          ? html`<span class="muted" data-testid="diagram-lag">Drawn up to tick ${this.last}, the last one that is recorded so far.</span>`
          : nothing}
        ${this.reason ? html`<span class="muted" role="status">${this.reason}</span>` : nothing}`,
      this.bar,
    );
  }

  /** The window. @param {number} width pixels */
  query(width) {
    return new URLSearchParams({
      from: String(this.from),
      count: String(this.ticks),
      width: String(Math.floor(width)),
      queries: String(this.hasQueries),
      epoch: String(this.player.header?.epoch ?? 0),
    });
  }

  /** Saves the window for paper: light, with its style sheet, and of a size in millimeters. */
  async save() {
    const { svg, reason } = await fetchDiagram(this.query(PAPER_PX));
    this.reason = reason;
    this.renderBar();
    if (!svg) return;

    for (const side of /** @type {const} */ (["width", "height"])) svg.setAttribute(side, `${((svg.viewBox.baseVal[side] * 25.4) / DPI).toFixed(2)}mm`);
    const style = document.createElementNS(svg.namespaceURI, "style");
    style.textContent = printedRules().map(({ cssText }) => cssText).join("\n");
    svg.prepend(style);
    const { from, to } = svg.dataset;
    download(new Blob([new XMLSerializer().serializeToString(svg)], { type: "image/svg+xml" }), `${this.player.store.run}-ticks-${from}-${to}.svg`);
  }

  /** Fetches the window, unless it is shown already or has been requested. @param {number} width */
  async request(width) {
    const query = this.query(width);
    // The window of a run in progress is drawn anew until it is complete.
    const complete = Math.min(this.last, this.from + this.ticks);
    const wanted = `${query} ${complete} ${this.player.header?.number}`;
    if (wanted === this.shown || !this.player.store.isConnected) return;
    this.shown = wanted;

    const { svg, reason } = await fetchDiagram(query);
    // Another window has been requested since.
    if (wanted !== this.shown) return;
    this.reason = reason;
    this.renderBar();
    if (svg) this.show(svg);
  }

  /** @param {SVGSVGElement} svg */
  show(svg) {
    this.picture.replaceChildren(svg);
    this.knots = (svg.dataset.scale ?? "").split(", ").map((knot) => {
      const [x, tick] = knot.split(" ").map(Number);
      return [x, tick];
    });

    this.crosshair.render();
  }

  /** The tick at the place of a pointer. @param {MouseEvent} event */
  tickAt({ clientX }) {
    const { svg } = this;
    const box = svg?.getBoundingClientRect();
    if (!svg || !box) return 0;
    return Math.floor(along(this.knots, 0, 1, ((clientX - box.left) * svg.viewBox.baseVal.width) / box.width));
  }

  /** Where a tick is, in pixels of what is scrolled; null if it is not drawn. @param {number} tick */
  xOf(tick) {
    const { svg, picture } = this;
    const [from, to] = [Number(svg?.dataset.from), Number(svg?.dataset.to)];
    if (!svg || !(from <= tick && tick <= to)) return null;
    const box = svg.getBoundingClientRect();
    const left = box.left - picture.getBoundingClientRect().left + picture.scrollLeft;
    return left + (along(this.knots, 1, 0, tick) * box.width) / svg.viewBox.baseVal.width;
  }

  /** Seeks the tick of what is clicked, or the tick at that place. @param {MouseEvent} event */
  seek(event) {
    const target = /** @type {Element} */ (event.target);
    if (!this.svg?.contains(target)) return;

    const thing = target.closest("[data-tick]");
    // Bands are long: the place in them counts.
    const isBand = thing?.matches(".emotion, .behavior, .partition, .fault, .absence, .gap") ?? true;
    const tick = isBand ? this.tickAt(event) : Number(thing?.getAttribute("data-tick"));

    this.player.isPlaying = false;
    this.player.seek(Math.min(this.last, Math.max(0, tick)));
  }
}

/**
 * @param {URLSearchParams} query
 * @returns {Promise<{svg: SVGSVGElement | null, reason: string}>}
 */
async function fetchDiagram(query) {
  const url = new URL("recording/diagram", location.href);
  url.search = query.toString();

  try {
    const answer = await fetch(url);
    const text = await answer.text();
    if (!answer.ok) return { svg: null, reason: text || answer.statusText };

    const root = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    if (root instanceof SVGSVGElement) return { svg: document.importNode(root, true), reason: "" };
    return { svg: null, reason: "The diagram is not SVG." };
  } catch (error) {
    return { svg: null, reason: `The diagram cannot be read: ${error instanceof Error ? error.message : error}` };
  }
}

/**
 * The value of a piecewise linear function.
 * @param {[number, number][]} knots
 * @param {0 | 1} of index of the argument in a knot
 * @param {0 | 1} to index of the value in a knot
 * @param {number} at
 */
function along(knots, of, to, at) {
  for (let i = 1; i < knots.length; i += 1) {
    const [before, after] = [knots[i - 1], knots[i]];
    if (at > after[of] && i + 1 < knots.length) continue;
    const share = (Math.min(after[of], Math.max(before[of], at)) - before[of]) / (after[of] - before[of]);
    return before[to] + share * (after[to] - before[to]);
  }
  return 0;
}
