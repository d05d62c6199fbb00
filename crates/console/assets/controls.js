// @ts-check
// The bar on top: phase and time, buttons as on a CD player, and the speed.

import { ICONS } from "./icons.js";
import { because } from "./presence.js";
import { seconds } from "./units.js";
import { html, nothing, render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Control} Control */
/** @typedef {{name: string, label: string, hint: string, act: () => void}} Button */

const SPEEDS = ["0.5", "1", "2", "5", "10", "20", "max"];
/** Words for the phases of a recording. @type {Record<string, string>} */
const PLAYING = { running: "playing", ended: "at the end" };

/**
 * What the buttons control: the simulator or the player of a recording.
 * @typedef {object} Transport
 * @property {(control: Control) => void} control
 * @property {(factor: number | null) => Promise<boolean>} speed resolves with whether it was accepted
 * @property {() => void} toggle start or pause
 * @property {() => void} step
 * @property {() => void} help shows the keys
 */

export class Controls {
  /**
   * @param {HTMLElement} place
   * @param {Store} store
   * @param {Transport} transport
   */
  constructor(place, store, transport) {
    this.place = place;
    this.store = store;
    this.transport = transport;
    this.isStopAsked = false;

    document.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.key === "Escape" && this.isStopAsked) return this.askStop(false);

    // The keys of a list or a question that is open are its own.
    if (document.querySelector("dialog[open]")) return;

    const { target } = event;
    const isTyping = target instanceof HTMLElement && target.closest("input:not([type=range]), select, textarea") !== null;
    const isPressing = target instanceof HTMLElement && target.closest("button, summary, label") !== null;
    if (isTyping || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;

    if (event.key === " " && !isPressing) {
      event.preventDefault();
      this.transport.toggle();
    } else if (event.key === ".") {
      this.transport.step();
    } else if (event.key === "?") {
      this.transport.help();
    }
  }

  /** @param {boolean} isAsked */
  askStop(isAsked) {
    this.isStopAsked = isAsked;
    this.render();
    const next = isAsked ? "btn-stop-confirm" : "btn-stop";
    /** @type {HTMLElement | null} */ (this.place.querySelector(`[data-testid="${next}"]`))?.focus();
  }

  render() {
    const { store } = this;
    const phase = store.phase ?? "–";
    const word = store.mode === "recording" ? (PLAYING[phase] ?? phase) : phase;
    const frame = store.frame;

    render(
      html`
        <div class="brand"><h1>CARS</h1><span class="run" title=${store.run} data-testid="run">${store.run}</span></div>
        <div class="now">
          <span class="pill ${store.isPast ? "" : `phase-${phase}`}" data-testid="phase">${word}</span>
          <span class="count">tick <b data-testid="tick">${frame?.tick ?? this.store.status?.tick ?? "–"}</b></span>
          <span class="count"><b data-testid="time">${frame ? seconds(frame.time_s) : "–"}</b>${
            frame ? html` of ${seconds(frame.duration_s)}` : nothing
          }</span>
        </div>
        ${store.mode === "recording" ? nothing : this.buttons()}
        <label class="field inline" title="simulated seconds for one of yours">
          <span>Speed</span>
          <select data-testid="speed" aria-label="Display speed" .value=${this.speed()} @change=${this.chooseSpeed}>
            ${this.speeds().map((name) => html`<option value=${name} ?selected=${name === this.speed()}>${name === "max" ? "max" : `${name}×`}</option>`)}
          </select>
        </label>
        ${this.connectionState()}
      `,
      this.place,
    );
  }

  speed() {
    const speed = this.store.frame ? this.store.frame.speed : this.store.status?.speed;
    return speed === undefined ? "1" : speed === null ? "max" : String(speed);
  }

  /** A launch may have set a speed that is not in the list. */
  speeds() {
    const speed = this.speed();
    return SPEEDS.includes(speed) ? SPEEDS : [...SPEEDS, speed];
  }

