#!/usr/bin/env node
// @NAME@ strolls back and forth. When it has been blocked for too long, it becomes frustrated and turns around.
//
// `cars exec` speaks the simulator's protocol for it: one JSON object a line arrives on standard input,
// and the answers go to standard output. What it writes to standard error is shown by the launcher,
// and kept in the log of its process.

import { createInterface } from "node:readline";

const say = (line) => process.stdout.write(JSON.stringify(line) + "\n");

/** All that it remembers; `init` sets everything. */
let robot = {};

/** Before tick 0, and whenever the run begins anew: start from nothing. */
function init({ location, parameters, tick_s }) {
  robot = {
    ...parameters, // `[robot.params]` of the scenario, in SI units
    tick_s,
    at: location,
    // The ends of its stroll, meters from the left edge; it is on its way to the second.
    endsX: [location.x, location.x + parameters.walk_m],
    heldUpS: 0, // its measure of progress: how long it has been blocked, seconds
    turns: 0,
    isFrustrated: false,
    isResting: false,
  };
  // Its panel in the console: two buttons that send it commands.
  say({
    type: "panel",
    widgets: [
      { widget: "button", label: "Rest", command: "rest" },
      { widget: "button", label: "Stroll", command: "stroll" },
    ],
  });
}

function turn() {
  robot.endsX.reverse();
  robot.turns += 1;
}

function obey({ from, command }) {
  if (command !== "rest" && command !== "stroll") {
    say({ type: "log", text: `does not know how to ${command}` });
    return;
  }
  robot.isResting = command === "rest";
  say({ type: "log", text: `obeys ${from}: ${command}` });
}

/** One tick: what it is told, what it feels, what it does about it. */
function tick({ location, blocked = false, commands = [] }) {
  robot.at = location; // Where it stands now: the place it proposed, or its old one if that was taken.
  commands.forEach(obey);

  // Progress.
  if (blocked) robot.heldUpS += robot.tick_s;
  else robot.heldUpS = Math.max(robot.heldUpS - robot.tick_s / 2, 0);

  // The emotion state generator: progress in, emotion out.
  const wasFrustrated = robot.isFrustrated;
  robot.isFrustrated = wasFrustrated ? robot.heldUpS > 0 : robot.heldUpS >= robot.patience_s;

  // The behavior state generator: emotion in, behavior out.
  if (robot.isFrustrated && !wasFrustrated) turn();
  if (robot.at.x === robot.endsX[1]) turn();
}

/** The end of every tick: where it wants to stand at the next one, and what others may learn. */
function done() {
  const { at, endsX, isResting, isFrustrated } = robot;
  const speed = isResting ? 0 : robot.speed_mps;
  const step = speed * robot.tick_s;
  const left = endsX[1] - at.x;
  const x = Math.abs(left) <= step ? endsX[1] : at.x + Math.sign(left) * step;
  say({
    type: "done",
    proposal: { x: isResting ? at.x : x, y: at.y },
    speed_mps: speed,
    direction_rad: left < 0 ? Math.PI : 0,
    emotion_state: isFrustrated ? "FRUSTRATED" : "HAPPY",
    behavior_state: isResting ? "REST" : "STROLL",
    state_variables: { held_up_s: robot.heldUpS, turns: robot.turns },
  });
}

for await (const text of createInterface({ input: process.stdin })) {
  const line = JSON.parse(text);
  if (line.type === "end") break;
  if (line.type === "init") init(line);
  if (line.type === "tick") tick(line);
  // An `init` in the middle of a run is not answered: the tick that follows at once is.
  if (line.type === "tick" || (line.type === "init" && line.tick === 0)) done();
}
