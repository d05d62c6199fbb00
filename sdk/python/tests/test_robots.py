"""Robots in Python, one behavior at a time: in this process, and as programs."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from lab import PATIENCE_S, Lab, environment

import cars
from cars import Action, Cars, CarsRobotInterface, Panel, Point, Robot, StateVariables, TooEarly, UnknownRobot
from cars.panel import Bar, Button, Text

HALL = """
seed = 1
tick = "0.5 s"
duration = "10 s"
[field]
size = ["20 m", "20 m"]
[sensing]
range = "4 m"
"""


def hall(*names: str, more: str = "") -> str:
    """A scenario with nothing in it but robots, two meters apart."""
    places = (f'[[robot]]\nname = "{name}"\nat = ["10 m", "{3 + 2 * i} m"]\n' for i, name in enumerate(names))
    return HALL + "".join(places) + more


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A hall with robots A and B."""
    file = tmp_path / "hall.toml"
    file.write_text(hall("A", "B"))
    return file


class Still(Robot):
    """Stands where it stands."""

    def tick(self, cars: Cars) -> Action:
        return Action.stay(cars, emotion_state="CALM", behavior_state="STAND")


class Caller(Robot):
    """Walks to the right, and does what robots can do."""

    senses_bodies = True

    def init(self, cars: Cars) -> None:
        cars.log(f"init of {cars.name} at {cars.location.x}")
        self.notes: list[str] = []

    def tick(self, cars: Cars) -> Action:
        if cars.tick == 0:
            with pytest.raises(TooEarly):
                cars.get_robot_state("B")
        if cars.tick == 1:
            cars.set_robot_command("B", "hello")
            with pytest.raises(UnknownRobot, match='no robot is called "C"'):
                cars.set_robot_command("C", "hello")
            state = cars.get_robot_state("B")
            self.notes.append(f"{state.emotion_state} {state.location.y} {cars.get_robot_behavior_state('B')}")
            self.notes.append(f"{cars.sensed_robots[0].name} {cars.bodies[0].kind}")
            self.notes.append(f"{cars.random.unit()} {cars.time_s} {cars.tick_s} {cars.welcome.roster}")
        goal = Point(12.0, cars.location.y)
        return Action.go(cars, goal, 1.0, emotion_state="CALM", state_variables={"notes": "; ".join(self.notes), "n": 3})


class Listener(Still):
    """Logs its commands."""

    def tick(self, cars: Cars) -> Action:
        for sender, text in cars.commands:
            cars.log(f"{sender} says {text}")
        return super().tick(cars)


def test_a_robot_perceives_and_acts(scenario: Path) -> None:
    run = cars.run(scenario, robots={"A": Caller, "B": Listener})
    said = run.events[run.events.event == "say"].text.tolist()
    assert said == ["init of A at 10.0", "A says hello"]
    published = run.summary["robots"]["A"]["state_variables"]
    draw = cars.stream(1, "robot/A").unit()
    assert published == {"notes": f"CALM 5.0 STAND; B robot; {draw} 0.5 0.5 ('A', 'B')", "n": 3.0}
    ways = run.states[run.states.robot == "A"]
    assert ways.x_m.tolist()[:6] == [10.0, 10.5, 11.0, 11.5, 12.0, 12.0]
    assert ways.speed_mps.tolist()[:6] == [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]


VALUES: list[Any] = [
    {"task": 3, "bid": 0.1 + 0.2, "of": ["A", None, True, -(2**63), 2**64 - 1, 5e-324], "caf\u00e9": "\U0001f916"},
    [[], {}, ""],
    "x" * (64 * 1024 - 2),
    False,
    0,
    -0.0,
]
BAD_VALUES: list[tuple[Any, type[Exception], str]] = [
    ("x" * (64 * 1024 - 1), ValueError, "65537 bytes of JSON, more than the 65536 allowed"),
    (2**64, ValueError, "an integer in a payload must have at most 64 bits"),
    (math.nan, ValueError, "JSON has no number"),
    ({1: 2}, TypeError, "keys of a dict in a payload must be texts, not int"),
    ({1, 2}, TypeError, "not a set"),
]


