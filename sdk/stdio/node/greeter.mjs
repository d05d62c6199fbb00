#!/usr/bin/env node
// A greeter: strolls about, says hello to every robot that comes near, and grows lonely when nobody does. Then it goes to
// see the one whom it has not met for longest.
//
//     cars exec --name Nora -- node greeter.mjs
//
// It speaks JSON Lines over stdin and stdout (docs/protocol.md, "Robots over stdin and stdout"). Units are SI. What it
// decides comes from what it is told and from the door's chance alone, so that the same seed gives the same run: no clock,
// no Math.random, and no sine or cosine, whose last bits differ from engine to engine.

import { createInterface } from "node:readline";

const lines = createInterface({ input: process.stdin, crlfDelay: Infinity })[Symbol.asyncIterator]();

/** What is told next; an end of the input is the end. */
async function hear() {
  const { value, done } = await lines.next();
  return done ? { type: "end" } : JSON.parse(value);
}

function say(message) {
  process.stdout.write(`${JSON.stringify(message)}\n`);
}

/** Asks, and gives the answer; undefined if there is none to be had, for instance across a cut network. */
async function ask(question) {
  say(question);
  const answer = await hear();
  if (answer.type !== "answer") process.exit(0); // The end came first.
  return answer.value;
}

const random = () => ask({ type: "random" });

/** Emotion state generator: progress in, emotion out. The first row that holds counts. */
const EMOTIONS = [
  { when: ({ alone }) => alone >= 1, feel: "LONELY", face: "sad", tone: "bad" },
  { when: ({ alone }) => alone >= 0.5, feel: "RESTLESS", face: "neutral", tone: "warning" },
  { when: () => true, feel: "HAPPY", face: "happy", tone: "good" },
];

/** Behavior state generator: in this behavior, when this is felt, go over to that one. */
const BEHAVIORS = [
  { from: "STROLL", when: "LONELY", go: "VISIT" },
  { from: "VISIT", when: "HAPPY", go: "STROLL" },
];

let told, parameters, self;

/** Back to the beginning; a former incarnation's variables say what it knew. */
function begin(init) {
  told = init;
  parameters = { speed_mps: 0.6, patience_s: 20, ...init.parameters };
  const last = init.last_state_variables ?? {};
  self = {
    at: init.location,
    heading: { x: 1, y: 0 },
    turn_s: 0, // until it turns
    aside_s: 0, // for how long it goes on around what stood in its way
    alone_s: last.alone_s ?? 0, // since it last met somebody
    greeted: last.greeted ?? 0,
    met_s: new Map(init.roster.filter((name) => name !== init.name).map((name) => [name, 0])), // how long ago
    near: new Set(),
    emotion: EMOTIONS.at(-1),
    behavior: "STROLL",
  };
}

/** It met a robot of the roster, or people greeted it from its panel. */
function meet(name) {
  self.alone_s = 0;
  if (self.met_s.has(name)) self.met_s.set(name, 0);
}

/** Progress: whom it met, and how long ago. */
function updateStateVariables(news) {
  self.at = news.location;
  self.alone_s += told.tick_s;
  for (const [name, met_s] of self.met_s) self.met_s.set(name, met_s + told.tick_s);
  for (const { from, command } of news.commands ?? []) {
    if (command === "hello") meet(from);
  }
  const near = new Set((news.sensed ?? []).map(({ name }) => name));
  for (const name of near) {
    if (!self.near.has(name)) {
      say({ type: "command", to: name, command: "hello" });
      self.greeted += 1;
      meet(name);
    }
  }
  self.near = near;
}

function updateEmotion() {
  self.emotion = EMOTIONS.find(({ when }) => when({ alone: self.alone_s / parameters.patience_s }));
}

function updateBehavior() {
  const row = BEHAVIORS.find(({ from, when }) => from === self.behavior && when === self.emotion.feel);
  if (row) self.behavior = row.go;
}

/** A direction, all equally probable: a place in the unit disc, drawn until it is inside and not near the middle. */
async function randomHeading() {
  for (;;) {
    const [x, y] = [2 * (await random()) - 1, 2 * (await random()) - 1];
    const square = x * x + y * y;
    if (square >= 1e-6 && square <= 1) return { x: x / Math.sqrt(square), y: y / Math.sqrt(square) };
  }
}

/** Straight on, with a new heading when its time has come or when the way was not free. */
async function stroll(isBlocked) {
  self.turn_s -= told.tick_s;
  if (isBlocked || self.turn_s <= 0) {
    self.heading = await randomHeading();
    self.turn_s = 5 * (0.5 + (await random()));
  }
}

/** Toward the one whom it has not met for longest; around what stands in its way for a while. */
async function visit(isBlocked) {
  self.aside_s = isBlocked ? 2 : self.aside_s - told.tick_s;
  const [friend] = [...self.met_s].reduce((longest, other) => (other[1] > longest[1] ? other : longest), [null, -1]);
  const there = friend && self.aside_s <= 0 && (await ask({ type: "query", of: friend, what: "location" }));
  if (!there) return stroll(isBlocked);
  const [x, y] = [there.x - self.at.x, there.y - self.at.y];
  const away_m = Math.sqrt(x * x + y * y);
  if (away_m > 0) self.heading = { x: x / away_m, y: y / away_m };
}

/** Where it wants to be next, and what it shows of itself. */
async function finish(isBlocked) {
  await (self.behavior === "VISIT" ? visit(isBlocked) : stroll(isBlocked));
  const { at, heading, alone_s, greeted, emotion, behavior } = self;
  const step_m = parameters.speed_mps * told.tick_s;
  say({
    type: "panel",
    widgets: [
      { widget: "face", face: emotion.face, intensity: Math.min(1, alone_s / parameters.patience_s) },
      { widget: "badge", label: "emotion", text: emotion.feel, tone: emotion.tone },
      { widget: "badge", label: "behavior", text: behavior, tone: "neutral" },
      { widget: "table", rows: [["alone for", `${alone_s.toFixed(1)} s`], ["greeted", `${greeted}`]] },
      { widget: "button", label: "say hello", command: "hello" },
    ],
  });
  say({
    type: "done",
    proposal: { x: at.x + heading.x * step_m, y: at.y + heading.y * step_m },
    speed_mps: parameters.speed_mps,
    direction_rad: Math.atan2(heading.y, heading.x),
    emotion_state: emotion.feel,
    behavior_state: behavior,
    state_variables: { alone_s, greeted },
  });
}

for (let message = await hear(); message.type !== "end"; message = await hear()) {
  if (message.type === "init") {
    begin(message);
    if (message.tick > 0) continue; // Somebody is to be replaced: the tick that follows is answered.
  } else {
    updateStateVariables(message);
    updateEmotion();
    updateBehavior();
  }
  await finish(message.blocked === true);
}
process.exit(0);
