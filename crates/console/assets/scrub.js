// @ts-check
// The time line: a bar with the ticks that can be shown, marks of what stands out, and a way back to the run in progress.

import { ICONS } from "./icons.js";
import { seconds } from "./units.js";
import { html, nothing, render } from "./vendor/lit-html.js";

/** @typedef {import("./recording.js").Player} Player */
/** @typedef {import("./window.js").TimeWindow} TimeWindow */

/** Least distance between two marks. */
const MARK_PX = 7;

/**
 * @param {HTMLElement} place
 * @param {Player} player
 * @param {TimeWindow} shown
 */
export function renderScrub(place, player, shown) {
  const { store } = player;
  const isShown = store.frame !== null && (player.header !== null || store.live !== null);
  place.hidden = !isShown;
  if (!isShown) return render(nothing, place);

  const seek = (/** @type {Event} */ event) => {
    player.isPlaying = false;
    player.seek(Number(/** @type {HTMLInputElement} */ (event.target).value));
  };
  const { tick, first, last, tick_s } = player;
  const time_s = tick * tick_s;
  const buttons = html`
    <button type="button" class="primary" data-testid="play" aria-pressed=${player.isPlaying} @click=${() => player.toggle()}>
      ${player.isPlaying ? ICONS.pause : ICONS.start}<span>${player.isPlaying ? "Pause" : "Play"}</span></button>
    <button type="button" data-testid="step" title=${store.mode === "recording" ? "one tick (.)" : "one tick"} @click=${() => player.step(1)}>${ICONS.step}<span>Step</span></button>`;

  render(
    html`
      ${player.isOver ? again(player) : nothing}
      ${player.isLive ? nothing : buttons}
      ${epochs(player)}
      <div class="track">
        <div class="marks" data-testid="marks">${marks(place, player)}</div>
        ${span(player, shown)}
        <input type="range" data-testid="scrub" aria-label="Tick" aria-valuetext="tick ${tick}, ${seconds(time_s, tick_s)}"
          min=${first} max=${last} step="1" .value=${String(Math.max(first, tick))} @input=${seek} />
      </div>
      <span class="count">${seconds(time_s, tick_s).slice(0, -2)} / ${seconds(last * tick_s, tick_s)}</span>
      ${store.mode === "live" ? live(player) : nothing}
      ${note(player)}`,
    place,
  );
}

/** @param {Player} player */
function again(player) {
  return html`<button type="button" class="primary" data-testid="watch-again" title="from its beginning, as it is recorded"
    @click=${() => player.watchAgain()}>${ICONS.start}<span>Watch again</span></button>`;
}

/** @param {Player} player */
function live(player) {
  const { isLive, store } = player;
  const tone = isLive && store.isLive ? "good" : "neutral";
  return html`<button type="button" class="live ${isLive ? "" : "primary"}" data-testid="live" aria-pressed=${isLive}
    title="the newest tick (L)" @click=${() => player.live()}>
    ${isLive ? html`<span class="dot ${tone}"></span>` : nothing}${store.isPast ? "Latest" : "Live"}</button>`;
}

/** The choice among epochs, if there are several. @param {Player} player */
function epochs(player) {
  const { epoch } = player;
  if (player.epochs.length < 2) return nothing;
  const choose = (/** @type {Event} */ event) => player.choose(Number(/** @type {HTMLSelectElement} */ (event.target).value));

  return html`<select data-testid="epoch" aria-label="Epoch" @change=${choose}>
    ${player.epochs.map((one) => html`<option value=${one} ?selected=${one === epoch} .selected=${one === epoch}>epoch ${one}</option>`)}
  </select>`;
}

/**
 * @param {HTMLElement} place
 * @param {Player} player
 */
function marks(place, player) {
  const width = place.querySelector(".track")?.clientWidth ?? place.clientWidth / 2;
  const { first, last } = player;
  const found = player.store.marks.of(player.epoch, first, last, Math.max(1, Math.floor(width / MARK_PX)));

  return found.map(
    ({ kind, tick, at, words }) => html`<button type="button" class="mark ${kind}" data-testid="mark-${kind}" data-tick=${tick}
      title=${words} aria-label=${words} tabindex="-1" .style=${`left:${100 * at}%`} @click=${() => player.seekIn(player.epoch, tick)}></button>`,
  );
}

/** What charts and bands show of the time. @param {Player} player @param {TimeWindow} shown */
function span({ first, last, tick_s }, shown) {
  if (shown.isWhole || last <= first) return nothing;
  const [from, to] = shown.range_s().map((time_s) => Math.min(1, Math.max(0, (time_s / tick_s - first) / (last - first))));
  return html`<div class="span-place"><div class="span" data-testid="span" .style=${`left:${100 * from}%;width:${100 * (to - from)}%`}></div></div>`;
}

/** What of the past is not there, or not yet. @param {Player} player */
function note(player) {
  const { newest, missing, store, first, tick_s } = player;
  if (store.mode !== "live") return nothing;
  const say = (/** @type {string} */ text, /** @type {string} */ why) =>
    html`<p class="past-note muted" data-testid="past-note" role="status" title=${why}>${text}</p>`;

  if (player.isWanting) return say(`Only what this page has seen, from ${seconds(first * tick_s, tick_s)} on: ${missing}.`, missing);
  const share = newest && newest.ticks > 0 ? player.readTo / newest.ticks : 1;
  if (share < 0.9 && newest && newest.epoch === store.live?.epoch) return say(`Reading what is recorded: ${Math.max(0, Math.floor(100 * share))} %`, "");
  return nothing;
}
