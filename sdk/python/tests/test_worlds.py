"""The worlds without emotions: their robots in Python do what those in Rust do. A pursuit, which is all of Python."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from bidder import Bidder
from lab import EXAMPLES, ROOT, Lab, assert_same
from scout import Scout

import cars
from cars import Action, Cars, Point, Robot

WORLDS: list[tuple[str, str, type[Robot], list[dict[str, Any]]]] = [
    (
        "auction",
        "B*",
        Bidder,
        [
            {},
            {"robot.B*.params.sends": "on_change"},
            {"robot.B*.params.sends": "never", "network.commands.loss": 0.9},
            {"robot.B*.params.lease": "2 s", "network.commands.loss": 0.9},
            {"robot.B*.params.lease": "2 s", "robot.B*.params.sends": "on_change", "network.commands.loss": 0.6},
        ],
    ),
    (
        "swarm",
        "S*",
        Scout,
        [{}, {"robot.S*.params.keeps": 2, "duration": "40 s"}, {"network.commands.loss": 0.3, "duration": "40 s"}],
    ),
]


@pytest.mark.parametrize(("world", "names", "kind", "changes"), WORLDS)
def test_a_robot_in_python_gives_the_same_run(
    lab: Lab, world: str, names: str, kind: type[Robot], changes: list[dict[str, Any]]
) -> None:
    for seed, change in enumerate(changes, start=1):
        rust, python = f"rust-{seed}", f"python-{seed}"
        cars.run(world, set=change, seed=seed, out=lab.folder, name=rust)
        cars.run(world, set=change, seed=seed, out=lab.folder, name=python, robots={names: kind})
        assert_same(lab.events(python), lab.events(rust))


@pytest.mark.parametrize(("world", "names", "kind", "_"), WORLDS)
def test_programs_in_python_give_the_same_run(lab: Lab, world: str, names: str, kind: type[Robot], _: object) -> None:
    file = lab.folder / "launch.toml"
    program = EXAMPLES / f"{kind.__name__.lower()}.py"
    file.write_text(
        f'scenario = "{ROOT / "configs" / world}.toml"\nspeed = "max"\n'
        f'[[process]]\nname = "team"\ncommand = ["{program}"]\nrobots = "{names}"\nper_process = 8\n'
    )
    lab.cars("launch", str(file), "--no-console", "-q", "--out", str(lab.folder), "--run", "python")
    cars.run(world, out=lab.folder, name="rust")
    assert_same(lab.events("python"), lab.events("rust"))


@pytest.mark.parametrize(
    ("world", "names", "kind", "_"), [WORLDS[0], pytest.param(*WORLDS[1], marks=pytest.mark.thorough)]
)
def test_an_experiment_takes_robots_in_python(
    tmp_path: Path, world: str, names: str, kind: type[Robot], _: object
) -> None:
    rust = cars.experiment(world, out=tmp_path / "rust", seeds=2, duration=10)
    python = cars.experiment(world, out=tmp_path / "python", seeds=2, duration=10, robots={names: kind})
    assert python.failures == []
    assert python.estimates.equals(rust.estimates)


@pytest.mark.parametrize(("page", "end"), [("auction", "done"), ("swarm", "REST")])
def test_the_robot_of_a_page_does_what_the_page_says(
    page: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text()
    (file,) = re.findall(r"Save this as `(\w+\.toml)`", text)
    (tmp_path / file).write_text(block(text, "toml"))
    monkeypatch.chdir(tmp_path)
    exec(block(text, "python"), {"__name__": "page"})
    assert end in capsys.readouterr().out


def block(page: str, language: str) -> str:
    """The first block of a page in a language."""
    return page.split(f"```{language}\n")[1].split("```")[0]


PURSUIT = """
duration = "300 s"
end_when = { distance = { robots = "P*", by = "min", to = "E" }, below = 1 }
[field]
size = ["30 m", "30 m"]
body = "0.4 m"
[sensing]
range = "6 m"
[network.radio]
range = "15 m"
[[robot]]
name = "P"
count = 3
at = "random"
[[robot]]
name = "E"
at = "random"
"""
CAPTURE = """
question = "How much sooner do four pursuers catch an evader than one?"
scenario = "pursuit.toml"
duration = "300 s"
seeds = 6
[[factor]]
name = "pursuers"
path = "robot.P.count"
values = [1, 4]
[[arm]]
name = "chase"
[[measure]]
name = "caught"
time = { to = { distance = { robots = "P*", by = "min", to = "E" }, below = 1 } }
"""


class Pursuer(Robot):
    """Goes where the evader was seen last, and tells the others of it."""

    def init(self, cars: Cars) -> None:
        self.goal = cars.location

    def tick(self, cars: Cars) -> Action:
        for command in cars.commands:
            self.goal = Point(**command.payload)
        for robot in cars.sensed_robots:
            if robot.name == "E":
                self.goal = robot.location
                cars.broadcast("seen", robot.location._asdict())
        if cars.location.distance_m(self.goal) < 0.5 or cars.was_blocked:
            width_m, height_m = cars.welcome.field_m
            self.goal = Point(width_m * cars.random.unit(), height_m * cars.random.unit())
        return Action.go(cars, self.goal, 1.2)


class Evader(Robot):
    """Flees from the pursuers that it senses."""

    def tick(self, cars: Cars) -> Action:
        here = cars.location
        x, y = here
        for robot in cars.sensed_robots:
            apart_m = here.distance_m(robot.location)
            x += (here.x - robot.location.x) / apart_m
            y += (here.y - robot.location.y) / apart_m
        width_m, height_m = cars.welcome.field_m
        goal = Point(min(max(x, 0.3), width_m - 0.3), min(max(y, 0.3), height_m - 0.3))
        return Action.go(cars, goal, 0.9)


def test_a_pursuit_is_a_scenario_and_two_classes(tmp_path: Path) -> None:
    file = tmp_path / "pursuit.toml"
    file.write_text(PURSUIT)
    robots = {"P*": Pursuer, "E": Evader}
    once = cars.run(file, robots=robots, out=tmp_path, name="once")
    again = cars.run(file, robots=robots, out=tmp_path, name="again")
    assert once.summary["digest"] == again.summary["digest"]
    assert "distance of P* to E" in once.summary["end_because"]

    experiment = tmp_path / "capture.toml"
    experiment.write_text(CAPTURE)
    result = cars.experiment(experiment, robots=robots, out=tmp_path / "results")
    assert result.failures == []
    caught_s = result.results.groupby("pursuers").caught.mean()
    assert caught_s[4] < caught_s[1]
