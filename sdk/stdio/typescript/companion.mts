// A companion: stays near its friend, longs for it where it falls behind, and worries and hurries when the friend is
// unhappy or cannot be asked.
//
//     tsc --project sdk/stdio/typescript          # or nothing, where the runtime reads TypeScript
//     cars exec --name Tove -- node target/stdio/companion.mjs
//
// Only + - * / and the square root decide where it goes: sines and cosines differ in their last bits from engine to engine.

import { play } from "./cars.mts";
import type { Cars, Done, Init, Point, PublicState, Robot, Tick, Tone } from "./cars.mts";

interface Parameters {
  /** Whose companion it is. */
  readonly friend: string;
  readonly speed_mps: number;
  /** How near is near. */
  readonly near_m: number;
}

/** Progress: how far away the friend is, as a share of what is near, for how long it has been silent, how it feels. */
interface Measures {
  readonly apart: number;
  readonly silent_s: number;
  readonly friend_feels: string;
}

type Emotion = "CONTENT" | "LONGING" | "WORRIED";
type Behavior = "ACCOMPANY" | "RUSH";

const UNHAPPY: readonly string[] = ["LONELY", "GRUMPY", "WORRIED", "CONCERNED", "FRUSTRATED"];

/** Emotion state generator: progress in, emotion out. The first row that holds counts. */
const EMOTIONS: readonly { when: (measures: Measures) => boolean; feel: Emotion; tone: Tone }[] = [
  { when: ({ silent_s }) => silent_s > 5, feel: "WORRIED", tone: "bad" },
  { when: ({ friend_feels }) => UNHAPPY.includes(friend_feels), feel: "WORRIED", tone: "bad" },
  { when: ({ apart }) => apart > 1, feel: "LONGING", tone: "warning" },
  { when: () => true, feel: "CONTENT", tone: "good" },
];

/** Behavior state generator: in this behavior, when this is felt, go over to that one. */
const BEHAVIORS: readonly { from: Behavior; when: Emotion; go: Behavior }[] = [
  { from: "ACCOMPANY", when: "WORRIED", go: "RUSH" },
  { from: "RUSH", when: "CONTENT", go: "ACCOMPANY" },
];

/** Cosine and sine of the headings it tries around the straight one: 0, then 30 to 120 degrees to either side. */
const TURNS: readonly (readonly [number, number])[] = [
  [1, 0],
  [0.866, 0.5], [0.866, -0.5],
  [0.5, 0.866], [0.5, -0.866],
  [0, 1], [0, -1],
  [-0.5, 0.866], [-0.5, -0.866],
];

const distance_m = (a: Point, b: Point): number => Math.sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y));

class Companion implements Robot {
  #told!: Init;
  #parameters!: Parameters;
  #friend: PublicState | undefined;
  #silent_s = 0;
  #rushed_s = 0;
  #emotion: Emotion = "CONTENT";
  #behavior: Behavior = "ACCOMPANY";
  #heading: Point = { x: 1, y: 0 };

  init(init: Init): void {
    this.#told = init;
    const others = init.roster.filter((name) => name !== init.name);
    this.#parameters = { friend: others[0] ?? init.name, speed_mps: 0.7, near_m: 2.5, ...init.parameters };
    this.#friend = undefined;
    this.#silent_s = 0;
    this.#rushed_s = Number(init.last_state_variables?.["rushed_s"] ?? 0);
    this.#emotion = "CONTENT";
    this.#behavior = "ACCOMPANY";
    this.#heading = { x: 1, y: 0 };
  }

  async tick(cars: Cars, news: Tick): Promise<Done> {
    // In tick 0 nobody has said anything yet, and there is no progress to feel.
    if (news.tick > 0) {
      const { tone } = this.#feel(await this.#look(cars, news.location));
      cars.panel([
        { widget: "face", face: tone === "good" ? "happy" : tone === "bad" ? "fearful" : "sad", intensity: 0.8 },
        { widget: "badge", label: "emotion", text: this.#emotion, tone },
        { widget: "badge", label: "behavior", text: this.#behavior, tone: "neutral" },
        { widget: "text", label: "friend", text: this.#parameters.friend },
      ]);
    }
    const proposal = await this.#project(cars, news.location);
    return {
      proposal,
      speed_mps: distance_m(news.location, proposal) / this.#told.tick_s,
      direction_rad: Math.atan2(this.#heading.y, this.#heading.x),
      emotion_state: this.#emotion,
      behavior_state: this.#behavior,
      state_variables: { friend: this.#parameters.friend, silent_s: this.#silent_s, rushed_s: this.#rushed_s },
    };
  }

  /** Asks the friend how it is. */
  async #look(cars: Cars, at: Point): Promise<Measures> {
    const { tick_s } = this.#told;
    const state = await cars.query(this.#parameters.friend, "state");
    this.#silent_s = state ? 0 : this.#silent_s + tick_s;
    this.#friend = state ?? this.#friend;
    this.#rushed_s += this.#behavior === "RUSH" ? tick_s : 0;
    return {
      apart: this.#friend ? distance_m(at, this.#friend.location) / this.#parameters.near_m : 0,
      silent_s: this.#silent_s,
      friend_feels: this.#friend?.emotion_state ?? "",
    };
  }

  /** From progress to emotion, and from emotion to behavior. */
  #feel(measures: Measures): { tone: Tone } {
    const felt = EMOTIONS.find(({ when }) => when(measures)) ?? { feel: this.#emotion, tone: "neutral" as const };
    this.#emotion = felt.feel;
    const row = BEHAVIORS.find(({ from, when }) => from === this.#behavior && when === this.#emotion);
    this.#behavior = row?.go ?? this.#behavior;
    return felt;
  }

  /** A step toward the friend, aside where somebody stands in the way; none where it is near or there is no way. */
  async #project(cars: Cars, at: Point): Promise<Point> {
    const there = this.#friend?.location;
    const away_m = there ? distance_m(at, there) : 0;
    const stop_m = this.#parameters.near_m / (this.#behavior === "RUSH" ? 2 : 1);
    const speed_mps = this.#parameters.speed_mps * (this.#behavior === "RUSH" ? 1.5 : 1);
    const step_m = Math.min(speed_mps * this.#told.tick_s, away_m - stop_m);
    if (!there || step_m <= 0) return at;
    const bodies = await cars.percept();
    const [x, y] = [(there.x - at.x) / away_m, (there.y - at.y) / away_m];
    for (const [cos, sin] of TURNS) {
      const heading = { x: x * cos - y * sin, y: x * sin + y * cos };
      const next = { x: at.x + heading.x * step_m, y: at.y + heading.y * step_m };
      const { body_m } = this.#told;
      const isInTheWay = ({ location }: { location: Point }): boolean =>
        Math.abs(location.x - next.x) < body_m && Math.abs(location.y - next.y) < body_m;
      if (!bodies.some(isInTheWay)) {
        this.#heading = heading;
        return next;
      }
    }
    return at;
  }
}

await play(new Companion());
