"""Nodes of ROS in processes of their own: a tick ends with the declared answer, or as the scenario has it for late robots."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from lab import PATIENCE_S, Lab, assert_same, eventually
from test_ros import SCENARIO

HERE = Path(__file__).parent
ALONE = 'name = "Rosie"\nat = ["2 m", "2 m"]\nradius = "0.1 m"\n'


def started(lab: Lab, name: str, text: str, answer: str, domain: int) -> tuple[subprocess.Popen[str], subprocess.Popen[str]]:
    """The simulator, the adapter and the node."""
    run = lab.simulator(name, text, "--speed", "max")
    ros = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
    kind = "stamp" if answer == "stamp" else "count"
    node = lab.start([sys.executable, str(HERE / "ros_nodes.py"), kind], **ros)
    adapter = lab.start([sys.executable, "-m", "cars.ros", "--external", "--answer", answer, "--name", "Rosie"], **run, **ros)
    return node, adapter


def scenario(duration: str, head: str = "") -> str:
    return head + SCENARIO.replace("DURATION", duration).replace("count = 6", "count = 0") + "[[robot]]\n" + ALONE


@pytest.mark.parametrize("answer", ["stamp", pytest.param("2", marks=pytest.mark.thorough)])
def test_an_external_node_answers_each_tick(lab: Lab, answer: str) -> None:
    runs = []
    for number in range(2):
        name = f"external{number}"
        node, adapter = started(lab, name, scenario("20 s"), answer, 43)
        assert adapter.wait(PATIENCE_S) == 0, adapter.communicate()
        lab.ended(name)
        node.kill()
        node.wait()
        runs.append(lab.events(name))
        assert not lab.of_kind(name, "missed")
    assert_same(*runs)
    assert "the same" in lab.cars("verify", "external0", "--out", str(lab.folder))


@pytest.mark.thorough
def test_a_stopped_node_misses_ticks_where_the_scenario_goes_on(lab: Lab) -> None:
    node, adapter = started(lab, "stopped", scenario("400 s", 'on_late = "continue"\ndeadline = "0.2 s"\n'), "stamp", 44)
    events = lab.folder / "stopped" / "events.jsonl"

    def has(kind: str) -> bool | None:
        return (events.exists() and f'"event":"{kind}"' in events.read_text()) or None

    eventually("the robot", lambda: has("joined"))
    node.send_signal(signal.SIGSTOP)
    eventually("a missed tick", lambda: has("missed"))
    node.send_signal(signal.SIGCONT)
    adapter.wait(PATIENCE_S)
    lab.ended("stopped")
    missed = [event for event in lab.of_kind("stopped", "missed") if event["robot"] == "Rosie"]
    assert missed
    assert "the same" in lab.cars("verify", "stopped", "--out", str(lab.folder))
