#!/usr/bin/env node
// Leguin, the refiller of the paper's experiment, in JavaScript: waits at the table until she is called, brings treats, hurries when
// she is asked to, and goes home when she is sent or has had enough. Under another name she is Vonda.
//
//     cars exec --name Leguin -- node leguin.mjs
//
// She speaks JSON Lines over stdin and stdout (docs/any-language.md). Her tables and her arithmetic are those of
// crates/robots/src/leguin, in the same order, so that a run with her is, byte for byte, a run with the Leguin in Rust. She has no
// panel. Units are SI.

import { createInterface } from "node:readline";

const FT_M = 0.3048;
// What each is for is in configs/robots/leguin.toml.
const PARAMETERS = {
  waiter: "Butler",
  goods: "treats",
  affect: "on",
  policy: "emotion",
  signals: "off", // The only one that she has here, as the next one.
  scripted: "felt",
  sensory_motor: "on",
  schematic: "on",
  caution: 0.5,
  exchange_radius_m: 4 * FT_M,
  exchange_s: 2,
  v_refill_mps: 3 * FT_M,
  hurry_mult: 1.5,
  prep_s: 1,
  errand_pressure: 0.35,
  hurry_pressure: 0.6,
  haste_onset: 0.25,
  haste_full: 0.55,
  block_patience_s: 32,
  await_patience_s: 26,
  progress_m: 0.5 * FT_M,
  arrive_m: 1.5 * FT_M,
  settle_s: 5,
  settle_m: 6 * FT_M,
  stand_off_m: 3 * FT_M,
  query_stale_s: 5,
  answer_s: 20,
  turn_mean_s: 5,
  look_s: 2,
  joke_mean_s: 60,
};
const DYNAMICS = {
  state_set: "murphy4", // The only one that she has here.
  rho_max: 2,
  caution_gain_base: 0.5,
  caution_gain_slope: 1,
  tau_up_s: 1.5,
  tau_down_s: 3,
  th_confident: 0.25,
  th_concerned: 0.45,
  th_frustrated: 0.75,
  th_angry: 0.95,
  anger_s: 15,
  hysteresis: 0.08,
  dwell_s: 1,
  low_importance: 0.4,
  high_importance: 0.75,
  setback: 0.15,
  hope_s: 15,
  label_cuts: [0.2, 0.4, 0.6, 0.8],
};
const APPRAISAL = { prediction_s: 5, recent_s: 60 };
const MOOD = { start: 0, tau_s: 86400, weight: 0 };
const JOKES = [
  "Waiting is easy. I have it in my state table.",
  "I asked the table for a joke. It said the spread was good enough.",
  "My favorite distance is four feet.",
  "They say a watched pot never boils. Nobody has tried it with a watched robot.",
];
/** Whether an emotion is unpleasant, its face, what it inclines her to (Table 2 of the paper), and its causal chain. */
const FEELINGS = {
  HAPPY: [false, "happy", "free-activate", [
    "belief: something good is happening", "achieved goal: I wanted this: {g}", "effect: because of this I feel good",
  ]],
  CONFIDENT: [false, "neutral", "continue-normal-activity", [
    "goal: I want {g}", "belief: I think this will happen", "belief: I know what to do", "effect: because of this I feel good",
  ]],
  CONCERNED: [true, "fearful", "monitor-progress-closely", [
    "goal: I want {g}", "belief: {a} is not here", "belief: something bad can happen soon", "belief: I do not want it",
    "belief: I do not know if it will happen", "effect: because of this I feel bad",
  ]],
  FRUSTRATED: [true, "angry", "change-current-strategy", [
    "goal: I want {g}", "belief: I cannot do this now", "belief: {a} is not here", "belief: I tried",
    "effect: because of this I feel bad and want to do something else",
  ]],
};
/** Emotions in the order in which the urgency leads to them, and the parameters with their thresholds. */
const LADDER = [
  ["HAPPY", null],
  ["CONFIDENT", "th_confident"],
  ["CONCERNED", "th_concerned"],
  ["FRUSTRATED", "th_frustrated"],
];
/** What she has done before on a way counts no more. */
const NO_WAY = { stalledS: 0, nearestM: null, comesNearer: false };
const endErrand = () => set({ ended: her.ended + her.isOnErrand, isOnErrand: 0 });
const finishErrand = () => {
  set({ owedS: null, completed: her.completed + her.isOnErrand });
  endErrand();
  set({ hurried: false, pending: "", sentHome: false });
};
const turnHome = () => set({ trips: her.trips + 1, sentHome: false, noted: "sent home" });
const giveUp = () => {
  endErrand();
  set({ givenUp: her.givenUp + 1, isLost: true, hurried: false, noted: "gives up", ...NO_WAY });
};
const takeErrand = ({ pending }) => {
  const hurried = pending === "hurry";
  set({ hurried, pending: "", noted: hurried ? "hurry" : "new errand", isOnErrand: 1 });
};
/** Behavior state generator: a row that applies acts, and goes where it says; without a place it reads on. */
const BEHAVIORS = [
  [["WAIT", "REFILL"], (c) => c.waiterIsNeedyHere, finishErrand, "EXCHANGE"],
  [["WAIT"], (c) => c.pending !== "", takeErrand, "REFILL"],
  [["REFILL"], (c) => c.pending === "hurry", () => set({ hurried: true, pending: "", noted: "hurry" }), null],
  [["EXCHANGE"], (c) => c.exchangeIsOver, () => {}, "AWAIT_GO_HOME"],
  [["AWAIT_GO_HOME"], (c) => c.sentHome, turnHome, "GO_HOME"],
  [["AWAIT_GO_HOME", "REFILL"], (c) => c.givesUp, giveUp, "GO_HOME"],
  [["GO_HOME"], (c) => c.isHome, () => set({ noted: "home" }), "WAIT"],
  [["WAIT", "GO_HOME"], (c) => c.isHappy && c.hasJoke, joke, null],
];

