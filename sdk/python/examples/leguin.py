#!/usr/bin/env python3
"""Leguin, the refiller, in Python: waits at the table until she is called, brings treats, hurries when she is asked to,
and goes home when she is sent or has had enough.

She does what ``crates/robots/src/leguin`` does, with the same parameters and the same chance: put her in the place of
``cars-leguin`` and the run is the same, byte for byte (``launch/leguin_in_python.toml``). Vonda is Leguin under another
name: ``leguin.py --name Vonda``.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field, fields
from enum import Enum, auto
from typing import Literal

from affect import (
    Appraisal,
    BehaviorGenerator,
    Cause,
    DynamicGenerator,
    DynamicsParameters,
    Emotion,
    Episode,
    Event,
    Feeling,
    MoodParameters,
    Prediction,
    RecentShare,
    Row,
    intensity_label,
    motor_gain,
)
from chance import Chance
from closing import Closing
from drive import Course, Legs
from peer import Peer

from cars import BadParameters, Cars, CarsRobotInterface, Panel, Point, StateVariables, main
from cars.panel import Badge, Bar, Button, Face, FaceName, Table, Text, Tone, Widget

FT_M = 0.3048
REFILL, HURRY, GO_HOME = "refill", "hurry", "go home"
JOKES = (
    "Waiting is easy. I have it in my state table.",
    "I asked the table for a joke. It said the spread was good enough.",
    "My favorite distance is four feet.",
    "They say a watched pot never boils. Nobody has tried it with a watched robot.",
)

Switch = Literal["on", "off"]
Policy = Literal["emotion", "rules", "timer", "neither"]


@dataclass(frozen=True)
class BeliefParameters:
    """Her beliefs about herself: none in Python. The other value is read and not used."""

    beliefs: Literal["off"] = "off"
    discouraged_after: int = 2

    def check(self) -> None:
        """:raises ValueError: what is wrong with the values, if anything is."""
        if self.discouraged_after < 1:
            raise ValueError("deliberation.discouraged_after must be at least 1")


@dataclass(frozen=True)
class AppraisalParameters:
    """How far she looks to appraise her situation."""

    prediction_s: float = 5.0
    recent_s: float = 60.0


@dataclass(frozen=True)
class RecruitmentParameters:
    """How she answers a waiter who calls any refiller: not at all in Python. The other values are read and not used."""

    by: Literal["off"] = "off"
    threshold: float = 0.6
    gain: float = 1.0
    weight: Literal["inverse", "inverse_square"] = "inverse"
    near_m: float = FT_M
    shame_start_max: float = 0.3


@dataclass(frozen=True)
class Parameters:
    """What she can be told about herself, in SI units; what each means is in ``configs/robots/leguin.toml``."""

    waiter: str = "Butler"
    goods: str = "treats"
    affect: Switch = "on"
    policy: Policy = "emotion"
    signals: Literal["off"] = "off"
    scripted: Literal["felt"] = "felt"
    sensory_motor: Switch = "on"
    schematic: Switch = "on"
    caution: float = 0.5
    exchange_radius_m: float = 4.0 * FT_M
    exchange_s: float = 2.0
    v_refill_mps: float = 3.0 * FT_M
    hurry_mult: float = 1.5
    prep_s: float = 1.0
    errand_pressure: float = 0.35
    hurry_pressure: float = 0.6
    haste_onset: float = 0.25
    haste_full: float = 0.55
    block_patience_s: float = 32.0
    await_patience_s: float = 26.0
    progress_m: float = 0.5 * FT_M
    arrive_m: float = 1.5 * FT_M
    settle_s: float = 5.0
    settle_m: float = 6.0 * FT_M
    stand_off_m: float = 3.0 * FT_M
    query_stale_s: float = 5.0
    answer_s: float = 20.0
    turn_mean_s: float = 5.0
    look_s: float = 2.0
    joke_mean_s: float = 60.0
    recruitment: RecruitmentParameters = field(default_factory=RecruitmentParameters)
    deliberation: BeliefParameters = field(default_factory=BeliefParameters)
    appraisal: AppraisalParameters = field(default_factory=AppraisalParameters)
    mood: MoodParameters = field(default_factory=MoodParameters)
    dynamics: DynamicsParameters = field(default_factory=DynamicsParameters)

    POSITIVE = (
        "exchange_radius_m",
        "block_patience_s",
        "await_patience_s",
        "progress_m",
        "turn_mean_s",
        "joke_mean_s",
    )

    def check(self) -> None:
        """:raises ValueError: what is wrong with the values, if anything is."""
        for name in (one.name for one in fields(self)):
            value = getattr(self, name)
            if isinstance(value, float) and (value < 0.0 or (name in self.POSITIVE and value == 0.0)):
                least = "above 0" if name in self.POSITIVE else "at least 0"
                raise ValueError(f"{name} must be {least}, not {value:g}")
        if not self.haste_onset <= self.haste_full <= 1.0:
            onset, full = self.haste_onset, self.haste_full
            raise ValueError(f"haste_onset, {onset:g}, and haste_full, {full:g}, must ascend up to 1")
        self.dynamics.check()
        self.mood.check()
        self.deliberation.check()
        if not 0.0 <= self.caution <= 1.0:
            raise ValueError(f"caution must lie in [0, 1], not {self.caution:g}")

    @property
    def acts_by(self) -> Policy:
        """What she gives up by, with regard to what is switched off."""
        has_emotions = self.affect == "on" and self.schematic == "on"
        return "neither" if self.policy == "emotion" and not has_emotions else self.policy

    @property
    def gain(self) -> float:
        """How strongly she reacts: 1 with the defaults."""
        return self.dynamics.gain(self.caution)


class Behavior(Enum):
    """Her behaviors, by the names under which they are published."""

    WAIT = "WAIT"
    REFILL = "REFILL"
    EXCHANGE = "EXCHANGE"
    AWAIT_GO_HOME = "AWAIT_GO_HOME"
    GO_HOME = "GO_HOME"


class Act(Enum):
    """What a row of the table has her do."""

    TAKE_ERRAND = auto()
    HURRY = auto()
    FINISH_ERRAND = auto()
    GIVE_UP = auto()
    TURN_HOME = auto()
    COME_HOME = auto()
    JOKE = auto()


@dataclass(frozen=True)
class Measures:
    """The progress measures."""

    hurried: bool = False
    errand: float = 0.0
    """The pressure of her errand itself."""
    blocked: float = 0.0
    """Time without progress on the way, as a share of her patience with that."""
    waiting: float = 0.0
    """Time for which she has waited to be sent home, as a share of her patience with that."""
    th_concerned: float = 0.45
    """The share at which she is concerned about the way."""


@dataclass(frozen=True)
class Context:
    """What a row's guard can see."""

    gives_up: bool
    is_happy: bool
    pending: str
    """What she was told to do and has not begun: "refill", "hurry", or nothing."""
    waiter_is_needy_here: bool
    exchange_is_over: bool
    sent_home: bool
    is_home: bool
    has_joke: bool


