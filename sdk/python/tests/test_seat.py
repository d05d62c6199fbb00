"""One robot's place in the lock-step, without a network."""

from __future__ import annotations

import json
import math

import pytest
from idle import Idle

import cars_robot
from cars_robot import BadParameters, Cars, Point, StateVariables, TooEarly
from cars_robot.messages import (
    MAX_ENTRIES,
    MAX_MESSAGE_BYTES,
    MAX_TEXT_BYTES,
    Clock,
    Command,
    CommandId,
    Correction,
    News,
    Percept,
    PublicState,
    Welcome,
    encode,
    report_json,
)
from cars_robot.seat import Seat
from cars_robot.streams import stream

WELCOME = Welcome("r", "A", 1, 1, 0, 1, "robot/A", 0.5, (9, 9), 0.6, 2, Point(1, 1), ("A", "B"), {"n": 1})


class Wires:
    """The network of a robot that is alone."""

    def __init__(self, *held: tuple[str, Command]) -> None:
        self.held = {CommandId(sender, command.seq): command for sender, command in held}
        self.sent: list[tuple[str, str, Command]] = []

    def state_of(self, target: str, epoch: int, tick: int) -> PublicState:
        raise cars_robot.cars.Lost

    def percept(self, robot: str, epoch: int, tick: int) -> Percept:
        return Percept(epoch, tick)

    def send(self, sender: str, to: str, command: Command) -> None:
        self.sent.append((sender, to, command))

    def receive(self, to: str, epoch: int, command: CommandId) -> Command | None:
        return self.held.pop(command, None)


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
    report = Seat(Chatterbox(), WELCOME).init(Clock(1), Wires())
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

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        self.heard.append(f"{sender} {command}")
        cars.set_robot_command("B", command)


def test_a_doubled_command_is_executed_twice_and_a_missing_one_is_told() -> None:
    robot = Parrot()
    seat, wires = Seat(robot, WELCOME), Wires(("B", Command(1, 0, 3, "go")), ("C", Command(1, 0, 1, "no")))
    seat.init(Clock(1), wires)
    ids = [CommandId("B", 3), CommandId("B", 3), CommandId("C", 7), CommandId("C", 1)]
    report = seat.tick(Clock(1, 1, {"A": News(commands=tuple(ids))}), wires)
    assert robot.heard == ["B go", "B go", "C no"] and report.missing == [ids[2]]
    assert [(to, sent.seq) for to, sent in report.sent] == [("B", 1), ("B", 2), ("B", 3)]
    assert [command for *_, command in wires.sent] == [sent for _, sent in report.sent]
    assert seat.tick(Clock(1, 2), wires).sent == []


def test_it_stands_where_it_is_told() -> None:
    class Runner(Idle):
        def project_location(self, cars: Cars) -> Point:
            assert cars.was_blocked == (cars.tick == 2)
            return Point(self.at.x + 1, self.at.y)

    seat, wires = Seat(Runner(), WELCOME), Wires()
    assert seat.init(Clock(1), wires).proposal == Point(2, 1)
    assert seat.tick(Clock(1, 1), wires).state.location == Point(2, 1)
    blocked = News(correction=Correction(Point(2, 1), True))
    assert seat.tick(Clock(1, 2, {"A": blocked}), wires).state.location == Point(2, 1)


def test_a_location_that_is_none_does_not_travel() -> None:
    class Nowhere(Idle):
        def current_location(self) -> Point:
            return Point(math.nan, 10**400)

    report = Seat(Nowhere(), WELCOME).init(Clock(1), Wires())
    assert report.state.location == Point(1, 1)


def test_its_chance_begins_anew_with_an_epoch_and_its_numbers_where_it_is_told() -> None:
    seen: list[int] = []

    class Gambler(Parrot):
        def update_state_variables(self, cars: Cars) -> None:
            seen.append(cars.random.next_u64())
            seen.append(cars.set_robot_command("B", "x"))

    seat, wires = Seat(Gambler(), WELCOME), Wires()
    for _ in range(2):
        seat.start_over(WELCOME)
        seat.init(Clock(1), wires)
        seat.tick(Clock(1, 1), wires)
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

    seat, wires = Seat(Shouter(), WELCOME), Wires()
    seat.init(Clock(1), wires)
    assert len(seat.tick(Clock(1, 1), wires).sent) == 1024


def test_bad_parameters_name_the_robot() -> None:
    class Picky(Idle):
        def init_robot(self, cars: Cars) -> None:
            raise BadParameters(cars.name, "n must be above 1")

    with pytest.raises(BadParameters, match="parameters of A: n must be above 1"):
        Seat(Picky(), WELCOME).init(Clock(1), Wires())