let told, parameters, dynamics, looks, moodiness, her;

function set(changes) {
  Object.assign(her, changes);
}

// Messages.

const lines = createInterface({ input: process.stdin, crlfDelay: Infinity })[Symbol.asyncIterator]();

/** The next message; the end of the input is the end. */
async function receive() {
  const { value, done } = await lines.next();
  return done ? { type: "end" } : JSON.parse(value);
}

function send(message) {
  process.stdout.write(`${JSON.stringify(message)}\n`);
}

/** The answer to a question; undefined if there is none to be had, for instance across a cut network. */
async function ask(question) {
  send(question);
  const answer = await receive();
  if (answer.type !== "answer") process.exit(0); // The end came first.
  return answer.value;
}

function log(text) {
  send({ type: "log", text });
}

// Chance (docs/protocol.md, "Numbers and chance"): a stream for each thing that she leaves to it.

const MASK = (1n << 64n) - 1n;
const rotated = (word, bits) => ((word << bits) | (word >> (64n - bits))) & MASK;

/** xoshiro256++, seeded by SplitMix64. */
class Stream {
  constructor(seed) {
    this.words = [1n, 2n, 3n, 4n].map((number) => {
      let z = (seed + number * 0x9e3779b97f4a7c15n) & MASK;
      z = ((z ^ (z >> 30n)) * 0xbf58476d1ce4e5b9n) & MASK;
      z = ((z ^ (z >> 27n)) * 0x94d049bb133111ebn) & MASK;
      return z ^ (z >> 31n);
    });
  }

  /** The stream that a run with this seed has under this name. */
  static named(seed, name) {
    let hash = 0xcbf29ce484222325n;
    for (const byte of Buffer.from(name)) hash = ((hash ^ BigInt(byte)) * 0x100000001b3n) & MASK;
    return new Stream(BigInt(seed) ^ hash);
  }

  next() {
    const words = this.words;
    const drawn = (rotated((words[0] + words[3]) & MASK, 23n) + words[0]) & MASK;
    const shifted = (words[1] << 17n) & MASK;
    words[2] ^= words[0];
    words[3] ^= words[1];
    words[1] ^= words[2];
    words[0] ^= words[3];
    words[2] ^= shifted;
    words[3] = rotated(words[3], 45n);
    return drawn;
  }

  /** Uniform in [0, 1). */
  unit() {
    return Number(this.next() >> 11n) / 2 ** 53;
  }

  /** Exponential with this mean. It decides when she jokes and nothing else: logarithms differ in the last bit between engines. */
  exponential(mean) {
    return -Math.log(1 - this.unit()) * mean;
  }

  /** A direction as a unit vector: a place in the unit disc, drawn until it is inside and not near the middle. */
  direction() {
    for (;;) {
      const x = 2 * this.unit() - 1;
      const y = 2 * this.unit() - 1;
      const square = x * x + y * y;
      if (square >= 1e-6 && square <= 1) return { x: x / Math.sqrt(square), y: y / Math.sqrt(square) };
    }
  }
}

