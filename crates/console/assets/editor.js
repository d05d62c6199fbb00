// @ts-check
// Editing the set-up on the plan: a click places or removes an obstacle, a drag builds or clears a wall, a robot is
// dragged to its place.

import { isWithin, overlaps } from "./draft.js";

/** @typedef {import("./types/messages.js").Setup} Setup */
/** @typedef {{x: number, y: number}} Place */
/** What a drag does. @typedef {{kind: "build", start: Place, at: Place} | {kind: "clear"} | {kind: "robot", name: string}} Drag */
/** What the keys carry, and from where; an obstacle if it is no robot. @typedef {{robot: string | null, from: Place}} Carried */

/** A drag that begins this far from a robot's body still moves the robot. */
const GRIP_M = 0.15;
const MAX_OBSTACLES = 5000;

export class Editor {
  /** @param {{changed: (what: string) => void, note: (text: string) => void, body_m: () => number, hasFault: (field: string) => boolean}} client */
  constructor(client) {
    this.client = client;
    /** Shown on the plan while not null. @type {Setup | null} */
    this.draft = null;
    /** Whether the draft is what the run is set up with. */
    this.isAsApplied = true;
    /** @type {Drag | null} */
    this.drag = null;
    /** Number of the drag, so that what belongs to one drag is undone together. */
    this.drags = 0;
    /** Where the keys act; none before the first one. @type {Place | null} */
    this.cursor = null;
    /** What the arrow keys move; none if they move the cursor alone. @type {Carried | null} */
    this.carried = null;
  }

  /** Told of a change. */
  changed() {
    this.client.changed(`drag ${this.drags}`);
  }

  /**
   * Edits by keys: arrows move the cursor, Enter places or removes an obstacle, M takes up or puts down what is there.
   * @param {KeyboardEvent} event
   */
  key(event) {
    if (!this.draft || event.ctrlKey || event.metaKey || event.altKey) return;
    const step_m = (this.client.body_m() / 2) * (event.shiftKey ? 4 : 1);
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowLeft: () => this.go(-step_m, 0),
      ArrowRight: () => this.go(step_m, 0),
      ArrowUp: () => this.go(0, step_m),
      ArrowDown: () => this.go(0, -step_m),
      Enter: () => (this.carried ? this.putDown() : this.toggle()),
      Delete: () => this.deleteHere(),
      Backspace: () => this.deleteHere(),
      m: () => (this.carried ? this.putDown() : this.takeUp()),
      Escape: () => this.putBack(),
    };
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || (event.key === "Escape" && !this.carried && !this.cursor)) return;

    event.preventDefault();
    event.stopImmediatePropagation();
    this.drags += 1;
    act();
    this.changed();
  }

  /** The middle of the field, if there is no cursor yet. */
  here() {
    const [width_m, height_m] = this.draft?.field_m ?? [0, 0];
    this.cursor ??= this.snap({ x: width_m / 2, y: height_m / 2 });
    return this.cursor;
  }

  /**
   * @param {number} dx_m
   * @param {number} dy_m
   */
  go(dx_m, dy_m) {
    const isNew = this.cursor === null;
    const { x, y } = this.here();
    if (!isNew) this.cursor = this.snap({ x: x + dx_m, y: y + dy_m });
  }

  toggle() {
    const here = this.here();
    if (this.remove(here)) return;
    const reason = this.place(here);
    if (reason) this.client.note(reason);
  }

  deleteHere() {
    if (this.carried) this.carried = null;
    else if (!this.remove(this.here())) this.client.note("There is no obstacle to remove.");
  }

  takeUp() {
    const here = this.here();
    const name = this.robotAt(here);
    if (name && this.draft) this.carried = { robot: name, from: this.draft.robots[name] };
    else if (this.remove(here)) this.carried = { robot: null, from: here };
    else this.client.note("There is nothing to move here.");
  }

  putDown() {
    const { carried, draft } = this;
    const here = this.here();
    if (!carried || !draft) return;
    if (carried.robot) {
      draft.robots[carried.robot] = here;
      this.carried = null;
      return;
    }

    const reason = this.place(here);
    if (reason) this.client.note(reason);
    else this.carried = null;
  }

  /** Puts what is carried back, or hides the cursor. */
  putBack() {
    if (this.carried && !this.carried.robot) this.place(this.carried.from);
    else if (!this.carried) this.cursor = null;
    this.carried = null;
  }

  /** What is at the cursor, in words. */
  get atCursor() {
    const { carried, cursor } = this;
    if (!cursor) return "";
    if (carried) return `moving ${carried.robot ?? "an obstacle"}: M puts it down`;
    const robot = this.robotAt(cursor);
    if (robot) return `${robot}: M moves it`;
    const isObstacle = this.obstacleAt(cursor) >= 0;
    return isObstacle ? "obstacle: Enter removes it, M moves it" : "free: Enter places an obstacle";
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

    this.drags += 1;
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

    this.changed();

    return true;
  }

  /** @param {Place} place */
  move(place) {
    const { draft, drag } = this;
    if (!draft || !drag) return;

    if (drag.kind === "robot") draft.robots[drag.name] = this.inside(place);
    else if (drag.kind === "clear") this.remove(place);
    else this.wall(drag, place);
    this.changed();
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
    if (draft.obstacles.length >= MAX_OBSTACLES) return `More than ${MAX_OBSTACLES} obstacles can only be set in a scenario file.`;

    draft.obstacles.push(place);

    return "";
  }

  /**
   * Removes the obstacle at a place.
   * @param {Place} place
   */
  remove(place) {
    const index = this.obstacleAt(place);
    if (index >= 0) this.draft?.obstacles.splice(index, 1);
    return index >= 0;
  }

  /** @param {Place} place */
  obstacleAt(place) {
    const half_m = this.client.body_m() / 2;
    const list = this.draft?.obstacles ?? [];
    return list.findIndex(({ x, y }) => Math.abs(x - place.x) <= half_m && Math.abs(y - place.y) <= half_m);
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
