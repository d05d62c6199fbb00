// @ts-check
// A panel for each robot; of many, a list, and the panel of the one that is chosen. The page has no knowledge of particular
// robots: it renders the widgets that they publish.

import { componentsOf, generic, heldUp, intensityOf, lastCommands, placeOf } from "./known.js";
import { presence } from "./presence.js";
import { RobotList } from "./robot-list.js";
import { initials } from "./roster.js";
import { seconds } from "./units.js";
import { html, nothing, render } from "./vendor/lit-html.js";
import { drawWidget } from "./widgets.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./units.js").Units} Units */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").Widget} Widget */

const MAX_WIDGETS = 64;
/** Emotions of a robot that are kept for its tree. */
const MAX_FELT = 32;
/** More robots than this are a list. */
const MAX_PANELS = 4;
/** Widgets that are folded, unless a panel has nothing else. */
const DETAILS = ["table", "sparkline"];

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
    /** Robots whose details are unfolded. @type {Set<string>} */
    this.unfolded = new Set();
    /** Robots whose components of emotion are unfolded. @type {Set<string>} */
    this.explained = new Set();
    /** The emotions that each robot has had on this page, with their valences. @type {Map<string, Map<string, number>>} */
    this.felt = new Map();
    /** Since when a robot's moves have been refused, simulated seconds. @type {Map<string, number>} */
    this.blockedSince_s = new Map();
    /** The class of each robot, if it is known. @type {Map<string, string>} */
    this.classes = new Map();
    this.list = new RobotList({ choose: (robot) => actions.choose(robot), changed: () => this.render() });
    store.on("epoch", () => {
      this.blockedSince_s.clear();
      this.felt.clear();
    });
    store.on("frame", () => this.note());
  }

  note() {
    const { frame } = this.store;
    for (const { name, blocked, emotion_state, state_variables } of frame?.robots ?? []) {
      const felt = this.felt.get(name) ?? new Map();
      const { valence } = state_variables;
      if (typeof valence === "number" && felt.size < MAX_FELT) this.felt.set(name, felt.set(emotion_state, valence));
      const since_s = this.blockedSince_s.get(name) ?? Infinity;
      if (!blocked) this.blockedSince_s.delete(name);
      else if (frame) this.blockedSince_s.set(name, Math.min(since_s, frame.time_s));
    }
  }

  render() {
    const robots = this.store.frame?.robots ?? [];
    const awaiting = this.store.awaiting();
    const isMany = robots.length > MAX_PANELS;
    const shown = isMany ? robots.filter(({ name }) => name === this.chosen) : robots;
    this.place.classList.toggle("many", isMany);
    this.place.classList.toggle("one-open", isMany && shown.length > 0);
    if (isMany) this.list.render(robots.map((robot) => this.line(robot, awaiting)), this.chosen);

    const placeholder = html`<p class="panels-empty">Each robot's emotion, behavior and state appear here.</p>`;
    const panels = robots.length ? shown.map((robot) => this.panel(robot, awaiting)) : placeholder;
    render(html`${isMany ? this.list.place : nothing}${panels}`, this.place);
  }

  /**
   * @param {RobotFrame} robot
   * @param {import("./types/messages.js").Awaited[]} awaiting
   * @returns {import("./robot-list.js").Line}
   */
  line(robot, awaiting) {
    const { name, emotion_state, behavior_state } = robot;
    const since_s = this.blockedSince_s.get(name) ?? Infinity;
    const { words, badness } = heldUp(robot, awaiting, Math.max(0, (this.store.frame?.time_s ?? 0) - since_s));

    return {
      name,
      emotion: emotion_state,
      intensity: intensityOf(robot, this.store.panels.get(name)),
      behavior: behavior_state,
      held: words,
      badness,
      isAbsent: robot.presence !== "here",
    };
  }

  /**
   * What a panel shows, what it folds, and its buttons: the robot's own widgets, or else what is known of it.
   * @param {RobotFrame} robot
   * @returns {{widgets: Widget[], details: Widget[], buttons: Widget[]}}
   */
  content(robot) {
    const own = this.store.panels.get(robot.name)?.widgets;
    const all = (Array.isArray(own) ? own : []).slice(0, MAX_WIDGETS);
    const buttons = all.filter((widget) => widget?.widget === "button");
    const others = all.filter((widget) => widget?.widget !== "button");
    const { frame, log } = this.store;
    if (others.length) return { ...split(others.map((widget) => readable(widget, robot, frame))), buttons };

    const { epoch = 0, tick = 0 } = frame ?? {};
    const known = { className: this.classes.get(robot.name) ?? "", commands: lastCommands(log, robot.name, epoch, tick), isBegun: tick > 0 };
    return { ...generic(robot, known), buttons };
  }

  /**
   * The place of the emotion in the tree of affective states, and its components, of a robot that publishes them.
   * @param {RobotFrame} robot
   */
  affect(robot) {
    const { name } = robot;
    const components = componentsOf(robot);
    if (!components.length) return nothing;

    const fold = (/** @type {Event} */ event) => {
      if (/** @type {HTMLDetailsElement} */ (event.target).open) this.explained.add(name);
      else this.explained.delete(name);
      this.render();
    };
    const isOpen = this.explained.has(name);
    const place = placeOf(robot, this.felt.get(name) ?? new Map());

    return html`<details class="details affect" data-testid="affect" ?open=${isOpen} @toggle=${fold}><summary>Emotion</summary>
      ${isOpen
        ? html`<ul class="tree">${place.map(
              ({ depth, text, isHere }) =>
                html`<li class=${isHere ? "here" : ""} aria-current=${isHere ? "true" : nothing} .style=${`margin-inline-start:${depth}rem`}>${text}</li>`,
            )}</ul>
            <div class="widget table" tabindex="0"><table class="pairs"><tbody>${components.map(
              ({ name: component, value, meaning }) => html`<tr title=${meaning}><td>${component}</td><td>${value}</td></tr>`,
            )}</tbody></table></div>`
        : nothing}</details>`;
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
    const { widgets, details, buttons } = this.content(robot);
    const send = (/** @type {string} */ command) => this.actions.send(name, command);
    const fold = (/** @type {Event} */ event) => {
      if (/** @type {HTMLDetailsElement} */ (event.target).open) this.unfolded.add(name);
      else this.unfolded.delete(name);
      this.render();
    };

    return html`
      <section class="panel ${word} ${name === this.chosen ? "chosen" : ""}" data-testid="panel-${name}" aria-label=${name}>
        <header>
          <button type="button" class="name" title=${name} aria-pressed=${name === this.chosen} @click=${() => this.actions.choose(name)}>
            <span class="initials ${initials(name).length > 2 ? "three" : ""}" aria-hidden="true">${initials(name)}</span><h2>${name}</h2></button>
          <span class="presence ${seen}" title=${detail}><span class="dot ${seen}"></span><span
            data-testid="presence">${word}</span>${since ? html` <span class="since">${since}</span>` : nothing}</span>
        </header>
        <p class="where">${this.units.length(robot.location.x)}, ${this.units.length(robot.location.y)}
          <span>${this.units.speed(robot.speed_mps)}</span>
          ${robot.blocked ? html`<span class="blocked">blocked</span>` : nothing}</p>
        ${this.store.displaying.has(name) && !this.store.panels.has(name) && robot.presence === "here"
          ? html`<p class="no-panel" data-testid="no-panel">Without its own panel, which there is not of this tick.</p>`
          : nothing}
        <div class="widgets">${widgets.map((widget) => drawWidget(widget, send))}</div>
        ${this.affect(robot)}
        ${details.length
          ? html`<details class="details" data-testid="details" ?open=${this.unfolded.has(name)} @toggle=${fold}><summary>Details</summary>
              <div class="widgets">${this.unfolded.has(name) ? details.map((widget) => drawWidget(widget, send)) : nothing}</div></details>`
          : nothing}
        ${buttons.length && this.store.mode === "live" && !this.store.replayOf
          ? html`<div class="buttons" role="group" aria-label="Commands">${buttons.map((button) => drawWidget(button, send))}</div>`
          : nothing}
      </section>`;
  }
}

/**
 * A widget as people read it: the reason for an emotion is of the tick in which its episode began, and has the numbers of then.
 * @param {Widget} widget
 * @param {RobotFrame} robot
 * @param {import("./types/messages.js").WorldFrame | null} frame
 * @returns {Widget}
 */
function readable(widget, robot, frame) {
  if (widget?.widget !== "text" || !widget.text) return widget;
  // The name of the action tendency in the paper, which is no infinitive.
  if (widget.label === "inclined to" && widget.text === "free activate") return { ...widget, text: "free activation" };

  const { duration_s } = robot.state_variables;
  if (widget.label !== "why" || typeof duration_s !== "number" || !frame) return widget;
  const began_s = Math.max(0, frame.time_s - duration_s);
  return { ...widget, text: `At ${seconds(began_s, frame.tick_s)}, when this began: ${widget.text}` };
}

/**
 * @param {Widget[]} all
 * @returns {{widgets: Widget[], details: Widget[]}}
 */
function split(all) {
  const details = all.filter((widget) => DETAILS.includes(widget?.widget));
  if (details.length === all.length) return { widgets: all, details: [] };
  return { widgets: all.filter((widget) => !details.includes(widget)), details };
}
