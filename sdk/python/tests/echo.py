"""Echo, the robot of the transcripts in ``docs/vectors``; the page of the protocol says what it does."""

from __future__ import annotations

import math
import sys

from cars import CallError, Cars, CarsRobotInterface, Interrupted, Point, StateVariables, UnknownRobot, Variable, main


class Echo(CarsRobotInterface):
    """Sends back what it hears, and looks around now and then."""

    senses_bodies = True

    def init_robot(self, cars: Cars) -> None:
        self.tick_s = cars.tick_s
        self.heard = 0
        self.last = ""
        self.seen: dict[str, Variable] = {}

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.at = location
        if cars.was_blocked:
            cars.log("blocked")

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        self.heard += 1
        self.last = command
        try:
            # A command has at most 4096 bytes, and what it heard may have as many.
            cars.set_robot_command(sender, f"echo {command}".encode()[:4096].decode(errors="ignore"))
        except UnknownRobot:
            cars.log(f"no echo for {sender}")

    def update_state_variables(self, cars: Cars) -> None:
        if cars.tick % 4:
            return
        self.seen["near"] = len(cars.bodies)
        for other in cars.welcome.roster:
            if other != cars.name:
                self.seen[f"saw_{other}"] = self.behavior_of(other, cars)

    def behavior_of(self, other: str, cars: Cars) -> str:
        try:
            return cars.get_robot_behavior_state(other)
        except Interrupted:
            raise
        except CallError:
            return "unreachable"

    def update_emotion_state(self, cars: Cars) -> None: ...

    def update_behavior_state(self, cars: Cars) -> None: ...

    def project_location(self, cars: Cars) -> Point:
        self.draw = cars.random.unit()
        self.step_m = (self.draw - 0.5) * 0.2 * 2.0
        return Point(self.at.x + self.step_m, self.at.y)

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return abs(self.step_m) / self.tick_s

    def direction(self) -> float:
        return math.pi if self.step_m < 0.0 else 0.0

    def state_variables(self) -> StateVariables:
        return {**self.seen, "heard": self.heard, "last": self.last, "draw": self.draw}

    def emotion_state(self) -> str:
        return "CALM"

    def behavior_state(self) -> str:
        return "ECHO" if self.heard else "LISTEN"

    def resume(self, cars: Cars, last: StateVariables) -> None:
        self.heard = int(float(last["heard"]))


if __name__ == "__main__":
    sys.exit(main("Echo", lambda name: Echo()))
