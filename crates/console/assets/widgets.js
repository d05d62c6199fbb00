// @ts-check
// The widgets of a robot's panel. Everything that a robot sends is untrusted: text is rendered as text, SVG as an image.

import { drawFace } from "./face.js";
import { badgeStyle } from "./palette.js";
import { short } from "./units.js";
import { html, nothing, svg } from "./vendor/lit-html.js";

/** @typedef {import("./types/messages.js").Widget} Widget */
/** @typedef {import("./types/messages.js").Tone} Tone */
/** What a robot displays of a tick. @typedef {Pick<import("./types/messages.js").TickPanel, "widgets">} Panel */
/** @typedef {(command: string) => void} Send */

const TONES = ["good", "neutral", "warning", "bad"];
/** Limits of a table. */
const MAX_ROWS = 60;
const MAX_CELLS = 12;
/** Rows that are shown without scrolling. */
const SHORT_TABLE = 10;
const MAX_POINTS = 1000;
/** Characters of a text that is scrolled. */
const LONG_TEXT = 420;
/** Characters. */
const LARGEST_SVG = 500_000;

/**
 * @param {Widget} widget
 * @param {Send} send
 */
export function drawWidget(widget, send) {
  switch (widget?.widget) {
    case "text":
      return text(widget);
    case "badge":
      return html`
        <div class="widget pair"><span class="label">${widget.label}</span>
          ${badge(widget)}</div>`;
    case "bar":
      return bar(widget);
    case "face":
      return html`
        <div class="widget face-box">
          <svg class="face" viewBox="0 0 100 100" role="img" data-testid="face" data-face=${widget.face}
            aria-label="${widget.face} face">${drawFace(widget.face, widget.intensity)}</svg>
        </div>`;
    case "sparkline":
      return sparkline(widget);
    case "table":
      return table(Array.isArray(widget.rows) ? widget.rows : []);
    case "svg":
      return html`<div class="widget"><img class="picture" alt=${widget.label} src=${imageOf(widget.svg)} /></div>`;
    case "button":
      return html`
        <button type="button" class="widget" data-testid="button-${String(widget.command).replaceAll(" ", "-")}"
          title="send: ${widget.command}" @click=${() => send(widget.command)}>${widget.label}</button>`;
    default:
      return nothing;
  }
}

/** All of a text can be read: a long one is scrolled. @param {Extract<Widget, {widget: "text"}>} widget */
function text({ label, text }) {
  const isLong = String(text).length > LONG_TEXT;
  return html`<div class="widget text"><span class="label">${label}</span>
    <p class=${isLong ? "long" : ""} tabindex=${isLong ? "0" : nothing}>${text}</p></div>`;
}

/** An emotion and a behavior have their own color, as in the bands, whatever the tone. @param {Extract<Widget, {widget: "badge"}>} widget */
function badge({ label, text, tone: word }) {
  if (label !== "emotion" && label !== "behavior") return html`<span class="badge ${tone(word)}">${text}</span>`;

  return html`<span class="badge state" .style=${badgeStyle(label, String(text))}>${text}</span>`;
}

/** @param {Tone} word */
function tone(word) {
  return TONES.includes(word) ? word : "neutral";
}

/** @param {Extract<Widget, {widget: "bar"}>} widget */
function bar({ label, value, min, max }) {
  const part = max > min ? (value / 2 - min / 2) / (max / 2 - min / 2) : 0;
  const width = Number.isFinite(part) ? 100 * Math.min(1, Math.max(0, part)) : 0;
  const of = min === 0 && max !== 1 ? html`<span class="of"> / ${short(max)}</span>` : nothing;

  return html`
    <div class="widget gauge">
      <div class="row"><span class="label" title=${label}>${label}</span><span class="number">${short(value)}${of}</span></div>
      <svg viewBox="0 0 100 1" preserveAspectRatio="none" role="meter" aria-label=${label} aria-valuemin=${min}
        aria-valuemax=${max} aria-valuenow=${value}><rect class="rail" width="100" height="1"></rect>
        <rect class="level" width=${width} height="1"></rect></svg>
    </div>`;
}

/** @param {Extract<Widget, {widget: "sparkline"}>} widget */
function sparkline({ label, values }) {
  const points = (Array.isArray(values) ? values : []).filter(Number.isFinite).slice(-MAX_POINTS);
  const low = Math.min(...points);
  const high = Math.max(...points);
  // Halves, because the difference of two large numbers may overflow.
  const range = high / 2 - low / 2 || 1;
  const at = (/** @type {number} */ value, /** @type {number} */ i) =>
    `${((100 * i) / Math.max(1, points.length - 1)).toFixed(2)},${(22 - 20 * ((value / 2 - low / 2) / range)).toFixed(2)}`;
  const last = points.at(-1);

  return html`
    <div class="widget spark">
      <div class="row"><span class="label">${label}</span><span class="number">${last === undefined ? "–" : short(last)}</span></div>
      <svg viewBox="0 0 100 24" preserveAspectRatio="none" role="img" aria-label="${label}, recent values">
        ${svg`<polyline vector-effect="non-scaling-stroke" points=${points.map(at).join(" ")}></polyline>`}
      </svg>
    </div>`;
}

/** @param {string[][]} rows */
function table(rows) {
  const cells = (/** @type {string[]} */ row) => (Array.isArray(row) ? row : []).slice(0, MAX_CELLS);
  const isPairs = rows.every((row) => row?.length === 2);

  const isLong = rows.length > SHORT_TABLE;

  return html`
    <div class="widget table" tabindex=${isLong ? "0" : nothing}><table class=${isPairs ? "pairs" : ""}><tbody>
      ${rows.slice(0, MAX_ROWS).map((row) => html`<tr>${cells(row).map((cell) => html`<td>${cell}</td>`)}</tr>`)}
    </tbody></table>
    ${rows.length > MAX_ROWS ? html`<p class="muted">and ${rows.length - MAX_ROWS} rows more</p>` : nothing}</div>`;
}

/**
 * An SVG in an `img` element runs no script and loads nothing.
 * @param {string} document
 */
function imageOf(document) {
  if (typeof document !== "string" || document.length > LARGEST_SVG) return "data:,";

  try {
    return `data:image/svg+xml;charset=utf-8,${encodeURIComponent(document)}`;
  } catch {
    // A lone surrogate cannot be encoded.
    return "data:,";
  }
}