WAIT, DRIVE, EXCHANGE, AWAIT, HOME = Behavior
HAPPY, CONFIDENT, CONCERNED, FRUSTRATED = Emotion

# fmt: off
TABLE: tuple[Row[Behavior, Context, Act], ...] = (
    # Behavior state generator.
    Row((WAIT, DRIVE),  lambda c: c.waiter_is_needy_here,             (Act.FINISH_ERRAND,), EXCHANGE),
    Row((WAIT,),        lambda c: c.pending != "",                    (Act.TAKE_ERRAND,),   DRIVE),
    Row((DRIVE,),       lambda c: c.pending == HURRY,                 (Act.HURRY,),         None),
    Row((EXCHANGE,),    lambda c: c.exchange_is_over,                 (),                   AWAIT),
    Row((AWAIT,),       lambda c: c.sent_home,                        (Act.TURN_HOME,),     HOME),
    Row((AWAIT, DRIVE), lambda c: c.gives_up,                         (Act.GIVE_UP,),       HOME),
    Row((HOME,),        lambda c: c.is_home,                          (Act.COME_HOME,),      WAIT),
    Row((WAIT, HOME),   lambda c: c.is_happy and c.has_joke,          (Act.JOKE,),          None),
)

EXPRESSIONS: dict[Emotion, tuple[FaceName, Tone, tuple[str, ...]]] = {
    # What people see of an emotion, and how she accounts for it: {g} is her goal, {a} who is in the way of it.
    HAPPY: ("happy", "good", (
        "belief: something good is happening", "achieved goal: I wanted this: {g}", "effect: because of this I feel good",
    )),
    CONFIDENT: ("neutral", "neutral", (
        "goal: I want {g}", "belief: I think this will happen", "belief: I know what to do",
        "effect: because of this I feel good",
    )),
    CONCERNED: ("fearful", "warning", (
        "goal: I want {g}", "belief: {a} is not here", "belief: something bad can happen soon", "belief: I do not want it",
        "belief: I do not know if it will happen", "effect: because of this I feel bad",
    )),
    FRUSTRATED: ("angry", "bad", (
        "goal: I want {g}", "belief: I cannot do this now", "belief: {a} is not here", "belief: I tried",
        "effect: because of this I feel bad and want to do something else",
    )),
}
# fmt: on


