"""One robot's place in the lock-step: from the tick it is to run to a report. Synchronous and without a network."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .cars import Cars, StateOf
from .messages import (
    MAX_ENTRIES,
    MAX_TEXT_BYTES,
    News,
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
        """The same robot in a new epoch, or as a further incarnation."""
        self.welcome = welcome
        self._random = stream(welcome.seed, welcome.stream)
        self._proposal = welcome.location

    def panel(self) -> Panel:
        """What the robot chooses to display."""
        return self._robot.panel()

    def run(self, tick: int, news: News, is_first: bool, state_of: StateOf) -> Report:
        """One tick, in the order of the paper's Figure 5. The first one of an incarnation begins with ``init_robot``.

        :raises BadParameters: if the robot refuses its parameters.
        :raises Interrupted: the tick is of no use any more, and the robot let it through.
        """
        robot, welcome = self._robot, self.welcome
        cars = Cars(welcome, tick, news, self._random, robot.senses_bodies, state_of)

        if is_first:
            robot.init_robot(cars)
            if tick > 0 and welcome.last_state is not None:
                robot.resume(cars, welcome.last_state.state_variables)

        stands = self._proposal if news.correction is None else news.correction.location
        robot.set_current_location(cars, stands)
        for sender, command in news.commands:
            robot.set_command(cars, sender, command)
        if tick > 0:
            robot.update_state_variables(cars)
            robot.update_emotion_state(cars)
            robot.update_behavior_state(cars)
        return self._report(cars, stands)

    def _report(self, cars: Cars, stands: Point) -> Report:
        """The end of every tick: where to go next, and what others may learn."""
        robot, log = self._robot, cars._log
        location = _finite_point(robot.current_location(), stands)
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
        return Report(state, self.welcome.generation, self._proposal, cars._sent, log)


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
