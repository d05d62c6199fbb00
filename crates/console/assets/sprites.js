// @ts-check
// Pictures of what is drawn again and again: what does not move, and robots by their look and by where in a pixel they are. They
// are copied onto the plan at whole pixels, so that they stay sharp.

import * as draw from "./draw.js";
import { areSameLayers } from "./layers.js";
import { drawGround } from "./solids.js";

/** @typedef {import("./theme.js").Theme} Theme */

/** Most pictures; beyond, all are made anew. */
const MOST = 1024;
/** Places in a pixel, each way. */
const PLACES = 4;

/** What does not move: the field, a layer and what stands on it. */
export class Ground {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { alpha: false }));
    this.key = "";
    /** @type {Pick<import("./solids.js").Standing, "obstacles" | "static_world">} */
    this.standing = { obstacles: [] };
    /** @type {import("./types/messages.js").LayerFrame | null} */
    this.layer = null;
    /** Its pixels, if they were asked for. @type {ImageData | null} */
    this.read = null;
  }

  /**
   * Draws it anew if anything of it is different.
   * @param {draw.Pen} pen
   * @param {HTMLCanvasElement} plan
   * @param {import("./solids.js").Standing} standing
   * @param {number} step_m between lines
   * @param {import("./types/messages.js").LayerFrame | null} layer
   */
  renew({ camera, theme }, plan, standing, step_m, layer) {
    const { width_px, height_px, field_m, scale, center } = camera;
    const key = [plan.width, plan.height, width_px, height_px, ...field_m, scale, center.x, center.y, standing.body_m, step_m, theme.field, theme.layer].join();
    const isSame = areSame(standing.obstacles, this.standing.obstacles) && standing.static_world === this.standing.static_world;
    if (key !== this.key || !isSame || !areSameLayers(layer, this.layer)) {
      this.key = key;
      this.standing = standing;
      this.layer = layer;
      this.read = null;
      this.canvas.width = plan.width;
      this.canvas.height = plan.height;
      this.context.setTransform(plan.width / width_px, 0, 0, plan.height / height_px, 0, 0);
      const pen = { context: this.context, camera, theme };
      draw.outside(pen);
      drawGround(pen, standing, step_m, layer);
    }
  }

  /** Its pixels, to write on a copy of them. */
  pixels() {
    if (this.read) return this.read;
    const { width, height } = this.canvas;
    // A canvas that is read again and again would be slow to draw from.
    const copy = new OffscreenCanvas(width, height).getContext("2d", { alpha: false, willReadFrequently: true });
    if (!copy) throw new Error("this browser draws no canvas");
    copy.drawImage(this.canvas, 0, 0);
    this.read = copy.getImageData(0, 0, width, height);
    return this.read;
  }
}

/** @type {(some: [number, number][], others: [number, number][]) => boolean} */
function areSame(some, others) {
  return some === others || (some.length === others.length && some.every(([x, y], i) => x === others[i][0] && y === others[i][1]));
}

/** Robots by their look. */
export class Sprites {
  constructor() {
    /** @type {Map<string, ImageBitmap>} */
    this.made = new Map();
    /** Pixels of the canvas in a CSS pixel. */
    this.ratio = 1;
  }

  /** To be called when colors have changed. */
  clear() {
    this.made.clear();
  }

  /** @param {number} ratio pixels of the canvas in a CSS pixel */
  scale(ratio) {
    if (ratio !== this.ratio) this.clear();
    this.ratio = ratio;
  }

  /**
   * Draws a robot's body.
   * @param {CanvasRenderingContext2D} context
   * @param {Theme} theme
   * @param {draw.Look} look
   * @param {number} x
   * @param {number} y
   */
  body(context, theme, look, x, y) {
    const half = draw.reach(look);
    const right = Math.round((x - half) * this.ratio * PLACES);
    const down = Math.round((y - half) * this.ratio * PLACES);
    const left = Math.floor(right / PLACES);
    const top = Math.floor(down / PLACES);
    const picture = this.picture(theme, look, right - left * PLACES, down - top * PLACES);
    context.drawImage(picture, left / this.ratio, top / this.ratio, picture.width / this.ratio, picture.height / this.ratio);
  }

  /**
   * @param {Theme} theme
   * @param {draw.Look} look
   * @param {number} right parts of a pixel
   * @param {number} down
   */
  picture(theme, look, right, down) {
    const key = [...Object.values(look), right, down].join("\n");
    const before = this.made.get(key);
    if (before) return before;

    const half = draw.reach(look);
    const side = Math.ceil(2 * half * this.ratio) + 1;
    const canvas = new OffscreenCanvas(side, side);
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser draws no canvas");
    context.scale(this.ratio, this.ratio);
    const part = 1 / (PLACES * this.ratio);
    draw.body({ context, theme }, look, half + right * part, half + down * part);

    // A canvas would be copied each time that it is drawn from.
    const picture = canvas.transferToImageBitmap();
    if (this.made.size >= MOST) this.made.clear();
    this.made.set(key, picture);
    return picture;
  }
}
