// Generated from docs/schemas by `npm run generate` in crates/console/check. Do not edit.

/**
 * A request to the simulator. It never goes through the barrier: it is answered at once, also while the clock is held.
 */
export type Control =
  | {
      do: "init";
      /**
       * Only if this is the epoch in progress: another one has another set-up, perhaps. Without it whatever the epoch.
       */
      epoch?: number | null;
      /**
       * Another seed; without it the same.
       */
      seed?: number | null;
      /**
       * Another set-up; without it the same. A refusal names the fields that are wrong, and changes nothing.
       */
      setup?: Setup | null;
    }
  | {
      do: "load";
      /**
       * The text of a scenario file. Its `params_from` may name parameters that the simulator brings along, and no other file.
       */
      scenario: string;
    }
  | {
      do: "setup";
    }
  | {
      do: "start";
    }
  | {
      do: "pause";
    }
  | {
      do: "step";
      /**
       * How many.
       */
      n: number;
    }
  | {
      do: "seek";
      /**
       * The tick.
       */
      tick: number;
    }
  | {
      do: "stop";
    }
  | {
      do: "speed";
      /**
       * The real-time factor.
       */
      factor?: number | null;
    }
  | {
      /**
       * After how long without a report a robot is late, seconds of wall clock; for all robots; without it as before.
       */
      deadline_s?: number | null;
      do: "late";
      /**
       * What it does; without it as before.
       */
      on_late?: OnLate | null;
      /**
       * For which robot; without it for all that have no rule of their own.
       */
      robot?: RobotName | null;
    }
  | {
      do: "intervene";
      what: Intervention;
    }
  | {
      do: "faults_done";
      /**
       * Epoch of the order.
       */
      epoch: number;
      /**
       * Tick of the order.
       */
      tick: number;
    }
  | {
      /**
       * How it ended, as the predicate of a sentence about the robot.
       */
      because: string;
      do: "process_ended";
      /**
       * The robots.
       */
      robots: RobotName[];
    }
  | {
      do: "log";
    }
  | {
      do: "status";
    };
/**
 * What the clock does about a robot that is late.
 */
export type OnLate = "wait" | "continue" | "abort";
/**
 * Name of a robot of the roster; robots are addressed by it (seed, "Inter-Robot Communication").
 */
export type RobotName = string;
/**
 * What a person does to a run in progress. It is what a scenario can say, too: the record has it in the words of the scenario.
 */
export type Intervention =
  | {
      /**
       * One group.
       */
      from: RobotName[];
      intervention: "cut";
      /**
       * Whether only messages from the one group to the other are cut.
       */
      one_way?: boolean;
      /**
       * The other.
       */
      to: RobotName[];
    }
  | {
      /**
       * One group; without names all robots.
       */
      from?: RobotName[];
      intervention: "heal";
      /**
       * Whether only messages from the one group to the other pass again.
       */
      one_way?: boolean;
      /**
       * The other; without names all robots.
       */
      to?: RobotName[];
    }
  | {
      from: RobotName;
      intervention: "lose";
      to: RobotName;
    }
  | {
      /**
       * By how much, simulated seconds.
       */
      by_s: number;
      from: RobotName;
      intervention: "delay";
      to: RobotName;
    }
  | {
      from: RobotName;
      intervention: "duplicate";
      to: RobotName;
    }
  | {
      /**
       * After how long it ends by itself, seconds of wall clock; only where the clock waits for the robot.
       */
      for_s?: number | null;
      intervention: "fault";
      kind: FaultKind;
      robot: RobotName;
    }
  | {
      intervention: "recover";
      robot: RobotName;
    }
  | {
      intervention: "set";
      /**
       * Changes as in `robot.Butler.params.policy=rules`.
       */
      set: string[];
    };
/**
 * A fault of a process.
 */
export type FaultKind = "crash" | "hang" | "slow" | "restart";
/**
 * The answer to a [`Control`].
 */
