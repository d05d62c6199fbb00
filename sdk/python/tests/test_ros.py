"""Nodes of ROS 2 as robots: the same run in one process, as programs and under load; what nodes do wrong."""

from __future__ import annotations

import _thread
import functools
import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from lab import EXPECTS_NOTHING, PATIENCE_S, Lab, assert_same, eventually

import cars

if importlib.util.find_spec("rclpy") is None:
    if os.environ.get("CI"):
        pytest.fail("there is no rclpy: `pip install 'cars-simulator[ros]'`", pytrace=False)
    pytest.skip("there is no rclpy: `pip install 'cars-simulator[ros]'`", allow_module_level=True)

import rclpy
import rclpy.context
import rclpy.executors
import ros_nodes
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rover import Rover
from std_msgs.msg import Int32, String

from cars import Action, Cars, Robot
from cars.ros import RosError, node

HERE = Path(__file__).parent
RUNS = int(os.environ.get("ROS_RUNS", "30"))
"""Runs that are compared; before a release 100."""
SCENARIO = """
seed = 5
tick = "0.25 s"
duration = "DURATION"
[field]
size = ["8 m", "7 m"]
max_speed = "2 m/s"
[guests]
count = 6
[sensing]
range = "3 m"
rays = { count = 36, range = "3 m" }
[[wall]]
points = [["4 m", "0 m"], ["4 m", "3 m"]]
"""
ROSIE = """
[[robot]]
name = "Rosie"
at = ["2 m", "2 m"]
radius = "0.2 m"
drive = { max_speed = "0.8 m/s", max_turn = "90 deg/s", max_acceleration = "1 m/s2" }
"""
GOER = '[[robot]]\nname = "go-2"\nat = ["6 m", "2 m"]\nradius = "0.1 m"\n'
CHATTY = '[[robot]]\nname = "Chatty"\nat = ["2 m", "5 m"]\n'
LINES = '[[robot]]\nname = "Lines"\nat = ["6 m", "6 m"]\ndrive = {}\n'
RUST = '[[robot]]\nname = "Rust"\nat = ["7 m", "6 m"]\nradius = "0.1 m"\ndrive = {}\n'
PYTHON = '[[robot]]\nname = "Python"\nat = ["1 m", "6 m"]\ndrive = {}\n'


def scenario(folder: Path, *robots: str, duration: str = "30 s") -> Path:
    file = folder / "ros.toml"
    file.write_text(SCENARIO.replace("DURATION", duration) + "".join(robots))
    return file


def command(of: str, *more: str) -> list[str]:
    return [sys.executable, "-m", "cars.ros", f"ros_nodes:{of}", *more]


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> str:
    """Processes find the nodes of these tests."""
    path = os.pathsep.join(filter(None, [str(HERE), os.environ.get("PYTHONPATH")]))
    monkeypatch.setenv("PYTHONPATH", path)
    return path


@pytest.mark.thorough
def test_the_same_run_in_one_process_and_in_a_mixed_launch(lab: Lab, tmp_path: Path, found: str) -> None:
    file = scenario(tmp_path, ROSIE, GOER, LINES, PYTHON, RUST)
    rust = lab.programs / "rover"
    commands = {
        "Rosie": command("WallAvoider"),
        "go-2": command("GoToGoal"),
        "Lines": [str(lab.programs / "cars"), "exec", "--", str(HERE / "rover_lines.py")],
        "Python": [str(HERE / "rover.py")],
        # The programs of the project have it only where they are built for tests.
        "Rust": [str(rust if rust.exists() else HERE / "rover.py")],
    }
    processes = [f'[[process]]\nname = "{name}"\ncommand = {words}\n' for name, words in commands.items()]
    launch_file = tmp_path / "launch.toml"
    launch_file.write_text(f'scenario = "{file}"\nspeed = "max"\n' + "".join(processes))
    out = ("--out", str(lab.folder))
    lab.cars("launch", str(launch_file), "--no-console", "-q", *out, *EXPECTS_NOTHING, "--run", "launched")

    nodes = {"Rosie": node(ros_nodes.WallAvoider), "go-2": node("ros_nodes:GoToGoal")}
    robots = nodes | dict.fromkeys(("Lines", "Python", "Rust"), Rover)
    own = cars.run(file, robots=robots, out=lab.folder, name="own")
    assert_same(lab.events("launched"), lab.events("own"))
    # They do what they are there for.
    states = own.states
    assert "HAPPY" in set(states[states.robot == "go-2"].emotion)
    rosie = states[states.robot == "Rosie"]
    assert rosie.heading_rad.nunique() > 5 and rosie.x_m.nunique() > 20
    for run in ("launched", "own"):
        assert "the same" in lab.cars("verify", run, *out)


