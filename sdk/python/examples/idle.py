#!/usr/bin/env python3
"""A robot that only answers: what the lock-step itself costs."""

import sys

from cars import Cars, CarsRobotInterface, Point, StateVariables, main


class Idle(CarsRobotInterface):
    """Stands where it stands."""

    def init_robot(self, cars: Cars) -> None:
        self.at = cars.welcome.location

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.at = location

    def set_command(self, cars: Cars, sender: str, command: str) -> None: ...

    def update_state_variables(self, cars: Cars) -> None: ...

    def update_emotion_state(self, cars: Cars) -> None: ...

    def update_behavior_state(self, cars: Cars) -> None: ...

    def project_location(self, cars: Cars) -> Point:
        return self.at

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return 0.0

    def direction(self) -> float:
        return 0.0

    def state_variables(self) -> StateVariables:
        return {}

    def emotion_state(self) -> str:
        return "CALM"

    def behavior_state(self) -> str:
        return "IDLE"


if __name__ == "__main__":
    sys.exit(main("Idle", lambda name: Idle()))
