"""Robots in a run of processes: the ``main`` of a robot's program, and the same without a command line."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Optional, Union

from . import _arguments, _cars
from ._robot import Robot, checked


def main(default_name: str, make: Callable[[str], Robot], arguments: Optional[Sequence[str]] = None) -> int:
    """Runs a robot's program, and returns the exit status: 0 if the run ended as it should, 1 if not, 2 for wrong arguments.

    The arguments are those of robots in Rust: see ``--help``. SIGINT ends the process at once, as it ends these.

    :param default_name: the robot's name where the command line gives none.
    :param make: builds the robot for a name.
    :param arguments: instead of those of the command line.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    given = sys.argv[1:] if arguments is None else arguments
    return _cars.main(default_name, lambda name: checked(make(name)), [sys.argv[0], *given])


def _seconds(name: str, value: Optional[float]) -> Optional[float]:
    return None if value is None else _arguments.number(name, value, "a number of seconds")


def take_part(
    robots: Mapping[str, Robot],
    *,
    run: Optional[str] = None,
    connect: Optional[str] = None,
    patience_s: Optional[float] = None,
    gone_patience_s: Optional[float] = None,
    zenoh_config: Union[str, os.PathLike[str], None] = None,
) -> str:
    """Takes part in a run of processes with these robots, by name, until it ends; returns how it ended: ``finished``, ``stopped``
    or ``aborted``. What is left out is as the environment says, in the variables that a robot's ``--help`` names.

    :param run: name of the run.
    :param connect: where its simulator listens.
    :param patience_s: how long to try to reach it and to join.
    :param gone_patience_s: how long to wait for a simulator that is gone.
    :param zenoh_config: a configuration file of the middleware instead of the built-in settings.
    :raises HostError: it is refused, replaced, or there is no simulator of this run.
    """
    options = {
        "--run": _arguments.text("run", run),
        "--connect": _arguments.text("connect", connect),
        "--patience-s": _seconds("patience_s", patience_s),
        "--gone-patience-s": _seconds("gone_patience_s", gone_patience_s),
        "--zenoh-config": None if zenoh_config is None else _arguments.path("zenoh_config", zenoh_config),
    }
    arguments = ["cars"]
    for option, value in options.items():
        if value is not None:
            arguments.append(f"{option}={value}")
    given = _arguments.mapping("robots", robots, "a mapping from names to robots")
    seated = [(name, checked(robot, f"robots[{name!r}] must be")) for name, robot in given.items()]
    return _cars.take_part(seated, arguments)