class Auctioneer(Still):
    """Sends payloads to B, one after the other, and all of them to all."""

    def tick(self, cars: Cars) -> Action:
        if cars.tick == 1:
            for value in VALUES:
                cars.send("B", "bid", value)
            cars.send("B", "plain")
        if cars.tick == 2:
            cars.broadcast("all", VALUES[:2])
            cars.broadcast("plain", None)
            for value, error, reason in BAD_VALUES:
                with pytest.raises(error, match=reason):
                    cars.broadcast("bad", value)
            nested: Any = 1
            for _ in range(65):
                nested = [nested]
            with pytest.raises(ValueError, match="more than 64 lists and objects"):
                cars.send("B", "deep", nested)
        return super().tick(cars)


def exact(value: Any) -> str:
    """A value as JSON: every bit of its numbers, and not the order of fields."""
    return json.dumps(value, sort_keys=True)


class Bidder(Still):
    """Compares what arrives with what was sent."""

    def tick(self, cars: Cars) -> Action:
        sent = {2: [*VALUES, None], 3: [VALUES[:2], None]} if cars.name == "B" else {3: [VALUES[:2], None]}
        arrived = [command.payload for command in cars.commands]
        assert exact(arrived) == exact(sent.get(cars.tick, [])), cars.tick
        if arrived:
            cars.log(" ".join(f"{sender}: {text}" for sender, text in cars.commands))
        return super().tick(cars)


def test_payloads_arrive_as_they_were_sent(tmp_path: Path) -> None:
    file = tmp_path / "auction.toml"
    file.write_text(hall("A", "B", "C"))
    run = cars.run(file, robots={"A": Auctioneer, "B": Bidder, "C": Bidder}, duration="3 s", out=tmp_path)
    said = run.events[run.events.event == "say"].text.tolist()
    assert said == [" ".join(["A: bid"] * 6 + ["A: plain"]), "A: all A: plain", "A: all A: plain"]
    sent = run.events[run.events.event == "command_sent"]
    assert sent.command.tolist() == ["bid"] * 6 + ["plain"] + ["all"] * 2 + ["plain"] * 2
    # Once for both targets of the broadcast.
    assert sent.payload_bytes.notna().tolist() == [True] * 6 + [False, True, False, False, False]


class Order(CarsRobotInterface):
    """Notes in what order its methods are called."""

    def init_robot(self, cars: Cars) -> None:
        self.calls = ["init"]

    def set_current_location(self, cars: Cars, location: Point) -> None:
        self.at = location
        self.calls.append("location")

    def set_command(self, cars: Cars, sender: str, command: str) -> None:
        self.calls.append(f"command {sender} {command}")

    def update_state_variables(self, cars: Cars) -> None:
        self.calls.append("variables")

    def update_emotion_state(self, cars: Cars) -> None:
        self.calls.append("emotion")

    def update_behavior_state(self, cars: Cars) -> None:
        self.calls.append("behavior")

    def project_location(self, cars: Cars) -> Point:
        cars.log(" ".join([*self.calls, "project"]))
        self.calls = []
        return self.at

    def current_location(self) -> Point:
        return self.at

    def speed(self) -> float:
        return 0.0

    def direction(self) -> float:
        return 0.1234567891

    def state_variables(self) -> StateVariables:
        return {"whole": 7, "part": 0.1, "flag": True, "text": "caf\u00e9", "huge": 10**400, "none": math.nan}

    def emotion_state(self) -> str:
        return "CALM"

    def behavior_state(self) -> str:
        return "NOTE"


class Orders(Still):
    """Sends a command at tick 1."""

    def tick(self, cars: Cars) -> Action:
        if cars.tick == 1:
            cars.set_robot_command("A", "go")
        return super().tick(cars)


def test_figure_7_is_called_in_the_order_of_figure_5(scenario: Path) -> None:
    run = cars.run(scenario, robots={"A": Order, "B": Orders}, duration="1.5 s")
    said = run.events[run.events.event == "say"]
    calls = [text for text in said.text if not text.startswith("error")]
    assert calls == [
        "init location project",
        "location variables emotion behavior project",
        "location command B go variables emotion behavior project",
        "location variables emotion behavior project",
    ]
    assert sum("huge" in text or "none" in text for text in said.text) == 8, "what is not finite is left out and logged"
    published = run.summary["robots"]["A"]["state_variables"]
    assert published == {"whole": 7.0, "part": 0.1, "flag": True, "text": "caf\u00e9"}
    assert run.states[run.states.robot == "A"].direction_rad.tolist()[0] == 0.123457