// Motion. A heading is a unit vector and never an angle.

const TOUCH_M = 1e-9; // How deep two bodies may overlap and still count as touching.
// Cosine and sine of the headings tried around the straight one, 20 to 120 degrees.
const OFFSETS = [
  [0.9396926207859084, 0.3420201433256687],
  [0.766044443118978, 0.6427876096865393],
  [0.5, 0.8660254037844386],
  [0.17364817766693041, 0.984807753012208],
  [-0.17364817766693041, 0.984807753012208],
  [-0.5, 0.8660254037844386],
];

function distanceM(a, b) {
  const x = b.x - a.x;
  const y = b.y - a.y;
  return Math.sqrt(x * x + y * y);
}

function stepped(heading, stepM) {
  return { x: her.at.x + heading.x * stepM, y: her.at.y + heading.y * stepM };
}

function isOnField({ x, y }) {
  const marginM = told.body_m / 2 - TOUCH_M;
  const [widthM, heightM] = told.field_m;
  return x >= marginM && x <= widthM - marginM && y >= marginM && y <= heightM - marginM;
}

function stay() {
  her.speedMps = 0;
  return her.at;
}

/** A random walk: straight on, with a new heading when its time has come, when a step was refused, or where the field ends. */
function walk(speedMps) {
  her.turnS -= told.tick_s;
  let turns = her.turnS <= 0 || her.wasBlocked;
  for (let tries = 0; tries < 8; tries++, turns = true) {
    if (turns) set({ heading: her.turns.direction(), turnS: parameters.turn_mean_s * (0.5 + her.turns.unit()) });
    const there = stepped(her.heading, speedMps * told.tick_s);
    if (!isOnField(there)) continue;
    her.speedMps = speedMps;
    return there;
  }
  return stay();
}

/** A straight step; for a while after a refused one she looks around first and steps aside where somebody is in the way. */
async function drive(goal, stopM, speedMps) {
  if (her.wasBlocked) her.carefulS = Math.max(parameters.look_s, told.tick_s);
  const awayM = distanceM(her.at, goal);
  let stepM = Math.min(speedMps * told.tick_s, awayM - stopM);
  if (stepM <= 0) return stay();
  let heading = { x: (goal.x - her.at.x) / awayM, y: (goal.y - her.at.y) / awayM };
  if (her.carefulS > 0) {
    her.carefulS -= told.tick_s;
    const bodies = (await ask({ type: "percept" }))?.bodies ?? [];
    // A narrow gap may take a short step where a long one does not fit.
    const found = freeHeading(bodies, heading, stepM) ?? freeHeading(bodies, heading, (stepM *= 0.5));
    if (!found) return stay();
    heading = found;
  }
  set({ heading, speedMps: stepM / told.tick_s });
  return stepped(heading, stepM);
}

/** The heading nearest to the straight one whose step is free, on the side that worked last before the other. */
function freeHeading(bodies, straight, stepM) {
  const apartM = told.body_m - TOUCH_M;
  const isFree = (heading) => {
    const there = stepped(heading, stepM);
    const isApart = ({ location: at }) => Math.abs(at.x - there.x) >= apartM || Math.abs(at.y - there.y) >= apartM;
    return isOnField(there) && bodies.every(isApart);
  };
  if (isFree(straight)) return straight;
  for (const [cos, sine] of OFFSETS) {
    for (const side of [her.side, -her.side]) {
      const sin = side * sine;
      const heading = { x: straight.x * cos - straight.y * sin, y: straight.x * sin + straight.y * cos };
      if (!isFree(heading)) continue;
      her.side = side;
      return heading;
    }
  }
  return null;
}

// Progress.

/** Asks the waiter and looks for him: where he is sensed counts for more than his answer, which is a tick old. */
async function observeWaiter(sensed) {
  her.unheardS += told.tick_s;
  her.unseenS += told.tick_s;
  const state = await ask({ type: "query", of: parameters.waiter, what: "state" });
  if (state) {
    const { need, refiller } = state.state_variables ?? {};
    set({ hasAnswered: true, unheardS: 0, waiterNeeds: need === true, waiterBehavior: state.behavior_state });
    her.waiterCalls = typeof refiller === "string" ? refiller : null;
  }
  const seen = sensed.find(({ name }) => name === parameters.waiter)?.location;
  const place = seen ?? state?.location ?? null;
  if (place) her.unseenS = 0;
  // Without an answer, a place within sensing range at which he is not sensed is one at which he is not.
  const wasSearched = her.waiter !== null && distanceM(her.at, her.waiter) <= told.sensing_range_m;
  set({ isSensed: seen !== undefined, isMissing: !place && (her.isMissing || wasSearched), waiter: place ?? her.waiter });
}

