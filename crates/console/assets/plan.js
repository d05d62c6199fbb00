// @ts-check
// The plan view: the field from above, at the display's frame rate.

import { Camera } from "./camera.js";
import { Crowd } from "./crowd.js";
import * as draw from "./draw.js";
import { Gestures } from "./gestures.js";
import { shownLayer } from "./layers.js";
import { Motion } from "./motion.js";
import { drawSenses, haveDirections, raysOf } from "./senses.js";
import { drawSites } from "./sites.js";
import { drawGround, footprint, shapeOf, sizeOf } from "./solids.js";
import { Ground, Sprites } from "./sprites.js";
import { onThemeChange, readTheme } from "./theme.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./units.js").Units} Units */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {{x: number, y: number}} Place */
/** The editor of the set-up; its draft is shown instead of the run.
 * @typedef {import("./gestures.js").DragHandler & {draft: import("./types/messages.js").Setup | null,
 *   isAsApplied: boolean, faulty: (robot: string) => boolean}} PlanEditor */

/** Samples in a trail. */
const TRAIL_SAMPLES = 240;
const CALM = matchMedia("(prefers-reduced-motion: reduce)");
/** What has moved less far is not painted anew. */
const MIN_TRAVEL_PX = 0.25;
/** The window of the frame rate. */
const RATE_WINDOW_MS = 1000;

