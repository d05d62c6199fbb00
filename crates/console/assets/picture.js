// @ts-check
// The plan as a figure for paper: light, of a size in millimeters, and with what one needs to read it: run, seed and tick, the
// robots with their faces, the emotions, and the signs. It is an SVG; a PNG is that SVG in pixels.

import { Camera } from "./camera.js";
import * as draw from "./draw.js";
import { faceShapes } from "./face.js";
import { intensityOf } from "./known.js";
import { drawScale, scaleWords, shownLayer } from "./layers.js";
import { arrow, barrier, cross, disk, envelope, line, ring } from "./shapes.js";
import { drawFan, drawSector } from "./senses.js";
import { diamond, kindsInLegend } from "./sites.js";
import { WALL_PX } from "./solids.js";
import { readTheme } from "./theme.js";
import { seconds } from "./units.js";
import { Vector } from "./vector.js";

/** @typedef {import("./types/messages.js").Face} Face */
/** @typedef {import("./widgets.js").Panel} Panel */
/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./theme.js").Theme} Theme */

/** Of the whole figure, the width of two columns of a paper, and pixels per inch of a PNG. */
const WIDTH_MM = 180;
const DPI = 300;
/** Of the plan and of what stands beside it: letters of 12.5 px are 8 pt on paper. */
const PLAN_PX = 536;
const SIDE_PX = 264;
/** Least and most height of the plan. */
const HEIGHTS_PX = /** @type {const} */ ([240, 1100]);
/** The size of a pixel, as a PNG has it after its header of 33 bytes: 11811 pixels per meter, both ways, with its checksum. */
const HEADER_BYTES = 33;
const DENSITY = Uint8Array.from([0, 0, 0, 9, 112, 72, 89, 115, 0, 0, 46, 35, 0, 0, 46, 35, 1, 120, 165, 63, 118]);
const PAD_PX = 18;
const ROBOT_PX = 74;
const SIGN_PX = 22;
const FACE_PX = 52;
/** Robots with a face beside the plan; of more, it is told how many there are. */
const MAX_ROBOTS = 6;
const MAX_EMOTIONS = 8;

/**
 * @param {import("./plan.js").Plan} plan
 * @param {Map<string, Panel>} panels
 * @returns {string} an SVG
 */
export function picture(plan, panels) {
  const camera = cameraOf(plan.camera);
  const theme = readTheme(true);
  const frame = plan.motion.to;
  const robots = frame?.robots ?? [];
  const field = new Vector();
  plan.drawWith({ context: field, camera, theme });

  const side = new Vector();
  const words = new Words(side, theme);
  if (frame) {
    const { run, seed, tick, time_s, duration_s, tick_s } = frame;
    words.bold(run.slice(0, 30), PAD_PX, 24, 15);
    words.muted(`${seconds(time_s, tick_s)} of ${seconds(duration_s, tick_s)}, tick ${tick}`, PAD_PX, 44);
    words.muted(`seed ${seed}`, PAD_PX, 62);
  }
  let y = 78;
  for (const robot of robots.slice(0, MAX_ROBOTS)) {
    person(side, words, theme, robot, panels.get(robot.name), y);
    y += ROBOT_PX;
  }
  if (robots.length > MAX_ROBOTS) {
    words.muted(`and ${robots.length - MAX_ROBOTS} robots more`, PAD_PX, y + 10);
    y += 28;
  }

  y = legend(side, words, theme, frame, plan, y + 6);
  const width = camera.width_px + SIDE_PX;
  const height = Math.max(camera.height_px, y + 6);
  const whole = new Vector();
  whole.fillStyle = theme.outside;
  whole.fillRect(0, 0, width, height);
  whole.put(field.element(0, (height - camera.height_px) / 2, camera.width_px, camera.height_px));
  whole.put(side.element(camera.width_px, 0, SIDE_PX, height));
  return whole.document(width, height, sentence(robots), WIDTH_MM);
}

/** What a camera shows, in the size of the figure. @param {Camera} shown */
function cameraOf({ field_m, zoom, center }) {
  const [least, most] = HEIGHTS_PX;
  const camera = new Camera();
  camera.fit(field_m, PLAN_PX, Math.min(most, Math.max(least, camera.heightFor(field_m, PLAN_PX))));
  return Object.assign(camera, { zoom, center });
}

/**
 * The same figure in pixels.
 * @param {string} svg
 * @returns {Promise<Blob>}
 */
