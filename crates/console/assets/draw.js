// @ts-check
// Draws the plan. Every function draws one kind of object and keeps no state.

import { robotColor, stateColors, stateLook } from "./palette.js";
import { initials } from "./roster.js";
import { arrow, barrier, cross, disk, envelope, line, nose, notch, ring, text } from "./shapes.js";

/** @typedef {import("./camera.js").Camera} Camera */
/** @typedef {import("./theme.js").Theme} Theme */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./history.js").Track} Track */
/** @typedef {{x: number, y: number}} Place */
/** A canvas, or what writes SVG in its place. @typedef {import("./shapes.js").Paper} Paper */
/** @typedef {{context: Paper, camera: Camera, theme: Theme}} Pen */
/** How a robot looks, wherever it is and goes.
 * @typedef {{letters: string, radius: number, presence: RobotFrame["presence"], emotion: string, hatching: number, isLate: boolean, isChosen: boolean}} Look */
/** What is drawn of a robot beside its body. @typedef {Pick<RobotFrame, "presence" | "blocked" | "direction_rad" | "heading_rad" | "speed_mps">} Drawn */

/** Where a robot looks, radians: along its heading, or where it moves if it does not drive.
 * @param {Pick<RobotFrame, "direction_rad" | "heading_rad">} robot */
export function viewOf({ heading_rad, direction_rad }) {
  return heading_rad ?? direction_rad;
}


const FULL_TURN = 2 * Math.PI;
/** Smallest radius at which the letters in a robot can be read. */
const SMALLEST_ROBOT_PX = 9;
/** Width of the ring in the color of the emotion, with its edge. */
const RING_PX = 4.5;
/** Dashes of the ring of an emotion whose areas are hatched, by their hatching. */
const DASHES = [[], [7, 3], [3, 3], [2, 2, 8, 2]];
/** Moods of guests that are drawn. */
const MOODS = /** @type {const} */ (["waiting", "annoyed"]);
/** Smaller guests would not be seen. */
const SMALLEST_GUEST_PX = 0.75;
/** Guests with a larger radius are pale, with an edge, so that robots stand out among them. */
const SMALLEST_PALE_PX = 5;
/** Circles per path: one path for all is slow, and so is one for each. */
const CIRCLES_IN_PATH = 60;

/** What is around the field. @param {Pen} pen */
export function outside({ context, camera, theme }) {
  context.fillStyle = theme.outside;
  context.fillRect(0, 0, camera.width_px, camera.height_px);
}

/**
 * The field with lines at whole steps, and what `below` draws below the lines.
 * @param {Pen} pen
 * @param {number} step_m
 * @param {() => void} below
 */
export function field({ context, camera, theme }, step_m, below) {
  const [width_m, height_m] = camera.field_m;
  const left = camera.x(0);
  const top = camera.y(height_m);
  const width = width_m * camera.scale;
  const height = height_m * camera.scale;
  context.fillStyle = theme.field;
  context.fillRect(left, top, width, height);
  below();

  if (step_m * camera.scale >= 6) {
    context.beginPath();
    for (let x = step_m; x < width_m - 1e-9; x += step_m) line(context, camera.x(x), top, camera.x(x), top + height);
    for (let y = step_m; y < height_m - 1e-9; y += step_m) line(context, left, camera.y(y), left + width, camera.y(y));
    context.strokeStyle = theme.grid;
    context.lineWidth = 1;
    context.stroke();
  }

  context.strokeStyle = theme.edge;
  context.lineWidth = 1.5;
  context.strokeRect(left, top, width, height);
}

/**
 * @param {Pen} pen
 * @param {Iterable<[number, number]>} centers
 * @param {number} body_m
 */