export class Plan {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Store} store
   * @param {Units} units
   * @param {PlanEditor} editor
   * @param {(robot: string | null) => void} onChoose
   */
  constructor(canvas, store, units, editor, onChoose) {
    const context = canvas.getContext("2d", { alpha: false });
    if (!context) throw new Error("this browser draws no canvas");

    this.canvas = canvas;
    this.context = context;
    /** CSS pixels. */
    this.width_px = 1;
    this.height_px = 1;
    this.ground = new Ground();
    this.crowd = new Crowd();
    this.sprites = new Sprites();
    this.store = store;
    this.units = units;
    this.editor = editor;
    this.camera = new Camera();
    this.motion = new Motion();
    /** @type {draw.Pen} */
    this.pen = { context, camera: this.camera, theme: readTheme() };
    this.hasTrails = false;
    /** What stands in the draft that was painted last, and of what.
     * @type {{key: string, known: WorldFrame["static_world"], standing: import("./solids.js").Standing}} */
    this.drafted = { key: "", known: undefined, standing: { obstacles: [], body_m: 1 } };
    /** @type {string | null} */
    this.chosen = null;
    /** The layer that was chosen in the legend. @type {string | null} */
    this.chosenLayer = null;
    this.isStale = true;
    /** @type {number[]} */
    this.drawnAt_ms = [];
    this.lastDraw_ms = performance.now();
    this.gestures = new Gestures(canvas, this.camera, {
      changed: () => this.touch(),
      clicked: (place) => onChoose(this.robotAt(place)),
      editor,
    });

    store.on("frame", () => this.push());
    onThemeChange(() => {
      this.pen.theme = readTheme();
      this.sprites.clear();
      this.touch();
    });

    units.listeners.push(() => this.touch());
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    requestAnimationFrame((now_ms) => this.loop(now_ms));
  }

  /** Paint again in the next animation frame. */
  touch() {
    this.isStale = true;
  }

  push() {
    const { frame } = this.store;
    if (!frame) return;
    this.motion.push(frame, performance.now(), CALM.matches);
    this.touch();
  }

  resize() {
    // Read here and nowhere else: reading them makes the browser lay the page out.
    const { clientWidth, clientHeight } = this.canvas;
    this.width_px = clientWidth;
    this.height_px = clientHeight;
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.sprites.scale(ratio);
    this.aim();
    this.paint(performance.now());
  }

  /** Fits the camera to the field that is shown. */
  aim() {
    const field_m = this.editor.draft?.field_m ?? this.motion.to?.field_m;
    const isField = field_m && field_m[0] > 0 && field_m[1] > 0;
    this.camera.fit(isField ? field_m : this.camera.field_m, this.width_px, this.height_px);
  }

  /** @param {number} now_ms */
  loop(now_ms) {
    requestAnimationFrame((next_ms) => this.loop(next_ms));
    this.drawnAt_ms.push(now_ms);
    while (this.drawnAt_ms[0] < now_ms - RATE_WINDOW_MS) this.drawnAt_ms.shift();
    if (this.isDue(performance.now())) this.paint(performance.now());
    if (!this.motion.isMoving) this.lastDraw_ms = performance.now();
  }

  /** Whether anybody would see a difference. @param {number} now_ms */
  isDue(now_ms) {
    const travel_px = this.motion.travel_m(this.lastDraw_ms, now_ms) * this.camera.scale;
    return this.isStale || travel_px >= MIN_TRAVEL_PX;
  }

  /** Animation frames in the last second, including those that needed no painting. */
  fps() {
    return this.drawnAt_ms.length;
  }

  /** @param {number} now_ms */
  paint(now_ms) {
    this.isStale = false;
    this.aim();
    this.gestures.touch();
    this.motion.advance(now_ms);
    // The same frame has the same pixels, whatever was painted before.
    this.context.save();
    if (this.editor.draft) this.paintDraft(this.editor.draft);
    else if (this.motion.to) this.paintRun(this.motion.to, now_ms);
    else draw.outside(this.pen);
    this.context.restore();
  }

  /**
   * @param {WorldFrame} frame
   * @param {number} now_ms
   */
  paintRun(frame, now_ms) {
    this.lastDraw_ms = now_ms;
    this.paintGround(frame, true, shownLayer(frame.layers, this.chosenLayer));
    this.paintMoving(this.pen, frame, this.drawRobot);
  }

  /**
   * The field with what stands on it, and the guests.
   * @param {import("./solids.js").Standing} standing
   * @param {boolean} hasGuests
   * @param {import("./types/messages.js").LayerFrame | null} layer
   */
  paintGround(standing, hasGuests, layer) {
    const { camera, theme } = this.pen;
    const radius = draw.guestRadius(camera, standing.body_m);
    const guests = hasGuests ? draw.guestsAt(camera, this.motion.now_m, radius) : [];
    this.ground.renew(this.pen, this.canvas, standing, this.step_m(camera), layer);
    if (this.crowd.takes(guests.length / 2, radius)) {
      this.crowd.draw(this.context, this.ground.pixels(), theme, guests, radius, this.sprites.ratio);
      return;
    }

    this.context.drawImage(this.ground.canvas, 0, 0, camera.width_px, camera.height_px);
    draw.guestCircles(this.pen, guests, radius);
  }

  /**
   * All that moves but the guests, on the canvas or in a picture.
   * @param {draw.Pen} pen
   * @param {WorldFrame} frame
   * @param {(pen: draw.Pen, robot: draw.Drawn, look: draw.Look, place: Place) => void} drawRobot
   */
  paintMoving(pen, frame, drawRobot) {
    const { motion } = this;
    if (this.chosen) drawSenses(pen, frame, this.chosen, motion);
    draw.guestMoods(pen, motion.now_m, frame.guest_moods, draw.guestRadius(pen.camera, frame.body_m));
    drawSites(pen, frame.sites ?? [], frame.body_m);
    if (this.hasTrails) this.paintTrails(pen, frame);
    /** @type {{words: draw.Area[], robots: draw.Area[]}} */
    const taken = { words: [], robots: [] };

    for (const { from, to, label } of cutPairs(frame.cuts ?? [])) {
      const a = motion.robotsNow.get(from);
      const b = motion.robotsNow.get(to);
      if (a && b) draw.cut(pen, a, b, label, taken.words);
    }

    const late = new Set(this.store.awaiting().map((awaited) => awaited.name));

    for (const robot of frame.robots) {
      const marks = { isLate: late.has(robot.name), isChosen: robot.name === this.chosen };
      const shape = shapeOf(frame, robot.name);
      const look = draw.lookOf(robot, pen.camera, Math.min(...sizeOf(shape, frame.body_m)), marks);
      const place = motion.robotsNow.get(robot.name) ?? robot.location;
      footprint(pen, shape, pen.camera.x(place.x), pen.camera.y(place.y), robot.heading_rad ?? 0);
      const side = 2 * look.radius;
      taken.robots.push({ x: pen.camera.x(place.x), y: pen.camera.y(place.y), width: side, height: side });
      drawRobot(pen, robot, look, place);
    }

    // The newest first: where there is no place for all words, they are those that stay.
    for (const flight of this.store.flights.at(frame.tick, frame.tick_s).reverse()) {
      // A sender that is not on the field, such as the operator, is drawn above it.
      const outside = { x: frame.field_m[0] / 2, y: frame.field_m[1] };
      const to = motion.robotsNow.get(flight.to);
      if (to) draw.flight(pen, flight, motion.robotsNow.get(flight.from) ?? outside, to, taken);
    }

    this.paintScale(pen);
  }

  /** On the canvas, a robot's body is a picture that was drawn before. @type {(pen: draw.Pen, robot: draw.Drawn, look: draw.Look, place: Place) => void} */
  drawRobot = (pen, robot, look, place) => {
    const x = this.camera.x(place.x);
    const y = this.camera.y(place.y);
    if (draw.isOutside(this.camera, x, y, draw.reach(look))) return;
    this.sprites.body(this.context, pen.theme, look, x, y);
    draw.course(pen, robot, look, x, y, haveDirections(this.motion.to));
  };

  /**
   * @param {draw.Pen} pen
   * @param {WorldFrame} frame
   */
  paintTrails(pen, frame) {
    const { history } = this.store;
    const end = history.indexAt(frame.time_s);

    for (const robot of frame.robots) {
      const track = history.tracks.get(robot.name);
      const place = this.motion.robotsNow.get(robot.name);
      if (track && place) draw.trail(pen, robot.name, track, Math.max(0, end - TRAIL_SAMPLES), end, place);
    }
  }

  /** @param {import("./types/messages.js").Setup} draft */
  paintDraft(draft) {
    const standing = this.standingOf(draft);
    const { body_m } = standing;
    // The simulator places the guests: those of a changed set-up have no places yet.
    this.paintGround(standing, this.editor.isAsApplied && this.motion.to?.tick === 0, null);

    for (const [name, place] of Object.entries(draft.robots)) {
      const robot = { name, emotion_state: "", blocked: false, presence: /** @type {const} */ ("here"), direction_rad: 0, speed_mps: 0 };
      const marks = { isLate: this.editor.faulty(name), isChosen: name === this.chosen };
      const shape = shapeOf(this.motion.to, name);
      const look = draw.lookOf(robot, this.camera, Math.min(...sizeOf(shape, body_m)), marks);
      footprint(this.pen, shape, this.camera.x(place.x), this.camera.y(place.y), 0);
      this.drawRobot(this.pen, robot, look, place);
    }

    this.paintScale(this.pen);
  }

  /**
   * What stands in a draft, in which an obstacle at the place of another one keeps its shape.
   * @param {import("./types/messages.js").Setup} draft
   * @returns {import("./solids.js").Standing}
   */
  standingOf(draft) {
    const frame = this.motion.to;
    const known = frame?.static_world;
    const key = JSON.stringify(draft.obstacles);
    if (key === this.drafted.key && known === this.drafted.known) return this.drafted.standing;

    const shapes = new Map(frame?.obstacles.map((at, i) => [at.join(), known?.obstacle_shapes?.[i] ?? null]));
    const obstacles = draft.obstacles.map(({ x, y }) => /** @type {[number, number]} */ ([x, y]));
    const obstacle_shapes = obstacles.map((at) => shapes.get(at.join()) ?? null);
    const standing = { obstacles, body_m: frame?.body_m ?? 0.6096, static_world: { ...known, obstacle_shapes } };
    this.drafted = { key, known, standing };
    return standing;
  }

  /** @param {draw.Pen} pen */
  paintScale(pen) {
    const { unit, unit_m } = this.units;
    const wanted = 90 / pen.camera.scale / unit_m;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((n) => n * power).find((n) => n <= wanted) ?? power;
    draw.scaleBar(pen, length * unit_m, `${Number(length.toPrecision(1))} ${unit}`);
  }

  /** Distance between grid lines. @param {Camera} camera */
  step_m(camera) {
    const { unit, unit_m } = this.units;
    const steps = unit === "ft" ? [5, 10, 50, 100, 500] : [1, 5, 10, 50, 100];
    return (steps.find((step) => step * unit_m * camera.scale >= 24) ?? 1000) * unit_m;
  }

  /**
   * @param {Place} place
   * @returns {string | null}
   */
  robotAt(place) {
    const frame = this.motion.to;
    const least_m = 12 / this.camera.scale;
    const isHit = (/** @type {string} */ name, /** @type {Place} */ at) => {
      const size_m = sizeOf(shapeOf(frame, name), frame?.body_m ?? 0);
      return Math.hypot(at.x - place.x, at.y - place.y) <= Math.max(...size_m.map((side_m) => side_m / 2), least_m);
    };
    return [...this.motion.robotsNow].find(([name, at]) => isHit(name, at))?.[0] ?? null;
  }

  /**
   * Draws what the canvas shows in another place.
   * @param {draw.Pen} pen
   */
  drawWith(pen) {
    this.motion.arrive();
    this.touch();
    const { camera } = pen;
    const frame = this.motion.to;
    draw.outside(pen);
    if (!frame) return;

    drawGround(pen, frame, this.step_m(camera), shownLayer(frame.layers, this.chosenLayer));
    const radius = draw.guestRadius(camera, frame.body_m);
    draw.guestCircles(pen, draw.guestsAt(camera, this.motion.now_m, radius), radius);
    this.paintMoving(pen, frame, (_, robot, look, place) => {
      const x = camera.x(place.x);
      const y = camera.y(place.y);
      if (draw.isOutside(camera, x, y, draw.reach(look))) return;
      draw.body(pen, look, x, y);
      draw.course(pen, robot, look, x, y, haveDirections(frame));
    });
  }

  /** The lengths of the rays of the chosen robot, meters. */
  rays() {
    const frame = this.motion.to;
    return frame && this.chosen ? raysOf(frame, this.chosen, this.motion) : [];
  }

  /**
   * The point of the window at a place of the field.
   * @param {number} x_m
   * @param {number} y_m
   */
  toClient(x_m, y_m) {
    this.aim();
    const box = this.canvas.getBoundingClientRect();
    return { x: box.left + this.camera.x(x_m), y: box.top + this.camera.y(y_m) };
  }
}

/**
 * Pairs of robots that are cut off from each other, each once, with a label unless everything is cut both ways.
 * @param {import("./types/messages.js").Cut[]} cuts
 */
function cutPairs(cuts) {
  /** @type {Map<string, {from: string, to: string, ways: number, kinds: Set<string>}>} */
  const found = new Map();

  for (const { from, to, commands, queries } of cuts) {
    const key = JSON.stringify([from, to].sort());
    const pair = found.get(key) ?? { from, to, ways: 0, kinds: new Set() };
    pair.ways += 1;
    if (commands) pair.kinds.add("commands");
    if (queries) pair.kinds.add("queries");
    found.set(key, pair);
  }

  return [...found.values()].map(({ from, to, ways, kinds }) => {
    const what = kinds.size === 1 ? [...kinds][0] : "";
    const way = ways === 1 ? `${from} → ${to}` : "";
    return { from, to, label: [way, what].filter(Boolean).join(", ") };
  });
}
