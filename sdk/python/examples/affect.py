"""Emotion state generator (ESG) and behavior state generator (BSG) as tables, and the sensory-motor level.

Emotion acts on behavior directly, behavior on emotion only through the progress it makes: each generator is shown the
other's state and owns nothing but its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Generic, Literal, TypeVar

SLACK_S = 1e-9
"""Sums of steps such as 0.1 s fall short of what they mean by far less than this, and no step is as short."""


class Emotion(Enum):
    """The emotions of the documented refiller."""

    HAPPY = "HAPPY"
    CONFIDENT = "CONFIDENT"
    CONCERNED = "CONCERNED"
    FRUSTRATED = "FRUSTRATED"

    @property
    def is_negative(self) -> bool:
        """Whether it is unpleasant."""
        return self in (Emotion.CONCERNED, Emotion.FRUSTRATED)


@dataclass(frozen=True, slots=True)
class Feeling:
    """What is felt now: an emotion, and how pressing its cause is, 0 to 1."""

    emotion: Emotion
    urgency: float

    @property
    def intensity(self) -> float:
        """How strongly it is felt, 0 to 1: a pleasant emotion the more, the less presses."""
        return self.urgency if self.emotion.is_negative else 1.0 - self.urgency

    @property
    def valence(self) -> float:
        """The intensity with the sign of the emotion, -1 to 1."""
        return -self.intensity if self.emotion.is_negative else self.intensity


@dataclass(frozen=True, slots=True)
class Appraisal:
    """How the situation is judged; the defaults are those before anything is perceived."""

    goal_congruence: float = 1.0
    """From -1, it prevents the goal, to 1, nothing is in the way."""
    controllability: float = 1.0
    """How much can be done about it, 0 to 1."""
    certainty: float = 0.0
    """How much is known of it, 0 to 1."""
    novelty: float = 0.0
    """How far the situation is from what was predicted, 0 to 1."""
    modifiability: float = 0.5
    """Whether it can change without oneself: 1 another one acts on it, 0.5 unknown, 0 none does."""
    external_norms: float = 1.0
    """How far one does what one owes others, 0 to 1."""
    internal_standards: float = 1.0
    """How far one does what one expects of oneself, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Cause:
    """Why an episode began; kept until it ends."""

    agency: str = "self"
    """Who is responsible: oneself, or another one by name."""
    focality: str = ""
    """What it is about."""
    causal_chain: str = ""
    """The beliefs and goals behind it, each with its kind."""


class Episode:
    """A time without a break in one emotion."""

    def __init__(self) -> None:
        self.emotion: Emotion | None = None
        self.lasted_s = 0.0
        self.cause = Cause()

    def update(self, emotion: Emotion, dt_s: float, begin: Callable[[Cause], Cause]) -> None:
        """Goes on, or begins another one, with the cause that ``begin`` finds, given the one before."""
        if emotion is self.emotion:
            self.lasted_s += dt_s
        else:
            self.emotion, self.lasted_s, self.cause = emotion, 0.0, begin(self.cause)


def ticks_in(time_s: float, dt_s: float) -> int:
    """How many ticks a memory of this time has."""
    return min(max(int(time_s / dt_s + 0.5), 1), 10_000)


class Prediction:
    """How new the value of a measure is: how far it is from what its trend predicted one horizon ago."""

    def __init__(self, horizon_s: float) -> None:
        self.horizon_s = horizon_s
        self.novelty = 0.0
        self._values: list[float] = []

    def observe(self, value: float, dt_s: float) -> None:
        """Adds the value of a tick, 0 to 1."""
        ticks = ticks_in(self.horizon_s, dt_s)
        self._values = [*self._values, value][-(2 * ticks + 1) :]
        base = len(self._values) - 1 - ticks
        if base < 0:
            self.novelty = 0.0
            return
        known = min(base, ticks)
        change = (self._values[base] - self._values[base - known]) / known * ticks if known else 0.0
        self.novelty = abs(value - min(max(self._values[base] + change, 0.0), 1.0))


class RecentShare:
    """The share of recent ticks that were good."""

    def __init__(self, recent_s: float) -> None:
        self.recent_s = recent_s
        self._ticks: list[bool] = []

    def add(self, is_good: bool, dt_s: float) -> None:
        """Adds a tick."""
        self._ticks = [*self._ticks, is_good][-ticks_in(self.recent_s, dt_s) :]

    @property
    def share(self) -> float:
        """0 to 1."""
        return sum(self._ticks) / len(self._ticks) if self._ticks else 1.0


B = TypeVar("B")
C = TypeVar("C")
A = TypeVar("A")


Event = tuple[Literal["positive", "negative"], float] | Literal["easing", "achieved"]
"""Something that brings nearer to the goal or farther from it: of this importance, 0 to 1; progress that the pressure shows; or
the goal itself."""


