"""From ``cmd_vel`` to what a robot proposes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .._cars import published_angle
from .._data import Point
from ._load import RosError

if TYPE_CHECKING:
    from .._cars import Cars

DIGITS = 12
"""Sines and cosines are rounded to so many digits: libraries of other machines differ in the sixteenth."""


@dataclass(frozen=True)
class Twist:
    """A velocity in the robot's frame: m/s forward and to the left, rad/s counter-clockwise."""

    forward_mps: float = 0.0
    left_mps: float = 0.0
    turn_radps: float = 0.0


def read_twist(name: str, message: object) -> Twist:
    """The velocity of a Twist or a TwistStamped.

    :raises RosError: if it is not finite.
    """
    twist = getattr(message, "twist", message)
    read = Twist(twist.linear.x, twist.linear.y, twist.angular.z)  # type: ignore[attr-defined]
    numbers = (read.forward_mps, read.left_mps, read.turn_radps)
    if not all(map(math.isfinite, numbers)):
        raise RosError(f"{name}: its node published a cmd_vel with a velocity that is not finite: {numbers}")
    return read


def rotated(angle_rad: float) -> tuple[float, float]:
    """Cosine and sine, the same on every machine."""
    return round(math.cos(angle_rad), DIGITS), round(math.sin(angle_rad), DIGITS)


def moved(cars: Cars, heading_rad: float, twist: Twist) -> tuple[Point, float]:
    """Where a robot without wheels wants to be in a tick, and its heading then. The way is straight, in its direction of now."""
    cos, sin = rotated(heading_rad)
    x_mps = cos * twist.forward_mps - sin * twist.left_mps
    y_mps = sin * twist.forward_mps + cos * twist.left_mps
    # No step is longer than the field: a velocity that is out of all reason must not leave the range of numbers.
    farthest_mps = sum(cars.welcome.field_m) / cars.tick_s
    largest_mps = max(abs(x_mps), abs(y_mps))
    scale = farthest_mps / largest_mps if largest_mps > farthest_mps else 1.0
    here = cars.location
    there = Point(here.x + x_mps * scale * cars.tick_s, here.y + y_mps * scale * cars.tick_s)
    # Less than a turn, before it is added: of a huge angle nothing would be left but its rounding.
    turned_rad = math.fmod(twist.turn_radps * cars.tick_s, math.tau)
    return there, published_angle(math.remainder(heading_rad + turned_rad, math.tau))