export type ControlAnswer =
  | (Status & {
      answer: "done";
    })
  | (SetupAnswer & {
      answer: "setup";
    })
  | {
      answer: "log";
      /**
       * The lines. Every line that is put later is newer than these.
       */
      lines: LogRecord[];
    }
  | {
      answer: "refused";
      /**
       * Why, and what to do about it.
       */
      explanation: string;
      /**
       * Of a set-up: what is wrong with which of its fields.
       */
      fields?: FieldError[];
    };
/**
 * What is known of a robot that is awaited.
 */
export type Reason =
  | "not_joined"
  | "gone"
  | "silent"
  | {
      waits_for: RobotName;
    }
  | {
      ended: string;
    };
/**
 * What the simulator is doing.
 */
export type Phase = "gathering" | "ready" | "running" | "paused" | "ended";
/**
 * Name of a run; several runs can share a network.
 */
export type RunName = string;
/**
 * Whether a robot is there.
 */
export type Presence = "here" | "gone" | "lost";
/**
 * Kinds of log lines, to filter by.
 */
export type LogKind =
  | "run"
  | "membership"
  | "emotion"
  | "behavior"
  | "command"
  | "network"
  | "say"
  | "site"
  | "layer"
  | "verdict"
  | "late";
/**
 * One element of a panel.
 */
export type Widget =
  | {
      /**
       * What it is.
       */
      label: string;
      /**
       * What it says.
       */
      text: string;
      widget: "text";
    }
  | {
      /**
       * What it is.
       */
      label: string;
      /**
       * The state.
       */
      text: string;
      tone: Tone;
      widget: "badge";
    }
  | {
      /**
       * What it is.
       */
      label: string;
      /**
       * Upper bound.
       */
      max: number;
      /**
       * Lower bound.
       */
      min: number;
      /**
       * The quantity.
       */
      value: number;
      widget: "bar";
    }
  | {
      face: Face;
      /**
       * How strong, 0 to 1.
       */
      intensity: number;
      widget: "face";
    }
  | {
      /**
       * What it is.
       */
      label: string;
      /**
       * The values, oldest first.
       */
      values: number[];
      widget: "sparkline";
    }
  | {
      /**
       * The rows.
       */
      rows: string[][];
      widget: "table";
    }
  | {
      /**
       * What it shows, for those who do not see it.
       */
      label: string;
      /**
       * The document.
       */
      svg: string;
      widget: "svg";
    }
  | {
      /**
       * The command.
       */
      command: string;
      /**
       * What it says.
       */
      label: string;
      widget: "button";
    };
/**
 * How a badge is meant.
 */
export type Tone = "good" | "neutral" | "warning" | "bad";
/**
 * The facial expressions of the seed ("Emotion Components").
 */
export type Face = "happy" | "sad" | "surprised" | "disgusted" | "angry" | "fearful" | "neutral";
/**
 * A unit of length in which people are shown a run. All messages and records are in meters.
 */
export type DisplayUnit = "m" | "ft";
/**
 * Whether a run has done what is expected of it. The worse is the greater: a run passes if one expectation does and no other one
 * fails or is undecided.
 */
export type Verdict = "unreached" | "not_asked" | "pass" | "undecided" | "fail";
/**
 * What became of a command.
 */
export type Fate = "sent" | "delivered" | "dropped";
/**
 * A value that a robot publishes about itself. Numbers are one kind: 7 and 7.0 are the same value, so that robots in
 * languages that do not tell them apart give the same run.
 */
export type Variable = boolean | number | string;
/**
 * The shape of a body that is not a square of the run's size. Bodies do not turn.
 */
export type BodyShape =
  | {
      /**
       * @minItems 2
       * @maxItems 2
       */
      rectangle: [number, number];
    }
  | {
      disc: number;
    };

/**
 * What a person can change between two epochs: the set-up screen of the paper ("Overall Architecture"). Everything else
 * of the scenario stays.
 */