// Sums of ticks such as 0.1 s fall short of what they mean by far less than this.
const hasLasted = (seconds) => her.lastingS + 1e-9 >= seconds;

/** Where she is going; null if nowhere. */
function goal() {
  if (her.behavior === "GO_HOME") return her.home;
  return her.behavior === "REFILL" && !her.isMissing ? her.waiter : null;
}

/** Whether she is nearer to her goal than ever before on this way. To and fro is no progress. */
function observeWay() {
  const hasLeft = her.behavior === "REFILL" && hasLasted(parameters.prep_s);
  if (!hasLeft && her.behavior !== "GO_HOME") return set(NO_WAY);
  her.stalledS += told.tick_s;
  const awayM = goal() && distanceM(her.at, goal());
  const isProgress = awayM !== null && (her.nearestM === null || awayM <= her.nearestM - parameters.progress_m);
  her.comesNearer = isProgress && her.nearestM !== null;
  if (isProgress) set({ nearestM: awayM, stalledS: 0 });
}

function measure() {
  const { hurried, behavior } = her;
  const gain = dynamics.caution_gain_base + dynamics.caution_gain_slope * parameters.caution;
  const { errand_pressure, hurry_pressure } = parameters;
  const errand = hurried ? Math.max(hurry_pressure, errand_pressure) : errand_pressure;
  const blocked = behavior === "REFILL" ? (her.stalledS * gain) / parameters.block_patience_s : 0;
  const waiting = (her.waitingS * gain) / parameters.await_patience_s;
  her.measures = { hurried, errand, blocked, waiting };
}

/** How pressing her errand is. */
function pressure() {
  const { errand, blocked, waiting } = her.measures;
  if (her.behavior === "REFILL") return Math.min(Math.max(errand, blocked), 1);
  return her.behavior === "AWAIT_GO_HOME" ? Math.min(waiting, 1) : 0;
}

const ticksIn = (seconds) => Math.min(Math.max(Math.round(seconds / told.tick_s), 1), 10000);

/** How far the pressure is from what its trend predicted. */
function novelty(value) {
  const ticks = ticksIn(looks.prediction_s);
  her.pressures.push(value);
  her.pressures = her.pressures.slice(-(2 * ticks + 1));
  const base = her.pressures.length - 1 - ticks;
  if (base < 0) return 0;
  const known = Math.min(base, ticks);
  const change = known ? ((her.pressures[base] - her.pressures[base - known]) / known) * ticks : 0;
  return Math.abs(value - Math.min(Math.max(her.pressures[base] + change, 0), 1));
}

/** Whether calls wait for too long. */
function checkDuty() {
  if (her.owedS !== null) her.owedS += told.tick_s;
  her.duty.push(her.owedS !== null && her.owedS > parameters.answer_s ? 0 : 1);
  her.duty = her.duty.slice(-ticksIn(looks.recent_s));
}

/** Whether the situation can change without her. */
function modifiability() {
  const isUnknown = !her.hasAnswered || her.unheardS > parameters.query_stale_s;
  if (her.behavior === "EXCHANGE") return 1;
  if (isUnknown) return 0.5;
  if (["INTERCEPT", "EXCHANGE"].includes(her.waiterBehavior) || her.behavior === "WAIT") return 1;
  return her.measures.blocked >= dynamics.th_concerned ? 0.5 : 0;
}

/** How she judges the moment. */
function appraise() {
  const { blocked } = her.measures;
  const urgency = pressure();
  const age = her.unseenS === 0 ? 0 : Math.min(her.unseenS / parameters.query_stale_s, 1);
  her.appraisal = {
    goal_congruence: her.isLost ? -1 : 1 - 2 * urgency,
    controllability: her.isLost ? 0 : 1 - Math.min(blocked, 1),
    certainty: her.waiter === null ? 0 : 1 - age,
    novelty: novelty(urgency),
    modifiability: modifiability(),
    external_norms: her.duty.reduce((sum, one) => sum + one, 0) / her.duty.length,
    internal_standards: her.ended ? her.completed / her.ended : 1,
  };
}

