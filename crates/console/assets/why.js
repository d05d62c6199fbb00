// @ts-check
// What decided the run: answers of `cars why` in its folder. A sentence, the expected outcome over the time line with its interval,
// and the ticks in which it jumps, as marks and as a list.

import { keep, kept } from "./kept.js";
import { steer, timeView } from "./window.js";
import { html, nothing, render, svg } from "./vendor/lit-html.js";

/** @typedef {import("./recording.js").Player} Player */
/** @typedef {{n: number, value: number | null, low: number | null, high: number | null}} Outcomes */
/**
 * An answer; `range` are the ends of the axis of outcomes, `told` are the jumps in words.
 * @typedef {{question: {name: string}, sentence: string, last: number, curve: (Outcomes & {tick: number})[], jumps: {tick: number}[],
 *   axis: string, range: [number, number], range_words: [string, string], told: string[]}} Answer
 */
/** @typedef {{answers: Answer[], notes: string[]}} Decisions */

/** How often it is looked whether there are other answers: `cars why` may be asked while the page is open. */
const LOOK_MS = 5000;
/** All of the band is time. */
const SIDES = { left_px: 0, right_px: 0 };
/** Height of the band in its own units. */
const HEIGHT = 100;
const FOLDED = "cars-why-folded";

export class WhyView {
  /**
   * @param {HTMLElement} place
   * @param {Player} player
   * @param {import("./window.js").TimeWindow} range the part of the time line that is shown
   * @param {import("./crosshair.js").Crosshair} crosshair
   */
  constructor(place, player, range, crosshair) {
    this.place = place;
    this.player = player;
    this.range = range;
    /** @type {Decisions} */
    this.found = { answers: [], notes: [] };
    /** The answers as they came, to draw nothing twice. */
    this.text = "";
    /** The recording and the epoch that they are of. */
    this.of = "";
    this.chosen = "";
    this.isFolded = kept(FOLDED) !== null;
    this.drawn = "";

    place.hidden = true;
    this.words = place.appendChild(document.createElement("div"));
    this.words.className = "why-words";
    this.band = place.appendChild(document.createElement("div"));
    this.band.className = "why-band";
    this.band.dataset.testid = "why-band";
    steer(this.band, range, { ...SIDES, seek: (time_s) => player.seekTime(time_s) });
    // The pictures of the band are drawn beside the lines of the cross-hair.
    this.picture = this.band.appendChild(document.createElement("div"));
    crosshair.join(timeView(this.band, range, SIDES, () => player.tick_s));
    this.list = place.appendChild(document.createElement("div"));
    window.setInterval(() => this.look(), LOOK_MS);
  }

  /** Asks for the answers about the epoch that is shown. */
  async look() {
    const { header, store } = this.player;
    if (!header || !store.isConnected || document.hidden) return;
    const of = `${header.number} ${header.epoch}`;
    const url = new URL("recording/decisions", location.href);
    url.searchParams.set("epoch", String(header.epoch));
    try {
      const answer = await fetch(url);
      const text = await answer.text();
      if (!answer.ok || of !== this.of || text === this.text) return;
      this.found = JSON.parse(text);
      this.text = text;
      this.render();
    } catch {
      // The console ends: the page says so elsewhere.
    }
  }

  /** The answer that is shown. */
  get answer() {
    const { answers } = this.found;
    return answers.find(({ question }) => question.name === this.chosen) ?? answers[0];
  }

  render() {
    const { player, place } = this;
    const of = player.header ? `${player.header.number} ${player.header.epoch}` : "";
    if (of !== this.of) {
      this.of = of;
      this.text = "";
      this.found = { answers: [], notes: [] };
      this.look();
    }
    const { answers, notes } = this.found;
    place.hidden = answers.length === 0 && notes.length === 0;
    if (place.hidden) return;

    const width = this.band.clientWidth;
    const drawn = [this.text.length, this.text, this.chosen, this.isFolded, width, ...this.range.range_s()].join("\n");
    if (drawn === this.drawn) return;
    this.drawn = drawn;

    const { answer } = this;
    const isShown = answer !== undefined && !this.isFolded;
    this.band.hidden = !isShown;
    this.list.hidden = !isShown;
    render(this.drawWords(answer), this.words);
    if (!answer || !isShown) return;
    render(this.drawBand(answer), this.picture);
    render(this.drawJumps(answer), this.list);
  }

