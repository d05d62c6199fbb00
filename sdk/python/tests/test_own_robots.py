"""Robots of Python in experiments and hunts: in this process, and as processes that play one unit after another."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from lab import Lab, environment, eventually, is_of_run

import cars

SCENARIO = """
duration = "10 s"
[[robot]]
name = "S"
count = 3
at = "random"
[[robot]]
name = "Boss"
at = ["7 m", "7 m"]
[[expect]]
name = "the boss is told"
eventually = { event = "behavior", robot = "Boss", to = "TOLD" }
within = "8 s"
"""
ROBOTS = """
import os, signal, sys, time
from dataclasses import dataclass
import cars
from cars import Action, Robot

@dataclass
class Parameters:
    fails_at: int = 0
    seed: int = 0
    how: str = "raise"

class Told(Robot):
    def init(self, c):
        self.p = c.parameters(Parameters)
        self.n = 0
        self.told = False
    def tick(self, c):
        self.n += 1
        if self.n == self.p.fails_at and c.welcome.seed == self.p.seed:
            fail(self.p.how)
        if c.name != "Boss" and c.tick == 3:
            c.set_robot_command("Boss", "go")
        self.told = self.told or bool(c.commands)
        state = {"n": self.n, "drawn": c.random.unit()}
        return Action.stay(c, behavior_state="TOLD" if self.told else "WAIT", emotion_state="CALM", state_variables=state)

def fail(how):
    if how == "raise":
        raise ValueError("no way out")
    if how != "sleep":
        os.kill(os.getpid(), {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}[how])
    # The system may take its time.
    time.sleep(1000)

class Keeps(Told):
    played = 0
    def init(self, c):
        super().init(c)
        Keeps.played += 1
        self.n = 100 * Keeps.played

CLASSES = {"Told": Told, "Keeps": Keeps}
if __name__ == "__main__":
    which = sys.argv.pop(1)
    sys.exit(cars.main("Boss", lambda name: CLASSES[which]()))
