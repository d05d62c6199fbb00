"""What a robot implements: one method from what it perceives to what it does, or the interface of the paper's Figure 7."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ._data import LayerAction, Point, SiteAction, StateVariables, Velocity
from .panel import Panel

if TYPE_CHECKING:
    from ._cars import Cars


@dataclass
class Action:
    """What a robot does in a tick, and what it publishes: others receive it when they query the robot during the next tick."""

    proposal: Point
    """Where it wants to stand at the next tick, meters. It stays where it is if the way is not free: ``cars.was_blocked``."""
    speed_mps: float = 0.0
    """Magnitude of its velocity, m/s."""
    direction_rad: float = 0.0
    """Direction of motion, radians counter-clockwise from +x."""
    emotion_state: str = ""
    """Name of its emotion."""
    behavior_state: str = ""
    """Name of its behavior."""
    state_variables: StateVariables = field(default_factory=dict)
    """Further variables that it publishes: numbers, flags and texts by name."""
    site_actions: Sequence[SiteAction] = ()
    """What it does to sites, in this order; what became of it is in ``cars.site_results`` in the next tick."""
    layer_actions: Sequence[LayerAction] = ()
    """What it does to layers, in this order; what became of it is in ``cars.layer_results`` in the next tick."""
    velocity: Velocity | None = None
    """The velocity that it wants, if the scenario has it drive like wheels: it counts in the place of the proposal."""

    @classmethod
    def stay(cls, cars: Cars, **published: Any) -> Action:
        """Stay here, and publish these fields."""
        return cls(cars.location, **published)

    @classmethod
    def go(cls, cars: Cars, goal: Point, speed_mps: float, **published: Any) -> Action:
        """Go straight toward ``goal`` and stop there, and publish these fields. The published speed is ``speed_mps`` also in the
        last step, which may be shorter; at the goal it is 0."""
        proposal, speed_mps, direction_rad = cars._go(goal, speed_mps)
        return cls(proposal, speed_mps, direction_rad, **published)

    @classmethod
    def drive(cls, cars: Cars, linear_mps: float, angular_radps: float, **published: Any) -> Action:
        """Drive forward (backward if ``linear_mps`` is negative) and turn counter-clockwise, and publish these fields. For robots
        that the scenario gives a ``drive``, which have a ``cars.pose``: the simulator applies the robot's limits, and moves it.
        The published speed is the one that is wanted."""
        speed_mps, direction_rad = cars._drive(linear_mps)
        velocity = Velocity(linear_mps, angular_radps)
        return cls(cars.location, speed_mps, direction_rad, velocity=velocity, **published)


class Robot(ABC):
    """A robot.

    ``init`` is called, then ``tick`` once for every tick of the run, beginning with tick 0. Everything a robot perceives is in
    ``cars``; everything it does is in the :class:`Action` that it returns and in the commands it sent on the way. Its state
    between ticks is its own.

    The same seed gives the same run only if a robot uses no clock, no chance and no iteration over sets of its own:
    ``cars.time_s`` and ``cars.random`` are there for that. An exception that a robot does not catch ends its run; only
    :class:`cars.Interrupted` may be let through.
    """

    senses_bodies = False
    """Whether the robot uses ``cars.bodies``: its news are larger then."""

    senses_ranges = False
    """Whether the robot uses ``cars.ranges``: its news are larger then."""

    is_quick = False
    """Whether every call takes some milliseconds at most. Then it may run on the thread on which messages arrive, which gives more
    ticks per second; a call that holds it for more than a second may have the robot taken for lost."""

    def init(self, cars: Cars) -> None:  # noqa: B027
        """Back to the initial state: before tick 0, at every start of a new epoch, and where it takes part again.

        :raises BadParameters: if the scenario's parameters make no sense to it.
        """

    @abstractmethod
    def tick(self, cars: Cars) -> Action:
        """Runs one tick. At tick 0 it stands at its start, no command has arrived, and others cannot be queried yet."""

    def resume(self, cars: Cars, last: StateVariables) -> None:  # noqa: B027
        """Its previous incarnation was lost in this epoch and had reported these variables last.

        Called after :meth:`init`; a robot that does not care starts afresh.
        """

    def reseed(self, cars: Cars) -> None:  # noqa: B027
        """The run is re-seeded: ``cars.random`` is another stream from this tick on.

        Called before :meth:`tick`. Only a robot that keeps generators of its own, made from ``cars.random``, has to make them anew.
        """

    def panel(self) -> Panel:
        """What the console shows of it (the paper's ``paintComponent``)."""
        return Panel()


class CarsRobotInterface(Robot):
    """The paper's ``CARSRobotInterface``: the fourteen methods of its Figure 7, with a generator each for emotion and behavior.

    In each tick the methods are called in the order of the paper's Figure 5: where it stands now, the commands that arrived, its
    variables, its emotion, its behavior, where it wants to be next. What the getters return after that is what the others
    learn during the next tick.
    """

    _name = ""

    @abstractmethod
    def init_robot(self, cars: Cars) -> None:
        """Back to the initial state (``initRobot``): see :meth:`Robot.init`."""

    def name(self) -> str:
        """Its name, by which the scenario and the other robots call it (``getName``); nothing before the first :meth:`init`."""
        return self._name

    @abstractmethod
    def set_current_location(self, cars: Cars, location: Point) -> None:
        """Where it really stands now, meters (``setCurrentLocation``)."""

    @abstractmethod
    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        """A command arrived (``setCommand``), in the order of senders and of their numbers."""

    @abstractmethod
    def update_state_variables(self, cars: Cars) -> None:
        """Updates the variables that measure its progress (``updateStateVariables``)."""

    @abstractmethod
    def update_emotion_state(self, cars: Cars) -> None:
        """The emotion state generator: progress in, emotion out (``updateEmotionState``)."""

    @abstractmethod
    def update_behavior_state(self, cars: Cars) -> None:
        """The behavior state generator: progress and emotion in, behavior out (``updateBehaviorState``)."""

    @abstractmethod
    def project_location(self, cars: Cars) -> Point:
        """Where it wants to stand at the next tick, meters (``projectLocation``)."""

    @abstractmethod
    def current_location(self) -> Point:
        """Where it stands, meters (``getCurrentLocation``)."""

    @abstractmethod
    def speed(self) -> float:
        """Magnitude of the velocity, m/s (``getSpeed``)."""

    @abstractmethod
    def direction(self) -> float:
        """Direction of motion, radians counter-clockwise from +x (``getDirection``)."""

    @abstractmethod
    def state_variables(self) -> StateVariables:
        """The variables that others may learn (``getStateVariables``)."""

    @abstractmethod
    def emotion_state(self) -> str:
        """Its emotion (``getEmotionState``)."""

    @abstractmethod
    def behavior_state(self) -> str:
        """Its behavior (``getBehaviorState``)."""

    def init(self, cars: Cars) -> None:
        """Calls :meth:`init_robot`."""
        self._name = cars.name
        self.init_robot(cars)

    def tick(self, cars: Cars) -> Action:
        """Calls the methods in the order of Figure 5; at tick 0, where there is nothing to update yet, only those that do not
        update."""
        self.set_current_location(cars, cars.location)
        for sender, text in cars.commands:
            self.set_command(cars, sender, text)
        if cars.tick > 0:
            self.update_state_variables(cars)
            self.update_emotion_state(cars)
            self.update_behavior_state(cars)
        proposal = self.project_location(cars)
        if self.name() != cars.name:
            raise ValueError(f"{cars.name} calls itself {self.name()!r}")
        return Action(
            proposal,
            self.speed(),
            self.direction(),
            self.emotion_state(),
            self.behavior_state(),
            self.state_variables(),
        )


def checked(robot: object, what: str = "a robot is") -> Robot:
    """A robot, if it is one. ``what`` begins the sentence of the error."""
    if isinstance(robot, Robot):
        return robot
    raise TypeError(f"{what} an object of a class derived from cars.Robot, not {robot!r}")


def maker(of: str, make: Callable[[], Robot]) -> Callable[[], Robot]:
    """What makes the robots called ``of``, and checks that it does."""
    return lambda: checked(make(), f"robots[{of!r}] must make")
