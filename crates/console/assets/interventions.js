// @ts-check
// Experiments by hand, in a tab: links are cut, robots stopped, parameters changed. What is in effect is listed, and can be undone.

import { seconds } from "./units.js";
import { html, nothing, render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Control} Control */
/** @typedef {import("./types/messages.js").Intervention} Intervention */
/** @typedef {import("./types/messages.js").FaultKind} FaultKind */
/** Something that is in effect, and what ends it. @typedef {{text: string, undo: string, act: () => void}} Effect */

/** @type {Record<FaultKind, {state: string, undo: string}>} */
const KINDS = {
  crash: { state: "is killed", undo: "Start again" },
  hang: { state: "is stopped", undo: "Go on" },
  slow: { state: "is slowed down", undo: "Let it run" },
  restart: { state: "starts again", undo: "" },
};

const HEAL = "Heal";
const OF_NOW = "Only the present can be changed.";
/** Most effects that are listed one by one. */
const MAX_EFFECTS = 12;
/** By how much the next command is delayed, seconds. */
const DELAY_S = 5;

export class Interventions {
  /**
   * @param {{menu: HTMLElement, effects: HTMLElement}} places
   * @param {Store} store
   * @param {{act: (control: Control, note: string) => Promise<boolean>, save: () => void, close: () => void, live: () => void}} client
   */
  constructor(places, store, client) {
    this.places = places;
    this.store = store;
    this.client = client;
    /** The robots of the two groups. @type {[Set<string>, Set<string>]} */
    this.groups = [new Set(), new Set()];
    this.isOneWay = false;
    this.robot = "";
    this.path = "";
    this.value = "";

    places.menu.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.client.close();
    });
  }

  /** Whether something can be done: to a run in progress, and not to a recording. */
  get isPossible() {
    const { store } = this;
    return store.mode === "live" && store.isLive && !store.replayOf && store.phase !== "ended";
  }

  get names() {
    return (this.store.frame?.robots ?? []).map((robot) => robot.name);
  }

  /** Makes the menu about a robot. @param {string} robot */
  about(robot) {
    this.robot = robot;
    this.groups = [new Set([robot]), new Set()];
    this.render();
  }

  /** @param {Intervention} what */
  do(what) {
    return this.client.act({ do: "intervene", what }, "It takes effect with the next tick, and is part of the record.");
  }

  render() {
    const { menu, effects } = this.places;
    render(this.isPossible && !menu.hidden ? this.menu() : nothing, menu);

    const listed = this.isPossible ? this.inEffect() : [];
    effects.hidden = listed.length === 0;
    render(listed.length ? this.list(listed) : nothing, effects);
  }

  /** What is in effect in the tick that is shown. @returns {Effect[]} */
  inEffect() {
    const { frame, status, isBack } = this.store;
    /** @type {Effect[]} */
    const effects = [];

    const cuts = frame?.cuts ?? [];
    const isCut = (/** @type {string} */ from, /** @type {string} */ to) => cuts.some((cut) => cut.from === from && cut.to === to);
    for (const { from, to } of cuts) {
      const isBoth = isCut(to, from);
      if (isBoth && from > to) continue;
      effects.push({
        text: `${from} ${isBoth ? "–" : "→"} ${to} is cut`,
        undo: HEAL,
        act: () => this.do({ intervention: "heal", from: [from], to: [to], one_way: !isBoth }),
      });
    }
    for (const { robot, kind } of frame?.faults ?? []) {
      const { state, undo } = KINDS[kind];
      effects.push({ text: `${robot} ${state}`, undo, act: () => this.do({ intervention: "recover", robot }) });
    }
    // How late robots are treated is known of now only.
    for (const { name, on_late } of isBack ? [] : (status?.robots ?? [])) {
      if (on_late === status?.on_late || on_late !== "continue") continue;
      effects.push({
        text: `the clock goes on without ${name} when it is late`,
        undo: "Wait for it",
        act: () => this.client.act({ do: "late", robot: name, on_late: "wait" }, `The clock waits for ${name} again.`),
      });
    }
    return effects;
  }

  /** @param {Effect[]} effects */
  list(effects) {
    const shown = effects.slice(0, MAX_EFFECTS);
    const rest = effects.length - shown.length;
    const hasCuts = effects.filter(({ undo }) => undo === HEAL).length > 1;
    const { isBack } = this.store;

    return html`
      ${isBack ? html`<b data-testid="effects-time">at ${this.time}:</b>` : nothing}
      <ul>${shown.map(
        ({ text, undo, act }) => html`<li><span>${text}</span>
          <button type="button" data-testid="undo-effect" aria-label="${undo}: ${text}" ?disabled=${isBack}
            title=${isBack ? OF_NOW : nothing} @click=${act}>${undo}</button></li>`,
      )}
      ${rest > 0 ? html`<li>and ${rest} more</li>` : nothing}</ul>
      ${hasCuts ? html`<button type="button" data-testid="heal-all" ?disabled=${isBack} @click=${() => this.do({ intervention: "heal" })}>Heal all links</button>` : nothing}`;
  }

  /** The time that is shown. */
  get time() {
    const { frame } = this.store;
    return frame ? seconds(frame.time_s, frame.tick_s) : "";
  }

  menu() {
    const { names } = this;
    const { isBack } = this.store;
    if (!names.includes(this.robot)) this.robot = names[0] ?? "";
    const choose = (/** @type {Event} */ event) => {
      this.robot = /** @type {HTMLSelectElement} */ (event.target).value;
      this.render();
    };

    return html`
      ${isBack
        ? html`<p class="of-past" role="status" data-testid="experiment-past">This is the past, at ${this.time}. ${OF_NOW}
            <button type="button" @click=${() => this.client.live()}>Back to now</button></p>`
        : nothing}
      <div class="experiment">
      <fieldset ?disabled=${isBack}><legend>A robot</legend>
        <select aria-label="Robot" data-testid="experiment-robot" .value=${this.robot} @change=${choose}>
          ${names.map((name) => html`<option value=${name} ?selected=${name === this.robot}>${name}</option>`)}</select>
        <div class="row">${this.faults()}</div>
      </fieldset>
      <fieldset ?disabled=${isBack}><legend>Its parameters</legend>${this.parameter()}</fieldset>
      <fieldset ?disabled=${isBack}><legend>Links</legend>${this.links()}</fieldset>
      <button type="button" data-testid="experiment-save" title="the scenario, with what was done by hand as changes of it"
        @click=${() => this.client.save()}>Save as a scenario</button></div>`;
  }

  faults() {
    const { robot } = this;
    const held = (this.store.frame?.faults ?? []).find((fault) => fault.robot === robot);
    if (held) {
      return html`<span>${robot} ${KINDS[held.kind].state}.</span>
        <button type="button" class="primary" data-testid="do-recover" @click=${() => this.do({ intervention: "recover", robot })}>${KINDS[held.kind].undo}</button>`;
    }

    const kinds = /** @type {const} */ ([["hang", "Stop"], ["crash", "Kill"], ["restart", "Restart"]]);
    return kinds.map(
      ([kind, label]) => html`<button type="button" data-testid="do-${kind}" @click=${() => this.do({ intervention: "fault", robot, kind })}>${label}</button>`,
    );
  }

  parameter() {
    const typed = (/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.target).value;
    const set = (/** @type {Event} */ event) => {
      event.preventDefault();
      this.do({ intervention: "set", set: [`robot.${this.robot}.params.${this.path.trim()}=${this.value.trim()}`] });
    };

    return html`<form class="row" @submit=${set}>
      <label class="field"><span>name</span><input type="text" required data-testid="experiment-path" placeholder="policy"
        autocomplete="off" spellcheck="false" .value=${this.path} @input=${(/** @type {Event} */ e) => (this.path = typed(e))} /></label>
      <label class="field"><span>value</span><input type="text" required data-testid="experiment-value" placeholder="rules"
        autocomplete="off" spellcheck="false" .value=${this.value} @input=${(/** @type {Event} */ e) => (this.value = typed(e))} /></label>
      <button type="submit" data-testid="do-set" title="the robot starts again with it, between two ticks">Change</button></form>`;
  }

  links() {
    const [from, to] = this.groups.map((group) => [...group].filter((name) => this.names.includes(name)));
    const isEmpty = from.length === 0 || to.length === 0;
    const isLink = from.length === 1 && to.length === 1;
    const toggle = (/** @type {Event} */ event) => {
      this.isOneWay = /** @type {HTMLInputElement} */ (event.target).checked;
    };

    return html`
      ${this.group(0, "from")} ${this.group(1, "to")}
      <label class="check"><input type="checkbox" data-testid="experiment-one-way" .checked=${this.isOneWay} @change=${toggle} />
        <span>one way only</span></label>
      <div class="row">
        <button type="button" data-testid="do-cut" ?disabled=${isEmpty}
          @click=${() => this.do({ intervention: "cut", from, to, one_way: this.isOneWay })}>Cut</button>
        <button type="button" data-testid="do-heal" ?disabled=${isEmpty}
          @click=${() => this.do({ intervention: "heal", from, to, one_way: this.isOneWay })}>Heal</button>
        <button type="button" data-testid="do-lose" ?disabled=${!isLink} title="of the commands from the one robot to the other"
          @click=${() => this.do({ intervention: "lose", from: from[0], to: to[0] })}>Lose the next command</button>
        <button type="button" data-testid="do-delay" ?disabled=${!isLink} title="the next command from the one robot to the other arrives this much later"
          @click=${() => this.do({ intervention: "delay", from: from[0], to: to[0], by_s: DELAY_S })}>Delay it by ${DELAY_S} s</button>
        <button type="button" data-testid="do-duplicate" ?disabled=${!isLink} title="the next command from the one robot to the other arrives twice"
          @click=${() => this.do({ intervention: "duplicate", from: from[0], to: to[0] })}>Double it</button>
      </div>`;
  }

  /**
   * A robot is in one of the groups at most.
   * @param {0 | 1} which
   * @param {string} label
   */
  group(which, label) {
    const toggle = (/** @type {string} */ name) => {
      const own = this.groups[which];
      if (!own.delete(name)) {
        own.add(name);
        this.groups[1 - which].delete(name);
      }
      this.render();
    };

    return html`<div class="chips" role="group" aria-label=${label}><span>${label}</span>${this.names.map(
      (name) => html`<button type="button" class="chip" aria-pressed=${this.groups[which].has(name)} data-testid="${label}-${name}"
        @click=${() => toggle(name)}>${name}</button>`,
    )}</div>`;
  }
}