export function obstacles({ context, camera, theme }, centers, body_m) {
  const side = body_m * camera.scale;
  context.fillStyle = theme.obstacle;
  context.strokeStyle = theme.obstacleEdge;
  context.lineWidth = 1;

  for (const [x_m, y_m] of centers) {
    const x = camera.x(x_m) - side / 2;
    const y = camera.y(y_m) - side / 2;
    if (isOutside(camera, x + side / 2, y + side / 2, side)) continue;
    context.fillRect(x, y, side, side);
    if (side > 4) context.strokeRect(x + 0.5, y + 0.5, side - 1, side - 1);
  }
}

/** Radius of a guest. @param {Camera} camera @param {number} body_m */
export function guestRadius(camera, body_m) {
  return Math.max(SMALLEST_GUEST_PX, (body_m * camera.scale) / 2);
}

/** Whether guests of a radius have one color. @param {number} radius */
export function isPlain(radius) {
  return radius < SMALLEST_PALE_PX;
}

/**
 * Where the guests are that can be seen, x and y in turn.
 * @param {Camera} camera
 * @param {Float64Array} places_m x and y in turn
 * @param {number} radius
 */
export function guestsAt(camera, places_m, radius) {
  const { scale, width_px, height_px } = camera;
  const left = camera.x(0);
  const bottom = camera.y(0);
  const seen = [];

  for (let i = 0; i < places_m.length; i += 2) {
    const x = left + places_m[i] * scale;
    const y = bottom - places_m[i + 1] * scale;
    if (x > -radius && y > -radius && x < width_px + radius && y < height_px + radius) seen.push(x, y);
  }

  return seen;
}

/**
 * Guests: pale circles with an edge, which has the contrast; small ones have the color of the edge.
 * @param {Omit<Pen, "camera">} pen
 * @param {number[]} at x and y in turn
 * @param {number} radius
 */
export function guestCircles({ context, theme }, at, radius) {
  context.fillStyle = isPlain(radius) ? theme.guest : theme.guestFill;
  if (isPlain(radius)) return circles(context, at, radius, () => context.fill());

  context.strokeStyle = theme.guest;
  context.lineWidth = 1.5;
  circles(context, at, radius - 0.75, () => {
    context.fill();
    context.stroke();
  });
}

/**
 * The moods of guests, as faces on their circles: who waits has a straight mouth, who is annoyed a frown and a ring.
 * @param {Pen} pen
 * @param {Float64Array} places_m x and y in turn, of all guests
 * @param {import("./types/messages.js").WorldFrame["guest_moods"]} moods
 * @param {number} radius
 */
export function guestMoods(pen, places_m, moods, radius) {
  const { camera } = pen;
  for (const mood of MOODS) {
    for (const guest of moods?.[mood] ?? []) {
      const at = guestsAt(camera, places_m.subarray(2 * guest, 2 * guest + 2), radius);
      if (at.length) guestMood(pen, mood, at[0], at[1], radius);
    }
  }
}

/** @type {(pen: Omit<Pen, "camera">, mood: "waiting" | "annoyed", x: number, y: number, radius: number) => void} */
export function guestMood({ context, theme }, mood, x, y, radius) {
  const color = mood === "annoyed" ? theme.bad : theme.warning;
  if (mood === "annoyed" || isPlain(radius)) ring(context, x, y, radius, color, 1.5);
  if (isPlain(radius)) return;

  for (const side of [-1, 1]) disk(context, x + 0.35 * side * radius, y - 0.2 * radius, Math.max(1, 0.12 * radius), color);
  context.strokeStyle = color;
  context.lineWidth = 1.5;
  context.beginPath();
  if (mood === "annoyed") {
    context.moveTo(x - 0.4 * radius, y + 0.55 * radius);
    context.lineTo(x, y + 0.3 * radius);
    context.lineTo(x + 0.4 * radius, y + 0.55 * radius);
  } else {
    context.moveTo(x - 0.4 * radius, y + 0.4 * radius);
    context.lineTo(x + 0.4 * radius, y + 0.4 * radius);
  }
  context.stroke();
}

