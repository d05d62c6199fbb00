"""The part of this process that belongs to one robot: its context of ROS, and the random numbers of its node."""

from __future__ import annotations

import os
import random
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Optional

from ._load import RosError

MAX_ROBOTS = 200
"""Most robots of ROS in a process at the same time: each has a DDS domain of its own, and domains are 0 to 232."""
ISOLATION = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_STATIC_PEERS": ""}
"""With these, a context finds nothing beyond its own process. Robots learn of each other through CARS only: otherwise what they
hear would depend on arrival order, and no link of the scenario could be cut."""

# Entered by one robot at a time: the default context and Python's random numbers belong to the process.
_ENTERED = threading.RLock()
_free_domains = list(range(MAX_ROBOTS, 0, -1))


class _Inside(threading.local):
    """What this thread is in."""

    world: Optional[RosWorld] = None
    """That of the robot whose node it executes."""


_inside = _Inside()


def world_inside() -> Optional[RosWorld]:
    """The world of the robot whose node this thread executes; ``None`` if it executes none."""
    return _inside.world


class RosWorld:
    """A context that hears nobody, and generators of random numbers that nobody else draws from."""

    def __init__(self, ros: Any, ros_args: Sequence[str], seed: int) -> None:
        self._ros = ros
        self._numbers: Any = None
        self.follow: Callable[[str, type], Callable[[], None]] = lambda topic, kind: lambda: None
        """Called with topic and type of each publisher before it is made; what it returns is called after that."""
        self.context = ros.context.Context()
        with _ENTERED:
            if not _free_domains:
                raise RosError(f"there are {MAX_ROBOTS} robots of ROS in this process: start further ones as processes")
            self._domain = _free_domains.pop()
            before = {name: os.environ.get(name) for name in ISOLATION}
            os.environ.update(ISOLATION)
            try:
                self.context.init(["--ros-args", *ros_args], domain_id=self._domain)
            except Exception:
                _free_domains.append(self._domain)
                raise
            finally:
                for name, value in before.items():
                    if value is None:
                        del os.environ[name]
                    else:
                        os.environ[name] = value
        self.seed(seed)

    def seed(self, seed: int) -> None:
        """Seeds ``random`` and, if it is loaded, ``numpy.random`` of the node."""
        with _ENTERED:
            outside = _numbers()
            random.seed(seed)
            if "numpy" in sys.modules:
                sys.modules["numpy"].random.seed(seed % 2**32)
            self._numbers = _numbers()
            _set_numbers(outside)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """While this is entered, the default context of rclpy and the random numbers are those of the robot."""
        utilities = self._ros.utilities
        with _ENTERED:
            context, outside = utilities.g_default_context, _numbers()
            before, _inside.world = _inside.world, self
            utilities.g_default_context = self.context
            _set_numbers(self._numbers)
            try:
                yield
            finally:
                self._numbers = _numbers()
                _set_numbers(outside)
                utilities.g_default_context, _inside.world = context, before

    def close(self) -> None:
        """Ends the context; what was made in it is gone."""
        with _ENTERED:
            self.context.try_shutdown()
            _free_domains.append(self._domain)


def _numbers() -> Any:
    numpy = sys.modules.get("numpy")
    return random.getstate(), None if numpy is None else numpy.random.get_state()


def _set_numbers(numbers: Any) -> None:
    own, of_numpy = numbers
    random.setstate(own)
    if of_numpy is not None:
        sys.modules["numpy"].random.set_state(of_numpy)