export interface Setup {
  /**
   * Simulated time, seconds.
   */
  duration_s: number;
  /**
   * Width and height of the field, meters.
   *
   * @minItems 2
   * @maxItems 2
   */
  field_m: [number, number];
  guest_duration_s: Range;
  guest_speed_mps: Range;
  /**
   * Number of guests.
   */
  guests: number;
  log_file: LogFile;
  /**
   * Centers of the fixed obstacles, meters.
   */
  obstacles: Point[];
  /**
   * Where each robot starts, meters.
   */
  robots: {
    [k: string]: Point;
  };
  /**
   * Where all chance of the epoch comes from.
   */
  seed: number;
}
/**
 * A triangular distribution.
 */
export interface Range {
  /**
   * Largest value.
   */
  max: number;
  /**
   * Least value.
   */
  min: number;
  /**
   * Most likely value.
   */
  mode: number;
}
/**
 * The readable log of a run, in the run's folder.
 */
export interface LogFile {
  /**
   * Whether it is written.
   */
  enabled: boolean;
  /**
   * Its name, without a folder.
   */
  name: string;
}
/**
 * A place on the field: meters from its lower left corner.
 */
export interface Point {
  /**
   * Meters to the right.
   */
  x: number;
  /**
   * Meters up.
   */
  y: number;
}
/**
 * How things stand.
 */
export interface Status {
  /**
   * For whom the clock waits now; empty when it does not.
   */
  awaiting: Awaited[];
  /**
   * After how long without a report a robot is late, seconds of wall clock.
   */
  deadline_s: number;
  /**
   * Simulated time at which the run ends, seconds.
   */
  duration_s: number;
  /**
   * The epoch.
   */
  epoch: number;
  /**
   * Messages that were ignored so far, by reason.
   */
  ignored: {
    [k: string]: number;
  };
  on_late: OnLate;
  /**
   * Ticks that were requested by `step` and are not done yet.
   */
  pending_steps: number;
  phase: Phase;
  /**
   * The recorded run of which this is a replay; none in a run in progress.
   */
  replay_of?: RunName | null;
  /**
   * The robots of the roster, by name.
   */
  robots: RobotStatus[];
  run: RunName;
  /**
   * Seed of the epoch.
   */
  seed: number;
  /**
   * Real-time factor; `null` is as fast as the barrier goes.
   */
  speed?: number | null;
  /**
   * Last tick that is complete.
   */
  tick: number;
  /**
   * Length of a tick, simulated seconds; 0 if it is not known.
   */
  tick_s?: number;
  /**
   * Simulated time at `tick`, seconds.
   */
  time_s: number;
}
/**
 * A robot that the clock waits for.
 */
export interface Awaited {
  because: Reason;
  name: RobotName;
  /**
   * For how long, seconds of wall clock.
   */
  since_s: number;
}
/**
 * One robot of the roster.
 */
export interface RobotStatus {
  /**
   * Incarnation; 0 before the first.
   */
  generation: number;
  name: RobotName;
  on_late: OnLate;
  presence: Presence;
}
/**
 * The set-up of a run.
 */
export interface SetupAnswer {
  /**
   * The whole scenario as a file, to keep.
   */
  scenario: string;
  setup: Setup;
}
/**
 * One line of the log.
 */
export interface LogRecord {
  /**
   * The epoch.
   */
  epoch: number;
  kind: LogKind;
  /**
   * A robot's name, or `simulator`.
   */
  source: string;
  /**
   * The line.
   */
  text: string;
  /**
   * The tick.
   */
  tick: number;
  /**
   * Length of a tick, seconds, which decides about the decimals of the time; 0 if it is not known.
   */
  tick_s?: number;
  /**
   * Simulated time, seconds.
   */
  time_s: number;
}
/**
 * A field that is wrong, and why.
 */
export interface FieldError {
  /**
   * Path of the field: `command`, `robots.Butler`, `setup.obstacles`.
   */
  field: string;
  /**
   * What is wrong with it, and what would be right.
   */
  reason: string;
}
/**
 * What a robot displays of one tick, published for the ticks that observers are shown ([`Clock::panels`](super::Clock)). It is
 * shown with this tick and with no other one.
 */
