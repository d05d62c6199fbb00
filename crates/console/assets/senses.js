// @ts-check
// Where a robot looks: its field of view as a sector, and the fan of its rays, each as long as what it measures. The lengths are in no
// frame and no record. Rays neither miss nor err, so they follow from the places of all bodies, by the rules of the simulator
// (`world/src/sight.rs`). A robot that turns in the tick that is shown has measured in its direction before.

import { viewOf } from "./draw.js";
import { shapeOf, sizeOf } from "./solids.js";

/** @typedef {import("./draw.js").Pen} Pen */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").BodyShape} BodyShape */
/** @typedef {{x: number, y: number}} Place */
/** Where all that moves is seen. @typedef {{robotsNow: Map<string, Place>, now_m: Float64Array}} Moving */
/** @typedef {{at: Place, shape: BodyShape | null, half_m: [number, number], turn_rad: number}} Body */

const FULL_TURN = 2 * Math.PI;
/** Size of the end of a ray that meets something. */
const HIT_PX = 1.8;

/** Whether robots look into a direction. @param {WorldFrame | null} frame */
export function haveDirections(frame) {
  return !!frame?.static_world?.sensing;
}

/**
 * The field of view of a robot, and what its rays measure.
 * @param {Pen} pen
 * @param {WorldFrame} frame
 * @param {string} name of the robot
 * @param {Moving} moving
 */
export function drawSenses(pen, frame, name, moving) {
  const sensing = frame.static_world?.sensing;
  const robot = frame.robots.find((one) => one.name === name);
  if (!sensing || robot?.presence !== "here") return;

  const place = moving.robotsNow.get(name) ?? robot.location;
  const { scale } = pen.camera;
  const x = pen.camera.x(place.x);
  const y = pen.camera.y(place.y);
  const { field_of_view_rad, range_m, rays } = sensing;
  if (field_of_view_rad) drawSector(pen, x, y, range_m * scale, viewOf(robot), field_of_view_rad);
  if (!rays) return;
  const ends = raysOf(frame, name, moving).map((length_m, i) => {
    const angle = viewOf(robot) + (FULL_TURN * i) / rays.count;
    return { x: x + Math.cos(angle) * length_m * scale, y: y - Math.sin(angle) * length_m * scale, isHit: length_m < rays.range_m };
  });
  drawFan(pen, x, y, ends);
}

/**
 * A sector around a direction.
 * @type {(pen: Omit<Pen, "camera">, x: number, y: number, radius: number, direction_rad: number, angle_rad: number) => void}
 */
export function drawSector({ context, theme }, x, y, radius, direction_rad, angle_rad) {
  const half = Math.min(angle_rad, FULL_TURN) / 2;
  context.beginPath();
  context.moveTo(x, y);
  // On the screen y points down.
  context.arc(x, y, radius, -direction_rad - half, -direction_rad + half);
  context.lineTo(x, y);
  context.fillStyle = theme.accent;
  context.globalAlpha = 0.1;
  context.fill();
  context.globalAlpha = 0.45;
  context.strokeStyle = theme.accent;
  context.lineWidth = 1;
  context.stroke();
  context.globalAlpha = 1;
}

/**
 * Rays from a place to their ends, with a dot where one meets something.
 * @type {(pen: Omit<Pen, "camera">, x: number, y: number, ends: {x: number, y: number, isHit: boolean}[]) => void}
 */
export function drawFan({ context, theme }, x, y, ends) {
  context.strokeStyle = theme.accent;
  context.lineWidth = 1;
  context.globalAlpha = 0.4;
  context.beginPath();
  for (const end of ends) {
    context.moveTo(x, y);
    context.lineTo(end.x, end.y);
  }
  context.stroke();
  context.globalAlpha = 1;
  context.fillStyle = theme.accent;
  context.beginPath();
  for (const end of ends.filter(({ isHit }) => isHit)) {
    context.moveTo(end.x + HIT_PX, end.y);
    context.arc(end.x, end.y, HIT_PX, 0, FULL_TURN);
  }
  context.fill();
}

/**
 * The lengths of a robot's rays, from its direction on counter-clockwise, meters; empty if there are none.
 * @param {WorldFrame} frame
 * @param {string} name
 * @param {Moving} moving
 * @returns {number[]}
 */
export function raysOf(frame, name, moving) {
  const rays = frame.static_world?.sensing?.rays;
  const robot = frame.robots.find((one) => one.name === name);
  if (!rays || !robot) return [];

  const from = moving.robotsNow.get(name) ?? robot.location;
  const bodies = bodiesNear(frame, name, moving, from, rays.range_m);
  const walls = wallsNear(frame.static_world?.walls ?? [], from, rays.range_m);
  const [width_m, height_m] = frame.field_m;
  const field = { at: { x: width_m / 2, y: height_m / 2 }, half_m: /** @type {[number, number]} */ ([width_m / 2, height_m / 2]) };

  return Array.from({ length: rays.count }, (_, i) => {
    const angle = viewOf(robot) + (FULL_TURN * i) / rays.count;
    const step = { x: Math.cos(angle) * rays.range_m, y: Math.sin(angle) * rays.range_m };
    let nearest = Math.min(1, Math.max(0, inRectangle(from, step, field)[1]));
    for (const body of bodies) nearest = Math.min(nearest, entered(from, step, body));
    for (const [one, other] of walls) nearest = Math.min(nearest, crossed(from, step, one, other));
    return nearest * rays.range_m;
  });
}

