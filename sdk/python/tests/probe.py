"""A robot that does what commands say and reports in what order it was called: the subject of the protocol's tests."""

from __future__ import annotations

import math
import sys
import time

import cars_robot
from cars_robot import CallError, Cars, Interrupted, Panel, Point, StateVariables, panel


class Probe(cars_robot.Robot):
    """Walks to the right, a meter a tick."""

    def init_robot(self, cars: Cars) -> None:
        cars.log("init")
        self.at = cars.welcome.location
        self.calls: list[str] = []
        self.orders: list[str] = []
        self.taken_over: StateVariables = {}
        self.is_number = True

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.calls = ["location"]
        self.at = location

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        self.calls.append(f"command {sender} {command}")
        self.orders.append(command)

    def update_state_variables(self, cars: Cars) -> None:
        self.calls.append("variables")
        orders, self.orders = self.orders, []
        for order in orders:
            self.obey(cars, *order.split(" ", 2))

    def obey(self, cars: Cars, verb: str, first: str = "", second: str = "") -> None:
        """Does what a command says."""
        try:
            if verb == "ask":
                self.calls.append(f"{first} is {cars.get_robot_state(first).emotion_state}")
            elif verb == "tell":
                self.calls.append(f"sent {cars.set_robot_command(first, second)}")
            elif verb == "look":
                self.calls.append(f"sees {[body.kind for body in cars.percept().bodies]}")
            elif verb == "draw":
                self.calls.append(f"draws {cars.random.next_u64()}")
            elif verb == "nan":
                self.is_number = False
            elif verb == "fail":
                raise ZeroDivisionError("as it was told")
            elif verb == "sleep":
                print("sleeps", flush=True)
                time.sleep(float(first))
        except Interrupted:
            raise
        except CallError as error:
            self.calls.append(f"{type(error).__name__}: {error}")

    def update_emotion_state(self, cars: Cars) -> None:
        self.calls.append("emotion")

    def update_behavior_state(self, cars: Cars) -> None:
        self.calls.append("behavior")

    def project_location(self, cars: Cars) -> Point:
        self.calls.append("project")
        for call in self.calls:
            cars.log(call)
        return Point(self.at.x + 1.0 if self.is_number else math.nan, self.at.y)

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return 1.0 if self.is_number else math.inf

    def direction(self) -> float:
        return 0.1234567891 if self.is_number else math.nan

    def state_variables(self) -> StateVariables:
        variables: dict[str, cars_robot.Variable] = {"whole": 7, "part": 0.1, "flag": True, "text": "caf\u00e9"}
        if not self.is_number:
            variables |= {"inf": math.inf, "huge": 10**400}
        return variables

    def emotion_state(self) -> str:
        return "CALM"

    def behavior_state(self) -> str:
        return "WALK"

    def resume(self, cars: Cars, last: StateVariables) -> None:
        cars.log(f"resumes {sorted(last.items())}")

    def panel(self) -> Panel:
        return Panel([panel.Bar("nothing", math.nan), panel.Text("at", str(self.at))])


if __name__ == "__main__":
    sys.exit(cars_robot.main("A", lambda name: Probe()))
