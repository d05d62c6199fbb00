#!/usr/bin/env python3
"""A robot that drives in curves, and turns away from what blocks it. `rover` is the same in Rust, and `rover_lines.py` over standard
input and output."""

from __future__ import annotations

import sys

import cars
from cars import Action, Cars, Robot


class Rover(Robot):
    """Drives in curves."""

    def init(self, cars: Cars) -> None:
        self.backward = 0

    def tick(self, cars: Cars) -> Action:
        if cars.was_blocked:
            self.backward = 3

        if self.backward > 0:
            self.backward -= 1
            action = Action.drive(cars, -0.5, 0.7)
        elif cars.tick % 20 < 12:
            action = Action.drive(cars, 0.9, 0.4)
        else:
            action = Action.drive(cars, 0.6, -1.1)
        if cars.pose is not None:
            action.state_variables = {"heading_rad": cars.pose.heading_rad, **cars.pose.velocity._asdict()}
        return action


if __name__ == "__main__":
    sys.exit(cars.main("A", lambda _: Rover()))