/** All bodies but the robot's own. @type {(frame: WorldFrame, name: string, moving: Moving, from: Place, range_m: number) => Body[]} */
function bodiesNear(frame, name, { robotsNow, now_m }, from, range_m) {
  const { body_m, static_world } = frame;
  /** @type {Body[]} */
  const bodies = [];
  const add = (/** @type {Place} */ at, /** @type {BodyShape | null | undefined} */ shape, turn_rad = 0) => {
    const [width_m, height_m] = sizeOf(shape, body_m);
    const most_m = Math.max(width_m, height_m);
    const isNear = Math.abs(at.x - from.x) <= range_m + most_m && Math.abs(at.y - from.y) <= range_m + most_m;
    if (isNear) bodies.push({ at, shape: shape ?? null, half_m: [width_m / 2, height_m / 2], turn_rad });
  };

  frame.obstacles.forEach(([x, y], i) => add({ x, y }, static_world?.obstacle_shapes?.[i]));
  for (const { name: other, location, heading_rad } of frame.robots) {
    if (other !== name) add(robotsNow.get(other) ?? location, shapeOf(frame, other), heading_rad ?? 0);
  }
  for (let i = 0; i < now_m.length; i += 2) add({ x: now_m[i], y: now_m[i + 1] }, null);
  return bodies;
}

/** The straight walls of which a part may be within a range. @type {(walls: [number, number][][], from: Place, range_m: number) => [Place, Place][]} */
function wallsNear(walls, from, range_m) {
  /** @type {[Place, Place][]} */
  const near = [];
  for (const corners of walls) {
    for (let i = 1; i < corners.length; i += 1) {
      const [one, other] = [corners[i - 1], corners[i]].map(([x, y]) => ({ x, y }));
      const isBeside = (/** @type {"x" | "y"} */ axis) =>
        Math.min(one[axis], other[axis]) <= from[axis] + range_m && from[axis] - range_m <= Math.max(one[axis], other[axis]);
      if (isBeside("x") && isBeside("y")) near.push([one, other]);
    }
  }
  return near;
}

/** The share of a way after which it enters a body; infinite if it does not. @type {(from: Place, step: Place, body: Body) => number} */
function entered(from, step, body) {
  const isDisc = body.shape !== null && "disc" in body.shape;
  const [enter, leave] = isDisc ? inDisc(from, step, body) : inTurned(from, step, body);
  const share = Math.max(0, enter);
  return share < Math.min(1, leave) ? share : Infinity;
}

/** The same of a rectangle that is turned. @type {(from: Place, step: Place, body: Body) => [number, number]} */
function inTurned(from, step, { at, half_m, turn_rad }) {
  const [cos, sin] = [Math.cos(turn_rad), Math.sin(turn_rad)];
  const turnBack = (/** @type {number} */ x, /** @type {number} */ y) => ({ x: x * cos + y * sin, y: y * cos - x * sin });
  return inRectangle(turnBack(from.x - at.x, from.y - at.y), turnBack(step.x, step.y), { at: { x: 0, y: 0 }, half_m });
}

/** The shares of a way between which it is in a rectangle. @type {(from: Place, step: Place, body: Pick<Body, "at" | "half_m">) => [number, number]} */
function inRectangle(from, step, { at, half_m }) {
  const [enterX, leaveX] = within(from.x, step.x, at.x, half_m[0]);
  const [enterY, leaveY] = within(from.y, step.y, at.y, half_m[1]);
  return [Math.max(enterX, enterY), Math.min(leaveX, leaveY)];
}

/** @type {(from: number, step: number, center: number, half: number) => [number, number]} */
function within(from, step, center, half) {
  if (step === 0) return Math.abs(from - center) < half ? [-Infinity, Infinity] : [0, 0];
  const [one, other] = [(center - half - from) / step, (center + half - from) / step];
  return [Math.min(one, other), Math.max(one, other)];
}

/** The shares of a way between which it is in a disc. @type {(from: Place, step: Place, body: Body) => [number, number]} */
function inDisc(from, step, { at, half_m: [radius_m] }) {
  const [x, y] = [from.x - at.x, from.y - at.y];
  const step_m2 = step.x ** 2 + step.y ** 2;
  const half_b = x * step.x + y * step.y;
  const discriminant = half_b ** 2 - step_m2 * (x ** 2 + y ** 2 - radius_m ** 2);
  if (discriminant <= 0) return [0, 0];
  const root = Math.sqrt(discriminant);
  return [(-half_b - root) / step_m2, (-half_b + root) / step_m2];
}

/** The share of a way at which it crosses a wall; infinite if it does not. @type {(from: Place, step: Place, one: Place, other: Place) => number} */
function crossed(from, step, one, other) {
  const along = { x: other.x - one.x, y: other.y - one.y };
  const offset = { x: one.x - from.x, y: one.y - from.y };
  const area = step.x * along.y - step.y * along.x;
  const share = (offset.x * along.y - offset.y * along.x) / area;
  const part = (offset.x * step.y - offset.y * step.x) / area;
  return area !== 0 && share >= 0 && share < 1 && part >= 0 && part <= 1 ? share : Infinity;
}