"""
EXPERIMENT = """
question = "How far do they get?"
scenario = "scenario.toml"
duration = "10 s"
seeds = 3
[[arm]]
name = "few"
[[arm]]
name = "more"
set = ["robot.S.count=4"]
[[measure]]
name = "n"
variable = { robot = "Boss", name = "n", as = "end" }
"""


class Place:
    """A folder with a scenario, robots, and an experiment."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.write("scenario.toml", SCENARIO)
        self.write("experiment.toml", EXPERIMENT)
        self.write("told.py", ROBOTS)

    def write(self, name: str, text: str) -> Path:
        file = self.folder / name
        file.write_text(text)
        return file

    def robots(self) -> ModuleType:
        """The module as it is in its file now."""
        spec = importlib.util.spec_from_file_location("told", self.folder / "told.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules["told"] = module
        importlib.invalidate_caches()
        spec.loader.exec_module(module)
        return module

    def launch(self, which: str = "Told") -> Path:
        program = [sys.executable, str(self.folder / "told.py"), which]
        return self.write(
            f"launch-{which}.toml",
            f'scenario = "scenario.toml"\n[[process]]\nname = "team"\ncommand = {json.dumps(program)}\nrobots = ["*"]\n',
        )

    def play(self, out: str, **more: Any) -> cars.Experiment:
        return cars.experiment(self.folder / "experiment.toml", out=self.folder / out, **more)

    def results(self, out: str) -> Any:
        """The digests and measures of all units, without what names their robots."""
        return (self.folder / out / "runs.csv").read_text()


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


@pytest.fixture
def programs(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """The programs of this build are found, and those that they start know no other run."""
    for name in list(os.environ):
        if is_of_run(name):
            monkeypatch.delenv(name)
    monkeypatch.setenv("PATH", os.pathsep.join([str(lab.programs), os.environ["PATH"]]))


def test_an_experiment_plays_own_robots_with_any_number_of_jobs(place: Place) -> None:
    told = place.robots().Told
    one = place.play("one", robots={"S*": told, "Boss": told}, jobs=1)
    place.play("many", robots={"*": told}, jobs=3)
    assert not one.failures and len(one.results) == 6
    assert place.results("one") == place.results("many")
    run = cars.run(place.folder / "scenario.toml", robots={"*": told}, seed=1)
    assert run.summary["digest"] in place.results("one")


def test_an_edited_robot_plays_again_and_no_other(place: Place) -> None:
    made: list[str] = []

    def noted(module: ModuleType) -> type[Any]:
        told: type[Any] = module.Told

        def note(self: object) -> None:
            made.append("made")

        setattr(told, "__init__", note)
        return told

    def plays() -> int:
        """How many robots are made beside those that are made to be checked."""
        made.clear()
        place.play("edited", robots={"*": noted(place.robots())})
        return len(made)

    checks = 2 * (4 + 5)
    assert plays() == checks + 3 * 4 + 3 * 5
    assert plays() == checks
    place.write("told.py", ROBOTS.replace("c.tick == 3", "c.tick == 4"))
    assert plays() == checks + 3 * 4 + 3 * 5
    before = place.results("edited")
    place.write("told.py", ROBOTS)
    # What was played before is there.
    assert plays() == checks
    assert place.results("edited") != before


def test_a_robot_that_raises_fails_its_unit_with_the_traceback(place: Place) -> None:
    told = place.robots().Told
    settings = {"robot.S*.params.fails_at": 5, "robot.S*.params.seed": 2}
    with pytest.warns(UserWarning, match="2 units failed"):
        played = place.play("raises", robots={"*": told}, set=settings)
    assert [failure["seed"] for failure in played.failures] == [2, 2]
    for failure in played.failures:
        assert "Traceback" in failure["reason"] and failure["reason"].endswith("ValueError: no way out")
        assert "told.py" in failure["reason"]
    assert list(played.results.seed) == [1, 2, 3] * 2

    # In the first tick of all runs nothing can be played.
    with pytest.raises(cars.RefusedError, match="no way out"):
        place.play("never", robots={"*": told}, set={"robot.*.params": {"fails_at": 1, "seed": 1}})


@pytest.mark.parametrize(
    ("names", "kind", "reason"),
    [
        (["X*"], cars.UnknownRobot, r"no robot's name matches \"X\*\"; the roster is Boss, S1"),
        (["X"], cars.UnknownRobot, r"no robot is called \"X\""),
        (["S", "Boss"], cars.UnknownRobot, r"no robot is called \"S\""),
        (["S*", "*1"], cars.BadArgument, r'both "\*1" and "S\*" match S1'),
        (["S/", "Boss"], cars.BadArgument, "robots: "),
        (["Boss"], cars.RefusedError, "is of class"),
    ],
)
def test_what_makes_no_robot_is_refused(place: Place, names: list[str], kind: type[Exception], reason: str) -> None:
    told = place.robots().Told
    robots = {name: told for name in names}
    calls: list[Callable[[], object]] = [
        lambda: place.play("out", robots=robots),
        lambda: cars.run(place.folder / "scenario.toml", robots=robots),
        lambda: cars.hunt(place.folder / "scenario.toml", plans=1, robots=robots, out=place.folder / "hunt"),
    ]
    for call in calls:
        with pytest.raises(kind, match=reason):
            call()


def test_a_name_goes_before_a_pattern(place: Place) -> None:
    module = place.robots()
    run = cars.run(place.folder / "scenario.toml", robots={"*": module.Told, "Boss": module.Keeps})
    assert run.summary["robots"]["Boss"]["state_variables"]["n"] > 100
    assert run.summary["robots"]["S1"]["state_variables"]["n"] == 21


@pytest.mark.thorough
def test_a_hunt_finds_what_an_own_robot_does_not_bear(place: Place) -> None:
    told = place.robots().Told
    options: dict[str, Any] = {"plans": 256, "kinds": "lose", "seed": 3}
    found = [
        cars.hunt(place.folder / "scenario.toml", robots={"*": told}, jobs=jobs, out=place.folder / f"hunt-{jobs}", **options)
        for jobs in (1, 3)
    ]
    (finding,) = found[0].findings
    assert finding.expectation == "the boss is told" and finding.is_minimal and len(finding.faults) == 3
    assert found[1].findings[0]._replace(file=finding.file) == finding
    assert cars.run(finding.file, robots={"*": told}).verdict == "fail"
    assert "256 plans, 1 findings" in repr(found[0]) and found[0].report["gone_on"] > 0


def test_a_hunt_finds_a_robot_that_raises(place: Place) -> None:
    text = ROBOTS.replace("state = {", "1 / (2 - self.p.fails_at if c.tick == 9 and not self.told and c.name == 'Boss' else 1); state = {")
    place.write("told.py", text)
    hunted = cars.hunt(
        place.folder / "scenario.toml",
        plans=256,
        kinds="lose",
        seed=3,
        robots={"*": place.robots().Told},
        set={"robot.Boss.params": {"fails_at": 2, "seed": 99}},
        out=place.folder / "hunt",
    )
    because = {finding.expectation: finding.because for finding in hunted.findings}
    assert "ZeroDivisionError" in because["the run goes to its end"]


def test_an_own_experiment_is_played_by_its_program_only(place: Place, lab: Lab) -> None:
    place.play("own", robots={"*": place.robots().Told})
    for arguments in (["unit", "0"], ["replay", "0"]):
        command = [str(lab.programs / "cars"), "experiment", arguments[0], str(place.folder / "own"), arguments[1]]
        done = subprocess.run(command, env=environment(), capture_output=True, text=True)
        assert done.returncode == 1 and "robots of a program of its own: *" in done.stderr
    assert "does not start" in str(cars.Experiment(place.folder / "own").report())


@pytest.mark.thorough
def test_processes_play_one_unit_after_another(place: Place, programs: None) -> None:
    told = place.robots().Told
    place.play("here", robots={"*": told})
    launch = place.launch()
    place.play("reused", processes=launch, jobs=2)
    place.play("fresh", processes=launch, fresh_processes=True, jobs=2)
    assert place.results("here") == place.results("reused") == place.results("fresh")

    options: dict[str, Any] = {"plans": 8, "kinds": "lose", "seed": 3, "jobs": 2}
    here = cars.hunt(place.folder / "scenario.toml", robots={"*": told}, out=place.folder / "h", **options)
    there = cars.hunt(launch, processes=True, out=place.folder / "p", **options)
    for hunted in (here, there):
        for finding in hunted.report["findings"]:
            finding["file"] = Path(finding["file"]).name
    assert dict(here.report) == {**there.report, "scenario": here.report["scenario"]}


@pytest.mark.thorough
def test_an_edited_program_of_a_launch_file_plays_again(place: Place, programs: None) -> None:
    def units() -> int:
        place.play("edited", processes=place.launch(), jobs=1)
        return sum(len(file.read_text().splitlines()) for file in (place.folder / "edited/units").glob("*.jsonl"))

    assert [units(), units()] == [6, 6]
    place.write("told.py", ROBOTS.replace("c.tick == 3", "c.tick == 4"))
    assert [units(), units()] == [12, 12]


@pytest.mark.thorough
def test_a_robot_that_keeps_something_over_init_gets_fresh_processes(place: Place, programs: None) -> None:
    launch = place.launch("Keeps")
    with pytest.warns(UserWarning, match="keeps something over `init`"):
        place.play("reused", processes=launch, jobs=1)
    place.play("fresh", processes=launch, jobs=1, fresh_processes=True)
    assert place.results("reused") == place.results("fresh")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("how", "reason", "tick_patience"),
    [
        ("kill", "signal 9|SIGKILL|killed", None),
        # As long as no tick of the other units takes, also on a busy machine.
        ("stop", "no tick for 10 s after tick 3: Boss is gone", 10),
        ("sleep", "no tick for 10 s after tick 3: Boss is there but has not reported", 10),
        ("raise", "no way out", None),
    ],
)
def test_processes_that_fail_are_replaced(
    place: Place, programs: None, how: str, reason: str, tick_patience: float | None
) -> None:
    settings: dict[str, Any] = {"robot.Boss.params": {"fails_at": 5, "seed": 2, "how": how}}
    with pytest.warns(UserWarning, match="units failed") as warned:
        played = place.play("fails", processes=place.launch(), jobs=1, set=settings, tick_patience=tick_patience)
    assert [failure["seed"] for failure in played.failures] == [2, 2], played.failures
    assert any("2 units failed" in str(warning.message) for warning in warned)
    for failure in played.failures:
        assert re.search(reason, failure["reason"]), failure["reason"]
    well = place.play("well", processes=place.launch(), jobs=1).results
    for seed in (1, 3):
        for column in ("arm", "n", "n_state"):
            assert list(played.results[played.results.seed == seed][column]) == list(well[well.seed == seed][column])


def test_wrong_uses_of_processes_are_refused(place: Place, programs: None) -> None:
    with pytest.raises(cars.BadArgument, match="classes of this process"):
        place.play("out", robots={"*": place.robots().Told}, processes=True)
    with pytest.raises(cars.BadArgument, match="is not a launch file"):
        place.play("out", processes=place.folder / "scenario.toml")
    with pytest.raises(cars.BadArgument, match="more than 0"):
        place.play("out", processes=place.launch(), tick_patience=0)


INTERRUPTED = """
import sys
import cars
try:
    cars.experiment(sys.argv[1], out=sys.argv[2], processes=sys.argv[3], seeds=400, duration=10)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.thorough)])
def test_an_experiment_that_is_ended_leaves_no_process(place: Place, programs: None, sent: signal.Signals) -> None:
    arguments = [str(place.folder / "experiment.toml"), str(place.folder / "out"), str(place.launch())]
    temporary = place.folder / "tmp"
    temporary.mkdir()
    played = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
    )

    def units() -> int:
        return sum(len(file.read_text().splitlines()) for file in (place.folder / "out/units").glob("*.jsonl"))

    eventually("units that have been played", lambda: True if units() > 3 else None)
    played.send_signal(sent)
    printed, _ = played.communicate(timeout=60)
    if sent == signal.SIGINT:
        assert printed == "interrupted\n"
        assert '"failed"' not in "".join(file.read_text() for file in (place.folder / "out/units").glob("*.jsonl"))

    def nobody() -> bool | None:
        return None if b"".join(lines_of(str(temporary))) else True

    eventually("the last process to be gone", nobody)


def lines_of(word: str) -> list[bytes]:
    """The command lines of processes that have a word in them."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            line = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if word.encode() in line:
            found.append(line)
    return found
