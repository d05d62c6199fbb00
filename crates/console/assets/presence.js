// @ts-check
// The presence of a robot in words.

/** @typedef {import("./types/messages.js").RobotFrame} RobotFrame */
/** @typedef {import("./types/messages.js").Awaited} Awaited */

/**
 * @param {Pick<RobotFrame, "name" | "presence" | "generation">} robot
 * @param {Awaited[]} awaiting
 * @returns {{word: string, since: string, detail: string, tone: "good" | "neutral" | "warning" | "bad"}}
 */
export function presence({ name, presence, generation }, awaiting) {
  const awaited = awaiting.find((one) => one.name === name);
  const since = awaited ? `${awaited.since_s.toFixed(0)} s` : "";
  if (presence === "lost") return { word: "lost", since: "", detail: "the run goes on without it", tone: "bad" };
  if (presence === "gone") return { word: "gone", since, detail: "its process or its link is down", tone: "bad" };
  if (awaited) return { word: "late", since, detail: because(awaited.because), tone: "warning" };
  if (generation > 1) return { word: "returned", since: "", detail: `this is its incarnation number ${generation}`, tone: "neutral" };

  return { word: "here", since: "", detail: "", tone: "good" };
}

/**
 * Why the clock waits for a robot.
 * @param {Awaited["because"]} because
 */
export function because(because) {
  if (because === "not_joined") return "has not joined yet";
  if (because === "gone") return "its process or its link is down";
  if (because === "silent") return "is connected but has not reported";
  if ("ended" in because) return `${because.ended}, and no further process is started for it`;
  return `waits for ${because.waits_for}`;
}
