// Robots over stdin and stdout, with a type for every line: docs/protocol.md, "Robots over stdin and stdout". Units are SI.
// A robot of your own implements `Robot` and hands itself to `play`; companion.mts is one.

/** A place on the field, meters from its lower left corner. */
export interface Point {
  readonly x: number;
  readonly y: number;
}

/** What a robot publishes about itself: a flag, a finite number in SI units, or text. */
export type Variables = Readonly<Record<string, boolean | number | string>>;

/** Another robot within sensing range, as of this tick. */
export interface SensedRobot {
  readonly name: string;
  readonly location: Point;
}

/** A body that the robot senses. */
export interface Body {
  readonly kind: "obstacle" | "guest" | "robot";
  readonly location: Point;
}

/** What a robot reported of itself for the tick before. */
export interface PublicState {
  readonly epoch: number;
  readonly tick: number;
  readonly location: Point;
  readonly speed_mps: number;
  /** Counter-clockwise from +x. */
  readonly direction_rad: number;
  readonly emotion_state: string;
  readonly behavior_state: string;
  readonly state_variables: Variables;
}

/** To the program: back to the initial state. */
export interface Init {
  readonly type: "init";
  readonly protocol: number;
  readonly run: string;
  readonly name: string;
  /** Its incarnation, from 1. */
  readonly generation: number;
  readonly epoch: number;
  /** 0, or the tick in which this incarnation takes over. */
  readonly tick: number;
  readonly seed: number;
  /** Name of its random stream, for a program with a generator of its own. */
  readonly stream: string;
  readonly tick_s: number;
  /** Width and height. */
  readonly field_m: readonly [number, number];
  /** Side of every body. */
  readonly body_m: number;
  readonly sensing_range_m: number;
  readonly location: Point;
  /** All robots of the scenario, itself included. */
  readonly roster: readonly string[];
  /** Whatever the scenario says of it. */
  readonly parameters: Readonly<Record<string, unknown>>;
  readonly sensed?: readonly SensedRobot[];
  /** What the incarnation before it reported last, if it takes over. */
  readonly last_state_variables?: Variables;
}

/** To the program: a tick. */
export interface Tick {
  readonly type: "tick";
  readonly tick: number;
  readonly location: Point;
  /** Whether its last move was refused. */
  readonly blocked?: boolean;
  /** Commands that arrive now, in order. */
  readonly commands?: readonly { readonly from: string; readonly performative: string; readonly command: string }[];
  readonly sensed?: readonly SensedRobot[];
}

/** Why a question has no answer. */
export type Unanswered = "unreachable" | "unknown robot" | "too early" | "interrupted" | "unknown query";

/** To the program: the answer to its question. */
export interface Answer {
  readonly type: "answer";
  readonly value?: unknown;
  readonly error?: Unanswered;
}

/** To the program: the run is over, or this robot's part in it. */
export interface End {
  readonly type: "end";
  readonly reason: "finished" | "stopped" | "aborted" | "interrupted" | "failed";
}

/** A line to the program. */
export type Told = Init | Tick | Answer | End;

/** What a query may ask for, and what it is answered with. */
export interface Answers {
  readonly location: Point;
  readonly speed: number;
  readonly direction: number;
  readonly state_variables: Variables;
  readonly emotion_state: string;
  readonly behavior_state: string;
  /** All of them at once. */
  readonly state: PublicState;
}

/** How a badge is meant. */
export type Tone = "good" | "neutral" | "warning" | "bad";

/** One element of a panel. */
export type Widget =
  | { widget: "text"; label: string; text: string }
  | { widget: "badge"; label: string; text: string; tone: Tone }
  | { widget: "bar"; label: string; value: number; min: number; max: number }
  | {
      widget: "face";
      face: "happy" | "sad" | "surprised" | "disgusted" | "angry" | "fearful" | "neutral";
      intensity: number;
    }
  | { widget: "sparkline"; label: string; values: readonly number[] }
  | { widget: "table"; rows: readonly (readonly string[])[] }
  | { widget: "svg"; label: string; svg: string }
  | { widget: "button"; label: string; command: string };

