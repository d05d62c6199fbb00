// @ts-check
// Maps places of the field (meters, y up) to points of the canvas (CSS pixels, y down).

/** @typedef {{x: number, y: number}} Place */

const MARGIN_PX = 26;
const MAX_ZOOM = 60;

export class Camera {
  constructor() {
    /** @type {[number, number]} */
    this.field_m = [10, 10];
    this.width_px = 1;
    this.height_px = 1;
    /** Factor of the scale at which the whole field is visible. */
    this.zoom = 1;
    /** The place in the middle of the canvas, meters. */
    this.center = { x: 5, y: 5 };
  }

  /**
   * Sets the sizes of field and canvas. Another field resets zoom and center.
   * @param {[number, number]} field_m
   * @param {number} width_px
   * @param {number} height_px
   */
  fit(field_m, width_px, height_px) {
    const isOther = field_m[0] !== this.field_m[0] || field_m[1] !== this.field_m[1];
    this.field_m = [field_m[0], field_m[1]];
    this.width_px = Math.max(1, width_px);
    this.height_px = Math.max(1, height_px);
    if (isOther) this.reset();
  }

  /** Shows the whole field. */
  reset() {
    this.zoom = 1;
    this.center = { x: this.field_m[0] / 2, y: this.field_m[1] / 2 };
  }

  get isWhole() {
    return this.zoom === 1;
  }

  /**
   * The height at which a field fills the width.
   * @param {[number, number]} field_m
   * @param {number} width_px
   */
  heightFor([width_m, height_m], width_px) {
    return Math.round(((width_px - 2 * MARGIN_PX) * height_m) / width_m) + 2 * MARGIN_PX;
  }

  /** CSS pixels per meter. */
  get scale() {
    const across = (this.width_px - 2 * MARGIN_PX) / this.field_m[0];
    const up = (this.height_px - 2 * MARGIN_PX) / this.field_m[1];
    return Math.max(1e-6, Math.min(across, up)) * this.zoom;
  }

  /** @param {number} x_m */
  x(x_m) {
    return this.width_px / 2 + (x_m - this.center.x) * this.scale;
  }

  /** @param {number} y_m */
  y(y_m) {
    return this.height_px / 2 - (y_m - this.center.y) * this.scale;
  }

  /**
   * The place of the field under a point of the canvas.
   * @param {number} x_px
   * @param {number} y_px
   * @returns {Place}
   */
  place(x_px, y_px) {
    return {
      x: this.center.x + (x_px - this.width_px / 2) / this.scale,
      y: this.center.y - (y_px - this.height_px / 2) / this.scale,
    };
  }

  /**
   * @param {number} factor
   * @param {number} x_px the point of the canvas that stays where it is
   * @param {number} y_px
   */
  zoomBy(factor, x_px = this.width_px / 2, y_px = this.height_px / 2) {
    const before = this.place(x_px, y_px);
    this.zoom = Math.min(MAX_ZOOM, Math.max(1, this.zoom * factor));
    if (this.zoom < 1.001) return this.reset();
    const after = this.place(x_px, y_px);
    this.moveTo(this.center.x + before.x - after.x, this.center.y + before.y - after.y);
  }

  /**
   * @param {number} dx_px
   * @param {number} dy_px
   */
  panBy(dx_px, dy_px) {
    if (!this.isWhole) this.moveTo(this.center.x - dx_px / this.scale, this.center.y + dy_px / this.scale);
  }

  /**
   * Moves the center to a place, clamped to the field.
   * @param {number} x_m
   * @param {number} y_m
   */
  moveTo(x_m, y_m) {
    this.center = {
      x: Math.min(this.field_m[0], Math.max(0, x_m)),
      y: Math.min(this.field_m[1], Math.max(0, y_m)),
    };
  }
}
