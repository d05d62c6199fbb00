// @ts-check
// What stands on the field, and what is under everything else: the floor, obstacles with their shapes, walls; and the shapes of
// robots.

import * as draw from "./draw.js";
import { drawLayer } from "./layers.js";

/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").BodyShape} BodyShape */
/** What of a frame stands. @typedef {Pick<WorldFrame, "obstacles" | "body_m" | "static_world">} Standing */

/** Width of a wall, which has no thickness, and with its edges. */
export const WALL_PX = 3;
const EDGED_PX = 4.5;

/**
 * The field with all that stands on it.
 * @param {draw.Pen} pen
 * @param {Standing} standing
 * @param {number} step_m between lines of the grid
 * @param {import("./types/messages.js").LayerFrame | null} layer
 */
export function drawGround(pen, standing, step_m, layer) {
  draw.field(pen, step_m, () => drawLayer(pen, layer));
  drawObstacles(pen, standing);
  drawWalls(pen, standing.static_world?.walls ?? []);
}

/** @type {(pen: draw.Pen, standing: Standing) => void} */
function drawObstacles(pen, { obstacles, body_m, static_world }) {
  const shapes = static_world?.obstacle_shapes ?? [];
  draw.obstacles(pen, shapes.length === 0 ? obstacles : obstacles.filter((_, i) => !shapes[i]), body_m);

  const { context, camera, theme } = pen;
  context.fillStyle = theme.obstacle;
  context.strokeStyle = theme.obstacleEdge;
  context.lineWidth = 1;
  for (const [i, shape] of shapes.entries()) {
    if (!shape || !obstacles[i]) continue;
    outline(context, shape, camera.scale, camera.x(obstacles[i][0]), camera.y(obstacles[i][1]));
    context.fill();
    context.stroke();
  }
}

/** @type {(pen: draw.Pen, walls: [number, number][][]) => void} */
function drawWalls({ context, camera, theme }, walls) {
  if (walls.length === 0) return;
  context.beginPath();
  for (const corners of walls) {
    for (const [i, [x_m, y_m]] of corners.entries()) {
      if (i === 0) context.moveTo(camera.x(x_m), camera.y(y_m));
      else context.lineTo(camera.x(x_m), camera.y(y_m));
    }
  }
  context.lineCap = "round";
  context.lineJoin = "round";
  // On a dark field obstacles stand out by their edges.
  context.strokeStyle = theme.obstacleEdge;
  context.lineWidth = EDGED_PX;
  context.stroke();
  context.strokeStyle = theme.obstacle;
  context.lineWidth = WALL_PX;
  context.stroke();
}

/** The path around a shape. @type {(context: draw.Pen["context"], shape: BodyShape, scale: number, x: number, y: number, turn_rad?: number) => void} */
function outline(context, shape, scale, x, y, turn_rad = 0) {
  context.beginPath();
  if ("disc" in shape) return context.arc(x, y, shape.disc * scale, 0, 2 * Math.PI);
  const [half_width, half_height] = shape.rectangle.map((side_m) => (side_m * scale) / 2);
  if (turn_rad === 0) return context.rect(x - half_width, y - half_height, 2 * half_width, 2 * half_height);
  // On the screen y points down.
  const [cos, sin] = [Math.cos(turn_rad), -Math.sin(turn_rad)];
  for (const [i, [right, down]] of [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]].entries()) {
    const [dx, dy] = [right * half_width, down * half_height];
    const corner = /** @type {const} */ ([x + dx * cos - dy * sin, y + dx * sin + dy * cos]);
    if (i === 0) context.moveTo(...corner);
    else context.lineTo(...corner);
  }
}

/** The shape of a robot, if it has one of its own. @type {(frame: Pick<WorldFrame, "static_world"> | null, robot: string) => BodyShape | undefined} */
export function shapeOf(frame, robot) {
  return frame?.static_world?.robot_shapes?.[robot];
}

/** Width and height of a shape; without one, of a square of the run's size. @type {(shape: BodyShape | null | undefined, body_m: number) => [number, number]} */
export function sizeOf(shape, body_m) {
  if (!shape) return [body_m, body_m];
  return "disc" in shape ? [2 * shape.disc, 2 * shape.disc] : shape.rectangle;
}

/**
 * The ground that a rectangular robot covers, which turns with a robot that drives. Its body, a circle, is as wide as the rectangle is
 * narrow.
 * @type {(pen: draw.Pen, shape: BodyShape | undefined, x: number, y: number, turn_rad: number) => void}
 */
export function footprint({ context, camera, theme }, shape, x, y, turn_rad) {
  if (!shape || "disc" in shape) return;
  outline(context, shape, camera.scale, x, y, turn_rad);
  context.fillStyle = theme.robot;
  context.globalAlpha = 0.22;
  context.fill();
  context.globalAlpha = 1;
  context.strokeStyle = theme.robot;
  context.lineWidth = 1.5;
  context.stroke();
}