def test_a_robot_that_goes_by_another_name_leaves_the_run(scenario: Path) -> None:
    class Imposter(Order):
        def name(self) -> str:
            return "B"

    with pytest.raises(ValueError, match="A calls itself 'B'"):
        cars.run(scenario, robots={"A": Imposter, "B": Still})


def raising(method: str, error: str) -> type[Robot]:
    """A class of robots one of whose methods raises something."""

    def fail(self: Any, *_: Any) -> Any:
        raise eval(error)

    return type("Raising", (Still,), {method: fail})


@pytest.mark.parametrize("method", ["init", "tick", "panel"])
def test_what_a_robot_raises_is_raised_by_the_run(scenario: Path, method: str) -> None:
    with pytest.raises(ZeroDivisionError, match="as it was told") as raised:
        cars.run(scenario, robots={"A": raising(method, "ZeroDivisionError('as it was told')"), "B": Still})
    assert "fail" in [entry.name for entry in raised.traceback], "the traceback shows the robot's own code"


def answering(**fields: Any) -> type[Robot]:
    """A class of robots that does and publishes this."""

    class Answering(Robot):
        def tick(self, cars: Cars) -> Action:
            return Action.stay(cars, **fields) if fields else None  # type: ignore[return-value]

    return Answering


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({}, "a tick returns a cars.Action"),
        ({"state_variables": {"list": []}}, "the state variable \"list\" must be a number, a text, True or False"),
        ({"speed_mps": "fast"}, "the speed_mps of a cars.Action must be a number, not .*str"),
        ({"emotion_state": 3}, "the emotion_state of a cars.Action must be a text, not .*int"),
        ({"state_variables": 3}, "the state_variables of a cars.Action must be a mapping, not .*int"),
    ],
)
def test_an_answer_of_the_wrong_kind_is_named(scenario: Path, fields: dict[str, Any], reason: str) -> None:
    with pytest.raises(TypeError, match=reason):
        cars.run(scenario, robots={"A": answering(**fields), "B": Still})


def test_numbers_of_numpy_are_numbers(scenario: Path) -> None:
    numpy = pytest.importorskip("numpy")
    values = {"a": numpy.float32(0.5), "b": numpy.int64(7), "c": numpy.bool_(True)}
    run = cars.run(scenario, robots={"A": answering(state_variables=values), "B": Still})
    assert run.summary["robots"]["A"]["state_variables"] == {"a": 0.5, "b": 7.0, "c": True}


class Hoarder(Still):
    """Keeps what it is lent."""

    kept: list[Cars] = []

    def tick(self, cars: Cars) -> Action:
        self.kept.append(cars)
        with pytest.raises(RuntimeError, match="A uses cars.bodies and its senses_bodies is False"):
            _ = cars.bodies
        return super().tick(cars)


def test_cars_is_lent_for_a_tick(scenario: Path) -> None:
    cars.run(scenario, robots={"A": Hoarder, "B": Still})
    with pytest.raises(RuntimeError, match="lent to a robot for a tick"):
        _ = Hoarder.kept[0].tick


def test_who_is_no_robot_is_refused(scenario: Path) -> None:
    with pytest.raises(cars.UnknownRobot, match='no robot is called "C"; the roster is A, B'):
        cars.run(scenario, robots={"C": Still})
    with pytest.raises(TypeError, match="derived from cars.Robot"):
        cars.run(scenario, robots={"A": dict, "B": Still})  # type: ignore[dict-item]


def test_a_robot_that_comes_back_is_made_anew_and_resumes(tmp_path: Path) -> None:
    class Counter(Still):
        """Counts its ticks, also those before it was lost."""

        count = 0.0

        def tick(self, cars: Cars) -> Action:
            self.count += 1
            return Action.stay(cars, state_variables={"count": self.count})

        def resume(self, cars: Cars, last: StateVariables) -> None:
            assert cars.welcome.last_state is not None
            self.count = float(last["count"])

    fault = '[[fault]]\nrobot = "A"\ndo = "crash"\nat = "2 s"\nuntil = "4 s"\n'
    file = tmp_path / "fault.toml"
    file.write_text('on_late = "continue"\n' + hall("A", "B", more=fault))
    run = cars.run(file, robots={"A": Counter, "B": Still})
    missed = run.summary["robots"]["A"]["missed"]
    assert missed > 0
    assert run.summary["robots"]["A"]["state_variables"]["count"] == 21 - missed


