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
 * @property {() => Draft | null} draft the changes of the set-up that are not applied; null if there are none
 */

/**
 * @typedef {object} Draft
 * @property {() => Promise<boolean>} apply begins the next epoch with them; resolves with whether it was accepted
 * @property {() => void} revert gives them up
 */

/** A question before something is done. @typedef {{label: string, text: string, back: string, answers: Answer[]}} Question */
/** @typedef {{name: string, label: string, tone: "" | "primary" | "danger", act: () => void}} Answer */

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
    /** The question that is open. @type {Question | null} */
    this.question = null;

    document.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.key === "Escape" && this.question) return this.ask(null);

    // The keys of a list or a question that is open are its own.
    if (document.querySelector("dialog[open]")) return;

    const { target } = event;
    const isTyping = target instanceof HTMLElement && target.closest("input:not([type=range]), select, textarea") !== null;
    const isPressing = target instanceof HTMLElement && target.closest("button, summary, label") !== null;
    if (isTyping || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;

    if (event.key === " " && !isPressing) {
      event.preventDefault();
      if (this.store.mode === "live" && this.store.phase !== "running") this.begin("start");
      else this.transport.toggle();
    } else if (event.key === ".") {
      this.transport.step();
    } else if (event.key === "?") {
      this.transport.help();
    }
  }

  /** Asks, or takes a question back. @param {Question | null} question */
  ask(question) {
    const back = this.question?.back;
    this.question = question;
    this.render();
    const next = question ? question.answers[0].name : back;
    if (next) /** @type {HTMLElement | null} */ (this.place.querySelector(`[data-testid="${next}"]`))?.focus();
  }

  /** Whether the next epoch would end one that has begun and is not over. A replay can be seen again. */
  get isInProgress() {
    const { live, phase, replayOf } = this.store;
    return (phase === "running" || phase === "paused") && (live?.tick ?? 0) > 0 && !replayOf;
  }

  /** How far the run is that would end, in words. */
  get end() {
    const { live } = this.store;
    if (!live) return "";
    const [time, of] = [live.time_s, live.duration_s].map((time_s) => seconds(time_s, live.tick_s));
    return `This ends the run in progress at ${time} of ${of}. What was recorded stays.`;
  }

  /**
   * Asks before a run in progress is ended.
   * @param {string} label of what ends it
   * @param {string} back what was pressed
   * @param {() => void} act
   */
  askToEnd(label, back, act) {
    if (!this.isInProgress) return act();
    this.ask({
      label: "End of the run",
      text: `${this.end} The next epoch begins at tick 0.`,
      back,
      answers: [
        { name: "end-run", label, tone: "danger", act },
        { name: "end-run-cancel", label: "Go on with it", tone: "", act: () => {} },
      ],
    });
  }

  /**
   * Starts the clock or begins the next epoch. Changes of the set-up that are not applied are asked about, and the end of a run
   * that is in progress.
   * @param {"start" | "init"} what
   */
  begin(what) {
    const { control, draft } = this.transport;
    const changed = draft();
    if (!changed && what === "init") return this.askToEnd("End it and begin again", "btn-init", () => control({ do: what }));
    if (!changed) return control({ do: what });

    const isStart = what === "start";
    const apply = async () => {
      const isAccepted = await changed.apply();
      if (isAccepted && isStart) control({ do: "start" });
    };
    const discard = () => {
      changed.revert();
      control({ do: what });
    };
    this.ask({
      label: "Changes of the set-up",
      text: `The set-up has changes that are not applied. They take effect with the next epoch, from tick 0 on. ${this.isInProgress ? this.end : ""}`,
      back: `btn-${what}`,
      answers: [
        { name: "draft-apply", label: isStart ? "Apply them and start" : "Apply them", tone: "primary", act: apply },
        { name: "draft-discard", label: isStart ? "Start without them" : "Init without them", tone: "", act: discard },
      ],
    });
  }

  render() {
    const { store } = this;
    const phase = store.phase ?? "–";
    const word = store.mode === "recording" ? (PLAYING[phase] ?? phase) : phase;
    const frame = store.frame;
    const letters = frame ? 2 * seconds(frame.duration_s, frame.tick_s).length + 4 : 0;

    render(
      html`
        <div class="brand"><h1>CARS</h1><span class="run" title=${store.run} data-testid="run">${store.run}</span></div>
        <div class="now">
          <span class="pill ${store.isPast ? "" : `phase-${phase}`}" data-testid="phase">${word}</span>
          <span class="count">tick <b data-testid="tick">${frame?.tick ?? this.store.status?.tick ?? "–"}</b></span>
          <span class="count" .style=${`--letters:${letters}`}><b data-testid="time">${frame ? seconds(frame.time_s, frame.tick_s) : "–"}</b>${
            frame ? html` of ${seconds(frame.duration_s, frame.tick_s)}` : nothing
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
      { name: "init", label: "Init", hint: "back to tick 0: the next epoch", act: () => this.begin("init") },
      { name: "start", label: "Start", hint: "let the clock run (space)", act: () => this.begin("start") },
      { name: "pause", label: "Pause", hint: "hold the clock (space)", act: () => control({ do: "pause" }) },
      { name: "step", label: "Step", hint: "one tick (.)", act: () => control({ do: "step", n: 1 }) },
      { name: "stop", label: "Stop", hint: "end the run for good", act: () => this.ask(this.question ? null : this.stopQuestion()) },
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
        ${this.question ? this.open(this.question) : nothing}
      </div>`;
  }

  /** @returns {Question} */
  stopQuestion() {
    return {
      label: "Stop",
      text: "End this run for good? The simulator and its robots end; what was recorded stays.",
      back: "btn-stop",
      answers: [
        { name: "btn-stop-confirm", label: "End the run", tone: "danger", act: () => this.transport.control({ do: "stop" }) },
        { name: "btn-stop-cancel", label: "Keep it", tone: "", act: () => {} },
      ],
    };
  }

  /** @param {Question} question */
  open({ label, text, answers }) {
    const answer = (/** @type {Answer} */ { act }) => {
      this.ask(null);
      act();
    };

    return html`
      <div class="question" role="alertdialog" aria-label=${label} data-testid="question">
        <p>${text}</p>
        <div class="row">${answers.map(
          (one) => html`<button type="button" class=${one.tone} data-testid=${one.name} @click=${() => answer(one)}>${one.label}</button>`,
        )}
        ${answers.some(({ name }) => name.endsWith("cancel"))
          ? nothing
          : html`<button type="button" data-testid="question-cancel" @click=${() => this.ask(null)}>Cancel</button>`}</div>
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
 * @param {(robot: string) => void} goOn has the clock go on without a robot
 */
export function renderAwaiting(place, store, goOn) {
  const awaiting = store.awaiting();
  place.hidden = awaiting.length === 0;
  const isOpen = store.mode === "live" && !store.replayOf && store.phase !== "gathering";
  const who = awaiting.map(
    ({ name, since_s, because: why }) =>
      html`<li><b>${name}</b> (${because(why)}) for <span class="since">${since_s.toFixed(0)} s</span>
        ${isOpen ? html`<button type="button" data-testid="go-on-${name}" @click=${() => goOn(name)}>Go on without it</button>` : nothing}</li>`,
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