/** Goes on with the episode of her emotion, or begins another one: who is responsible, and for what, is decided then. */
function followEpisode(tickS) {
  if (her.episode.of === her.emotion) {
    her.episode.duration_s += tickS;
    return;
  }
  const { hurried, blocked, waiting } = her.measures;
  const isOfCrowd = blocked >= dynamics.th_concerned;
  let agency = "self";
  if (her.emotion !== "HAPPY") {
    if (isOfCrowd) agency = "the crowd";
    else if (hurried || waiting > 0) agency = parameters.waiter;
    else if (isNegative()) agency = her.episode.agency;
  }
  const events = { WAIT: "the rest", EXCHANGE: "the exchange", AWAIT_GO_HOME: "the wait", GO_HOME: "the way home" };
  const event = events[her.behavior] ?? (isOfCrowd ? "the blocked way" : "the call");
  const words = { g: `to bring ${parameters.goods} to ${parameters.waiter}`, a: parameters.waiter };
  const chain = FEELINGS[her.emotion][3].map((clause) => clause.replace(/{([ga])}/, (_, slot) => words[slot]));
  her.episode = {
    of: her.emotion,
    agency,
    causal_chain: chain.join("; "),
    duration_s: 0,
    focality: `event: ${event}`,
  };
}

// Emotion and behavior.

const hasAffect = () => parameters.affect === "on";
const isNegative = () => FEELINGS[her.emotion][0];
const intensity = () => (isNegative() ? her.urgency : 1 - her.urgency);
const valence = () => (isNegative() ? -intensity() : intensity());

/** What happened since the last emotion, or else what this tick's measures say. */
function input() {
  const isOver = her.behavior === "EXCHANGE" && hasLasted(parameters.exchange_s);
  const nearer = her.behavior === "REFILL" ? "comes nearer" : "nearer home";
  const shown = her.noted || (isOver ? "exchange over" : her.comesNearer ? nearer : "");
  her.noted = "";
  return shown;
}

const leaveBelow = (rung) => (rung === 0 ? 0 : dynamics[LADDER[rung][1]]) - dynamics.hysteresis;
const rungOf = (emotion) => LADDER.findIndex(([name]) => name === emotion);

/** How an input changes the urgency, and how far it may fall from now on. */
function respond(shown, target, before, gain) {
  let urgency = before;
  if (target !== null) {
    const tauS = target > before ? dynamics.tau_up_s / gain : dynamics.tau_down_s;
    urgency = before + (target - before) * (1 - exp(-told.tick_s / tauS));
  }
  const behind = target !== null && target > before ? ["falls behind", before - target] : null;
  const positive = (importance, limit, jumps = true) => {
    her.floor = Math.min(her.floor, limit);
    return { urgency: jumps ? Math.min(urgency, limit) : urgency, counted: [shown, importance] };
  };
  const { low_importance: low, high_importance: high, setback } = dynamics;
  if (["new errand", "sent home", "home"].includes(shown)) return positive(high, 1 - high);
  if (shown === "nearer home") return positive(low, 1 - low);
  if (["hurry", "gives up"].includes(shown)) return { urgency: urgency + gain * setback, counted: [shown, -setback] };
  if (shown === "comes nearer" && target !== null && target < before) return positive(1 - target, target, false);
  return { urgency, counted: behind };
}

/** Her emotion, and then her mood, which is the slow mean of what she feels. */
function feel() {
  const shown = input();
  if (!hasAffect()) return;
  updateEmotion(shown);
  her.mood += (valence() - her.mood) * Math.min(told.tick_s / moodiness.tau_s, 1);
}

/** What the urgency moves toward: a bad mood makes everything more pressing. */
const target = () => (her.behavior === "EXCHANGE" ? null : Math.min(Math.max(pressure() - moodiness.weight * her.mood, 0), 1));

/** Emotion state generator: the urgency follows the pressure and leads up and down the ladder. FRUSTRATED is left by positive inputs
    only, as far as they are important. */
