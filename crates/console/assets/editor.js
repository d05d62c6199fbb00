// @ts-check
// Editing the set-up on the plan: a click places or removes an obstacle, a drag builds or clears a wall, a robot is
// dragged to its place.

import { isWithin, overlaps } from "./draft.js";

/** @typedef {import("./types/messages.js").Setup} Setup */
/** @typedef {{x: number, y: number}} Place */
/** What a drag does. @typedef {{kind: "build", start: Place, at: Place} | {kind: "clear"} | {kind: "robot", name: string}} Drag */

/** A drag that begins this far from a robot's body still moves the robot. */
const GRIP_M = 0.15;
const MOST_OBSTACLES = 5000;

export class Editor {
  /** @param {{changed: () => void, note: (text: string) => void, body_m: () => number, hasFault: (field: string) => boolean}} client */
  constructor(client) {
    this.client = client;
    /** Shown on the plan while not null. @type {Setup | null} */
    this.draft = null;
    /** Whether the draft is what the run is set up with. */
    this.isAsApplied = true;
    /** @type {Drag | null} */
    this.drag = null;
  }

  get isActive() {
    return this.draft !== null;
  }

  /** @param {string} robot */
  faulty(robot) {
    return this.client.hasFault(`robots.${robot}`);
  }

  /** @param {Place} place */
  down(place) {
    const { draft } = this;
    if (!draft) return false;

    const name = this.robotAt(place);
    if (name) {
      this.drag = { kind: "robot", name };
    } else if (this.remove(place)) {
      this.drag = { kind: "clear" };
    } else {
      const start = this.snap(place);
      this.drag = { kind: "build", start, at: start };
      const reason = this.place(start);
      if (reason) this.client.note(reason);
    }

    this.client.changed();

    return true;
  }

  /** @param {Place} place */
  move(place) {
    const { draft, drag } = this;
    if (!draft || !drag) return;

    if (drag.kind === "robot") draft.robots[drag.name] = this.inside(place);
    else if (drag.kind === "clear") this.remove(place);
    else this.wall(drag, place);
    this.client.changed();
  }

  up() {
    this.drag = null;
  }

  /**
   * Places obstacles side by side, at whole bodies from the start of the drag.
   * @param {Extract<Drag, {kind: "build"}>} drag
   * @param {Place} place
   */
  wall(drag, place) {
    const body_m = this.client.body_m();
    const cell = (/** @type {Place} */ at) => [Math.round((at.x - drag.start.x) / body_m), Math.round((at.y - drag.start.y) / body_m)];
    const [fromX, fromY] = cell(drag.at);
    const [toX, toY] = cell(place);
    const steps = Math.min(1000, Math.max(Math.abs(toX - fromX), Math.abs(toY - fromY)));

    for (let i = 1; i <= steps; i += 1) {
      const x = fromX + Math.round(((toX - fromX) * i) / steps);
      const y = fromY + Math.round(((toY - fromY) * i) / steps);
      this.place({ x: exact(drag.start.x + x * body_m), y: exact(drag.start.y + y * body_m) });
    }

    drag.at = place;
  }

  /**
   * Places an obstacle if there is room.
   * @param {Place} place
   * @returns {string} why there is no room; empty if it was placed
   */
  place(place) {
    const { draft } = this;
    const body_m = this.client.body_m();
    if (!draft) return "";
    if (!isWithin(place, draft.field_m, body_m)) return "An obstacle must be wholly within the field.";

    const robot = Object.entries(draft.robots).find(([, at]) => overlaps(at, place, body_m));
    if (robot) return `There is no room: ${robot[0]} stands there.`;
    if (draft.obstacles.some((at) => overlaps(at, place, body_m))) return "There is no room: an obstacle is too near.";
    if (draft.obstacles.length >= MOST_OBSTACLES) return `More than ${MOST_OBSTACLES} obstacles can only be set in a scenario file.`;

    draft.obstacles.push(place);

    return "";
  }

  /**
   * Removes the obstacle at a place.
   * @param {Place} place
   */
  remove(place) {
    const half_m = this.client.body_m() / 2;
    const list = this.draft?.obstacles ?? [];
    const index = list.findIndex(({ x, y }) => Math.abs(x - place.x) <= half_m && Math.abs(y - place.y) <= half_m);
    if (index >= 0) list.splice(index, 1);
    return index >= 0;
  }

  /** @param {Place} place */
  robotAt(place) {
    const reach_m = this.client.body_m() / 2 + GRIP_M;
    const isHit = (/** @type {Place} */ at) => Math.hypot(at.x - place.x, at.y - place.y) <= reach_m;
    return Object.entries(this.draft?.robots ?? {}).find(([, at]) => isHit(at))?.[0];
  }

  /**
   * Snaps to half bodies, so that walls have no gaps, and to the field's edge.
   * @param {Place} place
   */
  snap(place) {
    const half_m = this.client.body_m() / 2;
    const snapped = { x: Math.round(place.x / half_m) * half_m, y: Math.round(place.y / half_m) * half_m };
    return this.inside(snapped);
  }

  /**
   * The nearest place that is within the field.
   * @param {Place} place
   */
  inside(place) {
    const half_m = this.client.body_m() / 2;
    const [width_m, height_m] = this.draft?.field_m ?? [0, 0];
    const clamp = (/** @type {number} */ value, /** @type {number} */ size) => exact(Math.max(half_m, Math.min(size - half_m, value)));
    return { x: clamp(place.x, width_m), y: clamp(place.y, height_m) };
  }
}

/**
 * Rounds to a tenth of a millimeter, which keeps the numbers of a saved scenario short.
 * @param {number} value_m
 */
function exact(value_m) {
  return Math.round(value_m * 1e4) / 1e4;
}
