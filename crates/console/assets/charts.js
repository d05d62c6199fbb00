// @ts-check
// A state variable of the robots, or a measure of the run, over simulated time.

import { THE_RUN } from "./history.js";
import { robotColor } from "./palette.js";
import { rank } from "./roster.js";
import { onThemeChange, readTheme } from "./theme.js";
import { short } from "./units.js";
import { steer, timeView } from "./window.js";
import { html, nothing, render } from "./vendor/lit-html.js";
import uPlot from "./vendor/uPlot.esm.js";

/** @typedef {import("./store.js").Store} Store */

/** Space for the axis labels on the left; the bands have the same. */
export const GUTTER_PX = 76;
/** Space on the right. */
export const MARGIN_PX = 24;

/** Robots that are named in the list of variables; of more, their number. */
const MAX_NAMED = 3;
/** Robots that are shown before anybody has chosen: as many as have a color of their own. */
const FIRST_SHOWN = 8;

export class Charts {
  /**
   * @param {{select: HTMLElement, chart: HTMLElement}} places
   * @param {Store} store
   * @param {import("./window.js").TimeWindow} shown
   * @param {import("./crosshair.js").Crosshair} crosshair
   * @param {{seek: (time_s: number) => void, onChoose: () => void}} ways to seek, and what is done at another choice of robots
   */
  constructor({ select, chart }, store, shown, crosshair, { seek, onChoose }) {
    this.select = select;
    this.chart = chart;
    this.store = store;
    this.shown = shown;
    this.crosshair = crosshair;
    this.onChoose = onChoose;
    /** The robots that a person has chosen. @type {Set<string> | null} */
    this.chosen = null;
    /** What the plot shows, to draw nothing twice. */
    this.drawn = "";
    /** The history that it is of. @type {import("./history.js").History | null} */
    this.drawnOf = null;
    this.variable = "";
    /** @type {uPlot | null} */
    this.plot = null;
    /** Variable and robots of the current plot. */
    this.made = "";
    const sides = { left_px: GUTTER_PX, right_px: MARGIN_PX };
    steer(chart, shown, { ...sides, seek });
    crosshair.join(timeView(chart, shown, sides, () => store.frame?.tick_s ?? 0));
    crosshair.listeners.push(() => chart.clientWidth > 0 && this.renderSelect([...store.history.variables.keys()].sort()));
    new ResizeObserver(() => this.resize()).observe(chart);
    onThemeChange(() => this.forget());
  }

  forget() {
    this.plot?.destroy();
    this.plot = null;
    this.made = "";
    this.drawn = "";
  }

  /** @param {string} robot */
  isShown(robot) {
    if (robot === THE_RUN) return true;
    return this.chosen ? this.chosen.has(robot) : rank(robot) < FIRST_SHOWN;
  }

  /**
   * @param {string[]} robots all that can be shown
   * @param {(robot: string) => boolean} isChosen
   */
  choose(robots, isChosen) {
    this.chosen = new Set(robots.filter(isChosen));
    this.render();
    this.onChoose();
  }

  /** The series of the robots that are shown. */
  series() {
    const robots = this.store.history.variables.get(this.variable) ?? new Map();
    return new Map([...robots].filter(([robot]) => this.isShown(robot)));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.chart;
    if (width > 0 && height > 0) this.plot?.setSize({ width, height });
    if (!this.plot) this.render();
  }

  render() {
    const { history } = this.store;
    const names = [...history.variables.keys()].sort();
    if (!history.variables.has(this.variable)) this.variable = liveliest(history) ?? "";
    this.renderSelect(names);
    const robots = this.series();
    if (robots.size === 0) return this.forget();

    const [first_s, last_s] = this.shown.range_s();
    const drawn = [this.variable, ...robots.keys(), history.changes, first_s, last_s].join("\n");
    if (drawn === this.drawn && history === this.drawnOf) return;

    const { clientWidth: width, clientHeight: height } = this.chart;
    if (width === 0 || height === 0) return;

    const made = [this.variable, ...robots.keys()].join("\n");
    if (made !== this.made) {
      this.forget();
      this.made = made;
      this.plot = new uPlot(options(this.variable, [...robots.keys()], width, height), [[0, 1]], this.chart);
      this.chart.setAttribute("role", "img");
    }

    this.plot?.setData([history.times_s, ...robots.values()], false);
    this.plot?.setScale("x", { min: first_s, max: last_s });

    this.drawn = drawn;
    this.drawnOf = history;
    const now = [...robots].map(([robot, values]) => `${robot} ${short(values.at(-1) ?? NaN)}`);
    this.chart.setAttribute("aria-label", `${this.variable} over time; last: ${now.join(", ")}`);
  }

  /** The color of each robot, with its value at the pointer or else the last one. */
  key() {
    const { history, frame, isChosenTick } = this.store;
    const { tick } = this.crosshair;
    const time_s = tick !== null && frame ? tick * frame.tick_s : isChosenTick && frame ? frame.time_s : Infinity;
    const index = history.indexAt(time_s);

    return [...this.series()].map(
      ([robot, values]) => html`<li>${dot(robotColor(robot))}${robot} <b>${short(values[index] ?? NaN, 3)}</b></li>`,
    );
  }