export async function inPixels(svg) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();

  const width = Math.round((WIDTH_MM / 25.4) * DPI);
  const canvas = new OffscreenCanvas(width, Math.round((width * image.naturalHeight) / image.naturalWidth));
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no canvas");
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  const png = await canvas.convertToBlob();
  return new Blob([png.slice(0, HEADER_BYTES), DENSITY, png.slice(HEADER_BYTES)], { type: png.type });
}

/** What is to be seen, for those who do not see it. @param {RobotFrame[]} robots */
function sentence(robots) {
  const some = robots.slice(0, MAX_ROBOTS).map(({ name, emotion_state, behavior_state }) => [name, emotion_state, behavior_state].filter(Boolean).join(" "));
  return `The plan; ${some.join("; ")}${robots.length > MAX_ROBOTS ? ` and ${robots.length - MAX_ROBOTS} robots more` : ""}`;
}

/** Text in the styles of the picture. */
class Words {
  /**
   * @param {Vector} paper
   * @param {Theme} theme
   */
  constructor(paper, theme) {
    this.paper = paper;
    this.theme = theme;
  }

  /** @type {(words: string, x: number, y: number, size?: number) => void} */
  bold(words, x, y, size = 15) {
    this.put(words, x, y, `650 ${size}px`, this.theme.text);
  }

  /** @type {(words: string, x: number, y: number) => void} */
  muted(words, x, y) {
    this.put(words, x, y, "12.5px", this.theme.muted);
  }

  /** @type {(words: string, x: number, y: number, font: string, color: string) => void} */
  put(words, x, y, font, color) {
    this.paper.textAlign = "left";
    this.paper.textBaseline = "middle";
    this.paper.font = `${font} ${this.theme.font}`;
    this.paper.fillStyle = color;
    this.paper.fillText(words, x, y);
  }
}

/**
 * A robot: face, initials, name, emotion and behavior.
 * @type {(paper: Vector, words: Words, theme: Theme, robot: RobotFrame, panel: Panel | undefined, y: number) => void}
 */
function person(paper, words, theme, robot, panel, y) {
  const { name, emotion_state: emotion, behavior_state } = robot;
  const known = faceOf(robot, panel);
  const scale = FACE_PX / 100;
  const styles = faceStyles(theme);
  paper.put(`<g transform="translate(${PAD_PX - 4} ${y}) scale(${scale})">`);
  for (const shape of faceShapes(known.face, known.intensity)) {
    paper.shape(shape.d, `${styles[shape.name]}${shape.opacity === undefined ? "" : ` opacity="${shape.opacity}"`}`);
  }
  paper.put("</g>");

  const left = PAD_PX + FACE_PX + 8;
  const look = { ...draw.lookOf(robot, { scale: 0 }, 1, { isLate: false, isChosen: false }), emotion: "" };
  draw.body({ context: paper, theme }, look, left + look.radius, y + 11);
  words.bold(name.slice(0, 24), left + 2 * look.radius + 7, y + 11);
  if (emotion) {
    draw.emotionSign({ context: paper, theme }, emotion, left + 6, y + 32, 6);
    words.put(emotion.slice(0, 24), left + 18, y + 32, "600 12.5px", theme.text);
  }
  words.muted((behavior_state || "has not acted yet").slice(0, 28), left, y + 50);
}

/**
 * @type {(robot: RobotFrame, panel: Panel | undefined) => {face: Face, intensity: number}}
 */
function faceOf(robot, panel) {
  const widget = (panel?.widgets ?? []).find((one) => one?.widget === "face");
  const own = robot.state_variables.facial_expression;
  const face = widget?.widget === "face" ? widget.face : typeof own === "string" ? /** @type {Face} */ (own) : "neutral";
  return { face, intensity: intensityOf(robot, panel) ?? 0 };
}

/** The style of each part of a face, as in the style sheet. @param {Theme} theme @returns {Record<string, string>} */
function faceStyles({ skin, ink }) {
  const drawn = `fill="none" stroke="${ink}" stroke-linecap="round"`;
  return {
    skin: `fill="${skin}" stroke="${ink}" stroke-width="1.5"`,
    brow: `${drawn} stroke-width="3"`,
    eye: `fill="${ink}"`,
    lid: `fill="${skin}"`,
    wrinkle: `${drawn} stroke-width="1.75"`,
    mouth: `fill="${ink}" stroke="${ink}" stroke-width="3" stroke-linejoin="round"`,
  };
}

/**
 * The signs of the plan, drawn by what draws them there.
 * @type {(paper: Vector, words: Words, theme: Theme, frame: WorldFrame | null, plan: import("./plan.js").Plan, y: number) => number} where it ends
 */