/** @type {(context: Paper, at: number[], radius: number, paint: () => void) => void} */
function circles(context, at, radius, paint) {
  for (let first = 0; first < at.length; first += 2 * CIRCLES_IN_PATH) {
    context.beginPath();
    for (let i = first; i < Math.min(at.length, first + 2 * CIRCLES_IN_PATH); i += 2) {
      context.moveTo(at[i] + radius, at[i + 1]);
      context.arc(at[i], at[i + 1], radius, 0, FULL_TURN);
    }
    paint();
  }
}

/**
 * @param {Pen} pen
 * @param {string} name of the robot
 * @param {Track} track
 * @param {number} from index
 * @param {number} to index, not included
 * @param {Place} end where the robot is seen now
 */
export function trail({ context, camera }, name, track, from, to, end) {
  context.strokeStyle = robotColor(name);
  context.lineWidth = 2;
  context.lineJoin = "round";
  context.lineCap = "round";
  const pieces = 8;

  for (let piece = 0; piece < pieces; piece += 1) {
    const first = from + Math.floor(((to - from) * piece) / pieces);
    const last = from + Math.floor(((to - from) * (piece + 1)) / pieces);
    context.globalAlpha = 0.1 + (0.7 * (piece + 1)) / pieces;
    context.beginPath();

    let isJoined = true;
    for (let i = first; i <= last && i < to; i += 1) {
      const x = track.x_m[i];
      const y = track.y_m[i];
      const isKnown = x !== null && y !== null;
      if (isKnown && isJoined) context.lineTo(camera.x(x), camera.y(y));
      else if (isKnown) context.moveTo(camera.x(x), camera.y(y));
      isJoined = isKnown;
    }
    if (piece === pieces - 1) context.lineTo(camera.x(end.x), camera.y(end.y));
    context.stroke();
  }

  context.globalAlpha = 1;
}

/** How a robot looks. A draft of the set-up has no emotion. @type {(robot: Pick<RobotFrame, "name" | "emotion_state" | "presence">, camera: {scale: number}, body_m: number, marks: {isLate: boolean, isChosen: boolean}) => Look} */
export function lookOf({ name, emotion_state, presence }, camera, body_m, { isLate, isChosen }) {
  const letters = initials(name);
  const least = letters.length > 2 ? SMALLEST_ROBOT_PX + 1 : SMALLEST_ROBOT_PX;
  const radius = Math.max(least, (body_m * camera.scale) / 2);
  const { hatching } = stateLook("emotion", emotion_state);
  return { letters, radius, presence, emotion: emotion_state, hatching, isLate, isChosen };
}

/** Half the side of a square around a robot's look. @param {Look} look */
export function reach({ radius }) {
  return Math.ceil(radius * 1.15 + RING_PX + 8);
}

/**
 * The color of an emotion: a disk, or a ring with the dashes that it has around robots.
 * @param {Omit<Pen, "camera">} pen
 * @param {string} emotion
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 */
export function emotionSign({ context, theme }, emotion, x, y, radius) {
  const { hatching } = stateLook("emotion", emotion);
  const { fill } = stateColors("emotion", emotion, theme.isOnPaper);
  if (hatching) ring(context, x, y, radius - 1.5, fill, 3, DASHES[hatching]);
  else disk(context, x, y, radius, fill);
}

/**
 * A red circle with the initials, in a ring in the color of the emotion, and rings around it.
 * @param {Omit<Pen, "camera">} pen
 * @param {Look} look
 * @param {number} x
 * @param {number} y
 */
