"""CARS, the Cooperative Affective Robot Simulator, for Python: runs, experiments, and robots.

>>> run = cars.run("hors_doeuvres", seed=7)
>>> run.states.groupby("robot").emotion.value_counts()

A robot is a class derived from :class:`Robot`, for a run in this process (``cars.run(scenario, robots={"Walker": Walker})``) or,
by :func:`main`, as a program of its own.
"""

from typing import Any

from . import panel
from ._cars import Cars, Stream, __version__, published_angle, stream
from ._data import (
    Command,
    DriveLimits,
    KnownSite,
    LayerAction,
    LayerCell,
    LayerResult,
    Point,
    Pose,
    PublicState,
    Rays,
    SensedBody,
    SensedLayer,
    SensedRobot,
    SensedSite,
    SiteAction,
    SiteResult,
    StateVariables,
    Variable,
    Velocity,
    Welcome,
)
from ._entry import main, take_part
from ._errors import (
    BadArgument,
    BadParameters,
    CallError,
    Error,
    FileError,
    HostError,
    Interrupted,
    RecordError,
    RefusedError,
    RobotError,
    TooEarly,
    UnknownRobot,
    Unreachable,
)
from ._experiment import Experiment, Verdict, experiment
from ._frames import Frames
from ._hunt import Finding, Hunt, hunt
from ._pictures import Page, Picture
from ._robot import Action, CarsRobotInterface, Robot
from ._run import Run, fork, load, run, why
from ._why import Why, WhyFrames
from .panel import Panel

__all__ = [
    "Action",
    "BadArgument",
    "BadParameters",
    "CallError",
    "Cars",
    "CarsRobotInterface",
    "Command",
    "DriveLimits",
    "Error",
    "Experiment",
    "FileError",
    "Finding",
    "Frames",
    "HostError",
    "Hunt",
    "Interrupted",
    "KnownSite",
    "LayerAction",
    "LayerCell",
    "LayerResult",
    "Page",
    "Panel",
    "Picture",
    "Point",
    "Pose",
    "PublicState",
    "Rays",
    "RecordError",
    "RefusedError",
    "Robot",
    "RobotError",
    "Run",
    "SensedBody",
    "SensedLayer",
    "SensedRobot",
    "SensedSite",
    "SiteAction",
    "SiteResult",
    "StateVariables",
    "Stream",
    "TooEarly",
    "UnknownRobot",
    "Unreachable",
    "Variable",
    "Velocity",
    "Verdict",
    "Welcome",
    "Why",
    "WhyFrames",
    "__version__",
    "experiment",
    "fork",
    "hunt",
    "load",
    "main",
    "panel",
    "published_angle",
    "run",
    "stream",
    "take_part",
    "why",
]

_OF_RL = ("parallel_env", "gym_env", "vector_env")


def __getattr__(name: str) -> Any:
    """Environments: what they need is loaded when they are used."""
    if name in _OF_RL:
        from . import rl  # noqa: PLC0415

        return getattr(rl, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
