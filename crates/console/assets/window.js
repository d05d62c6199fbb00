// @ts-check
// The window of time that charts and bands share, and the gestures on either that change it.

/** Shortest window, simulated seconds. */
const SHORTEST_S = 1;
/** A press that moves less is a click. */
const CLICK_PX = 4;
/** A second click within this time is a double click; a click waits for it where that means something. */
const DOUBLE_MS = 250;
/** @typedef {[number, number]} Range first and last second */

export class TimeWindow {
  /** @param {() => Range} whole the time that there is */
  constructor(whole) {
    this.whole = whole;
    /** Its length; none if everything is shown. @type {number | null} */
    this.span_s = null;
    /** Its end; none if it goes on with the run. @type {number | null} */
    this.to_s = null;
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  get isWhole() {
    return this.span_s === null;
  }

  /** What is shown. @returns {Range} */
  range_s() {
    const [first_s, last_s] = this.whole();
    if (this.span_s === null) return [first_s, last_s];
    const span_s = Math.min(this.span_s, last_s - first_s);
    const to_s = Math.min(last_s, Math.max(first_s + span_s, this.to_s ?? last_s));
    return [to_s - span_s, to_s];
  }

  /**
   * @param {number} from_s
   * @param {number} to_s
   */
  show(from_s, to_s) {
    const [first_s, last_s] = this.whole();
    const span_s = Math.max(SHORTEST_S, to_s - from_s);
    const isAll = span_s >= last_s - first_s;
    const end_s = Math.max(first_s, from_s) + span_s;
    this.span_s = isAll ? null : span_s;
    this.to_s = isAll || end_s >= last_s ? null : end_s;
    this.listeners.forEach((listener) => listener());
  }

  reset() {
    this.show(-Infinity, Infinity);
  }

  /**
   * @param {number} factor of the length
   * @param {number} [at_s] the time that stays where it is; without it, the end of a run that goes on, or else the middle
   */
  zoom(factor, at_s) {
    const [from_s, to_s] = this.range_s();
    const fixed_s = at_s ?? (this.to_s === null ? to_s : (from_s + to_s) / 2);
    const span_s = Math.max(SHORTEST_S, (to_s - from_s) * factor);
    const share = (fixed_s - from_s) / (to_s - from_s);
    this.show(fixed_s - share * span_s, fixed_s + (1 - share) * span_s);
  }

  /** @param {number} by_s */
  move(by_s) {
    if (this.isWhole) return;
    const [first_s, last_s] = this.whole();
    const [from_s, to_s] = this.range_s();
    const step_s = Math.min(last_s - to_s, Math.max(first_s - from_s, by_s));
    this.show(from_s + step_s, to_s + step_s);
  }
}

/**
 * Wheel and drags on an element change the window, a click seeks.
 * @param {HTMLElement} element
 * @param {TimeWindow} shown
 * @param {{left_px: number, right_px: number, seek: (time_s: number) => void}} place how much of the element at the left and
 *   at the right is not time
 */
export function steer(element, shown, { seek, ...sides }) {
  element.classList.add("steered");
  zoomByWheel(element, shown, sides);
  const box = document.createElement("div");
  box.className = "selection";
  /** Where a press began. @type {{id: number, x_px: number, time_s: number} | null} */
  let press = null;
  let waiting = 0;

  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    press = { id: event.pointerId, x_px: event.clientX, time_s: timeAt(element, shown, sides, event.clientX) };
  });
  element.addEventListener("pointermove", (event) => {
    if (press?.id !== event.pointerId || Math.abs(event.clientX - press.x_px) < CLICK_PX) return;
    if (!box.isConnected) {
      element.setPointerCapture(event.pointerId);
      element.append(box);
    }
    const { left } = element.getBoundingClientRect();
    box.style.left = `${Math.min(press.x_px, event.clientX) - left}px`;
    box.style.width = `${Math.abs(event.clientX - press.x_px)}px`;
    box.style.height = `${element.scrollHeight}px`;
  });
  element.addEventListener("pointerup", (event) => {
    if (press?.id !== event.pointerId) return;
    const { time_s } = press;
    const isDrag = box.isConnected;
    const end_s = timeAt(element, shown, sides, event.clientX);
    leave();
    if (isDrag) shown.show(Math.min(time_s, end_s), Math.max(time_s, end_s));
    else click(end_s);
  });
  element.addEventListener("pointercancel", () => leave());
  element.addEventListener("dblclick", () => {
    clearTimeout(waiting);
    shown.reset();
  });

  const leave = () => {
    press = null;
    box.remove();
  };
  const click = (/** @type {number} */ time_s) => {
    clearTimeout(waiting);
    if (shown.isWhole) seek(time_s);
    else waiting = window.setTimeout(() => seek(time_s), DOUBLE_MS);
  };
}

/**
 * The wheel makes the window shorter or longer around the time at the pointer, and moves it.
 * @param {HTMLElement} element
 * @param {TimeWindow} shown
 * @param {{left_px: number, right_px: number}} sides how much of the element is not time
 */
export function zoomByWheel(element, shown, sides) {
  element.addEventListener(
    "wheel",
    (event) => {
      // What scrolls keeps doing so, unless the wheel is turned for zooming.
      const isScrolled = element.scrollHeight > element.clientHeight + 1 && getComputedStyle(element).overflowY !== "visible" && !event.ctrlKey;
      const [from_s, to_s] = shown.range_s();
      const along = event.shiftKey ? event.deltaY : event.deltaX;
      const isAlong = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
      if (isScrolled && !isAlong) return;
      event.preventDefault();
      if (isAlong) shown.move(((to_s - from_s) * along) / 600);
      else shown.zoom(Math.exp(Math.min(1, Math.max(-1, event.deltaY / 300))), timeAt(element, shown, sides, event.clientX));
    },
    { passive: false },
  );
}

/**
 * An element whose width is a window of time, as a view of the cross-hair.
 * @param {HTMLElement} place
 * @param {TimeWindow} shown
 * @param {{left_px: number, right_px: number}} sides how much of it is not time
 * @param {() => number} tick_s length of a tick
 * @returns {import("./crosshair.js").TimeView}
 */
export function timeView(place, shown, sides, tick_s) {
  return {
    place,
    hasCursor: true,
    tickAt: ({ clientX }) => (tick_s() > 0 ? Math.round(timeAt(place, shown, sides, clientX) / tick_s()) : null),
    xOf: (tick) => {
      const [from_s, to_s] = shown.range_s();
      const share = (tick * tick_s() - from_s) / (to_s - from_s);
      if (share < 0 || share > 1) return null;
      return sides.left_px + share * (place.clientWidth - sides.left_px - sides.right_px);
    },
  };
}

/**
 * The time at a place in an element.
 * @param {HTMLElement} element
 * @param {TimeWindow} shown
 * @param {{left_px: number, right_px: number}} sides
 * @param {number} x_px
 */
function timeAt(element, shown, { left_px, right_px }, x_px) {
  const box = element.getBoundingClientRect();
  const [from_s, to_s] = shown.range_s();
  const share = (x_px - box.left - left_px) / Math.max(1, element.clientWidth - left_px - right_px);
  return from_s + Math.min(1, Math.max(0, share)) * (to_s - from_s);
}