export function body({ context, theme }, { letters, radius, presence, emotion, hatching, isLate, isChosen }, x, y) {
  const isHere = presence === "here";
  const outside = radius + RING_PX;
  if (isChosen) ring(context, x, y, outside + 5, theme.accent, 2);
  if (isLate && isHere) ring(context, x, y, outside + 2.5, theme.warning, 2.5, [4, 4]);
  if (isHere && emotion) {
    const { fill } = stateColors("emotion", emotion, theme.isOnPaper);
    disk(context, x, y, outside, theme.muted);
    disk(context, x, y, outside - 0.75, hatching ? theme.field : fill);
    disk(context, x, y, radius + 0.75, theme.field);
    if (hatching) ring(context, x, y, radius + RING_PX / 2, fill, RING_PX - 1.5, DASHES[hatching]);
  }
  disk(context, x, y, radius, isHere ? theme.robot : theme.absentFill);
  if (!isHere) ring(context, x, y, radius - 1, presence === "lost" ? theme.absent : theme.robot, 2.25, [3, 3]);
  if (presence === "lost") cross(context, x, y, radius * 1.15, theme.absent);
  const size = letters.length > 2 ? Math.max(8.5, radius * 0.75) : Math.max(10, radius * 0.95);
  context.font = `650 ${Math.min(22, size)}px ${theme.font}`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  if (presence === "lost") {
    // The cross is not to be taken for a part of the letters.
    context.strokeStyle = theme.absentFill;
    context.lineWidth = 5;
    context.lineJoin = "round";
    context.strokeText(letters, x, y + 0.5);
  }
  context.fillStyle = isHere ? theme.robotText : theme.absent;
  context.fillText(letters, x, y + 0.5);
}

/**
 * Where a robot goes, and what is in its way. One that stands has a tick mark, if it looks into its direction.
 * @param {Omit<Pen, "camera">} pen
 * @param {Drawn} robot
 * @param {Look} look
 * @param {number} x
 * @param {number} y
 * @param {boolean} looksAhead
 */
export function course({ context, theme }, robot, { radius }, x, y, looksAhead) {
  const { presence, blocked, direction_rad, speed_mps } = robot;
  if (presence !== "here") return;
  if (speed_mps > 0) nose(context, x, y, radius + RING_PX, direction_rad, theme.robot);
  else if (looksAhead) notch(context, x, y, radius + RING_PX, viewOf(robot), theme.robot);
  if (blocked) barrier(context, x, y, radius + RING_PX, direction_rad, theme.warning);
}

/**
 * A dashed line with a cross between two robots that are cut off from each other.
 * @param {Pen} pen
 * @param {Place} from
 * @param {Place} to
 * @param {string} label
 * @param {Area[]} taken where words stand
 */
export function cut({ context, camera, theme }, from, to, label, taken) {
  const x1 = camera.x(from.x);
  const y1 = camera.y(from.y);
  const x2 = camera.x(to.x);
  const y2 = camera.y(to.y);
  context.strokeStyle = theme.bad;
  context.lineWidth = 1.75;
  context.setLineDash([7, 6]);
  context.beginPath();
  line(context, x1, y1, x2, y2);
  context.stroke();
  context.setLineDash([]);

  const x = (x1 + x2) / 2;
  const y = (y1 + y2) / 2;
  context.fillStyle = theme.field;
  context.beginPath();
  context.arc(x, y, 9, 0, FULL_TURN);
  context.fill();
  ring(context, x, y, 9, theme.bad, 1.75);
  cross(context, x, y, 4.5, theme.bad);
  if (!label) return;
  text(context, theme, label, x, y + 20, theme.bad);
  taken.push({ x, y: y + 20, width: widthOf(label), height: LINE_PX });
}

/** An area that is taken, by its middle. @typedef {{x: number, y: number, width: number, height: number}} Area */
/** Where the words of a command may stand, beside its envelope: the first of these that is free. Below the last one there are none. */
const WORDS_PX = [-16, -31, 20, -46, 35];
/** How far from the middle of a robot an envelope is beside it. */
const BESIDE_PX = 30;
/** Height of a line of words, and about the width of a letter. */
const LINE_PX = 15;
const LETTER_PX = 7;

/** About the width of words. @param {string} words */
function widthOf(words) {
  return words.slice(0, 60).length * LETTER_PX;
}

