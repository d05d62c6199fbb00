"""The common robot interface: Figure 7 of the CARS paper as a class."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from .messages import Point, StateVariables
from .panel import Panel

if TYPE_CHECKING:
    from .cars import Cars


class Robot(ABC):
    """A robot as the simulation and the other robots see it (``CARSRobotInterface``; ``getName`` is :attr:`Cars.name`).

    In each tick the methods are called in the order of the paper's Figure 5: where it stands now, the commands that
    arrived, its variables, its emotion, its behavior, where it wants to be next. What the getters return after that is
    what the others learn during the next tick.

    The same seed gives the same run only if a robot uses no clock, no chance and no iteration over sets of its own:
    :attr:`Cars.time_s` and :attr:`Cars.random` are there for that. An exception that a robot does not catch ends its
    process; only :class:`Interrupted` may be let through.
    """

    senses_bodies = True
    """Whether :meth:`Cars.percept` is used; a robot that does without it costs less."""

    @abstractmethod
    def init_robot(self, cars: Cars) -> None:
        """Back to the initial state, before tick 0, after every ``init``, and where it takes part again (``initRobot``).

        :raises BadParameters: if the scenario's parameters make no sense to it.
        """

    @abstractmethod
    def speed(self) -> float:
        """Magnitude of the current velocity, m/s (``getSpeed``)."""

    @abstractmethod
    def direction(self) -> float:
        """Direction of motion, radians counter-clockwise from +x (``getDirection``)."""

    @abstractmethod
    def update_state_variables(self, cars: Cars) -> None:
        """Updates the variables that measure its progress (``updateStateVariables``)."""

    @abstractmethod
    def state_variables(self) -> StateVariables:
        """The variables that others may learn (``getStateVariables``): numbers, flags and texts by name."""

    @abstractmethod
    def current_location(self) -> Point:
        """Where it stands, meters (``getCurrentLocation``)."""

    @abstractmethod
    def project_location(self, cars: Cars) -> Point:
        """Where it wants to stand at the next tick, meters (``projectLocation``).

        It stays where it is if the way is not free; what to do about that is its own affair
        (:attr:`Cars.was_blocked` tells).
        """

    @abstractmethod
    def set_current_location(self, cars: Cars, location: Point) -> None:
        """Where it really stands now, meters (``setCurrentLocation``)."""

    @abstractmethod
    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        """A command arrived (``setCommand``), in the order of senders and of their numbers."""

    @abstractmethod
    def update_emotion_state(self, cars: Cars) -> None:
        """The emotion state generator: progress in, emotion out (``updateEmotionState``)."""

    @abstractmethod
    def emotion_state(self) -> str:
        """Its emotion (``getEmotionState``)."""

    @abstractmethod
    def update_behavior_state(self, cars: Cars) -> None:
        """The behavior state generator: progress and emotion in, behavior out (``updateBehaviorState``)."""

    @abstractmethod
    def behavior_state(self) -> str:
        """Its behavior (``getBehaviorState``)."""

    def panel(self) -> Panel:
        """What it chooses to display (the paper's ``paintComponent``)."""
        return Panel()

    def resume(self, cars: Cars, last: StateVariables) -> None:  # noqa: B027
        """Its previous incarnation was lost in this epoch and had reported these variables last.

        Called after :meth:`init_robot`; a robot that does not care starts afresh.
        """
