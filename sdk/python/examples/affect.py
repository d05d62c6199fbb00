"""Emotion state generator (ESG) and behavior state generator (BSG) as tables, and the sensory-motor level.

Emotion acts on behavior directly, behavior on emotion only through the progress it makes: each generator is shown the
other's state and owns nothing but its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

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
    agency: str = "self"
    """Who is responsible: oneself, or another one by name."""


M = TypeVar("M")
B = TypeVar("B")
C = TypeVar("C")
A = TypeVar("A")


@dataclass(frozen=True, slots=True)
class EmotionRow(Generic[M, B]):
    """During these behaviors, if the guard holds, this is felt."""

    during: Sequence[B]
    when: Callable[[M], bool]
    feel: Emotion


class RuleGenerator(Generic[M, B]):
    """An ESG: the emotion is that of the first matching row, the urgency that of a formula. Without a row the emotion stays."""

    def __init__(self, rows: Sequence[EmotionRow[M, B]], urgency: Callable[[M], float], start: Emotion) -> None:
        self._rows = rows
        self._urgency = urgency
        self.feeling = Feeling(start, 0.0)

    def update(self, measures: M, behavior: B) -> None:
        """One step: measures of progress in, emotion out."""
        emotion = self.feeling.emotion
        for row in self._rows:
            if behavior in row.during and row.when(measures):
                emotion = row.feel
                break
        self.feeling = Feeling(emotion, min(max(self._urgency(measures), 0.0), 1.0))


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
