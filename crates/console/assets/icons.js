// @ts-check
// Icons of the buttons.

import { html } from "./vendor/lit-html.js";

/** @param {string} path */
const icon = (path) => html`<svg class="icon" viewBox="0 0 24 24" aria-hidden="true"><path d=${path}></path></svg>`;

export const ICONS = {
  init: icon("M5 5h2.6v14H5zM19 5v14L8.6 12z"),
  start: icon("M7 4.5v15L19.5 12z"),
  pause: icon("M6.5 5h4v14h-4zM13.5 5h4v14h-4z"),
  step: icon("M5 5v14l10.4-7zM16.4 5H19v14h-2.6z"),
  stop: icon("M6 6h12v12H6z"),
};
