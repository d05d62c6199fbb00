// @ts-check
// Buttons and scrub bar of a recording.

import { ICONS } from "./icons.js";
import { html, nothing, render } from "./vendor/lit-html.js";

/**
 * @param {HTMLElement} place
 * @param {import("./recording.js").Player} player
 */
export function renderScrub(place, player) {
  place.hidden = player.header === null;
  const seek = (/** @type {Event} */ event) => {
    const tick = Number(/** @type {HTMLInputElement} */ (event.target).value);
    player.isPlaying = false;
    player.seek(tick);
  };

  const time_s = player.tick * (player.header?.tick_s ?? 0);
  const bar = html`
    <button type="button" class="primary" data-testid="play" aria-pressed=${player.isPlaying} @click=${() => player.toggle()}>
      ${player.isPlaying ? ICONS.pause : ICONS.start}<span>${player.isPlaying ? "Pause" : "Play"}</span></button>
    <button type="button" data-testid="step" title="one tick (.)" @click=${() => player.step(1)}>${ICONS.step}<span>Step</span></button>
    <input type="range" data-testid="scrub" aria-label="Tick" aria-valuetext="tick ${player.tick}, ${time_s.toFixed(1)} s"
      min="0" max=${player.last} step="1" .value=${String(Math.max(0, player.tick))} @input=${seek} />
    <span class="count">${time_s.toFixed(1)} / ${(player.last * (player.header?.tick_s ?? 0)).toFixed(1)} s</span>`;

  render(player.header ? bar : nothing, place);
}
