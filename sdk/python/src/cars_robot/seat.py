"""One robot's place in the lock-step: from a clock to a report. Synchronous and without a network of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .cars import Cars, Network, Outbox
from .messages import (
    MAX_ENTRIES,
    MAX_TEXT_BYTES,
    NO_NEWS,
    Clock,
    Command,
    CommandId,
    Point,
    PublicState,
    Report,
    StateVariables,
    Variable,
    Welcome,
    shortened,
)
from .panel import Panel
from .robot import Robot
from .streams import stream


def published_angle(angle_rad: float) -> float:
    """An angle rounded to 1e-6 rad, so that languages whose arc tangents differ in the last bit publish the same."""
    scaled = angle_rad * 1e6 + 0.5
    if not math.isfinite(scaled):
        return scaled
    # Adding zero makes minus zero, which is another text, plain zero.
    return math.floor(scaled) / 1e6 + 0.0


class Seat:
    """A robot that takes part in an epoch."""

    def __init__(self, robot: Robot, welcome: Welcome) -> None:
        self._robot = robot
        self.start_over(welcome)

    def start_over(self, welcome: Welcome) -> None:
        """The same robot in a new epoch."""
        self.welcome = welcome
        self._random = stream(welcome.seed, welcome.stream)
        self._outbox = Outbox(welcome.last_seq)
        self._proposal = self._stands = welcome.location

    def panel(self) -> Panel:
        """What the robot chooses to display."""
        return self._robot.panel()

    def init(self, clock: Clock, network: Network) -> Report:
        """The first tick of the epoch: initialize, and propose where to go. Nobody has said anything yet.

        :raises BadParameters: if the robot refuses its parameters.
        """
        self._proposal = self._stands = self.welcome.location
        cars = self._enter(clock, network, [])
        self._robot.init_robot(cars)
        self._robot.set_current_location(cars, self.welcome.location)
        return self._leave(cars, [])

    def resume(self, clock: Clock, network: Network) -> Report:
        """The first tick of an incarnation that takes over in the middle of an epoch.

        :raises BadParameters: if the robot refuses its parameters.
        """
        log: list[str] = []
        cars = self._enter(clock, network, log)
        self._robot.init_robot(cars)
        if self.welcome.last_state is not None:
            self._robot.resume(cars, self.welcome.last_state.state_variables)
        report = self.tick(clock, network)
        report.log[:0] = log
        return report

    def tick(self, clock: Clock, network: Network) -> Report:
        """One tick, in the order of the paper's Figure 5.

        :raises Interrupted: the epoch is over, and the robot let it through.
        """
        robot = self._robot
        cars = self._enter(clock, network, [])
        correction = cars.news.correction
        self._stands = self._proposal if correction is None else correction.location
        robot.set_current_location(cars, self._stands)
        missing: list[CommandId] = []
        if cars.news.commands:
            self._obey(cars, clock.epoch, network, missing)
        robot.update_state_variables(cars)
        robot.update_emotion_state(cars)
        robot.update_behavior_state(cars)
        return self._leave(cars, missing)

    def abandon(self) -> None:
        """A tick was interrupted: what it has sent is nobody's business any more."""
        self._outbox.sent = []

    def _obey(self, cars: Cars, epoch: int, network: Network, missing: list[CommandId]) -> None:
        named: CommandId | None = None
        command: Command | None = None
        for one in cars.news.commands:
            # One that the medium has doubled is named twice in a row, and is here once.
            if command is None or one != named:
                named, command = one, network.receive(self.welcome.name, epoch, one)
            if command is None:
                missing.append(one)
            else:
                self._robot.set_command(cars, one.sender, command.command)

    def _enter(self, clock: Clock, network: Network, log: list[str]) -> Cars:
        """The simulation as the robot sees it in this tick."""
        news = clock.news.get(self.welcome.name, NO_NEWS)
        return Cars(self.welcome, clock.tick, news, self._random, self._outbox, log, network)

    def _leave(self, cars: Cars, missing: list[CommandId]) -> Report:
        """The end of every tick: where to go next, and what to tell."""
        robot, log = self._robot, cars._log
        location = _finite_point(robot.current_location(), self._stands)
        projected = robot.project_location(cars)
        # A number that is none cannot travel. The run goes on, and its log says whose fault it is.
        self._proposal = _finite_point(projected, location)
        if self._proposal != projected:
            log.append("error: the projected location is not a number; staying")
        state = PublicState(
            epoch=self.welcome.epoch,
            tick=cars.tick,
            location=location,
            speed_mps=_finite_or(robot.speed(), 0.0),
            direction_rad=_finite_or(published_angle(robot.direction()), 0.0),
            state_variables=_travelling(robot.state_variables(), log),
            emotion_state=shortened(robot.emotion_state(), MAX_TEXT_BYTES),
            behavior_state=shortened(robot.behavior_state(), MAX_TEXT_BYTES),
        )
        sent, self._outbox.sent = self._outbox.sent, []
        return Report(state, self.welcome.generation, self._proposal, sent, missing, log)


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        # An integer beyond what a floating-point number can hold.
        return False


def _finite_or(value: float, instead: float) -> float:
    return value if _is_finite(value) else instead


def _finite_point(point: Point, instead: Point) -> Point:
    x, y = point
    return Point(_finite_or(x, instead.x), _finite_or(y, instead.y))


def _travelling(variables: StateVariables, log: list[str]) -> Mapping[str, Variable]:
    """The variables that can travel, by name; what cannot is left out, and the log says so."""
    kept: dict[str, Variable] = {}
    for name, value in sorted(variables.items()):
        if len(kept) == MAX_ENTRIES:
            log.append(
                f"error: {len(variables)} state variables, more than {MAX_ENTRIES}; the last ones are left out"
            )
            break
        complaint = ""
        if isinstance(value, str):
            kept[shortened(name, MAX_TEXT_BYTES)] = shortened(value, MAX_TEXT_BYTES)
        elif not isinstance(value, (bool, int, float)):
            complaint = f"is no number, flag or text but a {type(value).__name__}"
        elif _is_finite(value):
            kept[shortened(name, MAX_TEXT_BYTES)] = value
        else:
            complaint = "is not a finite number"
        if complaint and len(log) < MAX_ENTRIES - 2:
            log.append(f"error: state variable {shortened(name, 100)} {complaint}; left out")
    return kept