@dataclass(frozen=True)
class DynamicsParameters:
    """The constants of the dynamics; what each means is in ``configs/robots/leguin.toml``. Of the sets of emotions there is
    one here."""

    state_set: Literal["murphy4"] = "murphy4"
    rho_max: float = 2.0
    caution_gain_base: float = 0.5
    caution_gain_slope: float = 1.0
    tau_up_s: float = 1.5
    tau_down_s: float = 3.0
    th_confident: float = 0.25
    th_concerned: float = 0.45
    th_frustrated: float = 0.75
    th_angry: float = 0.95
    anger_s: float = 15.0
    hysteresis: float = 0.08
    dwell_s: float = 1.0
    low_importance: float = 0.4
    high_importance: float = 0.75
    setback: float = 0.15
    hope_s: float = 15.0
    label_cuts: tuple[float, float, float, float] = (0.2, 0.4, 0.6, 0.8)

    def check(self) -> None:
        """:raises ValueError: what is wrong with the values, if anything is."""
        for name in ("rho_max", "caution_gain_base", "tau_up_s", "tau_down_s"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"dynamics.{name} must be above 0, not {getattr(self, name):g}")
        for name in ("caution_gain_slope", "anger_s", "hysteresis", "dwell_s", "hope_s", "setback"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"dynamics.{name} must be at least 0, not {getattr(self, name):g}")
        for names in (("low_importance", "high_importance"), ("th_confident", "th_concerned", "th_frustrated")):
            values = [0.0, *(getattr(self, name) for name in names), 1.0]
            if values[0] == values[1] or any(one > next_ for one, next_ in zip(values, values[1:], strict=False)):
                raise ValueError(f"{', '.join(names)} must ascend up to 1")

    def gain(self, caution: float) -> float:
        """How strongly a robot of this caution reacts."""
        return self.caution_gain_base + self.caution_gain_slope * caution


@dataclass(frozen=True)
class MoodParameters:
    """The constants of a mood, the slow mean of what is felt; what each means is in ``configs/robots/leguin.toml``."""

    start: float = 0.0
    tau_s: float = 86_400.0
    weight: float = 0.0

    def check(self) -> None:
        """:raises ValueError: what is wrong with the values, if anything is."""
        for name, least in (("start", -1.0), ("weight", 0.0)):
            if not least <= getattr(self, name) <= 1.0:
                raise ValueError(f"mood.{name} must be from {least:g} to 1, not {getattr(self, name):g}")
        if not self.tau_s > 0.0:
            raise ValueError(f"mood.tau_s must be above 0, not {self.tau_s:g}")


class DynamicGenerator:
    """An ESG: the urgency follows a pressure, and leads up and down a ladder of emotions. FRUSTRATED is left by positive
    inputs only, as far as they are important. A bad mood makes everything more pressing."""

    RUNGS = tuple(Emotion)

    def __init__(self, parameters: DynamicsParameters, mood: MoodParameters, caution: float) -> None:
        self._parameters = parameters
        self._mood = mood
        self._gain = parameters.gain(caution)
        self._enter = (0.0, parameters.th_confident, parameters.th_concerned, parameters.th_frustrated)
        self._rung = 0
        self._urgency = self._floor = self._unchanged_s = 0.0
        self.mood = mood.start
        """The slow mean of what is felt, -1 to 1."""
        self.progress: tuple[float, bool] | None = None
        """What counted as progress in the last step: its importance with its sign, and whether it was the event."""

    @property
    def feeling(self) -> Feeling:
        """What is felt now."""
        return Feeling(self.RUNGS[self._rung], self._urgency)

    def take_over(self, emotion: Emotion, urgency: float, mood: float) -> None:
        """Continues with a feeling of which nothing else is known: a negative one ends by a positive input only."""
        self.mood = min(max(mood, -1.0), 1.0)
        self._rung = self.RUNGS.index(emotion)
        self._urgency = min(max(urgency, 0.0), 1.0)
        self._floor = max(self._leave_below(self._rung), 0.0) if emotion.is_negative else 0.0

    def update(self, pressure: float | None, event: Event | None, dt_s: float) -> None:
        """One step: progress in, emotion out, and then the mood. Without a pressure the urgency holds."""
        if pressure is not None:
            pressure = min(max(pressure - self._mood.weight * self.mood, 0.0), 1.0)
        self._update_emotion(pressure, event, dt_s)
        self.mood += (self.feeling.valence - self.mood) * min(dt_s / self._mood.tau_s, 1.0)

    def _update_emotion(self, pressure: float | None, event: Event | None, dt_s: float) -> None:
        self._unchanged_s += dt_s
        if event == "achieved":
            self._urgency = self._floor = 0.0
            self.progress = (1.0, True)
            self._change_to(0)
            return

        self._update_urgency(pressure, event, dt_s)
        rung, urgency = self._rung, self._urgency
        if self._unchanged_s + SLACK_S < self._parameters.dwell_s:
            return
        if rung + 1 < len(self.RUNGS) and urgency >= self._enter[rung + 1]:
            rung += 1
        else:
            while rung > 0 and urgency < self._leave_below(rung):
                rung -= 1
        if rung != self._rung:
            if not self.RUNGS[rung].is_negative:
                self._floor = 0.0
            elif self.RUNGS[rung] is Emotion.FRUSTRATED:
                self._floor = max(self._leave_below(rung), 0.0)
        self._change_to(rung)

    def _update_urgency(self, pressure: float | None, event: Event | None, dt_s: float) -> None:
        before, floor = self._urgency, self._floor
        urgency = before if pressure is None else self._filtered(before, pressure, dt_s)
        self.progress = None
        if pressure is not None and pressure > before:
            self.progress = (before - pressure, False)
        match event:
            case ("positive", importance):
                limit = 1.0 - importance
                urgency, floor = min(urgency, limit), min(floor, limit)
                self.progress = (importance, True)
            case ("negative", importance):
                urgency += self._gain * importance
                self.progress = (-importance, True)
            case "easing" if pressure is not None and pressure < before:
                floor = min(floor, pressure)
                self.progress = (1.0 - pressure, True)
        self._floor = floor
        self._urgency = min(max(urgency, min(before, floor), 0.0), 1.0)

    def _filtered(self, urgency: float, target: float, dt_s: float) -> float:
        rises = target > urgency
        tau_s = self._parameters.tau_up_s / self._gain if rises else self._parameters.tau_down_s
        return urgency + (target - urgency) * (1.0 - exp(-dt_s / tau_s))

    def _leave_below(self, rung: int) -> float:
        return self._enter[rung] - self._parameters.hysteresis

    def _change_to(self, rung: int) -> None:
        if rung != self._rung:
            self._rung, self._unchanged_s = rung, 0.0