export interface TickPanel {
  /**
   * The epoch.
   */
  epoch: number;
  /**
   * The tick that the robot has run last.
   */
  tick: number;
  /**
   * The widgets, from top to bottom.
   */
  widgets: Widget[];
}
/**
 * The field at a moment, published at a display rate while there are subscribers.
 */
export interface WorldFrame {
  /**
   * For whom the clock waits; empty when it does not.
   */
  awaiting: Awaited[];
  /**
   * Side of every body, meters.
   */
  body_m: number;
  /**
   * Pairs of robots between which the medium lets nothing through now.
   */
  cuts?: Cut[];
  /**
   * In what people are shown lengths and speeds, unless they choose another unit.
   */
  display_unit?: DisplayUnit & string;
  /**
   * Simulated time at which the run ends, seconds.
   */
  duration_s: number;
  /**
   * The epoch.
   */
  epoch: number;
  /**
   * How the expectations of the scenario stand, in its order.
   */
  expectations?: Standing[];
  /**
   * Robots whose processes a fault holds now, because the scenario or a person wants it.
   */
  faults?: HeldProcess[];
  /**
   * Width and height of the field, meters.
   *
   * @minItems 2
   * @maxItems 2
   */
  field_m: [number, number];
  /**
   * Commands that were sent, or whose fate was decided, since the frame before; the newest [`MAX_FLIGHTS`] of them.
   */
  flights?: Flight[];
  /**
   * Guests that are not content, by their index in `guests`, by mood.
   */
  guest_moods?: {
    [k: string]: number[];
  };
  /**
   * The number of each of them, which it keeps; left out where guests do not enter and leave: then they are counted from 0.
   */
  guest_numbers?: number[];
  /**
   * Centers of the guests, meters.
   */
  guests: [number, number][];
  /**
   * How often a replay has been moved to another tick so far; 0 in a run in progress. With each move, observers forget what
   * they know of commands: `flights` then has all that is under way.
   */
  jumps?: number;
  /**
   * The layers, by name.
   */
  layers?: LayerFrame[];
  /**
   * The numbers that the measures of the scenario have up to the tick, by name. One that has none yet is left out.
   */
  measures?: {
    [k: string]: number;
  };
  /**
   * Centers of the fixed obstacles, meters.
   */
  obstacles: [number, number][];
  phase: Phase;
  /**
   * The recorded run of which this is a replay; none in a run in progress.
   */
  replay_of?: RunName | null;
  /**
   * The robots, by name.
   */
  robots: RobotFrame[];
  run: RunName;
  /**
   * Seed of the epoch.
   */
  seed: number;
  /**
   * The sites, by name.
   */
  sites?: SiteFrame[];
  /**
   * Real-time factor; `null` is as fast as the barrier goes.
   */
  speed?: number | null;
  /**
   * What does not change in an epoch: in its first frame, once a second, and in all frames while the clock stands. Without it,
   * what the frames before had in this epoch still holds.
   */
  static_world?: StaticWorld | null;
  /**
   * The tick.
   */
  tick: number;
  /**
   * Length of a tick, simulated seconds.
   */
  tick_s: number;
  /**
   * Simulated time, seconds.
   */
  time_s: number;
}
/**
 * A link that the medium has cut, one way.
 */
export interface Cut {
  /**
   * Whether commands are cut.
   */
  commands: boolean;
  from: RobotName;
  /**
   * Whether queries are cut.
   */
  queries: boolean;
  to: RobotName;
}
/**
 * How an expectation of the scenario stands.
 */
export interface Standing {
  /**
   * Its name.
   */
  expectation: string;
  /**
   * The verdict; none while it is not decided.
   */
  verdict?: Verdict | null;
}
/**
 * A robot whose process a fault holds.
 */
export interface HeldProcess {
  kind: FaultKind;
  robot: RobotName;
}
/**
 * A command on its way, as observers see it.
 */
