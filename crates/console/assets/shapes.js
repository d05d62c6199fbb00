// @ts-check
// Small symbols on a canvas or in a picture, in CSS pixels.

/** @typedef {import("./theme.js").Theme} Theme */
/** What is drawn on: a canvas, or what writes SVG in its place (`vector.js`).
 * @typedef {Pick<CanvasRenderingContext2D, "fillStyle" | "strokeStyle" | "lineWidth" | "lineCap" | "lineJoin" | "globalAlpha" | "font"
 *   | "textAlign" | "textBaseline" | "beginPath" | "moveTo" | "lineTo" | "arc" | "rect" | "fill" | "stroke" | "fillRect" | "strokeRect"
 *   | "fillText" | "strokeText" | "setLineDash">} Paper */

const FULL_TURN = 2 * Math.PI;

/**
 * @param {Paper} context
 * @param {Theme} theme
 * @param {string} words
 * @param {number} x
 * @param {number} y
 * @param {string} color
 */
export function text(context, theme, words, x, y, color) {
  context.font = `600 12px ${theme.font}`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = theme.field;
  context.strokeText(words.slice(0, 60), x, y);
  context.fillStyle = color;
  context.fillText(words.slice(0, 60), x, y);
}

/** @type {(context: Paper, x1: number, y1: number, x2: number, y2: number) => void} */
export function line(context, x1, y1, x2, y2) {
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
}

/** A line with a head at its end. @type {(context: Paper, x1: number, y1: number, x2: number, y2: number) => void} */
export function arrow(context, x1, y1, x2, y2) {
  const angle_rad = Math.atan2(y2 - y1, x2 - x1);
  const side = (/** @type {number} */ turn) => /** @type {const} */ ([x2 - 9 * Math.cos(angle_rad + turn), y2 - 9 * Math.sin(angle_rad + turn)]);
  line(context, x1, y1, x2, y2);
  line(context, ...side(0.5), x2, y2);
  context.lineTo(...side(-0.5));
}

/** @type {(context: Paper, x: number, y: number, radius: number, color: string) => void} */
export function disk(context, x, y, radius, color) {
  context.beginPath();
  context.arc(x, y, radius, 0, FULL_TURN);
  context.fillStyle = color;
  context.fill();
}

/** @type {(context: Paper, x: number, y: number, radius: number, color: string, width: number, dash?: number[]) => void} */
export function ring(context, x, y, radius, color, width, dash = []) {
  context.beginPath();
  context.arc(x, y, radius, 0, FULL_TURN);
  context.strokeStyle = color;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

/** @type {(context: Paper, x: number, y: number, size: number, color: string) => void} */
export function cross(context, x, y, size, color) {
  context.strokeStyle = color;
  context.lineWidth = 2;
  context.beginPath();
  line(context, x - size, y - size, x + size, y + size);
  line(context, x - size, y + size, x + size, y - size);
  context.stroke();
}

/** The direction of motion. @type {(context: Paper, x: number, y: number, radius: number, angle_rad: number, color: string) => void} */
export function nose(context, x, y, radius, angle_rad, color) {
  const at = (/** @type {number} */ turn, /** @type {number} */ distance) =>
    /** @type {const} */ ([x + Math.cos(angle_rad + turn) * distance, y - Math.sin(angle_rad + turn) * distance]);
  context.beginPath();
  context.moveTo(...at(0, radius + 7));
  context.lineTo(...at(0.42, radius));
  context.lineTo(...at(-0.42, radius));
  context.fillStyle = color;
  context.fill();
}

/** The direction of a robot that stands. @type {(context: Paper, x: number, y: number, radius: number, angle_rad: number, color: string) => void} */
export function notch(context, x, y, radius, angle_rad, color) {
  const [right, up] = [Math.cos(angle_rad), Math.sin(angle_rad)];
  context.beginPath();
  line(context, x + right * radius, y - up * radius, x + right * (radius + 6), y - up * (radius + 6));
  context.strokeStyle = color;
  context.lineWidth = 2.5;
  context.lineCap = "round";
  context.stroke();
}

/** A robot that is blocked. @type {(context: Paper, x: number, y: number, radius: number, angle_rad: number, color: string) => void} */
export function barrier(context, x, y, radius, angle_rad, color) {
  context.beginPath();
  context.arc(x, y, radius + 4, -angle_rad - 0.8, -angle_rad + 0.8);
  context.strokeStyle = color;
  context.lineWidth = 4.5;
  context.lineCap = "round";
  context.stroke();
}

/** @type {(context: Paper, x: number, y: number, color: string, paper: string) => void} */
export function envelope(context, x, y, color, paper) {
  context.fillStyle = paper;
  context.strokeStyle = color;
  context.lineWidth = 1.75;
  context.beginPath();
  context.rect(x - 9, y - 6, 18, 12);
  context.fill();
  context.moveTo(x - 9, y - 6);
  context.lineTo(x, y + 1);
  context.lineTo(x + 9, y - 6);
  context.stroke();
}
