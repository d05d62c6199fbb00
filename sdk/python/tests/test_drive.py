"""Robots that drive like wheels: in this process, as programs of two languages, and over standard input and output."""

from __future__ import annotations

from pathlib import Path

import pytest
from lab import EXPECTS_NOTHING, Lab, assert_same
from rover import Rover

import cars
from cars import Action, Cars, Point, Pose, Robot, Velocity

SCENARIO = """
seed = 5
tick = "0.25 s"
duration = "30 s"
[field]
size = ["8 m", "7 m"]
max_speed = "2 m/s"
[guests]
count = 4
[[wall]]
points = [["4 m", "0 m"], ["4 m", "3 m"]]
[[obstacle]]
at = ["6 m", "5 m"]
radius = "0.4 m"
[[robot]]
name = "A"
at = ["2 m", "2 m"]
size = ["0.9 m", "0.4 m"]
drive = { max_speed = "0.8 m/s", max_turn = "60 deg/s", max_acceleration = "0.5 m/s2", max_turn_acceleration = "90 deg/s2" }
[[robot]]
name = "B"
at = ["6 m", "2 m"]
radius = "0.25 m"
drive = { max_acceleration = "1 m/s2", heading = "135 deg" }
[[robot]]
name = "C"
at = ["2 m", "5 m"]
drive = { heading = "-90 deg" }
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Three robots with wheels, of different shapes and limits."""
    file = tmp_path / "drive.toml"
    file.write_text(SCENARIO)
    return file


def test_the_same_run_in_one_process_and_as_programs_of_two_languages_and_of_none(lab: Lab, scenario: Path) -> None:
    here = Path(__file__).parent
    # The programs of the project have it only where they are built for tests.
    rust = lab.programs / "rover"
    commands = {
        "A": [str(rust if rust.exists() else here / "rover.py")],
        "B": [str(here / "rover.py")],
        "C": [str(lab.programs / "cars"), "exec", "--", str(here / "rover_lines.py")],
    }
    file = lab.folder / "launch.toml"
    processes = [f'[[process]]\nname = "{name}"\ncommand = {command}\n' for name, command in commands.items()]
    file.write_text(f'scenario = "{scenario}"\nspeed = "max"\n' + "".join(processes))
    out = ("--out", str(lab.folder))
    launch = ("launch", str(file), "--no-console", "-q", *out, *EXPECTS_NOTHING)
    lab.cars(*launch, "--run", "launched")
    launched = lab.events("launched")

    everyone = {"A": Rover, "B": Rover, "C": Rover}
    own = cars.run(scenario, robots=everyone, out=lab.folder, name="own")
    assert_same(launched, lab.events("own"))
    assert own.summary["digest"] in launched[-1]
    by = {event["by"] if isinstance(event["by"], str) else "robot" for event in lab.of_kind("own", "blocked")}
    assert {"edge", "wall"} <= by
    assert not lab.of_kind("own", "warned")

    for run in ("launched", "own"):
        assert "the same" in lab.cars("verify", run, *out)
    lab.cars(*launch, "--run", "replayed", "--replay-robot", "B=launched")
    assert_same(launched, lab.events("replayed"))


def test_a_robot_that_crashes_and_comes_back_drives_on_from_where_it_stands(lab: Lab, scenario: Path) -> None:
    crash = '\n[[fault]]\nrobot = "B"\ndo = "crash"\nat = "10 s"\nuntil = "14 s"\n'
    scenario.write_text('on_late = "continue"\n' + SCENARIO + crash)
    everyone = {"A": Rover, "B": Rover, "C": Rover}
    run = cars.run(scenario, robots=everyone, out=lab.folder, name="crashed")
    assert "the same" in lab.cars("verify", "crashed", "--out", str(lab.folder))
    of_b = run.states[run.states.robot == "B"].set_index("tick")
    # It drives at 0.9 m/s at most when it crashes at tick 40, and it brakes at 1 m/s².
    assert of_b.x_m[50] == of_b.x_m[55] and of_b.y_m[50] == of_b.y_m[55]
    assert of_b.x_m[60] != of_b.x_m[55]


class Looker(Robot):
    """Notes its pose, and drives as it is told."""

    wanted: Velocity | None = Velocity(1.0, 0.5)
    poses: list[Pose | None] = []

    def tick(self, cars: Cars) -> Action:
        self.poses.append(cars.pose)
        if self.wanted is None:
            return Action.stay(cars)
        return Action.drive(cars, *self.wanted)


ONE = """
tick = "0.5 s"
duration = "2 s"
[[robot]]
name = "A"
at = ["5 m", "5 m"]
drive = { max_acceleration = "1 m/s2", max_turn = "1 rad/s", heading = "90 deg" }
"""


def test_a_robot_is_told_its_pose_and_drives_within_its_limits(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text(ONE)
    Looker.poses.clear()
    cars.run(file, robots={"A": Looker}, out=tmp_path, name="driven")
    poses = [pose for pose in Looker.poses if pose is not None]
    assert poses[0] == Pose(Point(5.0, 5.0), 1.570796, Velocity(0.0, 0.0))
    assert [pose.velocity for pose in poses[1:]] == [Velocity(0.5, 0.5)] + [Velocity(1.0, 0.5)] * 3
    assert [round(pose.heading_rad - poses[0].heading_rad, 5) for pose in poses] == [0.0, 0.25, 0.5, 0.75, 1.0]

    file.write_text(ONE.replace("drive", "# drive"))
    Looker.poses.clear()
    cars.run(file, robots={"A": Looker}, out=tmp_path, name="not_driven")
    assert Looker.poses == [None] * 5


def test_what_is_no_velocity_is_refused_with_its_reason(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text(ONE)

    class Careless(Robot):
        def tick(self, cars: Cars) -> Action:
            action = Action.stay(cars)
            action.velocity = 3.0  # type: ignore[assignment]
            return action

    with pytest.raises(TypeError, match="the velocity of a cars.Action must be a cars.Velocity or None"):
        cars.run(file, robots={"A": Careless}, out=tmp_path)
