"""Robots in Python for CARS, the Cooperative Affective Robot Simulator.

A robot is a class with the methods of :class:`Robot`, and one line that hands it to :func:`main`. ``README.md`` goes from
nothing to a running robot; ``examples/walker.py`` is a whole one.
"""

from . import panel
from .bus import BusError
from .cars import CallError, Cars, Interrupted, TooEarly, UnknownRobot, Unreachable
from .entry import main, run
from .host import HostError, HostOptions
from .messages import (
    Malformed,
    Percept,
    Point,
    PublicState,
    SensedBody,
    SensedRobot,
    StateVariables,
    Variable,
    Welcome,
)
from .panel import Panel
from .parameters import BadParameters
from .robot import Robot
from .seat import published_angle
from .streams import Stream, stream
from .version import __version__

__all__ = [
    "BadParameters",
    "BusError",
    "CallError",
    "Cars",
    "HostError",
    "HostOptions",
    "Interrupted",
    "Malformed",
    "Panel",
    "Percept",
    "Point",
    "PublicState",
    "Robot",
    "SensedBody",
    "SensedRobot",
    "StateVariables",
    "Stream",
    "TooEarly",
    "UnknownRobot",
    "Unreachable",
    "Variable",
    "Welcome",
    "__version__",
    "main",
    "panel",
    "published_angle",
    "run",
    "stream",
]
