// @ts-check
// Facial expressions: measures are interpolated between neutral and the full expression by its intensity.

import { svg } from "./vendor/lit-html.js";

/** @typedef {import("./types/messages.js").Face} Face */

/**
 * What makes an expression, in units of a 100 by 100 picture.
 * @typedef {object} Measures
 * @property {number} browInner how far the inner ends of the brows go down
 * @property {number} browOuter how far the outer ends go down
 * @property {number} eye half the height of an eye
 * @property {number} lid how much of the eye a lid below covers, 0 to 1
 * @property {number} corners how far the corners of the mouth go up
 * @property {number} upper how far the upper lip bends down in its middle
 * @property {number} lower how far the lower lip does
 * @property {number} width half the width of the mouth
 * @property {number} nose how visible a wrinkled nose is, 0 to 1
 */

/** @type {Measures} */
const NEUTRAL = { browInner: 0, browOuter: 0, eye: 6, lid: 0, corners: 0, upper: 0, lower: 0, width: 15, nose: 0 };

/** @type {Record<Face, Measures>} */
const FACES = {
  neutral: NEUTRAL,
  happy: { browInner: -2, browOuter: -2, eye: 6, lid: 0.45, corners: 7, upper: 5, lower: 18, width: 20, nose: 0 },
  sad: { browInner: -8, browOuter: 5, eye: 5, lid: 0, corners: -8, upper: -9, lower: -9, width: 14, nose: 0 },
  surprised: { browInner: -9, browOuter: -8, eye: 9, lid: 0, corners: 0, upper: -9, lower: 13, width: 9, nose: 0 },
  disgusted: { browInner: 4, browOuter: -1, eye: 4, lid: 0.4, corners: -4, upper: -9, lower: -3, width: 15, nose: 1 },
  angry: { browInner: 8, browOuter: -5, eye: 4.5, lid: 0, corners: -6, upper: -7, lower: -3, width: 16, nose: 0 },
  fearful: { browInner: -9, browOuter: -1, eye: 8.5, lid: 0, corners: -4, upper: -4, lower: 5, width: 16, nose: 0 },
};

/**
 * The lines and areas of a face, each with its class, from the back to the front.
 * @param {Face} face
 * @param {number} intensity 0 to 1
 * @returns {{name: string, d: string, opacity?: number}[]}
 */
export function faceShapes(face, intensity) {
  const full = Object.hasOwn(FACES, face) ? FACES[face] : NEUTRAL;
  // Without intensity a face is neutral; a weak expression is made stronger, so that it is visible.
  const part = Math.sqrt(Math.min(1, Math.max(0, Number.isFinite(intensity) ? intensity : 0)));
  const m = /** @type {Measures} */ (
    Object.fromEntries(
      Object.entries(NEUTRAL).map(([key, value]) => [key, value + part * (full[/** @type {keyof Measures} */ (key)] - value)]),
    )
  );

  return [
    { name: "skin", d: ellipse(50, 50, 45, 45) },
    { name: "brow", d: brow(m, 33, 1) },
    { name: "brow", d: brow(m, 67, -1) },
    { name: "eye", d: ellipse(34, 44, 5, m.eye) },
    { name: "eye", d: ellipse(66, 44, 5, m.eye) },
    { name: "lid", d: lid(m, 34) },
    { name: "lid", d: lid(m, 66) },
    { name: "wrinkle", d: "M43 54l4 3M57 54l-4 3M45 60l3 1M55 60l-3 1", opacity: m.nose },
    { name: "mouth", d: mouth(m) },
  ].filter(({ d, opacity }) => d && opacity !== 0);
}

/**
 * @param {Face} face
 * @param {number} intensity 0 to 1
 */
export function drawFace(face, intensity) {
  return faceShapes(face, intensity).map(({ name, d, opacity }) => svg`<path class=${name} d=${d} opacity=${opacity ?? 1}></path>`);
}

/** @type {(x: number, y: number, rx: number, ry: number) => string} */
function ellipse(x, y, rx, ry) {
  return `M${x - rx} ${y}A${rx} ${ry} 0 1 1 ${x + rx} ${y}A${rx} ${ry} 0 1 1 ${x - rx} ${y}Z`;
}

/**
 * @param {Measures} m
 * @param {number} x of its middle
 * @param {number} inward 1 where the inner end is on the right
 */
function brow(m, x, inward) {
  const outer = `${x - 10 * inward} ${29 + m.browOuter}`;
  const middle = `${x} ${26 + (m.browInner + m.browOuter) / 2}`;
  return `M${outer}Q${middle} ${x + 10 * inward} ${29 + m.browInner}`;
}

/**
 * @param {Measures} m
 * @param {number} x
 */
function lid(m, x) {
  if (m.lid < 0.05) return "";
  const top = 44 + m.eye - 2 * m.eye * m.lid;
  return `M${x - 7} ${top + 2}Q${x} ${top - 3} ${x + 7} ${top + 2}V${46 + m.eye}H${x - 7}Z`;
}

/** @param {Measures} m */
function mouth(m) {
  const y = 70 - m.corners / 2;
  const left = 50 - m.width;
  const right = 50 + m.width;

  return `M${left} ${y}Q50 ${y + m.upper} ${right} ${y}Q50 ${y + m.lower} ${left} ${y}Z`;
}
