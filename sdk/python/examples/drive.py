"""How a robot moves: a random walk, straight drives around whoever stands in the way, standing still.

What reaches the wire is made by + - * / and the square root alone, which are the same on every machine and in every
language; a heading is a unit vector and never an angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chance import Chance

from cars import Cars, Point, SensedBody

Heading = tuple[float, float]

# Cosine and sine of the headings tried around the straight one, 20 to 120 degrees.
OFFSETS = (
    (0.9396926207859084, 0.3420201433256687),
    (0.766044443118978, 0.6427876096865393),
    (0.5, 0.8660254037844386),
    (0.17364817766693041, 0.984807753012208),
    (-0.17364817766693041, 0.984807753012208),
    (-0.5, 0.8660254037844386),
)
SHARES = (1.0, 0.5)
"""Shares of a step that are tried, the longest first."""
TOUCH_M = 1e-9
"""How deep two bodies may overlap and still count as touching; as the collision rule has it."""
WALK_TRIES = 8
"""New headings tried in a tick before a walker stays where it is."""


@dataclass(frozen=True, slots=True)
class Course:
    """A straight drive."""

    goal: Point
    stop_m: float
    """How near is near enough."""
    speed_mps: float
    look_s: float
    """For how long to look around before each step after one was refused."""


class Legs:
    """Where a robot is heading, and how it got past the last obstacle."""

    def __init__(self) -> None:
        self._heading: Heading = (1.0, 0.0)
        self.speed_mps = 0.0
        """Magnitude of the motion that was decided last."""
        self._side = 1.0  # The side on which it last found a way: 1 for left, -1 for right.
        self._careful_s = 0.0  # For how long it goes on looking around before each step.
        self._turn_s = 0.0  # When the walk turns next.

    @property
    def direction_rad(self) -> float:
        """Its direction, radians."""
        return math.atan2(self._heading[1], self._heading[0])

    def stay(self, at: Point) -> Point:
        """Stands still."""
        self.speed_mps = 0.0
        return at

    def walk(self, cars: Cars, at: Point, speed_mps: float, turn_mean_s: float, chance: Chance) -> Point:
        """A step of a random walk: straight on, with a new heading when its time has come, when the last step was
        refused, or where the field ends."""
        self._turn_s -= cars.tick_s
        turns = self._turn_s <= 0.0 or cars.was_blocked
        for _ in range(WALK_TRIES):
            if turns:
                self._heading = chance.direction()
                self._turn_s = chance.around(turn_mean_s)
            there = stepped(at, self._heading, speed_mps * cars.tick_s)
            if is_on_field(cars, there):
                self.speed_mps = speed_mps
                return there
            turns = True
        return self.stay(at)

    def drive(self, cars: Cars, at: Point, course: Course) -> Point:
        """A step of a straight drive; for a while after a refused step it looks around first and steps aside where
        somebody stands in the way."""
        if cars.was_blocked:
            self._careful_s = max(course.look_s, cars.tick_s)
        away_m = at.distance_m(course.goal)
        step_m = min(course.speed_mps * cars.tick_s, away_m - course.stop_m)
        if step_m <= 0.0:
            return self.stay(at)
        heading: Heading | None = ((course.goal.x - at.x) / away_m, (course.goal.y - at.y) / away_m)
        if self._careful_s > 0.0 and heading is not None:
            self._careful_s -= cars.tick_s
            heading, step_m = self._free_step(cars, at, heading, step_m)
        if heading is None:
            return self.stay(at)
        self._heading = heading
        self.speed_mps = step_m / cars.tick_s
        return stepped(at, heading, step_m)

    def _free_step(self, cars: Cars, at: Point, straight: Heading, step_m: float) -> tuple[Heading | None, float]:
        bodies = cars.bodies
        # A narrow gap may take a short step where a long one does not fit.
        for share in SHARES:
            heading = self._free_heading(cars, bodies, at, straight, step_m * share)
            if heading is not None:
                return heading, step_m * share
        return None, 0.0

    def _free_heading(
        self, cars: Cars, bodies: tuple[SensedBody, ...], at: Point, straight: Heading, step_m: float
    ) -> Heading | None:
        """The heading nearest to the straight one whose step is free, on the side that worked last before the other."""
        apart_m = cars.welcome.body_m - TOUCH_M

        def is_free(heading: Heading) -> bool:
            there = stepped(at, heading, step_m)
            return is_on_field(cars, there) and not any(
                abs(body.x - there.x) < apart_m and abs(body.y - there.y) < apart_m for _, body in bodies
            )

        if is_free(straight):
            return straight
        for cos, sin in OFFSETS:
            for side in (self._side, -self._side):
                heading = turned(straight, cos, side * sin)
                if is_free(heading):
                    self._side = side
                    return heading
        return None


def stepped(at: Point, heading: Heading, step_m: float) -> Point:
    """Where a step leads."""
    return Point(at.x + heading[0] * step_m, at.y + heading[1] * step_m)


def turned(heading: Heading, cos: float, sin: float) -> Heading:
    """A heading, turned by an angle of this cosine and sine."""
    x, y = heading
    return (x * cos - y * sin, x * sin + y * cos)


def is_on_field(cars: Cars, center: Point) -> bool:
    """Whether a body with this center lies inside the field."""
    margin_m = cars.welcome.body_m / 2.0 - TOUCH_M
    width_m, height_m = cars.welcome.field_m
    return margin_m <= center.x <= width_m - margin_m and margin_m <= center.y <= height_m - margin_m
