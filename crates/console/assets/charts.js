// @ts-check
// A state variable of the robots over simulated time.

import { robotColor } from "./palette.js";
import { onThemeChange, readTheme } from "./theme.js";
import { short } from "./units.js";
import { steer } from "./window.js";
import { html, render } from "./vendor/lit-html.js";
import uPlot from "./vendor/uPlot.esm.js";

/** @typedef {import("./store.js").Store} Store */

/** Space for the axis labels on the left; the bands have the same. */
export const GUTTER_PX = 76;
/** Space on the right. */
export const MARGIN_PX = 24;

export class Charts {
  /**
   * @param {{select: HTMLElement, chart: HTMLElement}} places
   * @param {Store} store
   * @param {import("./window.js").TimeWindow} shown
   * @param {(time_s: number) => void} seek
   */
  constructor({ select, chart }, store, shown, seek) {
    this.select = select;
    this.chart = chart;
    this.store = store;
    this.shown = shown;
    this.variable = "";
    /** @type {uPlot | null} */
    this.plot = null;
    /** Variable and robots of the current plot. */
    this.made = "";
    /** Index of the sample under the pointer. @type {number | null} */
    this.pointed = null;
    steer(chart, shown, { left_px: GUTTER_PX, right_px: MARGIN_PX, seek });
    chart.addEventListener("pointermove", () => this.point(this.plot?.cursor.idx ?? null));
    chart.addEventListener("pointerleave", () => this.point(null));
    new ResizeObserver(() => this.resize()).observe(chart);
    onThemeChange(() => this.forget());
  }

  /** @param {number | null} index */
  point(index) {
    this.pointed = index;
    this.renderSelect([...this.store.history.variables.keys()].sort());
  }

  forget() {
    this.plot?.destroy();
    this.plot = null;
    this.made = "";
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.chart;
    if (width > 0 && height > 0) this.plot?.setSize({ width, height });
  }

  render() {
    const { history } = this.store;
    const names = [...history.variables.keys()].sort();
    if (!history.variables.has(this.variable)) this.variable = liveliest(history) ?? "";
    this.renderSelect(names);
    const robots = history.variables.get(this.variable);
    const { clientWidth: width, clientHeight: height } = this.chart;

    if (!robots || width === 0 || height === 0) {
      if (!robots) this.forget();
      return;
    }

    const made = [this.variable, ...robots.keys()].join("\n");
    if (made !== this.made) {
      this.forget();
      this.made = made;
      this.plot = new uPlot(options(this.variable, [...robots.keys()], width, height), [[0, 1]], this.chart);
      this.chart.setAttribute("role", "img");
    }

    const [first_s, last_s] = this.shown.range_s();
    this.plot?.setData([history.times_s, ...robots.values()], false);
    this.plot?.batch(() => {
      this.plot?.setScale("x", { min: first_s, max: last_s });
      this.cursor();
    });

    const now = [...robots].map(([robot, values]) => `${robot} ${short(values.at(-1) ?? NaN)}`);
    this.chart.setAttribute("aria-label", `${this.variable} over time; last: ${now.join(", ")}`);
  }

  /** In the past, marks the time that the plan shows. */
  cursor() {
    const { frame, isChosenTick } = this.store;
    if (!this.plot) return;
    if (!isChosenTick || !frame) {
      // The mark of a tick that is shown no more.
      if (this.pointed === null) this.plot.setCursor({ left: -10, top: -10 }, false);
      return;
    }
    this.plot.setCursor({ left: this.plot.valToPos(frame.time_s, "x"), top: 10 }, false);
  }

  /** The color of each robot, with its value at the pointer or else the last one. */
  key() {
    const { history, frame, isChosenTick } = this.store;
    const shown = isChosenTick && frame ? history.indexAt(frame.time_s) : history.times_s.length - 1;
    const index = this.pointed ?? shown;

    return [...(history.variables.get(this.variable) ?? [])].map(
      ([robot, values]) => html`<li>${dot(robotColor(robot))}${robot} <b>${short(values[index] ?? NaN, 3)}</b></li>`,
    );
  }

  /** @param {string[]} names */
  renderSelect(names) {
    const choose = (/** @type {Event} */ event) => {
      this.variable = /** @type {HTMLSelectElement} */ (event.target).value;
      this.render();
    };

    const robots = (/** @type {string} */ name) => [...(this.store.history.variables.get(name)?.keys() ?? [])].join(", ");

    render(
      html`
        <label class="field inline"><span>Variable</span>
          <select data-testid="chart-variable" @change=${choose}>
            ${names.map((name) => html`<option value=${name} ?selected=${name === this.variable}>${name} (${robots(name)})</option>`)}
          </select></label>
        <span class="muted" ?hidden=${names.length > 0}>No robot has published a number yet.</span>
        <button type="button" data-testid="window-all" title="show the whole run (double click)" ?hidden=${this.shown.isWhole}
          @click=${() => this.shown.reset()}>Whole run</button>
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
 * The variable that changes most often, which is shown first.
 * @param {import("./history.js").History} history
 */
function liveliest(history) {
  let most = -1;
  let found;

  for (const [name, robots] of history.variables) {
    for (const values of robots.values()) {
      const changes = values.reduce((/** @type {number} */ sum, value, i) => sum + (i > 0 && value !== values[i - 1] ? 1 : 0), 0);
      const rank = changes + robots.size / 10;
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
    cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
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
        points: { show: false },
      })),
    ],
  };
}