  /** The choice of robots, which says how many are shown. */
  chooser() {
    const all = [...(this.store.history.variables.get(this.variable)?.keys() ?? [])];
    const shown = all.filter((robot) => this.isShown(robot));
    if (all.length < 2) return nothing;

    const toggle = (/** @type {string} */ robot) => this.choose(all, (one) => (one === robot ? !this.isShown(one) : this.isShown(one)));
    return html`
      <details class="chooser" data-testid="chart-robots"><summary>${shown.length} of ${all.length} robots</summary>
        <div class="choices" role="group" aria-label="Robots that are shown">
          <div class="row"><button type="button" data-testid="chart-all" @click=${() => this.choose(all, () => true)}>All</button>
            <button type="button" data-testid="chart-none" @click=${() => this.choose(all, () => false)}>None</button></div>
          ${all.map(
            (robot) => html`<label class="check"><input type="checkbox" .checked=${this.isShown(robot)}
              @change=${() => toggle(robot)} />${dot(robotColor(robot))}${robot}</label>`,
          )}
        </div></details>`;
  }

  /** @param {string[]} names */
  renderSelect(names) {
    const choose = (/** @type {Event} */ event) => {
      this.variable = /** @type {HTMLSelectElement} */ (event.target).value;
      this.render();
    };

    const { history } = this.store;
    const robots = (/** @type {string} */ name) => {
      const all = [...(history.variables.get(name)?.keys() ?? [])];
      return all.length > MAX_NAMED ? `${all.length} robots` : all.join(", ");
    };

    render(
      html`
        <label class="field inline"><span>Variable</span>
          <select data-testid="chart-variable" @change=${choose}>
            ${names.map((name) => html`<option value=${name} ?selected=${name === this.variable}>${name} (${robots(name)})</option>`)}
          </select></label>
        ${this.chooser()}
        <span class="muted" ?hidden=${names.length > 0}>There is no number yet.</span>
        <button type="button" data-testid="window-all" title="show the whole run (double click)" .style=${`visibility:${this.shown.isWhole ? "hidden" : "visible"}`}
          @click=${() => this.shown.reset()}>Whole run</button>
        <span class="muted" ?hidden=${history.dropped === 0}>${history.dropped} variables more are not kept.</span>
        <ul class="key">${this.key()}</ul>`,
      this.select,
    );
  }
}

/**
 * A small filled circle.
 * @param {string} color
 */
function dot(color) {
  return html`<svg width="10" height="10" aria-hidden="true"><circle cx="5" cy="5" r="4.5" fill=${color}></circle></svg>`;
}

/**
 * Indices of the values beside which there is no other one.
 * @param {ArrayLike<number | null | undefined>} values
 * @returns {number[]}
 */
function isolated(values) {
  const is = (/** @type {number} */ i) => values[i] !== null && values[i] !== undefined;
  return [...Array(values.length).keys()].filter((i) => is(i) && !is(i - 1) && !is(i + 1));
}

/**
 * The variable that changes most often, which is shown first; times, which change in every tick, only if there is nothing else.
 * @param {import("./history.js").History} history
 */
function liveliest(history) {
  let most = -Infinity;
  let found;

  for (const [name, robots] of history.variables) {
    for (const values of robots.values()) {
      const changes = values.reduce((/** @type {number} */ sum, value, i) => sum + (i > 0 && value !== values[i - 1] ? 1 : 0), 0);
      const rank = changes + robots.size / 10 - (name.endsWith("_s") ? values.length : 0);
      if (rank > most) {
        most = rank;
        found = name;
      }
    }
  }

  return found;
}

/**
 * @param {string} variable
 * @param {string[]} robots
 * @param {number} width
 * @param {number} height
 * @returns {uPlot.Options}
 */
function options(variable, robots, width, height) {
  const theme = readTheme();
  const axis = { stroke: theme.muted, grid: { stroke: theme.grid, width: 1 }, ticks: { show: false }, font: `11px ${theme.font}` };

  return {
    width,
    height,
    padding: [10, MARGIN_PX, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, auto: false } },
    axes: [
      { ...axis, size: 26, values: (_, ticks) => ticks.map((tick) => `${short(tick)} s`) },
      { ...axis, size: GUTTER_PX, values: (_, ticks) => ticks.map((tick) => short(tick, 4)) },
    ],
    series: [
      {},
      ...robots.map((robot) => ({
        label: `${robot} ${variable}`,
        stroke: robotColor(robot),
        width: 1.75,
        // A sample between gaps is no line.
        points: { show: true, size: 4, fill: robotColor(robot), filter: (/** @type {uPlot} */ plot, /** @type {number} */ i) => isolated(plot.data[i]) },
      })),
    ],
  };
}
