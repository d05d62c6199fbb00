// @ts-check
// The emotions of the legend, each with its color: those that robots have had in what is shown.

import { hatchingPath, stateLook } from "./palette.js";
import { html, render, svg } from "./vendor/lit-html.js";

/** Most emotions in the legend: a robot may have any. */
const MAX_EMOTIONS = 15;

/**
 * @param {HTMLElement} place
 * @param {import("./store.js").Store} store
 */
export function renderEmotions(place, store) {
  const now = (store.frame?.robots ?? []).map((robot) => robot.emotion_state);
  const names = [...new Set([...store.history.emotions, ...now])].filter(Boolean).sort();
  const more = names.length - MAX_EMOTIONS;

  render(
    html`${names.slice(0, MAX_EMOTIONS).map((name) => {
      const { area, hatching } = stateLook("emotion", name);
      return html`<span class="emotion" data-testid="legend-emotion"><svg class="cars-diagram symbol" viewBox="0 0 16 16"
          aria-hidden="true"><rect class=${area} width="16" height="16"></rect>${
            hatching ? svg`<path class="over" d=${hatchingPath(hatching, 0, 0, 16, 16)}></path>` : ""
          }</svg>${name}</span>`;
    })}${more > 0 ? html`<span>and ${more} more</span>` : ""}`,
    place,
  );
}