function updateEmotion(shown) {
  her.unchangedS += told.tick_s;
  const rung = rungOf(her.emotion);
  if (shown === "exchange over") {
    if (rung !== 0) her.unchangedS = 0;
    return set({ emotion: "HAPPY", urgency: 0, floor: 0, isLost: false, progress: [shown, 1] });
  }
  const before = her.urgency;
  const gain = dynamics.caution_gain_base + dynamics.caution_gain_slope * parameters.caution;
  const { urgency, counted } = respond(shown, target(), before, gain);
  her.urgency = Math.min(Math.max(urgency, Math.min(before, her.floor), 0), 1);
  her.progress = counted ?? her.progress;
  if (counted?.[1] > 0) her.isLost = false;
  if (her.unchangedS + 1e-9 < dynamics.dwell_s) return;
  let next = rung;
  if (next + 1 < LADDER.length && her.urgency >= dynamics[LADDER[next + 1][1]]) next++;
  else while (next > 0 && her.urgency < leaveBelow(next)) next--;
  if (next === rung) return;
  set({ emotion: LADDER[next][0], unchangedS: 0 });
  if (!isNegative()) her.floor = 0;
  else if (her.emotion === "FRUSTRATED") her.floor = Math.max(leaveBelow(next), 0);
}

// Copyright (C) 2004 by Sun Microsystems, Inc. All rights reserved. Permission to use, copy, modify, and distribute this software is
// freely granted, provided that this notice is preserved.
/** The exponential of a number that is not above 0, to the last bit as in Rust: FreeBSD's e_exp.c. */
function exp(x) {
  if (x < -708) return 0;
  let k = 0;
  if (-x >= 1.0397205352783203) k = Math.trunc(1.4426950408889634 * x - 0.5); // 1.5 ln 2, to the bits that are compared
  else if (-x >= 0.3465735912322998) k = -1; // 0.5 ln 2
  else if (-x < 3.725293851175593e-9) return 1 + x;
  const high = x - k * 6.93147180369123816490e-1;
  const low = k * 1.90821492927058770002e-10;
  const r = high - low;
  const rr = r * r;
  const inner = 6.61375632143793436117e-5 + rr * (-1.65339022054652515390e-6 + rr * 4.13813679705723846039e-8);
  const c = r - rr * (1.66666666666666019037e-1 + rr * (-2.77777777770155933842e-3 + rr * inner));
  return (1 + ((r * c) / (2 - c) - low + high)) * 2 ** k;
}

function updateBehavior() {
  const { policy, exchange_radius_m: radiusM, query_stale_s: staleS, schematic } = parameters;
  const { blocked, waiting } = her.measures;
  const isEmotional = hasAffect() && schematic === "on";
  const isUnknown = !her.hasAnswered || her.unheardS > staleS;
  const isCertain = her.isSensed || (told.sensing_range_m < radiusM && her.unseenS === 0);
  const isHere = isCertain && her.waiter !== null && distanceM(her.at, her.waiter) <= radiusM;
  const awayM = distanceM(her.at, her.home);
  const hasSetOut = hasLasted(parameters.prep_s);
  const isOver = Math.max(blocked, waiting) >= dynamics.th_frustrated;
  const actsByRules = policy === "rules" || policy === "timer";
  const context = {
    givesUp: hasSetOut && (policy === "emotion" ? isEmotional && her.emotion === "FRUSTRATED" : actsByRules && isOver),
    isHappy: isEmotional && her.emotion === "HAPPY",
    pending: her.pending,
    // Vonda does not step in for Leguin.
    waiterIsNeedyHere: isHere && [null, told.name].includes(her.waiterCalls) && (her.waiterNeeds || isUnknown),
    exchangeIsOver: hasLasted(parameters.exchange_s),
    sentHome: her.sentHome,
    isHome: awayM <= parameters.arrive_m || (awayM <= parameters.settle_m && her.stalledS >= parameters.settle_s),
    hasJoke: her.untilJokeS <= 0,
  };
  const from = her.behavior;
  for (const [comeFrom, when, act, go] of BEHAVIORS) {
    if (!comeFrom.includes(from) || !when(context)) continue;
    act(context);
    if (go !== null) return set({ behavior: go, lastingS: 0 });
  }
}

function joke() {
  const chosen = Math.min(Math.floor(her.jokes.unit() * JOKES.length), JOKES.length - 1);
  log(`jokes: ${JOKES[chosen]}`);
  her.untilJokeS = her.jokes.exponential(parameters.joke_mean_s);
}

