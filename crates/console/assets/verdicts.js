// @ts-check
// How the expectations of the scenario stand, as one chip: the worst verdict first, and how many hold. It unfolds.

import { html, nothing, render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./types/messages.js").Verdict} Verdict */
/** @typedef {Verdict | "open"} Standing */

/** From the worst on: a mark for each, so that it does not depend on color, and its words.
 * @type {[Standing, {mark: string, one: string, many: string}][]} */
const STANDINGS = [
  ["fail", { mark: "✗", one: "fails", many: "fail" }],
  ["undecided", { mark: "?", one: "undecided", many: "undecided" }],
  ["open", { mark: "…", one: "open", many: "open" }],
  ["unreached", { mark: "–", one: "unreached", many: "unreached" }],
  ["not_asked", { mark: "–", one: "not asked", many: "not asked" }],
  ["pass", { mark: "✓", one: "holds", many: "hold" }],
];
let isOpen = false;

/**
 * @param {{chip: HTMLElement, list: HTMLElement}} places
 * @param {Store} store
 */
export function renderVerdicts({ chip, list }, store) {
  const expectations = (store.frame?.expectations ?? []).map(({ expectation, verdict }) => ({ expectation, standing: verdict ?? "open" }));
  const groups = STANDINGS.map(([standing, words]) => ({ standing, words, all: expectations.filter((one) => one.standing === standing) }));
  const found = groups.filter(({ all }) => all.length > 0);

  const toggle = () => {
    isOpen = !isOpen;
    renderVerdicts({ chip, list }, store);
  };
  const counts = found.map(({ words, all }, i) => `${all.length}${i === 0 ? ` of ${expectations.length}` : ""} ${all.length === 1 ? words.one : words.many}`);
  const worst = found[0];
  render(
    worst
      ? html`<button type="button" class="verdict ${worst.standing}" data-testid="verdicts-chip" aria-expanded=${isOpen} aria-controls=${list.id}
          title="expectations of the scenario" @click=${toggle}><span class="mark" aria-hidden="true">${worst.words.mark}</span>
          <span>${counts.join(", ")}</span><span class="fold" aria-hidden="true">${isOpen ? "▴" : "▾"}</span></button>`
      : nothing,
    chip,
  );

  list.hidden = !isOpen || !worst;
  const entries = found.flatMap(({ standing, words, all }) =>
    all.map(({ expectation }) => html`<li class="verdict ${standing}" data-testid="verdict">
      <span class="mark" aria-hidden="true">${words.mark}</span> <span class="word">${standing.replace("_", " ")}</span> <span>${expectation}</span></li>`),
  );
  render(html`${entries}<li class="more" aria-hidden="true" data-testid="verdicts-more"></li>`, list);
  list.onscroll = () => countHidden(list);
  requestAnimationFrame(() => countHidden(list));
}

/** Says how many entries are below those that are seen. @param {HTMLElement} list */
function countHidden(list) {
  const more = list.querySelector(".more");
  if (!more || list.hidden) return;
  const { bottom } = list.getBoundingClientRect();
  const hidden = [...list.querySelectorAll(".verdict")].filter((entry) => entry.getBoundingClientRect().bottom > bottom + 1);
  more.textContent = hidden.length ? `↓ ${hidden.length} more` : "";
}