def exp(x: float) -> float:
    """The exponential of a number that is not above 0, to the last bit as in Rust: FreeBSD's ``e_exp.c``, whose license is

    Copyright (C) 2004 by Sun Microsystems, Inc. All rights reserved. Permission to use, copy, modify, and distribute this
    software is freely granted, provided that this notice is preserved.
    """
    if x < -708.0:
        return 0.0
    k = 0
    if -x >= 1.0397205352783203:  # 1.5 ln 2, to the bits that are compared
        k = int(1.4426950408889634 * x - 0.5)
    elif -x >= 0.3465735912322998:  # 0.5 ln 2
        k = -1
    elif -x < 3.725293851175593e-09:
        return 1.0 + x
    high, low = x - k * 6.93147180369123816490e-01, k * 1.90821492927058770002e-10
    x = high - low
    xx = x * x
    c = x - xx * (
        1.66666666666666019037e-01
        + xx
        * (
            -2.77777777770155933842e-03
            + xx * (6.61375632143793436117e-05 + xx * (-1.65339022054652515390e-06 + xx * 4.13813679705723846039e-08))
        )
    )
    return (1.0 + (x * c / (2.0 - c) - low + high)) * 2.0**k


@dataclass(frozen=True, slots=True)
class Row(Generic[B, C, A]):
    """From these behaviors, if the guard holds, do this, and go there; ``None`` reads on."""

    come_from: Sequence[B]
    when: Callable[[C], bool]
    act: Sequence[A]
    go: B | None


class BehaviorGenerator(Generic[B, C, A]):
    """A BSG: a table of guarded transitions, and the behavior it has led to.

    Rows are read from the top. A row applies if it is for the current behavior and its guard holds. Any number of rows
    that read on may act in a step; the first row that goes ends it. The context is the snapshot from the step's start.
    """

    def __init__(self, rows: Sequence[Row[B, C, A]], start: B) -> None:
        self._rows = rows
        self.current = start
        self.lasting_s = 0.0

    def advance(self, dt_s: float) -> None:
        """Lets time pass."""
        self.lasting_s += dt_s

    def has_lasted(self, seconds: float) -> bool:
        """Whether the behavior has lasted so long or longer."""
        return self.lasting_s + SLACK_S >= seconds

    def update(self, context: C) -> list[A]:
        """Decides, goes where the decision leads, and gives the actions for the robot to perform."""
        actions: list[A] = []
        for row in self._rows:
            if self.current not in row.come_from or not row.when(context):
                continue
            actions.extend(row.act)
            if row.go is not None:
                self.current, self.lasting_s = row.go, 0.0
                break
        return actions


def motor_gain(feeling: Feeling, negative_gain: float, onset: float, full: float) -> float:
    """The sensory-motor level: a factor on motor output under negative affect, 1 up to the intensity ``onset`` and
    ``negative_gain`` from ``full`` on."""
    if not feeling.emotion.is_negative:
        share = 0.0
    elif feeling.intensity >= full:
        share = 1.0
    elif feeling.intensity <= onset:
        share = 0.0
    else:
        share = (feeling.intensity - onset) / (full - onset)
    return 1.0 + (negative_gain - 1.0) * share


LABELS = ("very low", "low", "medium", "high", "very high")


def intensity_label(intensity: float, cuts: Sequence[float]) -> str:
    """One of five words for an intensity, by the intensities at which the upper four begin."""
    return LABELS[sum(intensity >= cut for cut in cuts)]