export interface Flight {
  /**
   * Why the medium lost it, in words; only where it did.
   */
  because?: string | null;
  /**
   * What it says; only where it was sent just now.
   */
  command?: string;
  fate: Fate;
  from: RobotName;
  /**
   * Its number among the sender's.
   */
  seq: number;
  /**
   * Tick of what is told here.
   */
  tick: number;
  to: RobotName;
}
/**
 * A layer as observers see it: whole, with 256 levels between the least and the greatest number of its cells.
 */
export interface LayerFrame {
  /**
   * Side of a cell, meters. The first cell is in the lower left corner of the field; the last ones may reach over its edge.
   */
  cell_m: number;
  /**
   * Number of columns.
   */
  columns: number;
  /**
   * A byte for each cell, row by row from below, in Base64: its number is about `min + (max - min) * byte / 255`.
   */
  levels: string;
  /**
   * The greatest number of a cell.
   */
  max: number;
  /**
   * The least number of a cell.
   */
  min: number;
  /**
   * Its name.
   */
  name: string;
  /**
   * Number of rows.
   */
  rows: number;
  /**
   * The numbers at the ends of a color scale: the bounds of the layer, or where it has none the least and the greatest number of a cell
   * now and at the start.
   *
   * @minItems 2
   * @maxItems 2
   */
  scale: [number, number];
}
/**
 * A robot in a [`WorldFrame`].
 */
export interface RobotFrame {
  /**
   * Its behavior state.
   */
  behavior_state: string;
  /**
   * Whether its last move was refused.
   */
  blocked: boolean;
  /**
   * Direction of motion, radians counter-clockwise from +x.
   */
  direction_rad: number;
  /**
   * Its emotion state.
   */
  emotion_state: string;
  /**
   * Incarnation; above 1 it has returned.
   */
  generation: number;
  /**
   * Its heading, radians counter-clockwise from +x, if it drives like wheels: its body is turned by it.
   */
  heading_rad?: number | null;
  location: Point;
  name: RobotName;
  presence: Presence;
  /**
   * Magnitude of its velocity, m/s.
   */
  speed_mps: number;
  /**
   * What it publishes about itself.
   */
  state_variables: {
    [k: string]: Variable;
  };
}
/**
 * A site as observers see it.
 */
export interface SiteFrame {
  /**
   * A word for what it is.
   */
  kind: string;
  location: Point;
  /**
   * Its name.
   */
  name: string;
  /**
   * Its state.
   */
  state?: {
    [k: string]: Variable;
  };
}
/**
 * Walls, shapes of bodies, and how robots sense: what does not change in an epoch. Lengths are in steps of 0.1 mm.
 */
export interface StaticWorld {
  /**
   * Frames have every so manyth guest only, because all would be longer than a message; left out where frames have all.
   */
  guest_sample?: number | null;
  /**
   * Shapes of the fixed obstacles, in their order, `null` for squares of the run's size; empty if all are.
   */
  obstacle_shapes?: (BodyShape | null)[];
  /**
   * Robots with a shape of their own.
   */
  robot_shapes?: {
    [k: string]: BodyShape;
  };
  /**
   * Where robots look, if they do not look all around, or measure ranges.
   */
  sensing?: SensingLimits | null;
  /**
   * Walls, each the corners of a line, meters.
   */
  walls?: [number, number][][];
}
/**
 * Where robots look.
 */
export interface SensingLimits {
  /**
   * Angle that a robot overlooks, half of it to each side of its direction, radians; none is all around.
   */
  field_of_view_rad?: number | null;
  /**
   * Distance within which they sense other bodies, meters.
   */
  range_m: number;
  /**
   * The fan of rays of robots that ask for ranges.
   */
  rays?: Rays | null;
}
/**
 * A fan of rays around a robot. The first points in the direction of motion that the robot reported last, the others follow
 * counter-clockwise at equal angles.
 */
export interface Rays {
  /**
   * How many.
   */
  count: number;
  /**
   * How far they reach, meters.
   */
  range_m: number;
}