/** The factor on her speed. By emotion, the stronger her concern, the faster she is. */
function haste() {
  const { policy, hurry_mult: most, sensory_motor, haste_onset: onset, haste_full: full } = parameters;
  const { th_concerned } = dynamics;
  if (policy === "emotion") {
    if (sensory_motor !== "on") return 1;
    const felt = intensity();
    const share = !isNegative() ? 0 : felt >= full ? 1 : felt <= onset ? 0 : (felt - onset) / (full - onset);
    return 1 + (most - 1) * share;
  }
  const isConcerning = policy === "rules" && her.measures.blocked >= th_concerned;
  return policy !== "neither" && (her.hurried || isConcerning) ? most : 1;
}

function take({ from, command }) {
  const isThere = her.behavior === "EXCHANGE";
  if (!isThere && (command === "refill" || command === "hurry")) her.owedS ??= 0;
  if (command === "refill") {
    if (!isThere && her.behavior !== "REFILL") her.pending ||= "refill";
  } else if (command === "hurry") {
    if (!isThere) her.pending = "hurry";
  } else if (command === "go home") {
    her.sentHome ||= isThere || her.behavior === "AWAIT_GO_HOME";
  } else {
    const characters = [...command];
    const shown = characters.length <= 60 ? command : `${characters.slice(0, 60).join("")}...`;
    log(`does not understand ${JSON.stringify(shown)} from ${from}`);
  }
}

async function projectLocation() {
  const { v_refill_mps: speedMps, prep_s, stand_off_m } = parameters;
  if (her.behavior === "GO_HOME") return drive(her.home, 0, speedMps);
  if (her.behavior !== "REFILL" || !hasLasted(prep_s)) return stay();
  const to = goal();
  return to ? drive(to, stand_off_m, speedMps * haste()) : walk(speedMps * haste());
}

/** Rounded, so that languages whose arc tangents differ in the last bit agree; half a turn is positive. */
function publishedAngle(angle_rad) {
  const rounded = Math.floor(angle_rad * 1e6 + 0.5) / 1e6;
  return rounded === -3.141593 ? 3.141593 : rounded + 0; // + 0: not -0.
}

/** The end of every tick: where she goes, and what others see. */
async function finishTick() {
  const proposal = await projectLocation();
  const to = goal();
  const [, face, action_tendency] = FEELINGS[her.emotion];
  const { of: _, ...episode } = her.episode;
  const frame = {
    valence: valence(),
    intensity: intensity(),
    urgency: her.urgency,
    ...her.appraisal,
    ...episode,
    action_tendency,
    caution: parameters.caution,
    duration: "minutes",
    facial_expression: face,
    mood: her.mood,
  };
  send({
    type: "done",
    proposal,
    speed_mps: her.speedMps,
    direction_rad: publishedAngle(Math.atan2(her.heading.y, her.heading.x)),
    emotion_state: hasAffect() ? her.emotion : "NEUTRAL",
    behavior_state: her.behavior,
    state_variables: {
      hurried: her.hurried,
      blocked_s: her.stalledS,
      waiting_s: her.waitingS,
      distance_m: to ? distanceM(her.at, to) : 0,
      pending: her.pending,
      trips: her.trips,
      given_up: her.givenUp,
      waiter: parameters.waiter,
      behavior: her.behavior,
      home_x_m: her.home.x,
      home_y_m: her.home.y,
      ...(her.progress ? { progress_by: her.progress[0], progress: her.progress[1] } : {}),
      ...(hasAffect() ? frame : {}),
    },
  });
}

/** The defaults with what is given; a name that she does not know would silently run another experiment. */
function known(defaults, given) {
  const unknown = Object.keys(given).find((name) => !(name in defaults));
  if (unknown) throw new Error(`there is no parameter ${unknown}`);
  const wrong = Object.keys(given).find((name) => typeof given[name] !== typeof defaults[name]);
  if (wrong) throw new Error(`${wrong} must be a ${typeof defaults[wrong]}, not ${JSON.stringify(given[wrong])}`);
  return { ...defaults, ...given };
}

function within(name, value, least, most) {
  if (!(value >= least && value <= most)) throw new Error(`${name} must be from ${least} to ${most}, not ${value}`);
}