def test_a_change_of_parameters_that_a_robot_refuses_is_a_line_of_its_log(tmp_path: Path) -> None:
    @dataclass
    class Set:
        speed_mps: float = 0.25

    class Walker(Robot):
        """Walks as fast as it is told."""

        def init(self, cars: Cars) -> None:
            self.start = cars.random.unit()
            self.speed_mps = cars.parameters(Set).speed_mps
            if self.speed_mps > 1:
                raise ValueError("too fast")

        def tick(self, cars: Cars) -> Action:
            return Action.go(cars, Point(19, 10), self.speed_mps, state_variables={"start": self.start})

    def changed(*values: str) -> cars.Run:
        tables = "".join(
            f"[[change]]\nat = \"{2 + i} s\"\nset = ['robot.A.params.speed_mps={value}']\n" for i, value in enumerate(values)
        )
        file = tmp_path / "changed.toml"
        file.write_text(hall("A", "B", more=tables))
        return cars.run(file, robots={"A": Walker, "B": Still}, out=tmp_path / str(len(list(tmp_path.iterdir()))))

    with pytest.warns(RuntimeWarning) as warned:
        run = changed("fast", "0.5", "7", "8", "0.5")
    reasons = [str(warning.message) for warning in warned if warning.category is RuntimeWarning]
    assert "parameters of A: speed_mps must be a number, not 'fast'" in reasons[0]
    # 8 is refused, and so is 7, which was before it.
    assert [reason.endswith("ValueError: too fast; it keeps those before") for reason in reasons] == [False, True, True, True]
    log = (run.folder / "cars.log").read_text()
    assert log.count("error: refuses its new parameters, and keeps those before; its output has the reason") == 3
    speeds = run.states[run.states.robot == "A"].groupby("tick").speed_mps.first()
    assert [speeds[tick] for tick in (3, 5, 6, 8, 10, 19)] == [0.25, 0.25, 0.5, 0.5, 0.5, 0.5]
    with pytest.warns(RuntimeWarning):
        again = changed("fast", "0.5", "7", "8", "0.5")
    assert (run.folder / "events.jsonl").read_text() == (again.folder / "events.jsonl").read_text()


def test_parameters_that_a_robot_refuses_at_the_beginning_end_its_run(tmp_path: Path) -> None:
    class Refusing(Still):
        def init(self, cars: Cars) -> None:
            raise cars_BadParameters(cars.name, "nothing is right")

    cars_BadParameters = cars.BadParameters
    file = tmp_path / "hall.toml"
    file.write_text(hall("A", "B"))
    with pytest.raises(cars.BadParameters, match="nothing is right"):
        cars.run(file, robots={"A": Refusing, "B": Still})


def test_a_change_that_a_robot_of_rust_refuses_is_refused_at_the_beginning(tmp_path: Path) -> None:
    with pytest.raises(cars.Error, match="as a change of the scenario sets them: policy:"):
        cars.run(
            "hors_doeuvres",
            set={"change": [{"at": "10 s", "set": ["robot.Butler.params.policy=nonsense"]}]},
            duration="5 s",
        )


def test_the_same_seed_gives_the_same_run(scenario: Path) -> None:
    runs = [cars.run(scenario, seed=seed, robots={"A": Caller, "B": Listener}) for seed in (5, 5, 6)]
    digests = [run.summary["digest"] for run in runs]
    assert digests[0] == digests[1] != digests[2]


def test_panels_stay_within_the_limits_of_a_message() -> None:
    shown = cars.panel.to_json(Panel([Bar("b", math.nan), Text("t", "\u00e9" * 4096), *[Button("x", "y")] * 100]))
    assert '"value": 0.0' in shown and shown.count('"widget"') == 64 and len(shown) < 20_000


# As programs.

PROGRAM = """
import sys
import cars
from cars import Action, Cars, Point, Robot


class Own(Robot):
    def tick(self, cars: Cars) -> Action:
        %s
        return Action.stay(cars, emotion_state="CALM")


sys.exit(cars.main("A", lambda name: Own()))
"""


