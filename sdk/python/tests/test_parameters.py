"""Parameters as a robot's own type."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from cars._parameters import build


class Mood(enum.Enum):
    GOOD = "good"
    BAD = "bad"


@dataclass
class Inner:
    gain: float = 0.5


@dataclass
class Outer:
    speed_mps: float
    count: int = 3
    name: str = "x"
    is_loud: bool = False
    mood: Mood = Mood.GOOD
    switch: Literal["on", "off"] = "on"
    cuts: tuple[float, ...] = ()
    pair: tuple[float, float] = (0.0, 0.0)
    table: tuple[float, float] | None = None
    anything: Any = None
    inner: Inner = field(default_factory=Inner)


def test_values_become_what_they_are_declared_as() -> None:
    values = {
        "speed_mps": 2,
        "count": 7.0,
        "mood": "bad",
        "switch": "off",
        "cuts": [1, 2.5],
        "pair": [1, 2],
        "table": [3, 4],
        "anything": {"a": 1},
        "inner": {"gain": 1},
    }
    built = build(Outer, values)
    expected = Outer(
        2.0, 7, mood=Mood.BAD, switch="off", cuts=(1.0, 2.5), pair=(1.0, 2.0), table=(3.0, 4.0), anything={"a": 1}
    )
    expected.inner = Inner(1.0)
    assert built == expected and isinstance(built.speed_mps, float) and isinstance(built.count, int)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"sped_mps": 1}, "unknown parameter sped_mps; known are speed_mps, count"),
        ({"speed_mps": "fast"}, "speed_mps must be a number, not 'fast'"),
        ({"speed_mps": True}, "speed_mps must be a number, not True"),
        ({"count": 1.5}, "count must be a whole number, not 1.5"),
        ({"mood": "so so"}, "mood must be one of good, bad, not 'so so'"),
        ({"switch": "maybe"}, "switch must be one of on, off, not 'maybe'"),
        ({"pair": [1]}, "pair must be a list of a number and a number, not"),
        ({"inner": {"gian": 1}}, "unknown parameter inner.gian; known are gain"),
        ({"inner": 1}, "inner must be a table, not 1"),
    ],
)
def test_what_is_wrong_is_named(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        build(Outer, {"speed_mps": 1.0} | change)


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ValueError, match="parameter speed_mps is missing"):
        build(Outer, {})
