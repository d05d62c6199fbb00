// @ts-check
// A layer on the plan: a heat map under everything else, from the color of the field to `--layer` in steps that look equal (mixed in
// OKLab). One layer is shown at a time.

import { Vector } from "./vector.js";
import { html, render } from "./vendor/lit-html.js";

/** @typedef {import("./types/messages.js").LayerFrame} LayerFrame */
/** @typedef {import("./draw.js").Pen} Pen */
/** @typedef {import("./theme.js").Theme} Theme */

const LEVELS = 256;
/** Rectangles of a color scale in a picture. */
const STEPS = 32;

/** The colors of the scale, by the theme's two ends. @type {{key: string, pixels: Uint8ClampedArray}} */
let ramp = { key: "", pixels: new Uint8ClampedArray(4 * LEVELS) };
/** The picture of the layer that was drawn last, a pixel for each cell.
 * @type {{of: LayerFrame, colors: Uint8ClampedArray, canvas: HTMLCanvasElement} | null} */
let last = null;

/** The layer that is shown: the chosen one, or the first. @param {LayerFrame[] | undefined} layers @param {string | null} chosen */
export function shownLayer(layers, chosen) {
  return layers?.find((layer) => layer.name === chosen) ?? layers?.[0] ?? null;
}

/** How many cells layers have. @param {LayerFrame[] | undefined} layers */
export function cellsIn(layers) {
  return (layers ?? []).reduce((sum, layer) => sum + layer.columns * layer.rows, 0);
}

/** @type {(one: LayerFrame | null, other: LayerFrame | null) => boolean} */
export function areSameLayers(one, other) {
  if (one === other || !one || !other) return one === other;
  const isSameScale = one.scale[0] === other.scale[0] && one.scale[1] === other.scale[1];
  return isSameScale && one.name === other.name && one.min === other.min && one.max === other.max && one.levels === other.levels;
}

/**
 * Draws a layer on the field, on a canvas or in a picture.
 * @param {Pen} pen
 * @param {LayerFrame | null} layer
 */
export function drawLayer({ context, camera, theme }, layer) {
  if (!layer) return;
  const [width_m, height_m] = camera.field_m;
  const image = imageOf(layer, rampOf(theme));
  // The last column and the top row may reach over the edge of the field.
  const across = width_m / layer.cell_m;
  const up = height_m / layer.cell_m;
  const top = layer.rows - up;
  const place = /** @type {const} */ ([camera.x(0), camera.y(height_m), width_m * camera.scale, height_m * camera.scale]);

  if (context instanceof Vector) {
    const [x, y, width, height] = place;
    const size = `width="${layer.columns}" height="${layer.rows}"`;
    context.put(`<svg x="${x}" y="${y}" width="${width}" height="${height}" viewBox="0 ${top} ${across} ${up}" preserveAspectRatio="none">
<image ${size} image-rendering="pixelated" style="image-rendering:pixelated" href="${image.toDataURL()}"/></svg>`);
    return;
  }
  const canvas = /** @type {CanvasRenderingContext2D} */ (context);
  canvas.save();
  canvas.imageSmoothingEnabled = false;
  canvas.drawImage(image, 0, top, across, up, ...place);
  canvas.restore();
}

/** A pixel for each cell, the top row first. @param {LayerFrame} layer @param {Uint8ClampedArray} colors */
function imageOf(layer, colors) {
  if (last && last.colors === colors && areSameLayers(last.of, layer)) return last.canvas;
  const { columns, rows } = layer;
  const canvas = last?.canvas ?? document.createElement("canvas");
  canvas.width = columns;
  canvas.height = rows;
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no canvas");

  const image = context.createImageData(columns, rows);
  const shades = shadesOf(layer);
  const levels = atob(layer.levels);
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < columns; column += 1) {
      const color = 4 * shades[levels.charCodeAt(row * columns + column)];
      const pixel = 4 * ((rows - 1 - row) * columns + column);
      image.data.set(colors.subarray(color, color + 4), pixel);
    }
  }
  context.putImageData(image, 0, 0);
  last = { of: layer, colors, canvas };
  return canvas;
}

