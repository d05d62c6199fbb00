// @ts-check
// Speaks why a robot feels as it does, when that changes, with the browser's own voice. Off until the reader asks.

/** @typedef {import("./store.js").Store} Store */

/** The widget whose text is spoken. */
const LABEL = "why";
const LONGEST = 300;

export class Voice {
  /** @param {Store} store */
  constructor(store) {
    this.store = store;
    this.isOn = false;
    /** What each robot said last. @type {Map<string, string>} */
    this.said = new Map();
    /** What waits to be spoken, the newest of each robot. @type {Map<string, string>} */
    this.waiting = new Map();
    store.on("panel", () => this.listen());
  }

  get isPossible() {
    return "speechSynthesis" in window;
  }

  /** @param {boolean} isOn */
  turn(isOn) {
    this.isOn = isOn && this.isPossible;
    this.said.clear();
    this.waiting.clear();
    if (this.isPossible) speechSynthesis.cancel();
    if (this.isOn) this.listen();
  }

  listen() {
    if (!this.isOn) return;
    for (const [robot, panel] of this.store.panels) {
      const why = (panel.widgets ?? []).find((widget) => widget?.widget === "text" && widget.label === LABEL);
      if (why?.widget !== "text" || this.said.get(robot) === why.text) continue;
      this.said.set(robot, why.text);
      this.waiting.set(robot, why.text);
    }
    this.speak();
  }

  /** One at a time, so that nobody talks over another and old news is passed over. */
  speak() {
    const [next] = this.waiting;
    if (!this.isOn || !next || speechSynthesis.speaking || speechSynthesis.pending) return;
    const [robot, text] = next;
    this.waiting.delete(robot);
    const words = new SpeechSynthesisUtterance(`${robot}: ${text.slice(0, LONGEST)}`);
    words.lang = "en";
    words.addEventListener("end", () => this.speak());
    words.addEventListener("error", () => this.speak());
    speechSynthesis.speak(words);
  }
}
