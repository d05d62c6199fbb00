// @ts-check
// How the expectations of the scenario stand: a mark, the verdict as a word, and the name of each.

import { html, render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Verdict} Verdict */

/** A mark for each verdict, so that it does not depend on color. @type {Record<Verdict | "open", string>} */
const MARKS = { pass: "✓", fail: "✗", undecided: "?", not_asked: "–", open: "…" };

/**
 * @param {HTMLElement} place
 * @param {Store} store
 */
export function renderVerdicts(place, store) {
  const standings = store.frame?.expectations ?? [];
  place.hidden = standings.length === 0;

  const entries = standings.map(({ expectation, verdict }) => {
    const stands = verdict ?? "open";
    return html`<li class="verdict ${stands}" data-testid="verdict">
      <span class="mark" aria-hidden="true">${MARKS[stands]}</span> <span class="word">${stands.replace("_", " ")}</span> <span>${expectation}</span></li>`;
  });
  render(html`${entries}`, place);
}