  /** @type {(event: Event) => void} */
  chooseSpeed = (event) => {
    const select = /** @type {HTMLSelectElement} */ (event.target);
    this.transport.speed(select.value === "max" ? null : Number(select.value)).then((isAccepted) => {
      if (!isAccepted) select.value = this.speed();
    });
  };

  buttons() {
    const { control } = this.transport;
    const phase = this.store.phase;
    /** @type {Button[]} */
    const buttons = [
      { name: "init", label: "Init", hint: "back to tick 0: the next epoch", act: () => control({ do: "init" }) },
      { name: "start", label: "Start", hint: "let the clock run (space)", act: () => control({ do: "start" }) },
      { name: "pause", label: "Pause", hint: "hold the clock (space)", act: () => control({ do: "pause" }) },
      { name: "step", label: "Step", hint: "one tick (.)", act: () => control({ do: "step", n: 1 }) },
      { name: "stop", label: "Stop", hint: "end the run for good", act: () => this.askStop(!this.isStopAsked) },
    ];

    const next = phase === "running" ? "pause" : phase === "ended" ? "init" : "start";

    return html`
      <div class="transport" role="group" aria-label="Simulation">
        ${buttons.map(
          ({ name, label, hint, act }) => html`
            <button type="button" class=${name === next && this.store.isLive ? "next" : ""} data-testid="btn-${name}" title=${hint}
              @click=${(/** @type {MouseEvent} */ event) => press(event, act)}>
              ${ICONS[/** @type {keyof typeof ICONS} */ (name)]}<span>${label}</span>
            </button>`,
        )}
        ${this.isStopAsked ? this.stopQuestion() : nothing}
      </div>`;
  }

  stopQuestion() {
    const stop = () => {
      this.askStop(false);
      this.transport.control({ do: "stop" });
    };

    return html`
      <div class="question" role="alertdialog" aria-label="Stop">
        <p>End this run for good? The simulator and its robots end; what was recorded stays.</p>
        <div class="row">
          <button type="button" class="danger" data-testid="btn-stop-confirm" @click=${stop}>End the run</button>
          <button type="button" data-testid="btn-stop-cancel" @click=${() => this.askStop(false)}>Keep it</button>
        </div>
      </div>`;
  }

  connectionState() {
    const { store } = this;
    let word = "no simulator";
    let tone = "warning";

    if (store.stranger) {
      word = "another run has the address";
      tone = "bad";
    } else if (store.mode === "recording") {
      word = "recording";
      tone = "neutral";
    } else if (!store.isConnected) {
      word = "console not reachable";
      tone = "bad";
    } else if (store.isSimulatorPresent && store.replayOf) {
      word = `replay of ${store.replayOf}`;
      tone = "neutral";
    } else if (store.isSimulatorPresent) {
      word = "connected";
      tone = "good";
    }

    return html`<span class="connection"><span class="dot ${tone}"></span><span data-testid="connection">${word}</span></span>`;
  }
}

/**
 * The robots that the clock waits for, since when and why.
 * @param {HTMLElement} place
 * @param {Store} store
 */
export function renderAwaiting(place, store) {
  const awaiting = store.awaiting();
  place.hidden = awaiting.length === 0;
  const who = awaiting.map(
    ({ name, since_s, because: why }) =>
      html`<li><b>${name}</b> (${because(why)}) for <span class="since">${since_s.toFixed(0)} s</span></li>`,
  );

  render(awaiting.length ? html`<span>The clock has been waiting for</span><ul>${who}</ul>` : nothing, place);
}

/**
 * Removes the focus from a button that was clicked, so that the space bar does not click it again instead of pausing.
 * @param {MouseEvent} event
 * @param {() => void} act
 */
function press(event, act) {
  if (event.detail > 0) /** @type {HTMLElement} */ (event.currentTarget).blur();
  act();
}
