// @ts-check
// Sites on the plan: a diamond in the color of their kind, hollow where all flags of the state are set.

import { html, render } from "./vendor/lit-html.js";

/** @typedef {import("./types/messages.js").SiteFrame} SiteFrame */
/** @typedef {import("./draw.js").Pen} Pen */

/** Colors of kinds, in their alphabetical order. */
const COLORS = ["#b5651d", "#2a7f9e", "#7a4fa3", "#4f8a3c", "#b23a5e", "#6b6f2a"];
/** Most kinds in a legend: a scenario may have any. */
const MAX_KINDS = 8;
/** Half of a diamond's width, in bodies' sides, and at least in pixels. */
const HALF = 0.4;
const SMALLEST_PX = 4;

/** Half of a diamond's width. @param {number} scale @param {number} body_m */
function halfWidth(scale, body_m) {
  return Math.max(SMALLEST_PX, HALF * body_m * scale);
}

/** The kinds of sites, in their order. @param {SiteFrame[]} sites */
export function kindsOf(sites) {
  return [...new Set(sites.map((site) => site.kind))].sort();
}

/** The color of a kind. @param {string[]} kinds @param {string} kind */
function colorOf(kinds, kind) {
  return COLORS[Math.max(0, kinds.indexOf(kind)) % COLORS.length];
}

/** Whether all flags of a site's state are set, and there is one. @param {SiteFrame} site */
function isSet(site) {
  const flags = Object.values(site.state ?? {}).filter((value) => typeof value === "boolean");
  return flags.length > 0 && flags.every(Boolean);
}

/**
 * One diamond.
 * @param {Pick<Pen, "context" | "theme">} pen
 * @param {string} color
 * @param {boolean} isHollow
 * @param {number} x
 * @param {number} y
 * @param {number} half
 */
export function diamond({ context, theme }, color, isHollow, x, y, half) {
  context.beginPath();
  context.moveTo(x, y - half);
  context.lineTo(x + half, y);
  context.lineTo(x, y + half);
  context.lineTo(x - half, y);
  context.lineTo(x, y - half);
  context.fillStyle = isHollow ? theme.field : color;
  context.fill();
  context.strokeStyle = color;
  context.lineWidth = 2;
  context.stroke();
}

/**
 * All sites.
 * @param {Pen} pen
 * @param {SiteFrame[]} sites
 * @param {number} body_m
 */
export function drawSites(pen, sites, body_m) {
  const kinds = kindsOf(sites);
  const half = halfWidth(pen.camera.scale, body_m);
  for (const site of sites) {
    const x = pen.camera.x(site.location.x);
    const y = pen.camera.y(site.location.y);
    diamond(pen, colorOf(kinds, site.kind), isSet(site), x, y, half);
  }
}

/**
 * The site at a place.
 * @param {SiteFrame[]} sites
 * @param {{x: number, y: number}} place
 * @param {number} scale
 * @param {number} body_m
 */
export function siteAt(sites, place, scale, body_m) {
  const reach_m = halfWidth(scale, body_m) / scale;
  return sites.find(({ location }) => Math.abs(location.x - place.x) + Math.abs(location.y - place.y) <= reach_m);
}

/** A site in words: its name, its kind and its state. @param {SiteFrame} site */
export function siteWords(site) {
  const state = Object.entries(site.state ?? {}).map(([key, value]) => `${key} ${value === "" ? "–" : value}`);
  return [site.name, site.kind, ...state].join(" · ");
}

/** The kinds with their colors, for a legend. @param {SiteFrame[]} sites */
export function kindsInLegend(sites) {
  const kinds = kindsOf(sites);
  return kinds.slice(0, MAX_KINDS).map((kind) => ({ kind, color: colorOf(kinds, kind) }));
}

/**
 * The kinds in the page's legend.
 * @param {HTMLElement} place
 * @param {SiteFrame[]} sites
 */
export function renderKinds(place, sites) {
  place.hidden = sites.length === 0;
  render(
    html`${kindsInLegend(sites).map(
      ({ kind, color }) =>
        html`<span class="emotion" data-testid="legend-site"><svg class="symbol" viewBox="0 0 16 16" aria-hidden="true"><path
            d="M8 1l7 7-7 7-7-7z" fill=${color}></path></svg>${kind}</span>`,
    )}`,
    place,
  );
}
