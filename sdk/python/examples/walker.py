#!/usr/bin/env python3
"""Walks to and fro, counts its steps, and is annoyed when somebody is in its way."""

import sys

from cars import Cars, CarsRobotInterface, Point, StateVariables, main


class Walker(CarsRobotInterface):
    def init_robot(self, cars: Cars) -> None:
        self.at = cars.welcome.location
        self.way_mps = 0.5
        self.steps = 0
        self.is_annoyed = False

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.at = location

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        cars.log(f"does not know what {sender} means by {command!r}")

    def update_state_variables(self, cars: Cars) -> None:
        self.steps += not cars.was_blocked

    def update_emotion_state(self, cars: Cars) -> None:
        self.is_annoyed = cars.was_blocked

    def update_behavior_state(self, cars: Cars) -> None:
        if self.is_annoyed:
            self.way_mps = -self.way_mps

    def project_location(self, cars: Cars) -> Point:
        return Point(self.at.x + self.way_mps * cars.tick_s, self.at.y)

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return abs(self.way_mps)

    def direction(self) -> float:
        return 0.0 if self.way_mps > 0 else 3.141593

    def state_variables(self) -> StateVariables:
        return {"steps": self.steps}

    def emotion_state(self) -> str:
        return "ANNOYED" if self.is_annoyed else "CALM"

    def behavior_state(self) -> str:
        return "WALK"


if __name__ == "__main__":
    sys.exit(main("Walker", lambda name: Walker()))