/** Back to the initial state; a former incarnation that was lost has published what it knew. */
async function begin(init) {
  const { dynamics: given, appraisal, mood, deliberation, recruitment, ...others } = init.parameters ?? {};
  told = init;
  parameters = known(PARAMETERS, others);
  dynamics = known(DYNAMICS, given ?? {});
  looks = known(APPRAISAL, appraisal ?? {});
  moodiness = known(MOOD, mood ?? {});
  within("mood.start", moodiness.start, -1, 1);
  within("mood.weight", moodiness.weight, 0, 1);
  within("mood.tau_s", moodiness.tau_s, Number.MIN_VALUE, Number.MAX_VALUE);
  within("caution", parameters.caution, 0, 1);
  if (parameters.signals !== "off") throw new Error("this Leguin sees no signals: set signals to off");
  if (parameters.scripted !== "felt") throw new Error("this Leguin has no script: set scripted to felt");
  if ((recruitment?.by ?? "off") !== "off") throw new Error("this Leguin is not recruited: set recruitment.by to off");
  if ((deliberation?.beliefs ?? "off") !== "off") throw new Error("this Leguin has no beliefs: set deliberation.beliefs to off");
  const own = Stream.named(init.seed, init.stream);
  her = {
    at: init.location,
    home: init.location,
    heading: { x: 1, y: 0 },
    speedMps: 0,
    side: 1, // Where she last found a way around: 1 is left.
    carefulS: 0,
    turnS: 0,
    wasBlocked: false,
    waiter: null, // His last known place.
    waiterNeeds: false,
    waiterCalls: null,
    hasAnswered: false,
    isSensed: false,
    isMissing: false,
    unheardS: 0,
    unseenS: 0,
    behavior: "WAIT",
    lastingS: 0,
    waitingS: 0,
    emotion: "HAPPY",
    urgency: 0,
    floor: 0, // What the urgency does not fall below until there is a positive input.
    unchangedS: 0,
    mood: moodiness.start,
    noted: "", // What happened, for the next emotion.
    progress: null, // The last input that counted: its name, and its importance with its sign.
    measures: { hurried: false, errand: 0, blocked: 0, waiting: 0 },
    pressures: [], // Of the ticks from which she predicts.
    owedS: null, // How long ago she was first called, until she comes.
    duty: [], // Of recent ticks, whether no call waited for too long.
    isOnErrand: 0,
    isLost: false, // She gave up, and nothing good has happened since.
    ended: 0, // Errands, and those of them that she completed.
    completed: 0,
    appraisal: {
      goal_congruence: 1,
      controllability: 1,
      certainty: 0,
      novelty: 0,
      modifiability: 0.5,
      external_norms: 1,
      internal_standards: 1,
    },
    episode: { of: "", agency: "self" },
    hurried: false,
    sentHome: false,
    pending: "",
    trips: 0,
    givenUp: 0,
    turns: new Stream(own.next()),
    jokes: new Stream(own.next()),
    ...NO_WAY,
  };
  her.untilJokeS = her.jokes.exponential(parameters.joke_mean_s);
  followEpisode(0);
  if (init.tick === 0) return finishTick();

  const last = init.last_state_variables;
  if (!last) return;
  const isErrand = last.pending === "refill" || last.pending === "hurry";
  set({ hurried: last.hurried === true, pending: isErrand ? last.pending : "" });
  set({ trips: last.trips ?? 0, givenUp: last.given_up ?? 0, behavior: last.behavior ?? "GO_HOME" });
  const felt = Object.entries(FEELINGS).find(([, feeling]) => feeling[2] === last.action_tendency);
  if (hasAffect() && felt && typeof last.urgency === "number") {
    set({ emotion: felt[0], urgency: last.urgency, mood: last.mood ?? her.mood });
    her.floor = isNegative() ? Math.max(leaveBelow(rungOf(felt[0])), 0) : 0;
  }
  her.home = { x: last.home_x_m ?? her.home.x, y: last.home_y_m ?? her.home.y };
  log("is back, and takes over where the last one was lost");
}

/** A tick, in the order of the paper's Figure 5. */
async function tick({ location, blocked = false, sensed = [], commands = [] }) {
  set({ at: location, wasBlocked: blocked });
  commands.forEach(take);
  her.lastingS += told.tick_s;
  her.untilJokeS -= told.tick_s;
  her.waitingS = her.behavior === "AWAIT_GO_HOME" ? her.waitingS + told.tick_s : 0;
  checkDuty();
  await observeWaiter(sensed);
  observeWay();
  measure();
  feel();
  appraise();
  followEpisode(told.tick_s);
  updateBehavior();
  await finishTick();
}

for (let message = await receive(); message.type !== "end"; message = await receive()) {
  if (message.type === "init") {
    await begin(message).catch((error) => {
      process.stderr.write(`error: ${error.message}\n`);
      process.exit(1);
    });
  } else await tick(message);
}
process.exit(0);
