// @ts-check
// A panel for each robot. The page has no knowledge of particular robots: it renders the widgets that they publish.

import { presence } from "./presence.js";
import { initials } from "./roster.js";
import { html, nothing, render } from "./vendor/lit-html.js";
import { drawWidget } from "./widgets.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./units.js").Units} Units */
/** @typedef {import("./types/messages.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */

const MOST_WIDGETS = 64;

export class Panels {
  /**
   * @param {HTMLElement} place
   * @param {Store} store
   * @param {Units} units
   * @param {{send: (robot: string, command: string) => void, choose: (robot: string) => void}} actions
   */
  constructor(place, store, units, actions) {
    this.place = place;
    this.store = store;
    this.units = units;
    this.actions = actions;
    /** @type {string | null} */
    this.chosen = null;
  }

  render() {
    const robots = this.store.frame?.robots ?? [];
    const awaiting = this.store.awaiting();
    this.place.classList.toggle("many", robots.length > 3);
    const placeholder = html`<p class="panels-empty">Each robot's emotion, behavior and state appear here.</p>`;
    render(robots.length ? robots.map((robot) => this.panel(robot, awaiting)) : placeholder, this.place);
  }

  /**
   * @param {RobotFrame} robot
   * @param {import("./types/messages.js").Awaited[]} awaiting
   */
  panel(robot, awaiting) {
    const { word, since, detail, tone } = presence(robot, awaiting);
    // Nothing is known of a robot without its simulator.
    const seen = this.store.isPast ? "" : tone;
    const { name } = robot;
    const own = this.store.panels.get(name)?.widgets;
    const all = Array.isArray(own) && own.length ? own : generic(robot).widgets;
    const widgets = all.slice(0, MOST_WIDGETS);
    const [buttons, others] = split(widgets);
    const send = (/** @type {string} */ command) => this.actions.send(name, command);

    return html`
      <section class="panel ${word} ${name === this.chosen ? "chosen" : ""}" data-testid="panel-${name}" aria-label=${name}>
        <header>
          <button type="button" class="name" title="show on the plan" @click=${() => this.actions.choose(name)}>
            <span class="initials" aria-hidden="true">${initials(name)}</span><h2>${name}</h2></button>
          <span class="presence ${seen}" title=${detail}><span class="dot ${seen}"></span><span
            data-testid="presence">${word}</span>${since ? html` <span class="since">${since}</span>` : nothing}</span>
        </header>
        <p class="where">${this.units.length(robot.location.x)}, ${this.units.length(robot.location.y)}
          <span>${this.units.speed(robot.speed_mps)}</span>
          ${robot.blocked ? html`<span class="blocked">blocked</span>` : nothing}</p>
        <div class="widgets">${others.map((widget) => drawWidget(widget, send))}</div>
        ${buttons.length && this.store.mode === "live" && !this.store.replayOf
          ? html`<div class="buttons" role="group" aria-label="Commands">${buttons.map((button) => drawWidget(button, send))}</div>`
          : nothing}
      </section>`;
  }
}

/**
 * Separates the buttons, which are rendered in one row below the rest.
 * @param {Panel["widgets"]} widgets
 */
function split(widgets) {
  const isButton = (/** @type {Panel["widgets"][0]} */ widget) => widget?.widget === "button";
  return [widgets.filter(isButton), widgets.filter((widget) => !isButton(widget))];
}

/**
 * The panel of a robot without one, or without widgets: its published state.
 * @param {RobotFrame} robot
 * @returns {Panel}
 */
function generic(robot) {
  const show = (/** @type {unknown} */ value) =>
    typeof value === "number" ? String(Number(value.toPrecision(5))) : value === true ? "yes" : value === false ? "no" : String(value);
  return {
    widgets: [
      { widget: "badge", label: "emotion", text: robot.emotion_state, tone: "neutral" },
      { widget: "badge", label: "behavior", text: robot.behavior_state, tone: "neutral" },
      { widget: "table", rows: Object.entries(robot.state_variables).map(([name, value]) => [name, show(value)]) },
    ],
  };
}
