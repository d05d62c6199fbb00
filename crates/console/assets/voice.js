// @ts-check
// Speaks the reason for a robot's emotion when it changes, with the browser's speech synthesis. Off by default.

/** @typedef {import("./store.js").Store} Store */

/** The widget whose text is spoken. */
const LABEL = "why";
const LONGEST = 300;

export class Voice {
  /** @param {Store} store */
  constructor(store) {
    this.store = store;
    this.isOn = false;
    /** The last text of each robot. @type {Map<string, string>} */
    this.last = new Map();
    /** The newest text of each robot that is not spoken yet. @type {Map<string, string>} */
    this.waiting = new Map();
    store.on("panel", () => this.update());
  }

  get isPossible() {
    return "speechSynthesis" in window;
  }

  /** @param {boolean} isOn */
  turn(isOn) {
    this.isOn = isOn && this.isPossible;
    this.last.clear();
    this.waiting.clear();
    if (this.isPossible) speechSynthesis.cancel();
    if (this.isOn) this.update();
  }

  update() {
    // What is said is of now.
    if (!this.isOn || this.store.isBack) return;

    for (const [robot, panel] of this.store.panels) {
      const why = (panel.widgets ?? []).find((widget) => widget?.widget === "text" && widget.label === LABEL);
      if (why?.widget !== "text" || this.last.get(robot) === why.text) continue;
      this.last.set(robot, why.text);
      this.waiting.set(robot, why.text);
    }

    this.speak();
  }

  /** Speaks one text at a time; older texts of the same robot are skipped. */
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
