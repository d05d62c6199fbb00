// @ts-check
// Emotion and behavior of each robot over simulated time, a color per state.

import { GUTTER_PX, MARGIN_PX } from "./charts.js";
import { hatchingPath, stateLook } from "./palette.js";
import { seconds } from "./units.js";
import { steer, timeView } from "./window.js";
import { html, nothing, render, svg } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./history.js").Span} Span */

const BAND_PX = 16;
const GAP_PX = 3;
const ROBOT_GAP_PX = 9;
/** Spans that end closer to one another are drawn as one. */
const MIN_PX = 0.25;
/** Approximate width of a letter. */
const LETTER_PX = 6.2;

export class Bands {
  /**
   * @param {HTMLElement} place
   * @param {Store} store
   * @param {import("./window.js").TimeWindow} shown
   * @param {import("./crosshair.js").Crosshair} crosshair
   * @param {{seek: (time_s: number) => void, isShown: (robot: string) => boolean}} ways to seek, and the robots that are chosen
   */
  constructor(place, store, shown, crosshair, { seek, isShown }) {
    this.place = place;
    this.store = store;
    this.shown = shown;
    this.isShown = isShown;
    this.drawing = place.appendChild(document.createElement("div"));
    const sides = { left_px: GUTTER_PX, right_px: MARGIN_PX };
    steer(place, shown, { ...sides, seek });
    crosshair.join(timeView(place, shown, sides, () => store.frame?.tick_s ?? 0));
  }

  render() {
    const width = this.place.clientWidth;
    const states = new Map([...this.store.history.states].filter(([robot]) => this.isShown(robot)));
    const [first_s, last_s] = this.shown.range_s();
    const tick_s = this.store.frame?.tick_s;
    const inner = width - GUTTER_PX - MARGIN_PX;
    if (inner <= 0) return;

    const x = (/** @type {number} */ time_s) => GUTTER_PX + (inner * (Math.min(last_s, Math.max(first_s, time_s)) - first_s)) / (last_s - first_s);
    const seen = (/** @type {Span[]} */ spans) => visible(spans, first_s, last_s, x, MIN_PX);
    const rows = [...states].flatMap(([robot, { emotion, behavior }], i) => {
      const y = i * (2 * BAND_PX + GAP_PX + ROBOT_GAP_PX);
      return [
        svg`<text class="who" x="8" y=${y + BAND_PX + 5}>${robot.slice(0, 10)}</text>`,
        ...seen(emotion).map((span) => block(span, x, y, "emotion", robot, tick_s)),
        ...seen(behavior).map((span) => block(span, x, y + BAND_PX + GAP_PX, "behavior", robot, tick_s)),
      ];
    });

    const height = states.size * (2 * BAND_PX + GAP_PX + ROBOT_GAP_PX);

    render(
      states.size
        ? html`<svg class="cars-diagram" width=${width} height=${height} role="img" aria-label=${this.words()}>${rows}</svg>`
        : nothing,
      this.drawing,
    );
  }

  words() {
    const now = [...this.store.history.states].filter(([robot]) => this.isShown(robot)).map(([robot, { emotion, behavior }]) =>
      [robot, lastOf(emotion), lastOf(behavior)].join(" "),
    );
    return `Emotion and behavior over time; last: ${now.join("; ")}`;
  }
}

/** The state at the end; "" if there is none. @param {Span[]} spans */
function lastOf(spans) {
  const last = spans.at(-1);
  return last?.goesOn ? last.state : "";
}

/**
 * The states of a window, without those that others at the same place would cover.
 * @param {Span[]} spans
 * @param {number} first_s
 * @param {number} last_s
 * @param {(time_s: number) => number} x
 * @param {number} least_px spans that end closer to one another are one
 */
export function visible(spans, first_s, last_s, x, least_px) {
  let end = -Infinity;
  return spans.filter(({ from_s, to_s }) => {
    if (to_s < first_s || from_s > last_s || x(to_s) - end < least_px) return false;
    end = x(to_s);
    return true;
  });
}

/**
 * @param {Span} span
 * @param {(time_s: number) => number} x
 * @param {number} y
 * @param {"emotion" | "behavior"} kind
 * @param {string} robot
 * @param {number} [tick_s]
 */
function block({ state, from_s, to_s }, x, y, kind, robot, tick_s) {
  const left = x(from_s);
  const width = Math.max(1, x(to_s) - left - 0.5);
  const { area: color, hatching } = stateLook(kind, state);
  const over = hatchingPath(hatching, left, y, width, BAND_PX);
  const isRoomy = width > LETTER_PX * state.length + 8;

  return svg`
    <g class="band" data-state=${state}><title>${robot}, ${kind} ${state}, ${seconds(from_s, tick_s)} to ${seconds(to_s, tick_s)}</title>
      <rect x=${left} y=${y} width=${width} height=${BAND_PX} rx="2" class=${color}></rect>${hatching ? svg`<path class="over" d=${over}></path>` : nothing}
      ${isRoomy ? svg`<text class="on-${color}" x=${left + 5} y=${y + 12}>${state}</text>` : nothing}</g>`;
}
