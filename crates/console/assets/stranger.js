// @ts-check
// Another run has the address of this page: what is shown stays until the reader chooses.

import { html, nothing, render } from "./vendor/lit-html.js";

/** The one that the reader has been told of and has declined. @type {import("./connection.js").Stranger | null} */
let declined = null;

/**
 * @param {HTMLElement} place
 * @param {import("./store.js").Store} store
 */
export function renderStranger(place, store) {
  const { stranger } = store;
  const isTold = stranger !== null && stranger.run === declined?.run;
  place.hidden = stranger === null || isTold;
  if (stranger === null) declined = null;

  const keep = () => {
    declined = stranger;
    renderStranger(place, store);
  };
  const what = stranger?.run ? html`shows <b>${stranger.run}</b> now` : "has another console now, or asks for its token again";
  const banner = html`
    <p>The address of this page ${what}. What you see is still <b>${store.run}</b>, as it was last.</p>
    <span class="row">
      <button type="button" class="primary" data-testid="stranger-show" @click=${leave}>${stranger?.run ? "Show it" : "Leave this page"}</button>
      <button type="button" data-testid="stranger-keep" @click=${keep}>Keep this</button></span>`;

  render(place.hidden ? nothing : banner, place);
}

/** A new page begins without anything of this one, also without the tick in its address. */
function leave() {
  history.replaceState(null, "", location.pathname);
  location.reload();
}