TENDENCIES = {
    HAPPY: "free-activate",
    CONFIDENT: "continue-normal-activity",
    CONCERNED: "monitor-progress-closely",
    FRUSTRATED: "change-current-strategy",
}
"""What an emotion inclines her to (Table 2 of the paper)."""

CROWD = "the crowd"
"""The name of what blocks her way."""

"""Time in which she is to answer a call; how far ahead she predicts, and how far back she judges what she does."""

EVENTS = {WAIT: "the rest", DRIVE: "the call", EXCHANGE: "the exchange", AWAIT: "the wait", HOME: "the way home"}
"""What an emotion that begins is about, if the crowd does not block her way."""


def urgency(measures: Measures, behavior: Behavior) -> float:
    """How pressing her errand is: what is asked of her and how long her way is blocked; then how long she is kept waiting."""
    if behavior is DRIVE:
        return min(max(measures.errand, measures.blocked), 1.0)
    return min(measures.waiting, 1.0) if behavior is AWAIT else 0.0


class Leguin(CarsRobotInterface):
    """The refiller."""

    senses_bodies = True

    def init_robot(self, cars: Cars) -> None:
        self.parameters = cars.parameters(Parameters)
        try:
            self.parameters.check()
        except ValueError as error:
            raise BadParameters(cars.name, str(error)) from None
        self.esg = DynamicGenerator(self.parameters.dynamics, self.parameters.mood, self.parameters.caution)
        self.noted = self.shown = ""  # What happened, for the next emotion, and what the present one was shown.
        self.progress: tuple[str, float] | None = None  # The last input that counted.
        self.bsg = BehaviorGenerator(TABLE, WAIT)
        self.measures = Measures()
        self.appraisal = Appraisal()
        self.episode = Episode()
        self.pressure = Prediction(self.parameters.appraisal.prediction_s)
        self.owed_s: float | None = None  # How long ago she was first called, until she comes.
        self.duty = RecentShare(self.parameters.appraisal.recent_s)
        self.is_on_errand = False
        self.ended = self.completed = 0  # Errands, and those of them that she completed.
        self.at = self.home = cars.welcome.location
        self.legs = Legs()
        self.hurried = self.sent_home = False
        self.pending = ""
        self.way = Closing()  # How near she has come to her goal on this way.
        self.comes_nearer = False
        self.waiting_s = 0.0  # How long she has waited to be sent home.
        self.trips = self.given_up = 0
        self.is_lost = False  # Whether she gave up, and nothing good has happened since.
        self.waiter = Peer(self.parameters.waiter)
        self.waiter_needs = False  # Whether he needed a refill when he last answered, and of whom.
        self.waiter_calls: str | None = None
        self.turns, self.jokes = Chance.split(cars.random), Chance.split(cars.random)
        self.until_joke_s = self.jokes.exponential(self.parameters.joke_mean_s)
        self.episode.update(HAPPY, 0.0, self.cause)

    @property
    def feeling(self) -> Feeling:
        """What she feels."""
        return self.esg.feeling

    # Progress.

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.at = location

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        behavior = self.bsg.current
        if command in (REFILL, HURRY) and behavior is not EXCHANGE and self.owed_s is None:
            self.owed_s = 0.0
        if command in (REFILL, HURRY) and behavior is EXCHANGE:
            pass  # What was meant to bring her about is over once she is there.
        elif command == REFILL:
            if behavior is not DRIVE:
                self.pending = self.pending or REFILL
        elif command == HURRY:
            self.pending = HURRY
        elif command == GO_HOME:
            # The waiter may be done with the exchange a tick before her.
            self.sent_home = self.sent_home or behavior in (EXCHANGE, AWAIT)
        else:
            shown = command if len(command) <= 60 else command[:60] + "..."
            cars.log(f"does not understand {json.dumps(shown, ensure_ascii=False)} from {sender}")

    def update_state_variables(self, cars: Cars) -> None:
        behavior, parameters = self.bsg.current, self.parameters
        self.bsg.advance(cars.tick_s)
        self.until_joke_s -= cars.tick_s
        self.waiting_s = self.waiting_s + cars.tick_s if behavior is AWAIT else 0.0
        if self.owed_s is not None:
            self.owed_s += cars.tick_s
        self.duty.add(self.owed_s is None or self.owed_s <= self.parameters.answer_s, cars.tick_s)
        self.observe_waiter(cars)
        self.observe_way(behavior, cars.tick_s)
        self.measures = Measures(
            hurried=self.hurried,
            errand=max(parameters.hurry_pressure, parameters.errand_pressure) if self.hurried else parameters.errand_pressure,
            blocked=self.way.stalled_s * parameters.gain / parameters.block_patience_s if behavior is DRIVE else 0.0,
            waiting=self.waiting_s * parameters.gain / parameters.await_patience_s,
            th_concerned=parameters.dynamics.th_concerned,
        )

    def appraise(self) -> Appraisal:
        """Her judgment of this moment."""
        measures = self.measures
        return Appraisal(
            goal_congruence=-1.0 if self.is_lost else 1.0 - 2.0 * urgency(measures, self.bsg.current),
            controllability=0.0 if self.is_lost else 1.0 - min(measures.blocked, 1.0),
            certainty=self.waiter.location_certainty(self.parameters.query_stale_s),
            novelty=self.pressure.novelty,
            modifiability=self.modifiability(),
            external_norms=self.duty.share,
            internal_standards=self.completed / self.ended if self.ended else 1.0,
        )

    def modifiability(self) -> float:
        """Whether the situation can change without her: the waiter comes, takes treats, or may call; a crowd may move."""
        measures, behavior = self.measures, self.bsg.current
        waiter = self.waiter.behavior(self.parameters.query_stale_s)
        if behavior is EXCHANGE:
            return 1.0
        if waiter is None:
            return 0.5
        if waiter in ("INTERCEPT", "EXCHANGE") or behavior is WAIT:
            return 1.0
        return 0.5 if measures.blocked >= measures.th_concerned else 0.0

    def cause(self, before: Cause) -> Cause:
        """Why an emotion begins. The crowd is responsible if it blocks her, and the waiter if he told her to hurry or keeps her
        waiting."""
        measures, emotion, behavior = self.measures, self.feeling.emotion, self.bsg.current
        is_blocked = measures.blocked >= measures.th_concerned
        agency = "self"
        if emotion is not HAPPY:
            if is_blocked:
                agency = CROWD
            elif measures.hurried or measures.waiting > 0.0:
                agency = self.waiter.name
            elif emotion.is_negative:
                agency = before.agency
        event = "the blocked way" if is_blocked and behavior is DRIVE else EVENTS[behavior]
        goal = f"to bring {self.parameters.goods} to {self.parameters.waiter}"
        chain = "; ".join(EXPRESSIONS[emotion][2]).format(g=goal, a=self.waiter.name)
        return Cause(agency, f"event: {event}", chain)

    def observe_waiter(self, cars: Cars) -> None:
        """What his answer says of what he needs, and of whom."""
        state = self.waiter.look(cars, self.at)
        if state is not None:
            needs, calls = state.state_variables.get("need"), state.state_variables.get("refiller")
            self.waiter_needs = needs is True
            self.waiter_calls = calls if isinstance(calls, str) else None

    def observe_way(self, behavior: Behavior, tick_s: float) -> None:
        """Measures progress on the way: whether she is nearer to its goal than ever before."""
        goal = self.goal()
        distance_m = None if goal is None else self.at.distance_m(goal)
        has_left = behavior is DRIVE and self.bsg.has_lasted(self.parameters.prep_s)
        if has_left or behavior is HOME:
            self.comes_nearer = self.way.observe(distance_m, self.parameters.progress_m, tick_s)
        else:
            self.way, self.comes_nearer = Closing(), False

    # Emotion.

    def update_emotion_state(self, cars: Cars) -> None:
        behavior, event = self.bsg.current, self.event()
        pressure = None if behavior is EXCHANGE else urgency(self.measures, behavior)
        if self.parameters.affect == "on":
            self.esg.update(pressure, event, cars.tick_s)
            if self.esg.progress is not None:
                signed, is_event = self.esg.progress
                self.progress = (self.shown if is_event else "falls behind", signed)
                self.is_lost = self.is_lost and signed <= 0.0
        self.pressure.observe(urgency(self.measures, behavior), cars.tick_s)
        self.appraisal = self.appraise()
        self.episode.update(self.feeling.emotion, cars.tick_s, self.cause)

    def event(self) -> Event | None:
        """What happened since the last emotion, or else what this tick's measures say."""
        behavior, dynamics = self.bsg.current, self.parameters.dynamics
        measured = ""
        if behavior is EXCHANGE and self.bsg.has_lasted(self.parameters.exchange_s):
            measured = "exchange over"
        elif self.comes_nearer:
            measured = {DRIVE: "comes nearer", HOME: "nearer home"}[behavior]
        self.shown, self.noted = self.noted or measured, ""
        match self.shown:
            case "exchange over":
                return "achieved"
            case "comes nearer":
                return "easing"
            case "nearer home":
                return ("positive", dynamics.low_importance)
            case "new errand" | "sent home" | "home":
                return ("positive", dynamics.high_importance)
            case "gives up" | "hurry":
                return ("negative", dynamics.setback)
        return None

    def emotion_state(self) -> str:
        return self.feeling.emotion.value if self.parameters.affect == "on" else "NEUTRAL"

    # Behavior.

    def update_behavior_state(self, cars: Cars) -> None:
        for act in self.bsg.update(self.context(cars)):
            self.perform(act, cars)

    def behavior_state(self) -> str:
        return self.bsg.current.value

    def context(self, cars: Cars) -> Context:
        """What the rows of her table see in this tick."""
        parameters = self.parameters
        is_here = self.waiter.is_within(parameters.exchange_radius_m, self.at, cars.welcome.sensing_range_m)
        return Context(
            gives_up=self.gives_up(),
            is_happy=parameters.affect == "on" and parameters.schematic == "on" and self.feeling.emotion is HAPPY,
            pending=self.pending,
            waiter_is_needy_here=self.is_needed(cars) and is_here,
            exchange_is_over=self.bsg.has_lasted(parameters.exchange_s),
            sent_home=self.sent_home,
            is_home=self.is_home(),
            has_joke=self.until_joke_s <= 0.0,
        )

    def gives_up(self) -> bool:
        """Whether she turns back, by her policy."""
        if not self.bsg.has_lasted(self.parameters.prep_s):
            return False
        if self.parameters.acts_by == "emotion":
            return self.feeling.emotion is FRUSTRATED
        is_over = max(self.measures.blocked, self.measures.waiting) >= self.parameters.dynamics.th_frustrated
        return self.parameters.acts_by != "neither" and is_over

    def is_needed(self, cars: Cars) -> bool:
        """Whether the waiter wants treats of her. Where he cannot be asked she takes it that he does, unless he is known
        to call for somebody else: Vonda does not step in for Leguin."""
        if self.waiter_calls not in (None, cars.name):
            return False
        return self.waiter_needs or self.waiter.is_unknown(self.parameters.query_stale_s)

    def is_home(self) -> bool:
        """Whether she is back at the table: at her place, or near it if somebody stands there and does not go."""
        away_m = self.at.distance_m(self.home)
        is_kept_away = self.way.stalled_s >= self.parameters.settle_s
        return away_m <= self.parameters.arrive_m or (away_m <= self.parameters.settle_m and is_kept_away)

    def perform(self, act: Act, cars: Cars) -> None:
        """Does what a row says."""
        match act:
            case Act.TAKE_ERRAND:
                self.hurried, self.pending = self.pending == HURRY, ""
                self.noted = "hurry" if self.hurried else "new errand"
                self.is_on_errand = True
            case Act.HURRY:
                self.hurried, self.pending = True, ""
                self.noted = "hurry"
            case Act.FINISH_ERRAND:
                self.hurried, self.pending, self.sent_home = False, "", False
                self.owed_s = None
                self.completed += self.is_on_errand
                self.end_errand()
            case Act.TURN_HOME:
                self.trips, self.sent_home = self.trips + 1, False
                self.noted = "sent home"
            case Act.COME_HOME:
                self.noted = "home"
            case Act.GIVE_UP:
                self.given_up, self.hurried, self.is_lost = self.given_up + 1, False, True
                self.end_errand()
                self.way = Closing()
                self.noted = "gives up"
            case Act.JOKE:
                cars.log(f"jokes: {JOKES[self.jokes.one_of(len(JOKES))]}")
                self.until_joke_s = self.jokes.exponential(self.parameters.joke_mean_s)

    def end_errand(self) -> None:
        """She turns back, or her errand is completed."""
        self.ended += self.is_on_errand
        self.is_on_errand = False

    # Motion.

    def project_location(self, cars: Cars) -> Point:
        match self.bsg.current:
            case Behavior.REFILL:
                return self.refill(cars)
            case Behavior.GO_HOME:
                home = Course(self.home, 0.0, self.parameters.v_refill_mps, self.parameters.look_s)
                return self.legs.drive(cars, self.at, home)
            case _:
                return self.legs.stay(self.at)

    def goal(self) -> Point | None:
        """Where she is going."""
        match self.bsg.current:
            case Behavior.REFILL:
                return None if self.waiter.is_missing else self.waiter.place
            case Behavior.GO_HOME:
                return self.home
            case _:
                return None

    def refill(self, cars: Cars) -> Point:
        """On the way to the waiter; if he is not where he was last known to be, in search of him."""
        parameters, goal = self.parameters, self.goal()
        speed_mps = parameters.v_refill_mps * self.haste()
        if not self.bsg.has_lasted(parameters.prep_s):
            return self.legs.stay(self.at)
        if goal is None:
            return self.legs.walk(cars, self.at, speed_mps, parameters.turn_mean_s, self.turns)
        course = Course(goal, parameters.stand_off_m, speed_mps, parameters.look_s)
        return self.legs.drive(cars, self.at, course)

    def haste(self) -> float:
        """The factor on her speed, by her policy. By emotion it is the sensory-motor level: the stronger her concern, the
        faster she is; nothing else changes her speed."""
        parameters, dynamics = self.parameters, self.parameters.dynamics
        if parameters.policy == "emotion" and parameters.sensory_motor == "on":
            return motor_gain(self.feeling, parameters.hurry_mult, parameters.haste_onset, parameters.haste_full)
        is_concerning = self.hurried or self.measures.blocked >= dynamics.th_concerned
        hurries = is_concerning if parameters.policy == "rules" else parameters.policy == "timer" and self.hurried
        return parameters.hurry_mult if hurries else 1.0

    # What others see.

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return self.legs.speed_mps

    def direction(self) -> float:
        return self.legs.direction_rad

    def state_variables(self) -> StateVariables:
        goal = self.goal()
        variables: dict[str, bool | float | str] = {
            "hurried": self.hurried,
            "blocked_s": self.way.stalled_s,
            "waiting_s": self.waiting_s,
            "distance_m": 0.0 if goal is None else self.at.distance_m(goal),
            "pending": self.pending,
            "trips": self.trips,
            "given_up": self.given_up,
            "waiter": self.waiter.name,
            "behavior": self.bsg.current.value,
            "home_x_m": self.home.x,
            "home_y_m": self.home.y,
        }
        if self.progress is not None:
            variables["progress_by"], variables["progress"] = self.progress
        return {**variables, **self.frame()} if self.parameters.affect == "on" else variables

    def frame(self) -> StateVariables:
        """What she feels and how she appraises it, under the names that robots with emotions share."""
        emotion, appraisal, episode = self.feeling.emotion, self.appraisal, self.episode
        return {
            "valence": self.feeling.valence,
            "intensity": self.feeling.intensity,
            "urgency": self.feeling.urgency,
            "goal_congruence": appraisal.goal_congruence,
            "controllability": appraisal.controllability,
            "certainty": appraisal.certainty,
            "novelty": appraisal.novelty,
            "modifiability": appraisal.modifiability,
            "external_norms": appraisal.external_norms,
            "internal_standards": appraisal.internal_standards,
            "agency": episode.cause.agency,
            "focality": episode.cause.focality,
            "causal_chain": episode.cause.causal_chain,
            "duration": "minutes",
            "duration_s": episode.lasted_s,
            "caution": self.parameters.caution,
            "mood": self.esg.mood,
            "action_tendency": TENDENCIES[emotion],
            "facial_expression": EXPRESSIONS[emotion][0],
        }

    def resume(self, cars: Cars, last: StateVariables) -> None:
        def number(name: str) -> float | None:
            value = last.get(name)
            return value if isinstance(value, float) else None

        self.hurried = last.get("hurried") is True
        self.pending = pending if (pending := last.get("pending")) in (REFILL, HURRY) else ""
        self.trips, self.given_up = int(number("trips") or 0), int(number("given_up") or 0)
        x, y = number("home_x_m"), number("home_y_m")
        if x is not None and y is not None:
            self.home = Point(x, y)
        urgency = number("urgency")
        for emotion, tendency in TENDENCIES.items():
            if self.parameters.affect == "on" and urgency is not None and tendency == last.get("action_tendency"):
                mood = number("mood")
                self.esg.take_over(emotion, urgency, self.esg.mood if mood is None else mood)
        known = {behavior.value: behavior for behavior in Behavior}
        self.bsg = BehaviorGenerator(TABLE, known.get(str(last.get("behavior")), HOME))
        cars.log("is back, and takes over where the last one was lost")

    def panel(self) -> Panel:
        face, tone, _ = EXPRESSIONS[self.feeling.emotion]
        strength = self.feeling.intensity
        clauses = self.episode.cause.causal_chain.split("; ")
        account = "; ".join(clause.split(": ", 1)[-1] for clause in clauses)
        label = intensity_label(strength, self.parameters.dynamics.label_cuts)
        feeling: list[Widget] = [
            Face(face, strength),
            Badge("emotion", self.emotion_state(), tone),
            Bar(f"intensity ({label})", strength),
            Text("inclined to", TENDENCIES[self.feeling.emotion].replace("-", " ")),
            Text("why", account[0].upper() + account[1:] + "."),
        ]
        if self.parameters.affect != "on":
            feeling = [Face("neutral", 0.0), Badge("emotion", self.emotion_state())]
        way = "-" if (to := self.goal()) is None else f"{self.at.distance_m(to):.1f} m"
        rows = [
            ("waiter", self.parameters.waiter),
            ("way to go", way),
            ("hurried", "yes" if self.hurried else "no"),
            ("blocked for", f"{self.way.stalled_s:.1f} s"),
            ("kept waiting for", f"{self.waiting_s:.1f} s"),
            ("trips, given up", f"{self.trips}, {self.given_up}"),
        ]
        buttons = [Button(command, command) for command in (REFILL, HURRY, GO_HOME)]
        return Panel([*feeling, Badge("behavior", self.behavior_state()), Table(rows), *buttons])


if __name__ == "__main__":
    sys.exit(main("Leguin", lambda name: Leguin()))