/** What ends a tick: where it wants to be next (it stays, if absent), and what others learn of it. */
export interface Done {
  readonly proposal?: Point;
  readonly speed_mps?: number;
  readonly direction_rad?: number;
  readonly emotion_state?: string;
  readonly behavior_state?: string;
  readonly state_variables?: Variables;
}

/** A line from the program. */
export type Said =
  | { type: "query"; of: string; what: keyof Answers }
  | { type: "percept" }
  | { type: "random" }
  | { type: "command"; to: string; command: string }
  | { type: "log"; text: string }
  | { type: "panel"; widgets: readonly Widget[] }
  | ({ type: "done" } & Done);

/** A robot. What it decides may depend on what it is told and on `Cars.random` alone. */
export interface Robot {
  /** Back to the initial state, before tick 0 of every epoch. */
  init(init: Init): void;
  /** A tick; also tick 0, right after `init`, with no news but where it stands. */
  tick(cars: Cars, news: Tick): Promise<Done>;
}

/** The part of Node.js, Deno and Bun that is used here; their type packages are not needed. */
declare const process: {
  readonly stdin: AsyncIterable<string> & { setEncoding(encoding: "utf8"): unknown };
  readonly stdout: { write(text: string): unknown };
  exit(code: number): never;
};

async function* read(): AsyncGenerator<string, undefined> {
  let rest = "";
  process.stdin.setEncoding("utf8");
  for await (const chunk of process.stdin) {
    const lines = (rest + chunk).split("\n");
    rest = lines.pop() ?? "";
    yield* lines;
  }
  return undefined;
}

/** The simulation, as the robot sees it during a tick. */
export class Cars {
  readonly #lines = read();

  /** What is told next. The end of the input is the end. */
  async hear(): Promise<Told> {
    const { value } = await this.#lines.next();
    // `cars exec` writes these lines; what it says is taken as it is.
    return value === undefined ? { type: "end", reason: "aborted" } : (JSON.parse(value) as Told);
  }

  say(said: Said): void {
    process.stdout.write(`${JSON.stringify(said)}\n`);
  }

  async #ask(question: Said): Promise<Answer> {
    this.say(question);
    const told = await this.hear();
    if (told.type === "end") process.exit(0);
    if (told.type !== "answer") throw new Error(`an answer was to come, not ${told.type}`);
    return told;
  }

  /** Asks another robot; undefined if it cannot be reached. */
  async query<What extends keyof Answers>(of: string, what: What): Promise<Answers[What] | undefined> {
    const { value } = await this.#ask({ type: "query", of, what });
    return value as Answers[What] | undefined;
  }

  /** All bodies within sensing range. */
  async percept(): Promise<readonly Body[]> {
    const { value } = await this.#ask({ type: "percept" });
    return (value as { bodies: readonly Body[] } | undefined)?.bodies ?? [];
  }

  /** The next draw of the robot's own stream, from 0 up to but not including 1. */
  async random(): Promise<number> {
    const { value } = await this.#ask({ type: "random" });
    return (value as number | undefined) ?? 0;
  }

  /** Sends another robot a command. It arrives at a later tick, if the network lets it. */
  command(to: string, command: string): void {
    this.say({ type: "command", to, command });
  }

  /** Writes a line to the log of the run. */
  log(text: string): void {
    this.say({ type: "log", text });
  }

  /** Replaces what people see of the robot. */
  panel(widgets: readonly Widget[]): void {
    this.say({ type: "panel", widgets });
  }
}

/** Runs a robot until the run is over. */
export async function play(robot: Robot): Promise<void> {
  const cars = new Cars();
  for (let told = await cars.hear(); told.type !== "end"; told = await cars.hear()) {
    if (told.type === "answer") throw new Error("an answer to no question");
    if (told.type === "init") {
      robot.init(told);
      // Who takes over in the middle answers the tick that follows.
      if (told.tick > 0) continue;
    }
    const { location, sensed = [] } = told;
    const news: Tick = told.type === "tick" ? told : { type: "tick", tick: 0, location, sensed };
    cars.say({ type: "done", ...(await robot.tick(cars, news)) });
  }
  process.exit(0);
}
