#!/usr/bin/env python3
"""@NAME@ strolls back and forth. When it has been blocked for too long, it becomes frustrated and turns around.

In every tick the methods of the robot are called in this order: ``set_current_location``,
``set_command`` for each command, ``update_state_variables``, ``update_emotion_state``,
``update_behavior_state``, ``project_location``; then other robots can query what the getters return.
"""

import math
import sys
from dataclasses import dataclass

from cars import Cars, CarsRobotInterface, Panel, Point, StateVariables, main
from cars.panel import Button


@dataclass
class Parameters:
    """``[robot.params]`` of the scenario, in SI units. An unknown name is an error."""

    walk_m: float
    speed_mps: float
    patience_s: float


class Stroller(CarsRobotInterface):
    def init_robot(self, cars: Cars) -> None:
        """Before tick 0, and whenever the run starts again: back to the initial state."""
        self.parameters = cars.parameters(Parameters)
        self.at = cars.welcome.location
        # The ends of its stroll, meters from the left edge; it is on its way to the second.
        self.ends_x = [self.at.x, self.at.x + self.parameters.walk_m]
        # Its measure of progress: how long it has been blocked, seconds.
        self.held_up_s = 0.0
        self.turns = 0
        self.was_frustrated = False
        self.is_frustrated = False
        self.is_resting = False

    def turn(self) -> None:
        self.ends_x.reverse()
        self.turns += 1

    def set_current_location(self, cars: Cars, location: Point) -> None:
        """Where it stands now: the place it proposed, or its old one if that was taken."""
        self.at = location

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        if command not in ("rest", "stroll"):
            cars.log(f"does not know how to {command}")
            return
        self.is_resting = command == "rest"
        cars.log(f"obeys {sender}: {command}")

    def update_state_variables(self, cars: Cars) -> None:
        """Its progress. To look around: ``cars.bodies``, with ``senses_bodies = True`` in the class; to query another
        robot: ``cars.get_robot_state("Butler")``."""
        if cars.was_blocked:
            self.held_up_s += cars.tick_s
        else:
            self.held_up_s = max(self.held_up_s - cars.tick_s / 2, 0.0)

    def update_emotion_state(self, cars: Cars) -> None:
        """The emotion state generator: progress in, emotion out."""
        self.was_frustrated = self.is_frustrated
        if self.was_frustrated:
            self.is_frustrated = self.held_up_s > 0
        else:
            self.is_frustrated = self.held_up_s >= self.parameters.patience_s

    def update_behavior_state(self, cars: Cars) -> None:
        """The behavior state generator: emotion in, behavior out."""
        if self.is_frustrated and not self.was_frustrated:
            self.turn()
        if self.at.x == self.ends_x[1]:
            self.turn()

    def project_location(self, cars: Cars) -> Point:
        """Where it wants to stand at the next tick."""
        if self.is_resting:
            return self.at
        step, left = self.speed() * cars.tick_s, self.ends_x[1] - self.at.x
        x = self.ends_x[1] if abs(left) <= step else self.at.x + math.copysign(step, left)
        return Point(x, self.at.y)

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return 0.0 if self.is_resting else self.parameters.speed_mps

    def direction(self) -> float:
        return math.pi if self.ends_x[1] < self.at.x else 0.0

    def state_variables(self) -> StateVariables:
        return {"held_up_s": self.held_up_s, "turns": self.turns}

    def emotion_state(self) -> str:
        return "FRUSTRATED" if self.is_frustrated else "HAPPY"

    def behavior_state(self) -> str:
        return "REST" if self.is_resting else "STROLL"

    def panel(self) -> Panel:
        """Its panel in the console: two buttons that send it commands."""
        return Panel([Button("Rest", "rest"), Button("Stroll", "stroll")])


if __name__ == "__main__":
    sys.exit(main("@NAME@", lambda name: Stroller()))
