// @ts-check
// A run that has failed: which process, its last words, and how the run goes on.

import { html, nothing, render } from "./vendor/lit-html.js";

/** Whether the launcher has been asked to resume the run that the page shows as failed. */
let isResuming = false;

/**
 * @param {HTMLElement} place
 * @param {import("./store.js").Store} store
 * @param {() => Promise<boolean>} resume resolves with whether the launcher does so
 */
export function renderFailed(place, store, resume) {
  const { failed } = store;
  place.hidden = failed === null;
  if (!failed) isResuming = false;

  const go = async () => {
    isResuming = true;
    renderFailed(place, store, resume);
    isResuming = await resume();
    renderFailed(place, store, resume);
  };
  render(failed ? banner(failed, store.isConnected, go) : nothing, place);
}

/**
 * @param {import("./connection.js").Failed} failed
 * @param {boolean} isConnected
 * @param {() => void} go
 */
function banner({ text, lines, log, command }, isConnected, go) {
  const canGo = isConnected && !isResuming;
  return html`<details open>
    <summary data-testid="failed-summary">The run has failed</summary>
    <p><b>${text}</b>, and the run ended. What was recorded until then is kept.</p>
    ${lines.length ? html`<pre data-testid="failed-lines">${lines.join("\n")}</pre>` : html`<p>It wrote no errors.</p>`}
    <p class="muted">Its log: <code>${log}</code></p>
    <div class="row">
      <button type="button" class="primary" data-testid="resume" ?disabled=${!canGo} @click=${go}>${isResuming ? "Resuming …" : "Resume"}</button>
      <span>starts the processes again and goes on after the last tick, as this does in a terminal: <code data-testid="resume-command">${command}</code></span>
    </div>
  </details>`;
}
