// @ts-check
// First steps, for people who have opened the page for the first time. They can be put away for good.

import { keep, kept } from "./kept.js";
import { html, nothing, render } from "./vendor/lit-html.js";

const KEY = "cars-guide";
let isOpen = kept(KEY) === null;
/** Whether the steps are shown; until a person has chosen, before the run has begun. @type {boolean | null} */
let isUnfolded = null;

/**
 * Below the plan; when the run has begun, one line until it is unfolded.
 * @param {HTMLElement} place
 * @param {import("./store.js").Store} store
 */
export function renderGuide(place, store) {
  place.hidden = !isOpen || !store.hasGuide || store.failed !== null;
  render(place.hidden ? nothing : guide(place, store), place);
}

/**
 * @param {HTMLElement} place
 * @param {import("./store.js").Store} store
 */
function guide(place, store) {
  const close = (/** @type {boolean} */ isForGood) => {
    isOpen = false;
    if (isForGood) keep(KEY, "put away");
    renderGuide(place, store);
  };
  const hasNotBegun = store.phase === "ready" || store.phase === "gathering";
  const isLong = isUnfolded ?? hasNotBegun;
  const fold = () => {
    isUnfolded = !isLong;
    renderGuide(place, store);
  };

  return html`<header><h2>First steps</h2>
      <button type="button" data-testid="guide-fold" aria-expanded=${isLong} @click=${fold}>${isLong ? "Hide" : "Show"}</button>
      <button type="button" data-testid="guide-dismiss" @click=${() => close(true)}>Do not show again</button>
      <button type="button" class="close" aria-label="Close" data-testid="guide-close" @click=${() => close(false)}>×</button></header>
    ${isLong ? steps(hasNotBegun, store.run) : nothing}`;
}

/**
 * @param {boolean} hasNotBegun
 * @param {string} run
 */
function steps(hasNotBegun, run) {
  return html`<ol>
      <li><b>Look.</b> ${hasNotBegun ? html`The run waits: press <i>Start</i>. ` : nothing}A robot's ring is its emotion.</li>
      <li><b>Cut a link.</b> The tab <i>Experiment</i>, robots <i>from</i> and <i>to</i>, <i>Cut</i>.</li>
      <li><b>Why?</b> The panel beside the plan says <i>why</i> a robot feels so.</li>
      <li><b>Go back.</b> Drag the time line; after that <i>Back to now</i>.</li>
      <li><b>Verify.</b> In the end, in a terminal: <code data-testid="guide-verify">cars verify ${run}</code></li>
    </ol>`;
}