function legend(paper, words, theme, frame, { hasTrails, chosen, chosenLayer }, y) {
  const { robots = [], guest_moods: moods, static_world } = frame ?? {};
  const x = PAD_PX + 12;
  /** @type {(draw: (y: number) => void, label: string) => void} */
  const row = (sign, label) => {
    sign(y);
    words.muted(label, PAD_PX + 36, y);
    y += SIGN_PX;
  };

  const emotions = [...new Set(robots.map((robot) => robot.emotion_state))].filter(Boolean);
  const first = emotions[0] ?? "";
  const look = /** @type {const} */ ({ letters: "", radius: 6, presence: "here", hatching: 0, isLate: false, isChosen: false });
  y += 6;
  row((at) => draw.body({ context: paper, theme }, { ...look, emotion: first }, x, at), first ? "robot, and its emotion" : "robot");
  for (const emotion of emotions.slice(0, MAX_EMOTIONS)) {
    const count = robots.filter((robot) => robot.emotion_state === emotion).length;
    row((at) => draw.emotionSign({ context: paper, theme }, emotion, x + 26, at, 5.5), "");
    words.muted(`${emotion.slice(0, 22)}${robots.length > MAX_ROBOTS ? ` (${count})` : ""}`, x + 40, y - SIGN_PX);
  }
  row((at) => draw.guestCircles({ context: paper, theme }, [x, at], 6), "guest");
  for (const [mood, label] of /** @type {["waiting" | "annoyed", string][]} */ ([["waiting", "guest that waits"], ["annoyed", "annoyed guest"]])) {
    if (!moods?.[mood]?.length) continue;
    row((at) => {
      draw.guestCircles({ context: paper, theme }, [x, at], 6);
      draw.guestMood({ context: paper, theme }, mood, x, at, 6);
    }, label);
  }
  row((at) => {
    paper.fillStyle = theme.obstacle;
    paper.fillRect(x - 5.5, at - 5.5, 11, 11);
    paper.strokeStyle = theme.obstacleEdge;
    paper.lineWidth = 1;
    paper.strokeRect(x - 5.5, at - 5.5, 11, 11);
  }, "obstacle");
  if (static_world?.walls?.length) {
    row((at) => {
      paper.strokeStyle = theme.obstacle;
      paper.lineWidth = WALL_PX;
      paper.beginPath();
      line(paper, x - 8, at, x + 8, at);
      paper.stroke();
    }, "wall");
  }
  const sensing = chosen ? static_world?.sensing : undefined;
  if (sensing?.field_of_view_rad) row((at) => drawSector({ context: paper, theme }, x - 8, at, 18, 0, 0.9), `field of view of ${chosen}`);
  if (sensing?.rays) {
    const ends = [-0.4, 0, 0.4].map((angle) => ({ x: 16 * Math.cos(angle), y: 16 * Math.sin(angle) }));
    row((at) => drawFan({ context: paper, theme }, x - 8, at, ends.map((end) => ({ x: x - 8 + end.x, y: at + end.y, isHit: true }))), `rays of ${chosen}`);
  }
  for (const { kind, color } of kindsInLegend(frame?.sites ?? [])) {
    row((at) => diamond({ context: paper, theme }, color, false, x, at, 5.5), kind);
  }
  const layer = shownLayer(frame?.layers, chosenLayer);
  if (layer) row((at) => drawScale(paper, theme, x - 12, at, 26), scaleWords(layer));
  row((at) => barrier(paper, x - 8, at, 6, 0, theme.warning), "blocked");
  row((at) => envelope(paper, x, at, theme.accent, theme.field), "command under way");
  row((at) => {
    paper.strokeStyle = theme.accent;
    paper.lineWidth = 1.5;
    paper.beginPath();
    arrow(paper, x - 12, at, x + 12, at);
    paper.stroke();
  }, "received");
  row((at) => {
    envelope(paper, x, at, theme.bad, theme.field);
    cross(paper, x, at, 6, theme.bad);
  }, "lost command");
  row((at) => {
    paper.strokeStyle = theme.bad;
    paper.lineWidth = 1.75;
    paper.setLineDash([4, 3]);
    paper.beginPath();
    line(paper, x - 14, at, x + 14, at);
    paper.stroke();
    paper.setLineDash([]);
    disk(paper, x, at, 6, theme.field);
    ring(paper, x, at, 6, theme.bad, 1.5);
    cross(paper, x, at, 3, theme.bad);
  }, "cut off");
  if (hasTrails) words.muted("A line is the way of a robot.", PAD_PX, y);

  return hasTrails ? y + SIGN_PX : y;
}