def test_a_tick_ends_when_everything_is_handled(lab: Lab, tmp_path: Path) -> None:
    file = scenario(tmp_path, CHATTY, GOER, duration="10 s")
    run = cars.run(file, robots={"Chatty": node(ros_nodes.Chatty), "go-2": Greeter}, out=lab.folder, name="chatty")
    # 41 ticks with 100 messages to itself in each; a timer of 1 s; commands of each tick but the last, one tick later.
    last = run.summary["robots"]["Chatty"]["state_variables"]
    assert (last["odoms"], last["inners"], last["fired"]) == (41, 4100, 10)
    assert 30 < last["commands"] <= 41
    sent = [event for event in lab.of_kind("chatty", "command_sent") if event["command"] == "hello"]
    assert [event["payload"]["n"] for event in sent] == list(range(1, 11))


class Greeter(Robot):
    """Sends a command in each tick."""

    def tick(self, cars: Cars) -> Action:
        cars.send("Chatty", "hi")
        return Action.stay(cars)


def one(folder: Path, kind: Any, robot: str = ROSIE, **options: Any) -> cars.Run:
    """A run of a single robot."""
    name = "Rosie" if "Rosie" in robot else "go-2"
    file = scenario(folder, robot, duration="5 s")
    file.write_text(file.read_text().replace("count = 6", "count = 0"))
    return cars.run(file, robots={name: node(kind, **options)}, out=folder, replace=True, name="one")


def publishing(**numbers: float) -> type:
    """A node that publishes one velocity when its first odometry is there."""

    class Publishing(ros_nodes.GoToGoal):
        def on_odom(self, odom: Any) -> None:
            if self.pose is None:
                super().on_odom(odom)
                twist = Twist()
                twist.linear.x = numbers.get("x", 0.0)
                twist.linear.y = numbers.get("y", 0.0)
                twist.angular.z = numbers.get("turn", 0.0)
                self.publisher.publish(twist)

        def on_timer(self) -> None:
            pass

    return Publishing


def ends(run: cars.Run) -> tuple[float, float]:
    last = run.states[run.states.tick == 20].iloc[0]
    return float(last.x_m), float(last.y_m)


def test_velocities_move_robots_with_and_without_wheels(tmp_path: Path) -> None:
    # It goes on with the last velocity; sideways only without wheels. It starts at (6, 2), after the first tick.
    x, y = ends(one(tmp_path, publishing(x=-0.2, y=0.4), GOER))
    assert (round(x, 6), round(y, 6)) == (5.0, 4.0)
    x, y = ends(one(tmp_path, publishing(x=0.1, y=0.4)))
    assert y == 2.0 and 2.4 < x < 2.5
    # A quarter of a circle that closes: 1 rad/s, and 0.2 m of radius.
    x, y = ends(one(tmp_path, publishing(x=0.2, turn=1.0), GOER))
    assert abs(x - 6.0) < 0.45 and abs(y - 2.0) < 0.45
    # It stops when nothing follows for a second: four ticks.
    x, y = ends(one(tmp_path, publishing(y=0.4), GOER, cmd_vel_timeout_s=1.0))
    assert round(y, 6) == 2.4
    # Out of all reason, and still a velocity.
    for huge in (1e300, -1e300):
        one(tmp_path, publishing(x=huge, turn=huge))
        one(tmp_path, publishing(x=huge, turn=huge), GOER)


