"""Checks of arguments: what is wrong is said with the argument's name and with what it may be."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Optional

from ._errors import BadArgument

MAX_SEED = 2**53 - 1
"""Largest seed: JSON holds larger numbers in some languages only."""


def wrong_type(name: str, accepted: str, value: Any) -> TypeError:
    """The error of an argument of a type that is not accepted."""
    return TypeError(f"{name} must be {accepted}, not {value!r}")


def path(name: str, value: Any) -> Path:
    """A path, or the name of a file."""
    if isinstance(value, (str, os.PathLike)):
        return Path(value)
    raise wrong_type(name, "a path or a name (str or os.PathLike)", value)


def text(name: str, value: Any) -> Optional[str]:
    """A text, or None."""
    if value is None or isinstance(value, str):
        return value
    raise wrong_type(name, "a text", value)


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if isinstance(value, bool):
        return value
    raise wrong_type(name, "True or False", value)


def whole(name: str, value: Any, least: int, most: int) -> int:
    """A whole number within bounds, also of NumPy."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise wrong_type(name, f"a whole number from {least} to {most}", value)
    number = operator.index(value)
    if not least <= number <= most:
        raise BadArgument(f"{name} must be a whole number from {least} to {most}, not {number}")
    return number


def number(name: str, value: Any, accepted: str) -> float:
    """A finite number, also of NumPy."""
    if isinstance(value, (bool, str)) or not hasattr(value, "__float__"):
        raise wrong_type(name, accepted, value)
    found = float(value)
    if not math.isfinite(found):
        raise BadArgument(f"{name} must be {accepted}, not {found}")
    return found


def time(name: str, value: Any) -> Optional[str]:
    """A time as a text with its unit: seconds, or such a text."""
    if value is None or isinstance(value, str):
        return value
    seconds = number(name, value, "seconds, or a text with a unit such as '600 s'")
    return f"{seconds!r} s"


def speed(name: str, value: Any) -> Optional[str]:
    """A speed as a text: simulated seconds per second, or such a text."""
    if value is None or isinstance(value, str):
        return value
    return repr(number(name, value, "simulated seconds per second, or a text such as 'max'"))


def mapping(name: str, value: Any, accepted: str) -> Mapping[Any, Any]:
    """A mapping whose keys are texts; None is an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise wrong_type(name, accepted, value)
    for key in value:
        if not isinstance(key, str):
            raise TypeError(f"{name} must be {accepted}: its keys are texts, not {key!r}")
    return value


def makers(name: str, value: Any) -> dict[str, Callable[[], Any]]:
    """What makes robots, by their names."""
    accepted = "a mapping from names or patterns of robots to classes derived from cars.Robot, or to functions that make one"
    given = dict(mapping(name, value, accepted))
    for robot, make in given.items():
        if not callable(make):
            raise wrong_type(f"{name}[{robot!r}]", "a class derived from cars.Robot, or a function that makes one", make)
    return given


def processes(
    value: Any, robots: Mapping[str, Any], fresh: Any, tick_patience: Any
) -> Optional[tuple[Optional[Path], bool, Optional[float]]]:
    """How robots are played as processes: by a launch file, whether each run gets fresh ones, and how long a tick may take."""
    if value is None or value is False:
        return None
    if robots:
        raise BadArgument("robots are classes of this process: without processes, or without robots and with a launch file")
    file = None if value is True else path("processes", value)
    patience_s = None if tick_patience is None else number("tick_patience", tick_patience, "a number of seconds")
    return file, flag("fresh_processes", fresh), patience_s


def seeds(name: str, value: Any) -> Optional[list[int]]:
    """Seeds, or how many from 1 on."""
    if value is None:
        return None
    if hasattr(value, "__index__"):
        return list(range(1, whole(name, value, 2, 100_000) + 1))
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
        raise wrong_type(name, "a number of seeds, or the seeds", value)
    return [whole(f"{name}[{index}]", seed, 0, MAX_SEED) for index, seed in enumerate(value)]