def program(folder: Path, body: str) -> list[str]:
    """The command of a robot's program with these lines in its tick."""
    file = folder / "own.py"
    file.write_text(PROGRAM % textwrap.indent(body, "        ").strip())
    return [sys.executable, str(file)]


def test_a_program_whose_robot_fails_ends_with_its_traceback(lab: Lab) -> None:
    robot = lab.start(program(lab.folder, "1 / 0"), **lab.simulator("fails", hall("A")))
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1
    assert "1 / 0" in said and said.rstrip().endswith("ZeroDivisionError: division by zero"), said


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("body", ["pass", "print('busy', flush=True)\nwhile True: pass"])
def test_a_signal_ends_a_program_at_once(lab: Lab, number: signal.Signals, body: str) -> None:
    at = lab.simulator("signal", hall("A"), "--paused")
    robot = lab.start(program(lab.folder, body), **at)
    ctl = ["--run", "signal", "--connect", at["CARS_CONNECT"]]
    if "busy" in body:
        assert robot.stdout is not None and robot.stdout.readline() == "busy\n"
    else:
        lab.until_ready(*ctl)
    robot.send_signal(number)
    assert robot.wait(PATIENCE_S) == -number


TAKES_PART = """
import sys
import cars


class Still(cars.Robot):
    def tick(self, cars):
        print("tick", flush=True)
        return {action}


try:
    print(cars.take_part({{"A": Still()}}))
except KeyboardInterrupt:
    print("interrupted")
except Exception as error:
    print(type(error).__name__, error)
"""


def takes_part(lab: Lab, action: str, **more: str) -> subprocess.Popen[str]:
    """A program that takes part without a command line."""
    file = lab.folder / "takes_part.py"
    file.write_text(TAKES_PART.format(action=action))
    return lab.start([sys.executable, str(file)], **more)


STAY = "__import__('cars').Action.stay(cars)"


def test_taking_part_returns_how_the_run_ended(lab: Lab) -> None:
    robot = takes_part(lab, STAY, **lab.simulator("ends", hall("A")))
    printed, _ = robot.communicate(timeout=PATIENCE_S)
    assert printed == "tick\n" * 21 + "finished\n"


def test_taking_part_raises_what_the_robot_raised(lab: Lab) -> None:
    robot = takes_part(lab, "1 / 0", **lab.simulator("raises", hall("A")))
    printed, _ = robot.communicate(timeout=PATIENCE_S)
    assert printed == "tick\nZeroDivisionError division by zero\n"


def test_taking_part_is_interrupted(lab: Lab) -> None:
    robot = takes_part(lab, STAY, **lab.simulator("interrupted", hall("A"), "--paused"))
    assert robot.stdout is not None and robot.stdout.readline() == "tick\n"
    robot.send_signal(signal.SIGINT)
    printed, _ = robot.communicate(timeout=PATIENCE_S)
    assert (printed, robot.returncode) == ("interrupted\n", 0)


def test_where_nobody_is_it_says_what_to_do(lab: Lab) -> None:
    robot = takes_part(lab, STAY, CARS_CONNECT="tcp/127.0.0.1:1", CARS_PATIENCE_S="0.3")
    printed, _ = robot.communicate(timeout=PATIENCE_S)
    assert printed.startswith("HostError ") and "127.0.0.1:1" in printed


def test_a_robot_without_the_module_of_the_lab_costs_little() -> None:
    """Neither pandas nor polars is imported by a robot's program."""
    script = "import sys, cars; sys.exit(bool({'pandas', 'polars', 'numpy'} & set(sys.modules)))"
    subprocess.run([sys.executable, "-c", script], env=environment(), check=True)

def test_half_a_turn_has_one_angle() -> None:
    above = math.nextafter(-math.pi, 0)
    assert {cars.published_angle(angle_rad) for angle_rad in (-math.pi, above, -math.pi + 0.1e-6, math.pi)} == {3.141593}
    assert [cars.published_angle(-math.pi + more) for more in (0.4e-6, 0.6e-6)] == [-3.141592, -3.141592]
    assert math.copysign(1, cars.published_angle(-0.4e-6)) == 1
