"""Robots in Python in real runs: beside robots in Rust, and in their place."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from lab import EXAMPLES, EXPECTS_NOTHING, PATIENCE_S, PYTHON, ROOT, Lab, assert_same

EMPTY_HALL = """
seed = 1
tick = "0.5 s"
duration = "%s"
[field]
size = ["20 m", "20 m"]
"""


def hall(*robots: str, duration: str = "100 s") -> str:
    """A scenario with nothing in it but robots."""
    places = (f'[[robot]]\nname = "{name}"\nat = ["10 m", "{3 + 2 * i} m"]\n' for i, name in enumerate(robots))
    return EMPTY_HALL % duration + "".join(places)


def test_the_launch_file_of_the_project_plays(lab: Lab) -> None:
    out = ["--no-console", "-q", "--speed", "max", "--duration", "60 s", "--out", str(lab.folder), "--run", "shipped"]
    lab.cars("launch", "launch/leguin_in_python.toml", *EXPECTS_NOTHING, *out)
    assert_same(lab.events("shipped"), lab.play("local", "hors_doeuvres.toml", "--duration", "60 s"))


def test_threads_of_the_middleware_and_start_order_change_nothing(lab: Lab) -> None:
    runs = []
    for i, runtime in enumerate(["", "(app:(worker_threads:3))"]):
        run = f"order{i}"
        at = lab.simulator(run, hall("A", "B", "C", duration="50 s"))
        groups = [["A"], ["B"], ["C"]] if i == 0 else [["C", "A"], ["B"]]
        more = {"ZENOH_RUNTIME": runtime} if runtime else {}
        arguments = [[word for name in group for word in ("--name", name)] for group in groups]
        robots = [lab.robot("walker.py", *words, **at, **more) for words in arguments]
        assert [robot.wait(PATIENCE_S) for robot in robots] == [0] * len(groups)
        lab.ended(run)
        runs.append(lab.events(run))
    assert_same(*runs)


def test_init_begins_the_same_run_anew(lab: Lab) -> None:
    at = lab.simulator("again", hall("A", "B", duration="100000 s"), "--paused")
    robots = [lab.robot("walker.py", "--name", name, **at) for name in "AB"]
    ctl = ["--run", "again", "--connect", at["CARS_CONNECT"]]
    digests = []
    for _ in range(2):
        lab.until_ready(*ctl)
        lab.step(60, *ctl)
        digests.append([event["digest"] for event in lab.of_kind("again", "tick")][-60:])
        lab.cars("ctl", *ctl, "init")
    assert digests[0] == digests[1]
    lab.cars("ctl", *ctl, "stop")
    assert [robot.wait(PATIENCE_S) for robot in robots] == [0, 0]


def test_one_who_is_killed_comes_back_and_takes_over(lab: Lab) -> None:
    scenario = (ROOT / "configs/hors_doeuvres.toml").read_text().replace('"robots/', f'"{ROOT}/configs/robots/')
    at = lab.simulator("back", scenario, "--paused", "--no-verdict")
    ctl = ["--run", "back", "--connect", at["CARS_CONNECT"]]
    butler = lab.start([str(lab.programs / "cars-butler")], **at)
    first = lab.robot("leguin.py", **at)
    lab.until_ready(*ctl)
    lab.step(300, *ctl)
    first.kill()
    second = lab.robot("leguin.py", **at)
    lab.step(300, *ctl)
    lab.cars("ctl", *ctl, "stop")
    assert (butler.wait(PATIENCE_S), second.wait(PATIENCE_S)) == (0, 0)
    lab.ended("back")
    said = [event["text"] for event in lab.of_kind("back", "say") if event["robot"] == "Leguin"]
    assert "is back, and takes over where the last one was lost" in said


def status(lab: Lab, program: list[str], *arguments: str, **more: str) -> int:
    """The exit status of a program that ends by itself."""
    return lab.start([*program, *arguments], **more).wait(PATIENCE_S)


@pytest.mark.thorough
def test_exit_statuses_are_those_of_robots_in_rust(lab: Lab) -> None:
    at = lab.simulator("taken", hall("Butler", "Leguin"), "--paused") | {"CARS_PATIENCE_S": "0.4"}
    nobody = {"CARS_CONNECT": "tcp/127.0.0.1:1", "CARS_PATIENCE_S": "0.3"}
    python = [sys.executable, str(EXAMPLES / "leguin.py")]
    rust = [str(lab.programs / "cars-leguin")]
    for arguments, more in [
        (["--help"], {}),
        (["--version"], {}),
        (["--nonsense"], {}),
        (["--name", "a/b"], {}),
        (["--patience-s", "soon"], {}),
        ([], {"CARS_RUN": "a b"}),
        ([], nobody),
        (["--name", "Vera"], at),
        (["--run", "another"], at),
    ]:
        expected = status(lab, rust, *arguments, **more)
        assert status(lab, python, *arguments, **more) == expected, (arguments, more)


def test_a_robot_that_refuses_its_parameters_says_which(lab: Lab) -> None:
    scenario = hall("Leguin") + "params = { cautoin = 1 }\n"
    robot = lab.robot("leguin.py", **lab.simulator("params", scenario))
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1
    assert said.startswith("error: parameters of Leguin: unknown parameter cautoin; known are waiter, goods")


def test_waiting_costs_nothing(lab: Lab) -> None:
    at = lab.simulator("held", hall("Walker"), "--paused")
    robot = lab.robot("walker.py", **at)
    ctl = ["--run", "held", "--connect", at["CARS_CONNECT"]]
    lab.until_ready(*ctl)

    def switches() -> int:
        """How often its threads were put to sleep so far."""
        tasks = Path(f"/proc/{robot.pid}/task").glob("*/status")
        return sum(
            int(line.split()[1])
            for task in tasks
            for line in task.read_text().splitlines()
            if line.startswith("voluntary_ctxt_switches")
        )

    before = switches()
    # Two seconds of a run that somebody else observes: a poller would have woken up hundreds of times.
    for _ in range(20):
        subprocess.run(["sleep", "0.1"], check=True)
    assert switches() - before < 200
    robot.send_signal(signal.SIGTERM)
    assert robot.wait(PATIENCE_S) == -signal.SIGTERM


def test_a_secured_run_takes_a_robot_with_its_certificate(lab: Lab) -> None:
    folder = str(lab.folder / "certificates")
    lab.cars("secure", "init", folder, "--robots", "Butler,Leguin")
    team = {name: PYTHON[name] for name in ("Butler", "Leguin")}
    secured = lab.launch("secured", "hors_doeuvres.toml", team, "--secure", folder, "--duration", "60 s")
    assert_same(secured, lab.play("local", "hors_doeuvres.toml", "--duration", "60 s"))


def test_an_encrypted_endpoint_wants_a_certificate(lab: Lab) -> None:
    robot = lab.robot("walker.py", "--name", "A", "--connect", "tls/127.0.0.1:1")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1 and "wants a certificate: name a file zenoh.json5" in said


@pytest.mark.thorough
def test_the_kit_finds_no_fault(lab: Lab) -> None:
    """Every rule of docs/protocol.md, as `cars conform` checks it."""
    echo = Path(__file__).with_name("echo.py")
    found = lab.cars("conform", "--say", "hello", "--say", "world", "--", sys.executable, str(echo))
    assert "not ok" not in found and "# SKIP" not in found and found.count("\nok ") >= 28, found


@pytest.mark.thorough
def test_the_kit_finds_no_fault_in_plain_zenoh(lab: Lab) -> None:
    """The example of the page, over zenoh's own bindings. It asks nobody and commands nobody."""
    example = [sys.executable, str(EXAMPLES / "plain_zenoh.py")]
    found = lab.cars("conform", "--name", "Walker", "--say", "turn", "--", *example)
    assert "not ok" not in found and found.count("\nok ") >= 28, found


@pytest.mark.thorough
def test_the_benchmark_measures(lab: Lab) -> None:
    bench = [sys.executable, str(ROOT / "sdk/python/bench.py"), "--rounds", "1", "--robots", "2", "--ticks", "400"]
    measured = lab.start(bench, CARS_BIN_DIR=str(lab.programs))
    printed, said = measured.communicate(timeout=PATIENCE_S)
    assert measured.returncode == 0, said
    assert [line.split()[1] for line in printed.splitlines()[1:]] == ["Python,", "Rust,", "Python,"]


def test_the_summary_names_the_state_variables(lab: Lab) -> None:
    robot = lab.robot("walker.py", **lab.simulator("sum", hall("Walker")))
    assert robot.wait(PATIENCE_S) == 0
    lab.ended("sum")
    summary = json.loads((lab.folder / "sum" / "summary.json").read_text())
    assert summary["robots"]["Walker"]["state_variables"]["steps"] > 100
    assert os.path.getsize(lab.folder / "sum" / "events.jsonl") > 0
