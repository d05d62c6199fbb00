#!/usr/bin/env python3
"""Covers a field with others: ``crates/robots/src/scout.rs`` in Python, the same to the last bit."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from cars import Action, Cars, Point, Robot, main

ATTRACTS_FROM, ATTRACTION, MIN_FORCE, MIN_DISTANCE_M = 0.6, 2.0, 0.05, 1e-6


@dataclass
class Parameters:
    speed: float = 0.5
    covers: float = 2.5
    radio: float = 5.0
    keeps: int = 0
    period: float = 1.0
    forgets_after: float = 2.5


class Scout(Robot):
    is_quick = True

    def init(self, cars: Cars) -> None:
        self.parameters = cars.parameters(Parameters)
        self.heard: dict[str, tuple[float, Point]] = {}
        self.sends_s = 0.0

    def tick(self, cars: Cars) -> Action:
        self.receive(cars)
        self.send(cars)
        here = cars.location
        places = [self.heard[name][1] for name in sorted(self.heard)]
        force = self.force(here, sorted(places, key=here.distance_m), cars.welcome.field_m)
        strength = min(force.distance_m(Point(0.0, 0.0)), 1.0)
        if strength < MIN_FORCE:
            action = Action.stay(cars, behavior_state="REST")
        else:
            goal = Point(here.x + force.x, here.y + force.y)
            action = Action.go(cars, goal, self.parameters.speed * strength, behavior_state="SPREAD")
        action.state_variables = {"neighbors": len(places)}
        return action

    def receive(self, cars: Cars) -> None:
        for command in cars.commands:
            if command.text == "place":
                self.heard[command.sender] = cars.time_s, Point(**command.payload)
        oldest_s = cars.time_s - self.parameters.forgets_after
        self.heard = {name: heard for name, heard in self.heard.items() if heard[0] >= oldest_s}

    def send(self, cars: Cars) -> None:
        if cars.time_s >= self.sends_s:
            self.sends_s = cars.time_s + self.parameters.period
            cars.broadcast("place", cars.location._asdict())

    def force(self, here: Point, neighbors: list[Point], field_m: tuple[float, float]) -> Point:
        """The force on the robot, of which 1 stands for its highest speed. The nearest neighbor comes first."""
        own = self.parameters
        pushes = []
        apart_m, attracts_from_m = 2.0 * own.covers, ATTRACTS_FROM * own.radio
        for rank, neighbor in enumerate(neighbors):
            distance_m = max(here.distance_m(neighbor), MIN_DISTANCE_M)
            x, y = (here.x - neighbor.x) / distance_m, (here.y - neighbor.y) / distance_m
            if distance_m < apart_m:
                pushes.append((x, y, (apart_m - distance_m) / apart_m))
            if rank < own.keeps and distance_m > attracts_from_m:
                excess = (distance_m - attracts_from_m) / (own.radio - attracts_from_m)
                pushes.append((x, y, -ATTRACTION * excess))

        # An edge pushes like a neighbor on its other side.
        width_m, height_m = field_m
        edges = (here.x, 1.0, 0.0), (width_m - here.x, -1.0, 0.0), (here.y, 0.0, 1.0), (height_m - here.y, 0.0, -1.0)
        for distance_m, x, y in edges:
            if distance_m < own.covers:
                pushes.append((x, y, (own.covers - distance_m) / own.covers))

        force = Point(0.0, 0.0)
        for x, y, strength in pushes:
            force = Point(force.x + x * strength, force.y + y * strength)
        return force


if __name__ == "__main__":
    sys.exit(main("Scout", lambda name: Scout()))
