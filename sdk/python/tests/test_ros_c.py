"""A node in C over rcl, in a process of its own, as a robot: compiled as the book says, and always the same run."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import missing
from lab import EXAMPLES, PATIENCE_S, ROOT, Lab, assert_same, eventually
from ros_types import DOMAIN, missing_tools
from test_ros import ROSIE, SCENARIO

import cars

pytestmark = pytest.mark.thorough

ALIVE = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
LAUNCH = """
scenario = "c.toml"
speed = 20
[[process]]
name = "Rosie"
command = ["{python}", "-m", "cars.ros", "--external", "--answer", "stamp"]
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The example, compiled by the commands of ``docs/ros.md``."""
    if lacks := missing_tools():
        missing(lacks)
    page = (ROOT / "docs" / "ros.md").read_text()
    commands = next(block for block in re.findall(r"```sh\n(.*?)```", page, re.DOTALL) if "wall_avoider.c" in block)
    commands = commands.replace('./wall_avoider --ros-args -r __ns:=/Rosie\n', '')
    shutil.copy(EXAMPLES / "wall_avoider.c", tmp_path)
    done = subprocess.run(["sh", "-ec", commands], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return tmp_path / "wall_avoider"


def test_a_node_in_c_is_a_robot_of_which_each_run_is_the_same(lab: Lab, program: Path) -> None:
    (lab.folder / "c.toml").write_text(SCENARIO.replace("DURATION", "30 s") + ROSIE)
    (lab.folder / "launch.toml").write_text(LAUNCH.format(python=sys.executable))

    def launched(run: str, is_stopped: bool = False) -> list[str]:
        node = lab.start([str(program), "--ros-args", "-r", "__ns:=/Rosie"], **ALIVE)
        out = ["--no-console", "-q", "--out", str(lab.folder), "--run", run, *(["--paused"] if is_stopped else [])]
        launch = lab.start([str(lab.programs / "cars"), "launch", str(lab.folder / "launch.toml"), *out], **ALIVE)
        if is_stopped:
            stopped(lab, run, node)
        assert launch.wait(PATIENCE_S) == 0, launch.communicate()
        assert node.poll() is None, node.communicate()
        node.kill()
        node.wait()
        return lab.events(run)

    first = launched("first")
    for run in ("second", "third"):
        assert_same(first, launched(run))
    assert_same(first, launched("stopped", is_stopped=True))
    assert "the same" in lab.cars("verify", "first", "--out", str(lab.folder))
    # It drove to the wall, and on.
    states = cars.load("first", out=lab.folder).states
    assert states["x_m"].max() > 3.5 and states["heading_rad"].max() > 1.0


def stopped(lab: Lab, run: str, node: subprocess.Popen[str]) -> None:
    """Stops the node in the middle of a run that was started paused, and lets the clock run, which stands still for a second."""
    ctl = ["--run", run, "--out", str(lab.folder)]
    lab.until_ready(*ctl)
    lab.step(20, *ctl)
    node.send_signal(signal.SIGSTOP)
    lab.cars("ctl", *ctl, "start")

    def status() -> dict[str, Any]:
        found: dict[str, Any] = json.loads(lab.cars("ctl", *ctl, "status", "--json"))
        return found

    eventually("a clock that waits", lambda: [robot["name"] for robot in status()["awaiting"]] == ["Rosie"] or None)
    before = status()["tick"]
    time.sleep(1.0)
    assert status()["tick"] == before
    node.send_signal(signal.SIGCONT)
