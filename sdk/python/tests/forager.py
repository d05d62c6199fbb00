#!/usr/bin/env python3
"""A robot that takes from every site that it senses, and goes to the right as far as its first ray allows. `forager` is the same in
Rust."""

from __future__ import annotations

import sys

import cars
from cars import Action, Cars, Point, Robot, SiteAction


class Forager(Robot):
    """Takes from sites."""

    senses_ranges = True

    def init(self, cars: Cars) -> None:
        self.taken = 0
        self.refused = ""

    def tick(self, cars: Cars) -> Action:
        for result in cars.site_results:
            if result.refused is None:
                self.taken += 1
            else:
                self.refused = result.refused

        ahead_m = cars.ranges[0]
        step_m = 0.2 if ahead_m > 0.5 else 0.0
        action = Action.go(cars, Point(cars.location.x + step_m, cars.location.y), 0.4)
        action.state_variables = {"ahead_m": ahead_m, "refused": self.refused, "taken": self.taken}
        action.site_actions = [
            SiteAction(site.name, set={"last": cars.name}, add={"stock": -1}, only_if={"open": True}) for site in cars.sites
        ]
        return action


if __name__ == "__main__":
    sys.exit(cars.main("A", lambda _: Forager()))