/**
 * Where words are to stand that overlap none that stand already, and no robot if that can be helped; `null` if there is no such place.
 * @param {Area[]} taken by words; the new ones are added
 * @param {string} words
 * @param {number} x
 * @param {number} y of the envelope
 * @param {Area[]} robots
 * @returns {number | null}
 */
export function freeLine(taken, words, x, y, robots = []) {
  const width = widthOf(words);
  const isFree = (/** @type {Area[]} */ areas, /** @type {number} */ line) =>
    areas.every((area) => Math.abs(area.y - line) >= (area.height + LINE_PX) / 2 || Math.abs(area.x - x) >= (area.width + width) / 2);
  const free = WORDS_PX.map((offset) => y + offset).filter((line) => isFree(taken, line));
  const line = free.find((line) => isFree(robots, line)) ?? free[0] ?? null;
  if (line !== null) taken.push({ x, y: line, width, height: LINE_PX });
  return line;
}

/**
 * A command under way: an envelope on a dotted line. One that has arrived: an arrow that fades. One that was lost: crossed out.
 * @param {Pen} pen
 * @param {import("./flights.js").Shown} flight
 * @param {Place} from
 * @param {Place} to
 * @param {{words: Area[], robots: Area[]}} taken where words and robots are
 */
export function flight({ context, camera, theme }, { text: words, fate, progress, faded, isNamed }, from, to, taken) {
  const x1 = camera.x(from.x);
  const y1 = camera.y(from.y);
  const x2 = camera.x(to.x);
  const y2 = camera.y(to.y);
  const length = Math.max(1, Math.hypot(x2 - x1, y2 - y1));
  // Between the two robots, whose letters can be read.
  const beside = Math.min(0.35, BESIDE_PX / length);
  const part = beside + (1 - 2 * beside) * progress;
  const x = x1 + (x2 - x1) * part;
  const y = y1 + (y2 - y1) * part;
  const color = fate === "dropped" ? theme.bad : theme.accent;
  context.globalAlpha = 1 - 0.7 * faded;
  context.strokeStyle = color;
  context.lineWidth = 1.5;
  context.lineCap = "round";
  if (fate !== "delivered") context.setLineDash([1, 5]);
  context.beginPath();
  if (fate !== "delivered") line(context, x1, y1, x2, y2);
  else arrow(context, x1 + (x2 - x1) * beside, y1 + (y2 - y1) * beside, x, y);
  context.stroke();
  context.setLineDash([]);
  if (fate !== "delivered") envelope(context, x, y, color, theme.field);
  if (fate === "dropped") cross(context, x, y, 9, color);
  // Not beyond the edges.
  const half = widthOf(words) / 2 + 4;
  const middle_px = Math.max(half, Math.min(camera.width_px - half, x));
  const line_px = words && isNamed ? freeLine(taken.words, words, middle_px, y, taken.robots) : null;
  if (line_px !== null) text(context, theme, words, middle_px, line_px, color);
  context.globalAlpha = 1;
}

/**
 * A scale bar.
 * @param {Pen} pen
 * @param {number} length_m
 * @param {string} label
 */
export function scaleBar({ context, camera, theme }, length_m, label) {
  const x = 14;
  const y = camera.height_px - 14;
  const width = length_m * camera.scale;

  context.strokeStyle = theme.muted;
  context.lineWidth = 1.5;
  context.beginPath();
  line(context, x, y, x + width, y);
  line(context, x, y - 4, x, y);
  line(context, x + width, y - 4, x + width, y);
  context.stroke();
  text(context, theme, label, x + width + 26, y - 1, theme.muted);
}

/** @type {(camera: Camera, x: number, y: number, margin: number) => boolean} */
export function isOutside(camera, x, y, margin) {
  return x < -margin || y < -margin || x > camera.width_px + margin || y > camera.height_px + margin;
}