  /** @param {Answer | undefined} answer */
  drawWords(answer) {
    const { answers, notes } = this.found;
    const fold = () => {
      this.isFolded = !this.isFolded;
      keep(FOLDED, this.isFolded ? "1" : null);
      this.render();
    };
    const choose = (/** @type {Event} */ event) => {
      this.chosen = /** @type {HTMLSelectElement} */ (event.target).value;
      this.render();
    };

    return html`
      ${answer
        ? html`<button type="button" class="why-fold" data-testid="why-fold" aria-expanded=${!this.isFolded}
            title="what cars why found" @click=${fold}>Why <span aria-hidden="true">${this.isFolded ? "▸" : "▾"}</span></button>`
        : nothing}
      ${answers.length > 1
        ? html`<select data-testid="why-question" aria-label="Question" @change=${choose}>
            ${answers.map(({ question }) => html`<option value=${question.name} ?selected=${question.name === answer?.question.name}>${question.name}</option>`)}
          </select>`
        : nothing}
      ${answer ? html`<p class="why-sentence" data-testid="why-sentence" title=${answer.sentence}>${answer.sentence}</p>` : nothing}
      ${notes.map((note) => html`<p class="muted why-note" data-testid="why-note" role="status">${note}</p>`)}`;
  }

  /** @param {Answer} answer */
  drawBand(answer) {
    const width = Math.max(1, this.band.clientWidth);
    const [from_s, to_s] = this.range.range_s();
    const at = (/** @type {number} */ tick) => (tick * this.player.tick_s - from_s) / (to_s - from_s);
    const [least, most] = answer.range;
    const y = (/** @type {number} */ value) => (HEIGHT * (most - value)) / (most - least);

    /** @type {string[]} */
    const middle = [];
    /** @type {string[]} */
    const upper = [];
    /** @type {string[]} */
    const lower = [];
    for (const { tick, value, low, high } of answer.curve) {
      if (value === null) continue;
      const x = width * at(tick);
      middle.push(`${x} ${y(value)}`);
      upper.push(`${x} ${y(high ?? value)}`);
      lower.push(`${x} ${y(low ?? value)}`);
    }
    const line = (/** @type {string[]} */ points) => (points.length ? `M${points.join("L")}` : "");
    const ends = [...answer.range_words].reverse().map((words) => words.replace(" ", "\u200a"));
    // In the corner where the curve is not.
    const last = answer.curve.filter(({ tick, value }) => value !== null && at(tick) > 0.7);
    const isHigh = last.filter(({ value }) => y(value ?? least) < HEIGHT / 2).length > last.length / 2;

    return html`
      <svg class="why-picture" data-testid="why-picture" viewBox="0 0 ${width} ${HEIGHT}" preserveAspectRatio="none" role="img"
        aria-label="${answer.axis} over the run: ${answer.sentence}">
        ${svg`<path class="why-interval" d=${upper.length ? `${line([...upper, ...lower.reverse()])}Z` : ""}></path>
          <path class="why-curve" d=${line(middle)}></path>`}
      </svg>
      <div class="why-ends" aria-hidden="true">${ends.map((words) => html`<span>${words}</span>`)}</div>
      <span class="why-axis ${isHigh ? "below" : ""}" aria-hidden="true">${answer.axis}</span>
      ${answer.jumps.map(({ tick }, i) => {
        const share = at(tick);
        if (share < 0 || share > 1) return nothing;
        return html`<button type="button" class="why-mark" data-testid="why-mark" data-tick=${tick} title=${answer.told[i]} aria-hidden="true" tabindex="-1"
          .style=${`left:${100 * share}%`} @pointerdown=${stay} @click=${() => this.show(tick)}></button>`;
      })}`;
  }

  /** @param {Answer} answer */
  drawJumps(answer) {
    if (answer.jumps.length === 0) return nothing;
    return html`<ol class="why-jumps" aria-label="Ticks that decided">
      ${answer.jumps.map(({ tick }, i) => html`<li><button type="button" data-testid="why-jump" data-tick=${tick} title=${answer.told[i]}
        @click=${() => this.show(tick)}>${answer.told[i]}</button></li>`)}
    </ol>`;
  }

  /** Shows a tick on the plan. @param {number} tick */
  show(tick) {
    this.player.seekIn(this.player.epoch, tick);
  }
}

/** A press on a mark begins no drag of the band. @param {Event} event */
function stay(event) {
  event.stopPropagation();
}
