// @ts-check
// Refusals with their reasons, and short confirmations.

import { html, nothing, render } from "./vendor/lit-html.js";

/** @typedef {import("./types/messages.js").ControlAnswer} ControlAnswer */

const NOTE_MS = 6000;

export class Notices {
  /**
   * @param {HTMLElement} place
   */
  constructor(place) {
    this.place = place;
    this.timer = 0;
    this.set("", false);
  }

  /** Confirms an action; disappears by itself. @param {string} text */
  note(text) {
    this.set(text, false);
    this.timer = window.setTimeout(() => this.clear(), NOTE_MS);
  }

  /** Shows why an action was refused; stays until the next action. @param {string} text */
  refusal(text) {
    this.set(text, true);
  }

  clear() {
    this.set("", false);
  }

  /**
   * Shows a refusal with its reason; any other answer removes an old refusal.
   * @param {ControlAnswer} answer
   * @param {string} note
   */
  show(answer, note = "") {
    if (answer.answer === "refused") this.refusal(answer.explanation);
    else if (note) this.note(note);
    else this.clear();
  }

  /**
   * @param {string} text
   * @param {boolean} isRefusal
   */
  set(text, isRefusal) {
    clearTimeout(this.timer);
    const close = html`<button type="button" class="close" aria-label="Dismiss" @click=${() => this.clear()}>×</button>`;

    render(
      html`<span data-testid="message" role="status">${text}</span>${text ? close : nothing}`,
      this.place,
    );

    this.place.className = text ? `notice${isRefusal ? " refusal" : ""}` : "notice empty";
  }
}