/** The place on the scale of each level. @param {LayerFrame} layer */
function shadesOf({ min, max, scale: [low, high] }) {
  const range = high - low;
  return Uint8Array.from({ length: LEVELS }, (_, level) => {
    const number = min + ((max - min) * level) / (LEVELS - 1);
    const share = range > 0 ? (number - low) / range : 0;
    return Math.round(Math.min(1, Math.max(0, share)) * (LEVELS - 1));
  });
}

/** The colors of a scale, mixed by the browser. @param {Theme} theme */
function rampOf({ field, layer }) {
  const key = `${field} ${layer}`;
  if (ramp.key === key) return ramp.pixels;
  const context = new OffscreenCanvas(LEVELS, 1).getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("this browser draws no canvas");
  for (let level = 0; level < LEVELS; level += 1) {
    context.fillStyle = `color-mix(in oklab, ${layer} ${(100 * level) / (LEVELS - 1)}%, ${field})`;
    context.fillRect(level, 0, 1, 1);
  }
  ramp = { key, pixels: context.getImageData(0, 0, LEVELS, 1).data };
  return ramp.pixels;
}

/** A number as people read it. @param {number} number */
function short(number) {
  return String(Number(number.toPrecision(3)));
}

/** The number of a layer at a place, in words. @param {LayerFrame | null} layer @param {{x: number, y: number}} place */
export function layerWords(layer, place) {
  if (!layer) return "";
  const column = Math.floor(place.x / layer.cell_m);
  const row = Math.floor(place.y / layer.cell_m);
  if (column < 0 || row < 0 || column >= layer.columns || row >= layer.rows) return "";
  const level = atob(layer.levels).charCodeAt(row * layer.columns + column);
  return `${layer.name} ${short(layer.min + ((layer.max - layer.min) * level) / (LEVELS - 1))}`;
}

/**
 * The color scale in the legend of a picture.
 * @param {Vector} paper
 * @param {Theme} theme
 * @param {number} x
 * @param {number} y its middle
 * @param {number} width
 */
export function drawScale(paper, theme, x, y, width) {
  const colors = rampOf(theme);
  for (let step = 0; step < STEPS; step += 1) {
    const at = 4 * Math.round((step * (LEVELS - 1)) / (STEPS - 1));
    paper.fillStyle = `rgb(${colors.subarray(at, at + 3).join()})`;
    // A little wider, so that no line is seen between two.
    paper.fillRect(x + (step * width) / STEPS, y - 5, width / STEPS + 0.5, 10);
  }
  paper.strokeStyle = theme.grid;
  paper.lineWidth = 1;
  paper.strokeRect(x, y - 5, width, 10);
}

/** The name of a layer and the ends of its scale. @param {LayerFrame} layer */
export function scaleWords({ name, scale: [low, high] }) {
  return `${name}, ${short(low)} to ${short(high)}`;
}

/**
 * The layers in the page's legend; of several, one can be chosen.
 * @param {HTMLElement} place
 * @param {LayerFrame[]} layers
 * @param {string | null} chosen
 * @param {(name: string) => void} onChoose
 */
export function renderLayers(place, layers, chosen, onChoose) {
  place.hidden = layers.length === 0;
  const shown = shownLayer(layers, chosen);
  render(
    html`${layers.map((layer) => {
      const now = `now from ${short(layer.min)} to ${short(layer.max)}`;
      const [low, high] = layer.scale.map(short);
      const isShown = layer === shown;
      const bar = isShown ? html`${low}<span class="layer-scale" aria-hidden="true"></span>${high}` : "";
      return layers.length === 1
        ? html`<span class="emotion" data-testid="legend-layer" title=${now}>${layer.name} ${bar}</span>`
        : html`<button type="button" class="emotion" data-testid="legend-layer" title=${now} aria-pressed=${isShown}
            @click=${() => onChoose(layer.name)}>${layer.name} ${bar}</button>`;
    })}`,
    place,
  );
}
