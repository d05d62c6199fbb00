// @ts-check
// Pointer, wheel and keys on the plan: zoom, pan, and drags for the editor.

/** @typedef {import("./camera.js").Camera} Camera */
/** @typedef {{x: number, y: number}} Place */

/**
 * Handles a drag if `down` returns true.
 * @typedef {object} DragHandler
 * @property {boolean} isActive
 * @property {(place: Place) => boolean} down
 * @property {(place: Place) => void} move
 * @property {() => void} up
 */

const CLICK_PX = 4;

export class Gestures {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Camera} camera
   * @param {{changed: () => void, clicked: (place: Place) => void, editor: DragHandler}} client
   */
  constructor(canvas, camera, client) {
    this.canvas = canvas;
    this.camera = camera;
    this.client = client;
    /** Pointers that are down. @type {Map<number, {x: number, y: number}>} */
    this.pointers = new Map();
    this.travel_px = 0;
    this.isEditing = false;
    /** What a touch does, as it was set last. */
    this.action = "";

    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event, true));
    canvas.addEventListener("pointercancel", (event) => this.up(event, false));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** One finger scrolls the page while the whole field is visible and not edited. */
  touch() {
    const action = this.camera.isWhole && !this.client.editor.isActive ? "pan-y" : "none";
    if (action !== this.action) this.canvas.style.touchAction = action;
    this.action = action;
  }

  /** @param {MouseEvent} event */
  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  /** @param {PointerEvent} event */
  down(event) {
    const at = this.at(event);
    this.pointers.set(event.pointerId, at);
    this.canvas.setPointerCapture(event.pointerId);
    this.travel_px = 0;

    if (this.pointers.size > 1) {
      this.endEdit();
    } else if (event.button === 0 && this.client.editor.isActive) {
      this.isEditing = this.client.editor.down(this.camera.place(at.x, at.y));
    }
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;

    const at = this.at(event);
    if (this.isEditing) {
      this.client.editor.move(this.camera.place(at.x, at.y));
    } else if (this.pointers.size === 2) {
      this.pinch(event.pointerId, before, at);
    } else {
      this.camera.panBy(at.x - before.x, at.y - before.y);
    }

    this.travel_px += Math.hypot(at.x - before.x, at.y - before.y);
    this.pointers.set(event.pointerId, at);
    this.client.changed();
  }

  /**
   * @param {number} id
   * @param {Place} before
   * @param {Place} at
   */
  pinch(id, before, at) {
    const other = [...this.pointers].find(([key]) => key !== id)?.[1];
    if (!other) return;

    const spread = (/** @type {Place} */ p) => Math.max(1, Math.hypot(p.x - other.x, p.y - other.y));
    this.camera.zoomBy(spread(at) / spread(before), (at.x + other.x) / 2, (at.y + other.y) / 2);
    this.camera.panBy((at.x - before.x) / 2, (at.y - before.y) / 2);
    this.touch();
  }

  /**
   * @param {PointerEvent} event
   * @param {boolean} isDone
   */
  up(event, isDone) {
    if (!this.pointers.delete(event.pointerId)) return;
    const at = this.at(event);
    if (this.isEditing) this.endEdit();
    else if (isDone && this.travel_px < CLICK_PX) this.client.clicked(this.camera.place(at.x, at.y));
  }

  endEdit() {
    if (this.isEditing) this.client.editor.up();
    this.isEditing = false;
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const at = this.at(event);
    this.camera.zoomBy(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), at.x, at.y);
    this.touch();
    this.client.changed();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    /** @type {Record<string, () => void>} */
    const keys = {
      "+": () => this.camera.zoomBy(1.25),
      "=": () => this.camera.zoomBy(1.25),
      "-": () => this.camera.zoomBy(0.8),
      "0": () => this.camera.reset(),
      ArrowLeft: () => this.camera.panBy(40, 0),
      ArrowRight: () => this.camera.panBy(-40, 0),
      ArrowUp: () => this.camera.panBy(0, 40),
      ArrowDown: () => this.camera.panBy(0, -40),
    };

    const act = keys[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;

    event.preventDefault();
    event.stopPropagation();
    act();
    this.touch();
    this.client.changed();
  }
}
