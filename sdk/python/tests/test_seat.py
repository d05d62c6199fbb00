"""One robot's place in the lock-step, without a network."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from idle import Idle

import cars_robot
from cars_robot import BadParameters, Cars, Point, StateVariables, TooEarly
from cars_robot.messages import (
    MAX_ENTRIES,
    MAX_MESSAGE_BYTES,
    MAX_TEXT_BYTES,
    NO_NEWS,
    Correction,
    Delivery,
    News,
    PublicState,
    Report,
    SensedBody,
    Welcome,
    command_json,
    encode,
    report_json,
)
from cars_robot.seat import Seat
from cars_robot.streams import stream

WELCOME = Welcome("r", "A", 1, 1, 0, 1, "robot/A", 0.5, (9, 9), 0.6, 2, Point(1, 1), ("A", "B"), {"n": 1})


def nobody(target: str, epoch: int, tick: int) -> PublicState:
    """The state of another robot, for a robot that is alone."""
    raise cars_robot.Unreachable(target)


def run(seat: Seat, tick: int, news: News = NO_NEWS, is_first: bool = False) -> Report:
    """A tick of a robot that is alone."""
    return seat.run(tick, news, is_first or tick == 0, nobody)


class Chatterbox(Idle):
    """Says more than a message may hold, and numbers that are none."""

    def init_robot(self, cars: Cars) -> None:
        super().init_robot(cars)
        with pytest.raises(TooEarly):
            cars.get_robot_state("B")
        for _ in range(5000):
            cars.log("\u00e9" * 5000)

    def speed(self) -> float:
        return math.nan

    def state_variables(self) -> StateVariables:
        return {"a_inf": math.inf, "a_none": None, "long": "l" * 9999} | {f"n{i}": i for i in range(2000)}  # type: ignore[return-value]

    def project_location(self, cars: Cars) -> Point:
        return Point(math.nan, 1.0)

    def emotion_state(self) -> str:
        return "\u00e9" * 5000


def test_reports_stay_within_the_limits_of_a_message() -> None:
    report = run(Seat(Chatterbox(), WELCOME), 0)
    assert report.proposal == Point(1, 1) and report.state.speed_mps == 0.0
    assert len(report.log) <= MAX_ENTRIES and all(len(line.encode()) <= MAX_TEXT_BYTES for line in report.log)
    assert len(report.state.state_variables) == MAX_ENTRIES
    assert len(report.state.emotion_state.encode()) == MAX_TEXT_BYTES
    assert "error: state variable a_none is no number, flag or text but a NoneType; left out" in report.log
    assert report.log[-1] == "error: 2003 state variables, more than 1024; the last ones are left out"
    data = encode(report_json(report))
    assert len(data) < MAX_MESSAGE_BYTES and json.loads(data)["log"] == report.log


class Parrot(Idle):
    """Notes what it hears, and sends it on."""

    def init_robot(self, cars: Cars) -> None:
        super().init_robot(cars)
        self.heard: list[str] = []
        self.numbers: list[int] = []

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        self.heard.append(f"{sender} {command}")
        self.numbers.append(cars.set_robot_command("B", command))


def test_a_doubled_command_is_executed_twice_and_commands_are_numbered_within_a_tick() -> None:
    robot = Parrot()
    seat = Seat(robot, WELCOME)
    run(seat, 0)
    commands = (Delivery("B", "go"), Delivery("B", "go"), Delivery("C", "no"))
    report = run(seat, 1, News(commands=commands))
    assert robot.heard == ["B go", "B go", "C no"] and robot.numbers == [1, 2, 3]
    assert report.commands == [("B", "go"), ("B", "go"), ("B", "no")]
    assert report_json(report)["commands"] == 3
    assert command_json(report, 2, "go") == {
        "epoch": 1,
        "tick": 1,
        "generation": 1,
        "number": 2,
        "performative": "achieve",
        "command": "go",
    }
    assert run(seat, 2).commands == []
    assert run(seat, 3, News(commands=commands[:1])).commands and robot.numbers[3:] == [1]


def test_it_stands_where_it_is_told() -> None:
    class Runner(Idle):
        def project_location(self, cars: Cars) -> Point:
            assert cars.was_blocked == (cars.tick == 2)
            return Point(self.at.x + 1, self.at.y)

    seat = Seat(Runner(), WELCOME)
    assert run(seat, 0).proposal == Point(2, 1)
    assert run(seat, 1).state.location == Point(2, 1)
    blocked = News(correction=Correction(Point(2, 1), True))
    assert run(seat, 2, blocked).state.location == Point(2, 1)


def test_who_takes_over_is_reset_then_resumes_and_all_of_it_is_one_report() -> None:
    class Heir(Parrot):
        def init_robot(self, cars: Cars) -> None:
            super().init_robot(cars)
            cars.log("init")
            cars.set_robot_command("B", "early")

        def resume(self, cars: Cars, last: StateVariables) -> None:
            cars.log(f"resumes {last['trips']}")

    last = PublicState(1, 6, Point(5, 5), 0, 0, {"trips": 3}, "", "")
    report = run(Seat(Heir(), replace(WELCOME, last_state=last)), 7, News(commands=(Delivery("B", "go"),)), True)
    assert report.log == ["init", "resumes 3"] and report.commands == [("B", "early"), ("B", "go")]
    # At tick 0 there is nothing to resume.
    assert run(Seat(Heir(), replace(WELCOME, last_state=last)), 0).log == ["init"]


def test_bodies_are_those_of_the_news_for_who_asked_for_them() -> None:
    class Looker(Idle):
        senses_bodies = True

        def update_state_variables(self, cars: Cars) -> None:
            self.seen = cars.percept()

    news = News(bodies=(SensedBody("guest", Point(1, 2)),))
    robot = Looker()
    run(Seat(robot, WELCOME), 1, news, True)
    assert (robot.seen.epoch, robot.seen.tick, robot.seen.bodies) == (1, 1, news.bodies)
    robot.senses_bodies = False
    with pytest.raises(RuntimeError, match="A calls percept"):
        run(Seat(robot, WELCOME), 1, news, True)


def test_a_location_that_is_none_does_not_travel() -> None:
    class Nowhere(Idle):
        def current_location(self) -> Point:
            return Point(math.nan, 10**400)

    report = run(Seat(Nowhere(), WELCOME), 0)
    assert report.state.location == Point(1, 1)


def test_its_chance_begins_anew_with_an_epoch() -> None:
    seen: list[int] = []

    class Gambler(Parrot):
        def update_state_variables(self, cars: Cars) -> None:
            seen.append(cars.random.next_u64())
            seen.append(cars.set_robot_command("B", "x"))

    seat = Seat(Gambler(), WELCOME)
    for _ in range(2):
        seat.start_over(WELCOME)
        run(seat, 0)
        run(seat, 1)
    first = stream(1, "robot/A").next_u64()
    assert seen == [first, 1, first, 1]


def test_commands_that_cannot_be_sent_are_refused() -> None:
    class Shouter(Idle):
        def update_state_variables(self, cars: Cars) -> None:
            with pytest.raises(cars_robot.UnknownRobot, match="the roster is A, B"):
                cars.set_robot_command("Nobody", "x")
            with pytest.raises(cars_robot.Unreachable):
                cars.get_robot_speed("B")
            with pytest.raises(ValueError, match="4096 bytes"):
                cars.set_robot_command("B", "x" * 4097)
            for _ in range(1024):
                cars.set_robot_command("B", "x")
            with pytest.raises(ValueError, match="1024 commands"):
                cars.set_robot_command("B", "x")

    seat = Seat(Shouter(), WELCOME)
    run(seat, 0)
    assert len(run(seat, 1).commands) == 1024


def test_bad_parameters_name_the_robot() -> None:
    class Picky(Idle):
        def init_robot(self, cars: Cars) -> None:
            raise BadParameters(cars.name, "n must be above 1")

    with pytest.raises(BadParameters, match="parameters of A: n must be above 1"):
        run(Seat(Picky(), WELCOME), 0)
