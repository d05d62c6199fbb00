#!/usr/bin/env node
// A robot that bids for a task: the one that is nearest to the task gets it. Shows broadcasts and payloads in JavaScript.
//
//     command = ["cars", "exec", "--", "sdk/stdio/node/bidder.mjs"]

import { createInterface } from "node:readline";

/** The task, meters from the lower left corner of the field. */
const TASK = { x: 0, y: 0 };

const say = (message) => console.log(JSON.stringify(message));
const isBetter = (one, other) => other === undefined || one.distance_m < other.distance_m
  || (one.distance_m === other.distance_m && one.bidder < other.bidder);

let name;
let best;

for await (const line of createInterface({ input: process.stdin })) {
  const { type, tick, location, commands = [], ...more } = JSON.parse(line);
  if (type === "end") break;
  if (type === "init") {
    name = more.name;
    best = undefined;
    if (tick > 0) continue; // It replaces a lost process: the tick that follows is answered instead.
  }

  for (const { from, command, payload } of commands) {
    if (command !== "bid" || typeof payload?.distance_m !== "number") continue;
    const bid = { bidder: from, distance_m: payload.distance_m };
    if (isBetter(bid, best)) best = bid;
  }
  if (tick === 1) {
    const distance_m = Math.sqrt((location.x - TASK.x) ** 2 + (location.y - TASK.y) ** 2);
    best = { bidder: name, distance_m };
    say({ type: "command", to: "*", command: "bid", payload: { task: "clean", distance_m } });
  }
  say({
    type: "done",
    emotion_state: "CALM",
    behavior_state: best?.bidder === name ? "WORK" : "WAIT",
    state_variables: best === undefined ? {} : { winner: best.bidder, distance_m: best.distance_m },
  });
}
