"""A run in progress as ROS sees it: what the bridge publishes, and what it serves."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from lab import PATIENCE_S, Lab, eventually

for module in ("rclpy", "std_srvs", "zenoh"):
    if importlib.util.find_spec(module) is None:
        text = f"there is no {module}: `pip install 'cars-simulator[ros]'`"
        if os.environ.get("CI"):
            pytest.fail(text, pytrace=False)
        pytest.skip(text, allow_module_level=True)

os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from ros_types import DOMAIN
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

SCENARIO = """
tick = "0.5 s"
duration = "100 s"
[field]
size = ["8 m", "7 m"]
[guests]
count = 3
[[robot]]
name = "walker-1"
at = ["2 m", "2 m"]
"""
ALIVE = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


class Other:
    """A node in this process that knows nothing of CARS."""

    def __init__(self) -> None:
        self.context = Context()
        self.context.init([], domain_id=DOMAIN)
        self.node: Any = Node("other", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.seen: dict[str, list[Any]] = {}
        for topic, kind in {"/clock": Clock, "/walker_1/odom": Odometry, "/guests": PoseArray}.items():
            self.node.create_subscription(kind, topic, self.seen.setdefault(topic, []).append, 100)

    def until(self, what: str, ready: Any) -> Any:
        """Spins until something is there."""

        def spun() -> Any:
            self.executor.spin_once(timeout_sec=0.05)
            return ready()

        return eventually(what, spun)

    def done(self, future: Any) -> Any:
        return self.until("an answer", lambda: future.result() if future.done() else None)

    def call(self, name: str) -> tuple[bool, Any]:
        client = self.node.create_client(Trigger, f"/cars/{name}")
        assert client.wait_for_service(PATIENCE_S)
        answer = self.done(client.call_async(Trigger.Request()))
        return answer.success, answer.message


def alive(monkeypatch: pytest.MonkeyPatch) -> Iterator[Other]:
    """Such a node in the domain of this process, as long as a test takes."""
    for name, value in ALIVE.items():
        monkeypatch.setenv(name, value)
    made = Other()
    yield made
    made.executor.shutdown()
    made.node.destroy_node()
    made.context.try_shutdown()


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> Iterator[Other]:
    yield from alive(monkeypatch)


def test_a_step_is_exactly_so_many_ticks(lab: Lab, other: Other) -> None:
    run = lab.simulator("bridged", SCENARIO, "--speed", "max", "--paused")
    lab.robot("walker.py", "--name", "walker-1", **run)
    lab.until_ready("--run", "bridged", "--connect", run["CARS_CONNECT"])
    lab.start([str(lab.programs / "cars"), "ros", "bridge"], **run, **ALIVE)

    def tick() -> int:
        done, status = other.call("get_state")
        assert done, status
        found: int = json.loads(status)["tick"]
        return found

    before = tick()
    for steps in (1, 7, 30):
        parameters = AsyncParameterClient(other.node, "/cars")
        other.done(parameters.set_parameters([Parameter("steps", value=steps)]))
        other.seen["/clock"].clear()
        done, status = other.call("step")
        assert done, status
        assert json.loads(status)["tick"] == before + steps == tick()
        before += steps
        at_ns = before * 500_000_000
        other.until("the last frame", lambda at_ns=at_ns: time_ns(other.seen["/clock"]) == at_ns or None)
    other.until("odometry", lambda: other.seen["/walker_1/odom"] or None)
    odometry = other.seen["/walker_1/odom"][-1]
    assert odometry.child_frame_id == "walker_1/base_link" and odometry.pose.pose.position.x > 2.0
    assert len(other.seen["/guests"][-1].poses) == 3
    done, text = other.call("get_entities")
    entities = json.loads(text)
    assert done and entities["tick"] == before
    assert [entity["name"] for entity in entities["entities"]] == ["walker_1", "guest_0", "guest_1", "guest_2"]
    assert entities["entities"][0]["x"] == odometry.pose.pose.position.x
    done, text = other.call("get_features")
    assert done and "STEP_SIMULATION_MULTIPLE" in json.loads(text)["features"]

    done, status = other.call("reset")
    assert done and json.loads(status)["epoch"] == 2
    # Its robots have joined, so it can be stepped at once: the loop of a learner.
    done, status = other.call("step")
    assert done, status
    assert other.call("stop")[0]
    lab.ended("bridged")


@pytest.mark.thorough
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_during_a_long_step_a_run_is_paused_and_a_bridge_ends(lab: Lab, other: Other, end: signal.Signals) -> None:
    endless = SCENARIO.replace("100 s", "10000000 s")
    run = lab.simulator("long", endless, "--speed", "max", "--paused")
    lab.robot("walker.py", "--name", "walker-1", **run)
    lab.until_ready("--run", "long", "--connect", run["CARS_CONNECT"])
    bridge = lab.start([str(lab.programs / "cars"), "ros", "bridge"], **run, **ALIVE)
    parameters = AsyncParameterClient(other.node, "/cars")
    assert parameters.wait_for_services(PATIENCE_S)

    def set_steps(steps: int) -> None:
        other.done(parameters.set_parameters([Parameter("steps", value=steps)]))

    def begin_step() -> Any:
        before = json.loads(other.call("get_state")[1])["tick"]
        client = other.node.create_client(Trigger, "/cars/step")
        assert client.wait_for_service(PATIENCE_S)
        answer = client.call_async(Trigger.Request())
        other.until("a tick of the step", lambda: json.loads(other.call("get_state")[1])["tick"] > before or None)
        return answer

    set_steps(1_000_000)
    answer = begin_step()
    assert other.call("pause")[0]
    assert json.loads(other.done(answer).message)["tick"] < 1_000_000
    begin_step()
    bridge.send_signal(end)
    bridge.communicate(timeout=PATIENCE_S)


def time_ns(clocks: list[Any]) -> int:
    return clocks[-1].clock.sec * 10**9 + int(clocks[-1].clock.nanosec) if clocks else -1


@pytest.mark.thorough
def test_a_bridge_without_ros_or_a_run_says_what_to_do(lab: Lab, tmp_path: Path) -> None:
    def said(**more: str) -> str:
        bridge = lab.start([str(lab.programs / "cars"), "ros", "bridge", "--out", str(tmp_path)], **more)
        _, errors = bridge.communicate(timeout=PATIENCE_S)
        assert bridge.returncode != 0
        return errors

    # A Python that finds no rclpy.
    (tmp_path / "rclpy.py").write_text("raise ImportError('no rclpy here')")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    run = {"CARS_RUN": "none", "CARS_CONNECT": "tcp/127.0.0.1:1"}
    errors = said(PYTHONPATH=path, **run)
    assert "no rclpy here" in errors and "pip install 'cars-simulator[ros]'" in errors
    assert "there is no simulator at tcp/127.0.0.1:1" in said(**run)
    assert "is not in progress" in said(CARS_RUN="none")
