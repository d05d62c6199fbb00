// @ts-check
// Many small guests: written into the pixels of the plan, which costs a fraction of drawing circles. Each is a circle that was
// drawn once, by what draws guests, for each of some places in a pixel.

import * as draw from "./draw.js";

/** @typedef {import("./theme.js").Theme} Theme */

/** Fewer guests are drawn one by one. */
const LEAST = 200;
/** Places in a pixel, each way. */
const PLACES = 4;
/** Full cover; one more than a byte can say, so that a shift divides by it. */
const FULL = 256;

export class Crowd {
  constructor() {
    /** For what the masks are. */
    this.key = "";
    /** How much of each pixel a guest covers, by its place in a pixel. @type {Uint16Array[]} */
    this.masks = [];
    /** Pixels. */
    this.side = 0;
    /** As in an image: the bytes red, green, blue and cover. */
    this.color = 0;
    /** @type {ImageData | null} */
    this.image = null;
  }

  /**
   * Whether guests are drawn here.
   * @param {number} count
   * @param {number} radius
   */
  takes(count, radius) {
    return count >= LEAST && draw.isPlain(radius);
  }

  /**
   * Draws the ground and the guests on it.
   * @param {CanvasRenderingContext2D} context
   * @param {ImageData} ground
   * @param {Theme} theme
   * @param {number[]} at x and y in turn
   * @param {number} radius
   * @param {number} ratio pixels in a CSS pixel
   */
  draw(context, ground, theme, at, radius, ratio) {
    const { width, height } = ground;
    if (this.image?.width !== width || this.image.height !== height) this.image = new ImageData(width, height);
    this.makeMasks(theme, radius, ratio);
    const pixels = new Uint32Array(this.image.data.buffer);
    pixels.set(new Uint32Array(ground.data.buffer));

    for (let i = 0; i < at.length; i += 2) {
      const right = Math.round(at[i] * ratio * PLACES);
      const down = Math.round(at[i + 1] * ratio * PLACES);
      const mask = this.masks[(right & (PLACES - 1)) * PLACES + (down & (PLACES - 1))];
      const left = Math.floor(right / PLACES) - (this.side >> 1);
      this.put(pixels, width, height, mask, left, Math.floor(down / PLACES) - (this.side >> 1));
    }

    context.putImageData(this.image, 0, 0);
  }

  /** @type {(pixels: Uint32Array, width: number, height: number, mask: Uint16Array, left: number, top: number) => void} */
  put(pixels, width, height, mask, left, top) {
    const { side, color } = this;
    const redBlue = color & 0xff00ff;
    const green = color & 0x00ff00;
    const lastRow = Math.min(side, height - top);
    const lastColumn = Math.min(side, width - left);

    for (let row = Math.max(0, -top); row < lastRow; row += 1) {
      for (let column = Math.max(0, -left); column < lastColumn; column += 1) {
        const cover = mask[row * side + column];
        if (cover === 0) continue;
        const index = (top + row) * width + left + column;
        const below = pixels[index];
        const rest = FULL - cover;
        const mixed = (((below & 0xff00ff) * rest + redBlue * cover) >>> 8) & 0xff00ff;
        pixels[index] = (mixed | ((((below & 0x00ff00) * rest + green * cover) >>> 8) & 0x00ff00) | 0xff000000) >>> 0;
      }
    }
  }

  /** @type {(theme: Theme, radius: number, ratio: number) => void} */
  makeMasks(theme, radius, ratio) {
    const key = [theme.guest, radius, ratio].join();
    if (key === this.key) return;

    this.key = key;
    this.side = 2 * Math.ceil(radius * ratio + 1);
    this.masks = [];
    for (let place = 0; place < PLACES * PLACES; place += 1) {
      const context = new OffscreenCanvas(this.side, this.side).getContext("2d", { willReadFrequently: true });
      if (!context) throw new Error("this browser draws no canvas");
      context.scale(ratio, ratio);
      const x = this.side / 2 + Math.floor(place / PLACES) / PLACES;
      const y = this.side / 2 + (place % PLACES) / PLACES;
      draw.guestCircles({ context, theme }, [x / ratio, y / ratio], radius);
      const { data } = context.getImageData(0, 0, this.side, this.side);
      const pixels = new Uint32Array(data.buffer);
      this.masks.push(Uint16Array.from(pixels, (_, i) => Math.round((data[4 * i + 3] * FULL) / 255)));
      const middle = pixels[(this.side >> 1) * this.side + (this.side >> 1)];
      if (place === 0) this.color = middle;
    }
  }
}
