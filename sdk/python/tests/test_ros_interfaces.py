"""What the bridge does where packages are installed of which there is no wheel: transforms, and services of simulation_interfaces.

The packages are made here, from their definitions.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import missing
from lab import Lab, eventually
from nav_msgs.msg import Odometry
from ros_types import build, missing_tools
from test_ros_bridge import ALIVE, SCENARIO, Other, alive, time_ns

import cars
from cars.ros import _interfaces

pytestmark = pytest.mark.thorough

TF = {"msg/TFMessage.msg": "geometry_msgs/TransformStamped[] transforms"}
"""tf2_msgs/TFMessage of ros2/geometry2."""
STANDARD = {
    "msg/Bounds.msg": "uint8 TYPE_EMPTY=0\nuint8 TYPE_SPHERE=3\nuint8 type\ngeometry_msgs/Vector3[] points",
    "msg/EntityCategory.msg": "uint8 CATEGORY_ROBOT=1\nuint8 category",
    "msg/TagsFilter.msg": "string[] tags\nuint8 filter_mode",
    "msg/EntityFilters.msg": "string filter\nEntityCategory[] categories\nTagsFilter tags\nBounds bounds",
    "msg/EntityState.msg": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\ngeometry_msgs/Accel acceleration"
    ),
    "msg/Result.msg": (
        "uint8 RESULT_FEATURE_UNSUPPORTED=0\nuint8 RESULT_OK=1\nuint8 RESULT_NOT_FOUND=2\nuint8 RESULT_INCORRECT_STATE=3\n"
        "uint8 RESULT_OPERATION_FAILED=4\nuint8 result\nstring error_message"
    ),
    "msg/SimulationState.msg": (
        "uint8 STATE_STOPPED=0\nuint8 STATE_PLAYING=1\nuint8 STATE_PAUSED=2\nuint8 STATE_QUITTING=3\n"
        "uint8 STATE_NO_WORLD=4\nuint8 state"
    ),
    "msg/SimulatorFeatures.msg": (
        "uint8 ENTITY_STATE_GETTING=10\nuint8 SIMULATION_RESET=20\nuint8 SIMULATION_STATE_GETTING=24\n"
        "uint8 SIMULATION_STATE_SETTING=25\nuint8 SIMULATION_STATE_PAUSE=26\nuint8 STEP_SIMULATION_SINGLE=31\n"
        "uint8 STEP_SIMULATION_MULTIPLE=32\nuint16[] features\nstring[] spawn_formats\nstring custom_info"
    ),
    "srv/GetSimulatorFeatures.srv": "---\nSimulatorFeatures features",
    "srv/GetSimulationState.srv": "---\nSimulationState state\nResult result",
    "srv/SetSimulationState.srv": (
        "SimulationState state\n---\nuint8 ALREADY_IN_TARGET_STATE=101\nuint8 STATE_TRANSITION_ERROR=102\n"
        "uint8 INCORRECT_TRANSITION=103\nResult result"
    ),
    "srv/StepSimulation.srv": "uint64 steps 1\n---\nResult result",
    "srv/ResetSimulation.srv": (
        "uint8 SCOPE_DEFAULT=0\nuint8 SCOPE_TIME=1\nuint8 SCOPE_STATE=2\nuint8 SCOPE_SPAWNED=4\nuint8 SCOPE_ALL=255\n"
        "uint8 scope\n---\nResult result"
    ),
    "srv/GetEntities.srv": "EntityFilters filters\n---\nResult result\nstring[] entities",
    "srv/GetEntityState.srv": "string entity\n---\nResult result\nEntityState state",
    "srv/GetEntitiesStates.srv": "EntityFilters filters\n---\nResult result\nstring[] entities\nEntityState[] states",
}
"""What is served here of version 2.1.0 of simulation_interfaces (github.com/ros-simulation/simulation_interfaces), fields and
constants in their order: messages of the whole package are the same on the wire."""
WHEELS = """
[[robot]]
name = "Wheels"
at = ["7.4 m", "3 m"]
radius = "0.2 m"
drive = { max_speed = "0.8 m/s", max_turn = "90 deg/s" }
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with both packages, which this process can import as well."""
    if lacks := missing_tools():
        missing(lacks)
    folder = tmp_path_factory.mktemp("made")
    build(folder, "tf2_msgs", TF)
    build(folder, "simulation_interfaces", STANDARD)
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> Iterator[Other]:
    yield from alive(monkeypatch)


@pytest.fixture
def bridged(lab: Lab, made: Path) -> tuple[str, subprocess.Popen[str]]:
    """A run in progress, paused at tick 0, with its bridge; its name, and one of its robots."""
    run = lab.simulator("made", SCENARIO + WHEELS, "--speed", "max", "--paused")
    walker = lab.robot("walker.py", "--name", "walker-1", **run)
    lab.start([sys.executable, str(Path(__file__).with_name("rover.py")), "--name", "Wheels"], **run)
    lab.until_ready("--run", "made", "--connect", run["CARS_CONNECT"])
    path = os.pathsep.join(filter(None, [str(made), os.environ.get("PYTHONPATH")]))
    lab.start([str(lab.programs / "cars"), "ros", "bridge"], PYTHONPATH=path, **run, **ALIVE)
    return "made", walker


class Standard:
    """A client of simulation_interfaces."""

    def __init__(self, other: Other) -> None:
        self.other = other
        self.msg: Any = importlib.import_module("simulation_interfaces.msg")
        self.srv: Any = importlib.import_module("simulation_interfaces.srv")

    def call(self, name: str, **fields: Any) -> Any:
        return self.other.done(self.asked(name, **fields))

    def asked(self, name: str, **fields: Any) -> Any:
        kind = getattr(self.srv, name)
        topic = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
        client = self.other.node.create_client(kind, f"/{topic}")
        self.other.until(topic, lambda: client.service_is_ready() or None)
        return client.call_async(kind.Request(**fields))

    def result(self, name: str, **fields: Any) -> int:
        return int(self.call(name, **fields).result.result)

    def set_state(self, state: int) -> int:
        return self.result("SetSimulationState", state=self.msg.SimulationState(state=state))

    def state(self) -> int:
        return int(self.call("GetSimulationState").state.state)


def test_transforms_are_those_of_the_record(lab: Lab, other: Other, bridged: tuple[str, subprocess.Popen[str]]) -> None:
    run, _ = bridged
    seen: list[Any] = []
    other.node.create_subscription(importlib.import_module("tf2_msgs.msg").TFMessage, "/tf", seen.append, 100)
    odometries: list[Any] = []
    other.node.create_subscription(Odometry, "/Wheels/odom", odometries.append, 100)
    clock = other.seen["/clock"]
    other.until("transforms", lambda: other.call("get_state")[0] and seen or None)
    for tick in range(1, 41):
        assert other.call("step")[0]
        at_ns = tick * 500_000_000
        other.until("the clock", lambda at_ns=at_ns: time_ns(clock) == at_ns or None)
    # Frames are put when a control was answered, too.
    standard = Standard(other)
    assert other.call("pause")[0]
    assert standard.set_state(standard.msg.SimulationState.STATE_QUITTING) == standard.msg.Result.RESULT_OK
    lab.ended(run)
    other.until("the last transforms", lambda: seen[-1].transforms[0].header.stamp.sec == 20 or None)

    states = cars.load(run, out=lab.folder).frames("pandas").states
    rows = {(row.robot, round(row.time_s * 1e9)): row for row in states.itertuples()}
    names = {"walker_1/base_link": "walker-1", "Wheels/base_link": "Wheels"}
    stamps = []
    for message in seen:
        assert sorted(one.child_frame_id for one in message.transforms) == sorted(names)
        for one in message.transforms:
            at_ns = one.header.stamp.sec * 10**9 + one.header.stamp.nanosec
            row = rows[names[one.child_frame_id], at_ns]
            assert one.header.frame_id == "map"
            assert (one.transform.translation.x, one.transform.translation.y) == (row.x_m, row.y_m)
            turn = one.transform.rotation
            is_driving = names[one.child_frame_id] == "Wheels"
            heading_rad = row.heading_rad if is_driving else row.direction_rad
            assert math.isclose(2.0 * math.atan2(turn.z, turn.w), heading_rad, abs_tol=1e-9)
            assert (turn.x, turn.y) == (0.0, 0.0) and math.isclose(math.hypot(turn.z, turn.w), 1.0, rel_tol=1e-11)
        stamps.append(at_ns)
    # Each tick once: a listener warns of stamps that it has already.
    assert stamps == [tick * 500_000_000 for tick in range(stamps[0] // 500_000_000, 41)] and len(stamps) >= 40

    # A velocity is that of the robot's frame. It drove ahead, and backwards where it was blocked.
    for odometry in odometries:
        row = rows["Wheels", odometry.header.stamp.sec * 10**9 + odometry.header.stamp.nanosec]
        linear = odometry.twist.twist.linear
        assert math.isclose(linear.x, row.speed_mps * math.cos(row.direction_rad - row.heading_rad), abs_tol=1e-9)
    speeds = [odometry.twist.twist.linear.x for odometry in odometries]
    assert min(speeds) < -0.1 and max(speeds) > 0.1


def test_a_run_is_controlled_by_the_standard(lab: Lab, other: Other, bridged: tuple[str, subprocess.Popen[str]]) -> None:
    run, walker = bridged
    standard = Standard(other)
    states, results = standard.msg.SimulationState, standard.msg.Result
    features = standard.call("GetSimulatorFeatures").features
    assert list(features.features) == [getattr(standard.msg.SimulatorFeatures, name) for name in _interfaces.FEATURES]

    def clock_ns() -> int:
        state = standard.call("GetEntityState", entity="Wheels").state
        assert state.header.frame_id == "map"
        return int(state.header.stamp.sec * 10**9 + state.header.stamp.nanosec)

    # Set to what it is, from each side.
    assert standard.state() == states.STATE_STOPPED and clock_ns() == 0
    assert standard.set_state(states.STATE_STOPPED) == 101
    assert standard.set_state(states.STATE_PAUSED) == results.RESULT_OK
    assert standard.state() == states.STATE_PAUSED
    assert standard.set_state(states.STATE_PAUSED) == 101
    assert standard.set_state(states.STATE_NO_WORLD) == results.RESULT_FEATURE_UNSUPPORTED

    # Steps are exact, and the state is that after the step when it is answered.
    at_tick = 0
    for steps in (1, 7, 30):
        assert standard.result("StepSimulation", steps=steps) == results.RESULT_OK
        at_tick += steps
        assert clock_ns() == at_tick * 500_000_000 and standard.state() == states.STATE_PAUSED
    for steps in (0, 1_000_001, 2**64 - 1):
        answer = standard.call("StepSimulation", steps=steps).result
        assert answer.result == results.RESULT_OPERATION_FAILED and "1 to 1000000" in answer.error_message
    assert clock_ns() == at_tick * 500_000_000

    # Entities.
    filters = standard.msg.EntityFilters
    everything = ["Wheels", "walker_1", "guest_0", "guest_1", "guest_2"]
    found = standard.call("GetEntities")
    assert sorted(found.entities) == sorted(everything) and found.result.result == results.RESULT_OK
    found = standard.call("GetEntitiesStates", filters=filters(filter="^guest_[01]$"))
    assert found.entities == ["guest_0", "guest_1"] and len(found.states) == 2
    assert standard.call("GetEntities", filters=filters(filter="nobody")).entities == []
    assert standard.result("GetEntities", filters=filters(filter="(")) == results.RESULT_OPERATION_FAILED
    for unsupported in (
        filters(categories=[standard.msg.EntityCategory()]),
        filters(tags=standard.msg.TagsFilter(tags=["any"])),
        filters(bounds=standard.msg.Bounds(type=3)),
    ):
        assert standard.result("GetEntitiesStates", filters=unsupported) == results.RESULT_FEATURE_UNSUPPORTED
    answer = standard.call("GetEntityState", entity="nobody").result
    assert answer.result == results.RESULT_NOT_FOUND and "nobody" in answer.error_message

    # Playing.
    assert standard.set_state(states.STATE_STOPPED) == results.RESULT_OK
    assert standard.state() == states.STATE_STOPPED and clock_ns() == 0
    assert standard.call("GetEntityState", entity="walker_1").state.pose.position.x == 2.0
    lab.cars("ctl", "--run", run, "--out", str(lab.folder), "speed", "2")
    assert standard.set_state(states.STATE_PLAYING) == results.RESULT_OK
    assert standard.state() == states.STATE_PLAYING
    assert standard.set_state(states.STATE_PLAYING) == 101
    answer = standard.call("StepSimulation", steps=1).result
    assert answer.result == results.RESULT_OPERATION_FAILED and "pause it to step" in answer.error_message
    eventually("a tick", lambda: clock_ns() or None)
    assert standard.set_state(states.STATE_PAUSED) == results.RESULT_OK

    # Reset.
    scopes = standard.srv.ResetSimulation.Request
    assert standard.result("ResetSimulation", scope=scopes.SCOPE_TIME) == results.RESULT_FEATURE_UNSUPPORTED
    assert clock_ns() > 0
    assert standard.result("ResetSimulation", scope=scopes.SCOPE_ALL) == results.RESULT_OK
    assert clock_ns() == 0

    # A step that hangs, because a robot does, is paused; meanwhile the others are answered.
    walker.send_signal(signal.SIGSTOP)
    step = standard.asked("StepSimulation", steps=50)
    other.until("a step", lambda: json.loads(other.call("get_state")[1])["awaiting"] or None)
    assert standard.state() == states.STATE_PAUSED and not step.done()
    assert other.call("pause")[0]
    answer = other.done(step).result
    assert answer.result == results.RESULT_OPERATION_FAILED and "0 of 50 ticks" in answer.error_message
    walker.send_signal(signal.SIGCONT)
    assert standard.result("ResetSimulation") == results.RESULT_OK

    # More steps than there are left.
    answer = standard.call("StepSimulation", steps=500).result
    assert answer.result == results.RESULT_OPERATION_FAILED and "200 of 500 ticks" in answer.error_message
    lab.ended(run)
    answer = standard.call("GetSimulationState").result
    assert answer.result == results.RESULT_OPERATION_FAILED and run in answer.error_message