def test_what_nodes_do_wrong_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Each of them takes a while: fewer, and more than any other node here has in a tick.
    monkeypatch.setattr(cars.ros._spin, "MAX_CALLBACKS", 500)
    base = ros_nodes.GoToGoal

    class Threads(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            # It would have ended when the callback returns.
            thread = threading.Thread(target=bool, name="mine")
            thread.start()
            thread.join()

    class RawThreads(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            _thread.start_new_thread(bool, ())

    class SteadyTimer(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            self.create_timer(0.001, bool, clock=Clock(clock_type=ClockType.STEADY_TIME))

    class Sleeps(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            self.get_clock().sleep_for(Duration(seconds=0.1))

    class SleepsAtARate(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            self.create_rate(10.0).sleep()

    class WallClock(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            self.set_parameters([Parameter("use_sim_time", value=False)])

    class TwoTypes(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("two")
            self.create_publisher(Twist, "cmd_vel", 10)
            self.create_publisher(TwistStamped, "cmd_vel", 10)

    class Exits(base):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            raise SystemExit(3)

    class Endless(base):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            super().__init__()
            self.loop = self.create_publisher(String, "loop", 10)
            self.create_subscription(String, "loop", self.loop.publish, 10)

        def on_timer(self) -> None:
            self.loop.publish(String(data="again"))

    class Raises(base):  # type: ignore[valid-type, misc]
        def on_timer(self) -> None:
            raise LookupError("lost my way")

    class WrongType(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("wrong")
            self.create_publisher(Int32, "cmd_vel", 10)

    class NoJson(base):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            super().__init__()
            self.send = self.create_publisher(String, "send", 10)

        def on_timer(self) -> None:
            self.send.publish(String(data="refill"))

    for kind, error, what in [
        (Threads, RosError, r"starts a thread \(mine\).*Use a timer"),
        (RawThreads, RosError, r"starts a thread \(without a name\).*Use a timer"),
        (SteadyTimer, RosError, "a timer of the clock STEADY_TIME, which goes on by itself"),
        (Sleeps, RosError, "the node sleeps in a callback"),
        (SleepsAtARate, RosError, "the node sleeps at a rate in a callback"),
        (WallClock, RosError, "the node of Rosie has set use_sim_time to false"),
        (TwoTypes, RosError, "publishes TwistStamped on /Rosie/cmd_vel; what is read there is Twist: remap"),
        (Exits, RosError, "the node ended with exit status 3"),
        (Raises, LookupError, "lost my way"),
        (Endless, RosError, "500 callbacks in a tick, and was not idle"),
        (WrongType, RosError, "publishes Int32 on /Rosie/cmd_vel; what is read there is Twist or TwistStamped"),
        (NoJson, RosError, "Rosie: its node published on send what is no JSON"),
        (publishing(x=float("nan")), RosError, "Rosie: .* not finite"),
        (publishing(turn=float("inf")), RosError, "Rosie: .* not finite"),
    ]:
        with pytest.raises(error, match=what):
            one(tmp_path, kind)
    with pytest.raises(RosError, match="subscribes to a scan, and the scenario has no rays"):
        file = tmp_path / "no_rays.toml"
        file.write_text(SCENARIO.replace("DURATION", "5 s").replace("rays =", "# rays =") + ROSIE)
        cars.run(file, robots={"Rosie": node(ros_nodes.WallAvoider)}, out=tmp_path)

    for of, what in [
        ("ros_nodes", "names no node: write the module, a colon and the class"),
        ("ros_nodes:main", "a function such as main.. spins its node by itself"),
        ("ros_nodes:Wall", "has no 'Wall'; its classes are WallAvoider, GoToGoal, Chatty"),
        ("ros_nodes:String", "not derived from rclpy.node.Node"),
        ("ros_nodes:Answers", "cannot be made without arguments .*'is_stamped'.*: derive a class"),
        ("no_such_package.node:Node", "there is no module 'no_such_package': start where it lies"),
    ]:
        with pytest.raises(RosError, match=what):
            node(of)


def test_a_node_may_end_itself(lab: Lab, tmp_path: Path) -> None:
    class Ends(ros_nodes.GoToGoal):
        def on_timer(self) -> None:
            super().on_timer()
            if self.get_clock().now().nanoseconds >= 2_000_000_000:
                raise SystemExit

    class ShutsDown(ros_nodes.GoToGoal):
        def on_timer(self) -> None:
            super().on_timer()
            if self.get_clock().now().nanoseconds >= 2_000_000_000:
                rclpy.shutdown()

    runs = [one(tmp_path, kind, GOER) for kind in (Ends, ShutsDown)]
    assert runs[1].summary["digest"] is not None and len({run.summary["digest"] for run in runs}) == 1

    class EndsAtOnce(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            raise SystemExit

    class ShutsDownAtOnce(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("at_once")
            rclpy.shutdown()

    runs = [one(tmp_path, kind, GOER) for kind in (EndsAtOnce, ShutsDownAtOnce)]
    assert ends(runs[0]) == (6.0, 2.0) and runs[0].summary["digest"] == runs[1].summary["digest"]


def test_what_a_node_publishes_first_is_read(tmp_path: Path) -> None:
    """In its constructor, latched or not, with a publisher made a moment ago, and with another node of its own."""
    forward = Twist()
    forward.linear.x = 0.2

    class InConstructor(Node):  # type: ignore[misc]
        def __init__(self, qos: Any = 10) -> None:
            super().__init__("first")
            self.create_publisher(Twist, "cmd_vel", qos).publish(forward)

    class Latched(InConstructor):
        def __init__(self) -> None:
            super().__init__(QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))

    class ByAnother(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("one")
            self.other = Node("other")
            self.other.create_publisher(Twist, "cmd_vel", 10).publish(forward)

    for kind in (InConstructor, Latched, ByAnother):
        x, y = ends(one(tmp_path, kind, GOER))
        assert (round(x, 6), y) == (7.0, 2.0), kind

    class Lazy(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("lazy")
            self.create_subscription(Odometry, "odom", self.on_odom, 10)
            self.replaced = self.create_publisher(String, "elsewhere", 10)

        def on_odom(self, odom: Odometry) -> None:
            if self.replaced is not None:
                self.destroy_publisher(self.replaced)
                self.replaced = None
                self.emotion = self.create_publisher(String, "emotion", 10)
                self.create_publisher(Twist, "cmd_vel", 10).publish(forward)
            self.emotion.publish(String(data="GLAD"))

    run = one(tmp_path, Lazy, GOER)
    assert round(ends(run)[0], 6) == 7.0 and set(run.states.emotion) == {"GLAD"}


def test_a_node_crashes_comes_back_and_is_forked(lab: Lab, tmp_path: Path) -> None:
    crash = '\n[[fault]]\nrobot = "Rosie"\ndo = "crash"\nat = "5 s"\nuntil = "8 s"\n'
    file = scenario(tmp_path, ROSIE, crash, duration="15 s")
    file.write_text('on_late = "continue"\n' + file.read_text())
    robots = {"Rosie": node(ros_nodes.WallAvoider)}
    run = cars.run(file, robots=robots, out=lab.folder, name="crashed")
    rosie = run.states.set_index("tick")
    assert rosie.x_m[27] == rosie.x_m[31] and rosie.generation[60] == 2
    assert rosie.heading_rad[60] != rosie.heading_rad[31] or rosie.x_m[60] != rosie.x_m[31]
    assert "the same" in lab.cars("verify", "crashed", "--out", str(lab.folder))
    forked = cars.fork(run, at=10, seed=3, reseed=["robot.Rosie"], robots=robots, out=lab.folder, name="forked")
    assert_same(lab.events("crashed")[:8], lab.events("forked")[:8])
    assert forked.summary["ticks"] == run.summary["ticks"]


def ros_process(lab: Lab, name: str, file: Path) -> tuple[subprocess.Popen[str], dict[str, str]]:
    run = lab.simulator(name, file.read_text(), "--speed", "max")
    return lab.start(command("WallAvoider", "--name", "Rosie"), **run), run


OUTSIDE = """
import rclpy
from std_msgs.msg import String
rclpy.init(domain_id=1)
node = rclpy.create_node("outside")
publisher = node.create_publisher(String, "/outside", 10)
node.create_timer(0.01, lambda: publisher.publish(String(data="hear me")))
rclpy.spin(node)
"""


@pytest.mark.thorough
def test_a_robot_hears_nothing_from_outside(lab: Lab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    lab.start([sys.executable, "-c", OUTSIDE])
    heard: list[str] = []

    def hear(text: Any) -> None:
        heard.append(text.data)

    # Who is not isolated hears it, in the domain that the first robot of a process has.
    context = rclpy.context.Context()
    context.init([], domain_id=1)
    listener = Node("listener", context=context, namespace="/all")
    listener.create_subscription(String, "/outside", hear, 10)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(listener)

    def spun() -> bool | None:
        executor.spin_once(timeout_sec=0.05)
        return bool(heard) or None

    eventually("a message", spun)
    robot_heard: list[str] = []

    class Hears(ros_nodes.GoToGoal):
        def __init__(self) -> None:
            super().__init__()
            self.create_subscription(String, "/outside", lambda text: robot_heard.append(text.data), 10)

        def on_odom(self, odom: Any) -> None:
            super().on_odom(odom)
            # As long as others are heard.
            heard.clear()
            eventually("a message", spun)

    one(tmp_path, Hears, GOER)
    assert heard and not robot_heard
    executor.shutdown()
    listener.destroy_node()
    context.try_shutdown()


def test_a_new_epoch_makes_the_node_anew(lab: Lab, tmp_path: Path, found: str) -> None:
    run = lab.simulator("epochs", scenario(tmp_path, ROSIE, duration="100 s").read_text(), "--speed", "max", "--paused")
    robot = lab.start(command("WallAvoider", "--name", "Rosie"), **run)
    ctl = ("--run", "epochs", "--connect", run["CARS_CONNECT"])
    lab.until_ready(*ctl)
    lab.step(60, *ctl)
    lab.cars("ctl", *ctl, "init")
    lab.until_ready(*ctl)
    lab.step(60, *ctl)
    lab.cars("ctl", *ctl, "stop")
    assert robot.wait(PATIENCE_S) == 0, robot.communicate()
    lab.ended("epochs")
    states = cars.load("epochs", out=lab.folder).states
    ways = [states[states.epoch == epoch][["x_m", "y_m", "heading_rad"]].to_numpy().tolist()[:60] for epoch in (1, 2)]
    assert ways[0] == ways[1] and len(ways[0]) == 60


@pytest.mark.thorough
def test_a_killed_run_goes_on_with_the_same_robot(lab: Lab, tmp_path: Path, found: str) -> None:
    file = scenario(tmp_path, ROSIE, duration="200 s")
    launch_file = tmp_path / "launch.toml"
    process = f'[[process]]\nname = "Rosie"\ncommand = {command("WallAvoider")}\n'
    launch_file.write_text(f'scenario = "{file}"\nspeed = "max"\n{process}')
    out = ("--out", str(lab.folder))
    launch = [str(lab.programs / "cars"), "launch", str(launch_file), "--no-console", "-q", *out, "--run", "killed"]
    launcher = lab.start(launch)
    events = lab.folder / "killed" / "events.jsonl"
    eventually("some ticks", lambda: (events.exists() and events.stat().st_size > 3000) or None)
    launcher.kill()
    launcher.wait()

    def resumed() -> bool | None:
        # The guard of the launcher ends the simulator, which takes a moment.
        done = lab._run("launch", "--resume", "killed", "--no-console", "-q", *out)
        assert done.returncode == 0 or "is in" in done.stderr, done.stderr
        return done.returncode == 0 or None

    eventually("the end of the old simulator", resumed)
    own = cars.run(file, robots={"Rosie": node(ros_nodes.WallAvoider)}, out=lab.folder, name="own")
    assert_same(lab.events("killed"), lab.events("own"))


@pytest.mark.thorough
def test_many_runs_are_the_same_under_load_and_when_the_node_is_stopped(lab: Lab, tmp_path: Path, found: str) -> None:
    file = scenario(tmp_path, ROSIE, duration="25 s")
    robots = {"Rosie": node(ros_nodes.WallAvoider)}
    first = cars.run(file, robots=robots, out=lab.folder, name="first")
    digests = {first.summary["digest"]}
    with load():
        for _ in range(RUNS - RUNS // 10):
            digests.add(cars.run(file, robots=robots, out=lab.folder, name="again", replace=True).summary["digest"])
        # Long enough to be stopped in the middle.
        file = scenario(tmp_path, ROSIE, duration="150 s")
        cars.run(file, robots=robots, out=lab.folder, name="longer")
        stopped = 0
        for number in range(RUNS // 10):
            name = f"stopped{number}"
            robot, run = ros_process(lab, name, file)
            events = lab.folder / name / "events.jsonl"
            # In the middle of it: its file grows, and the run is not over.
            eventually("some events", functools.partial(is_written, events))
            if robot.poll() is None:
                robot.send_signal(signal.SIGSTOP)
                time.sleep(1.0)
                stopped += '"event":"end"' not in events.read_text()
                robot.send_signal(signal.SIGCONT)
            assert robot.wait(PATIENCE_S) == 0
            lab.ended(name)
            assert_same(lab.events("longer"), lab.events(name))
    assert len(digests) == 1 and stopped > 0


def is_written(events: Path) -> bool | None:
    return (events.exists() and events.stat().st_size > 300) or None


class load:
    """Four processes that compute while this is entered."""

    def __enter__(self) -> None:
        self.processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
