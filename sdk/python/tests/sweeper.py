#!/usr/bin/env python3
"""A robot that sweeps the dust below it, goes to the most dust that it senses, and leaves a trail. `sweeper` is the same in Rust."""

from __future__ import annotations

import sys

import cars
from cars import Action, Cars, LayerAction, Robot


class Sweeper(Robot):
    """Sweeps dust."""

    def init(self, cars: Cars) -> None:
        self.swept = 0.0
        self.refused = ""

    def tick(self, cars: Cars) -> Action:
        for result in cars.layer_results:
            if result.refused is not None:
                self.refused = result.refused
            elif result.layer == "dust":
                self.swept -= result.change

        here = cars.location
        goal, most = here, 0.0
        dust, trail = cars.layer("dust"), cars.layer("trail")
        for cell in dust.cells() if dust else ():
            if cell.value > most:
                goal, most = cell.center, cell.value
        at_here = trail.value_at(here) if trail else None
        action = Action.go(cars, goal, 0.4)
        action.state_variables = {"refused": self.refused, "swept": self.swept, "trail": -1.0 if at_here is None else at_here}
        action.layer_actions = [
            LayerAction("dust", here, 0.3, add=-0.1),
            LayerAction("trail", here, set=1),
            LayerAction("mist", here, set=1),
        ]
        return action


if __name__ == "__main__":
    sys.exit(cars.main("A", lambda _: Sweeper()))
