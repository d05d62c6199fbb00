// @ts-check
// What was edited, to go back and forward. Every state is kept as its text.

/** Most steps that are kept. */
const MAX_STEPS = 200;
/** Edits of the same thing within this time are one step. */
const SAME_STEP_MS = 1000;

export class Undo {
  constructor() {
    /** @type {string[]} */
    this.past = [];
    /** @type {string[]} */
    this.future = [];
    this.now = "";
    this.what = "";
    this.at_ms = 0;
  }

  /** Forgets everything but a state. @param {unknown} state */
  begin(state) {
    this.past = [];
    this.future = [];
    this.now = JSON.stringify(state);
    this.what = "";
  }

  /**
   * Notes the state after an edit.
   * @param {unknown} state
   * @param {string} what was edited
   * @param {number} at_ms
   */
  note(state, what, at_ms) {
    const text = JSON.stringify(state);
    if (text === this.now) return;
    const isSameStep = what !== "" && what === this.what && at_ms - this.at_ms < SAME_STEP_MS;
    if (!isSameStep || this.past.length === 0) this.past.push(this.now);
    if (this.past.length > MAX_STEPS) this.past.shift();
    this.future = [];
    this.now = text;
    this.what = what;
    this.at_ms = at_ms;
  }

  /** The state before; null if there is none. @returns {unknown} */
  back() {
    return this.go(this.past, this.future);
  }

  /** The state that was undone last; null if there is none. @returns {unknown} */
  forward() {
    return this.go(this.future, this.past);
  }

  /**
   * @param {string[]} from
   * @param {string[]} to
   */
  go(from, to) {
    const text = from.pop();
    if (text === undefined) return null;
    to.push(this.now);
    this.now = text;
    this.what = "";
    return JSON.parse(text);
  }
}
