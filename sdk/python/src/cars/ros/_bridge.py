"""A run in progress as others in ROS see it, and what controls it: an observer, which takes part in no tick."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import os
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, Optional

from ._interfaces import FEATURES, Entity, Interfaces, fill_pose
from ._load import RosError, load
from ._motion import rotated
from ._topics import ros_name

SETTINGS = {
    "mode": '"client"',
    "scouting/multicast/enabled": "false",
    "scouting/gossip/enabled": "false",
    "transport/link/tx/lease": "2000",
    "transport/link/tx/keep_alive": "4",
    "connect/timeout_ms": "5000",
}
ANSWER_S = 10.0
"""How long to wait for an answer of the simulator, which comes at once."""
STEP_S = 3600.0
"""How long to wait for that to a step, which comes when its ticks are complete."""
JOIN_S = 30.0
"""How long to wait for the robots of a further epoch, wall clock."""
POLL_S = 0.02
"""How often to look for them."""
THREADS = 4
"""How many services are answered at a time."""
SERVICES = {
    "start": {"do": "start"},
    "pause": {"do": "pause"},
    "stop": {"do": "stop"},
    "get_state": {"do": "status"},
}
"""Services of std_srvs/Trigger, and the controls that they are."""


class Bridge:
    """Publishes each frame of a run, and serves its controls."""

    def __init__(self, run: str, connect: str, zenoh_config: Optional[str]) -> None:
        self._ros = load()
        try:
            self._zenoh: Any = importlib.import_module("zenoh")
            self._trigger = importlib.import_module("std_srvs.srv").Trigger
        except ImportError as error:
            raise RosError(f"the bridge cannot be started ({error}): `pip install 'cars-simulator[ros]'`") from error
        # Both are on no registry as a wheel; an installation of ROS has them.
        self._tf: Any = importlib.import_module("tf2_msgs.msg").TFMessage if _is_installed("tf2_msgs") else None
        has_interfaces = _is_installed("simulation_interfaces")

        ros = self._ros
        ros.rclpy.init(args=[])
        self._node = ros.node.Node("cars", start_parameter_services=True)
        self._node.declare_parameter("steps", 1)
        self._run = run
        self._publishers: dict[str, Any] = {}
        self._names: dict[str, str] = {}
        self._frame: dict[str, Any] = {}
        self._transformed: Optional[tuple[int, int]] = None
        # One frame at a time is published, in their order.
        self._arrived = threading.Condition()
        # A step takes as long as its ticks, and may be paused meanwhile: no service waits for another one.
        self._group = ros.rclpy.callback_groups.ReentrantCallbackGroup()
        for name in SERVICES:
            self.serve(self._trigger, f"/cars/{name}", self._serve(name))
        self.serve(self._trigger, "/cars/reset", self._reset)
        self.serve(self._trigger, "/cars/step", self._step)
        self.serve(self._trigger, "/cars/get_features", self._features)
        self.serve(self._trigger, "/cars/get_entities", self._entities)
        if has_interfaces:
            Interfaces(self)
        self._extras = ", /tf" * (self._tf is not None), " and those of simulation_interfaces" * has_interfaces

        zenoh = self._zenoh
        config = zenoh.Config.from_file(zenoh_config) if zenoh_config else zenoh.Config()
        settings = {} if zenoh_config else SETTINGS
        for key, value in {**settings, "mode": '"client"', "connect/endpoints": json.dumps([connect])}.items():
            config.insert_json5(key, value)
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            raise RosError(f"there is no simulator at {connect} ({error}): is the run in progress?") from error
        # Kept: it is undeclared when it is dropped.
        self._world = self._session.declare_subscriber(f"cars/{run}/world", self._on_frame)

    def spin(self) -> None:
        """Serves until it is interrupted."""
        topics, services = self._extras
        print(f"bridging run {self._run}: /clock, odometry, guests{topics}; services in /cars{services}", flush=True)
        executor = self._ros.executors.MultiThreadedExecutor(THREADS)
        executor.add_node(self._node)
        executor.spin()

    def serve(self, kind: Any, name: str, answer: Any) -> None:
        """Declares a service."""
        self._node.create_service(kind, name, answer, callback_group=self._group)

    def close(self) -> None:
        """Ends it."""
        self._session.close()
        self._ros.rclpy.try_shutdown()

    def _publish(self, topic: str, message: Any) -> None:
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._publishers[topic] = self._node.create_publisher(type(message), topic, 100)
        publisher.publish(message)

    def _on_frame(self, sample: Any) -> None:
        with self._arrived:
            if self._ros.rclpy.ok():
                self._show(json.loads(sample.payload.to_bytes()))
            self._arrived.notify_all()

    def _show(self, frame: dict[str, Any]) -> None:
        ros = self._ros
        self._frame = frame
        clock = ros.rosgraph.Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(_time_ns(frame), 10**9)
        stamp = clock.clock
        self._publish("/clock", clock)
        transforms = [self._show_robot(robot, stamp) for robot in frame["robots"]]
        # A frame is shown again when the run is paused; those who listen to transforms warn of a stamp that they have already.
        tick = frame["epoch"], frame["tick"]
        if self._tf is not None and transforms and tick != self._transformed:
            self._publish("/tf", self._tf(transforms=transforms))
            self._transformed = tick

        guests = ros.geometry.PoseArray()
        guests.header.stamp, guests.header.frame_id = stamp, "map"
        for x, y in frame["guests"]:
            pose = ros.geometry.Pose()
            pose.position.x, pose.position.y = float(x), float(y)
            guests.poses.append(pose)
        self._publish("/guests", guests)

    def _show_robot(self, robot: dict[str, Any], stamp: Any) -> Any:
        ros = self._ros
        name = self._name(robot["name"])
        odometry = ros.nav.Odometry()
        odometry.header.stamp, odometry.header.frame_id = stamp, "map"
        odometry.child_frame_id = f"{name}/base_link"
        pose, twist = odometry.pose.pose, odometry.twist.twist
        fill_pose(pose, robot["location"]["x"], robot["location"]["y"], _heading_rad(robot))
        # In the frame of the robot: one that drives backwards has a negative velocity.
        cos, sin = rotated(robot["direction_rad"] - _heading_rad(robot))
        twist.linear.x, twist.linear.y = robot["speed_mps"] * cos, robot["speed_mps"] * sin
        self._publish(f"/{name}/odom", odometry)
        self._publish(f"/{name}/emotion", ros.std.String(data=robot["emotion_state"]))
        self._publish(f"/{name}/behavior", ros.std.String(data=robot["behavior_state"]))
        transform = ros.geometry.TransformStamped()
        transform.header = odometry.header
        transform.child_frame_id = odometry.child_frame_id
        transform.transform.translation.x, transform.transform.translation.y = pose.position.x, pose.position.y
        transform.transform.rotation = pose.orientation
        return transform

    def _name(self, robot: str) -> str:
        """Its name in ROS; no two are alike."""
        if robot not in self._names:
            plain = name = ros_name(robot)
            number = 2
            while name in self._names.values():
                name, number = f"{plain}_{number}", number + 1
            self._names[robot] = name
        return self._names[robot]

    def control(self, request: dict[str, Any], patience_s: float = ANSWER_S) -> dict[str, Any]:
        """Asks the simulator, and returns its answer."""
        replies = self._session.get(f"cars/{self._run}/control", payload=json.dumps(request), timeout=patience_s)
        for reply in replies:
            if reply.ok is not None:
                answer: dict[str, Any] = json.loads(reply.ok.payload.to_bytes())
                return answer
            return {"answer": "refused", "explanation": reply.err.payload.to_string()}
        return {"answer": "refused", "explanation": f"the simulator of run {self._run} did not answer within {patience_s:.0f} s"}

    def step(self, ticks: int) -> dict[str, Any]:
        """Has the simulator do so many ticks, and returns its answer when they are complete."""
        return self.control({"do": "step", "n": ticks}, STEP_S)

    def reset(self) -> dict[str, Any]:
        """Begins the next epoch, and returns the answer of the simulator when all robots are there again: it can be stepped."""
        answer = self.control({"do": "init"})
        deadline_s = time.monotonic() + JOIN_S
        while answer["answer"] == "done" and answer["phase"] == "gathering":
            if time.monotonic() > deadline_s:
                names = ", ".join(robot["name"] for robot in answer["awaiting"])
                return {"answer": "refused", "explanation": f"robots did not join epoch {answer['epoch']} within {JOIN_S:.0f} s: {names}"}
            time.sleep(POLL_S)
            answer = self.control({"do": "status"})
        return answer

    def current(self) -> dict[str, Any]:
        """The frame of the last tick that is complete, or nothing. That of a step is still on its way when the step is answered."""
        status = self.control({"do": "status"})
        with self._arrived:
            if status["answer"] != "done":
                return self._frame
            tick = status["epoch"], status["tick"]
            is_here = self._arrived.wait_for(lambda: (self._frame.get("epoch", 0), self._frame.get("tick", 0)) >= tick, ANSWER_S)
            return self._frame if is_here else {}

    def entities(self, frame: dict[str, Any]) -> list[Entity]:
        """Robots and guests of a frame."""
        time_ns = _time_ns(frame)
        entities = []
        for robot in frame["robots"]:
            cos, sin = rotated(robot["direction_rad"])
            velocity = robot["speed_mps"] * cos, robot["speed_mps"] * sin
            at = robot["location"]
            entities.append(Entity(self._name(robot["name"]), at["x"], at["y"], _heading_rad(robot), velocity, time_ns))
        numbers = frame.get("guest_numbers") or range(len(frame["guests"]))
        for number, (x, y) in zip(numbers, frame["guests"]):
            entities.append(Entity(f"guest_{number}", x, y, 0.0, (0.0, 0.0), time_ns))
        return entities

    def _serve(self, name: str) -> Any:
        def serve(_request: Any, response: Any) -> Any:
            return _filled(response, self.control(SERVICES[name]))

        return serve

    def _step(self, _request: Any, response: Any) -> Any:
        steps = self._node.get_parameter("steps").value
        if steps < 1:
            response.message = f"the parameter steps of /cars is {steps}; it must be 1 or more"
            return response
        return _filled(response, self.step(steps))

    def _reset(self, _request: Any, response: Any) -> Any:
        return _filled(response, self.reset())

    def _features(self, _request: Any, response: Any) -> Any:
        response.success, response.message = True, json.dumps({"features": FEATURES})
        return response

    def _entities(self, _request: Any, response: Any) -> Any:
        """Robots and guests as the last frame has them."""
        frame = self.current()
        response.success = bool(frame)
        if not frame:
            response.message = "there is no frame of the run yet"
            return response
        entities = [{"name": one.name, "x": one.x_m, "y": one.y_m, "yaw": one.yaw_rad} for one in self.entities(frame)]
        response.message = json.dumps({"tick": frame["tick"], "frame_id": "map", "entities": entities})
        return response


def _is_installed(package: str) -> bool:
    return importlib.util.find_spec(package) is not None


def _time_ns(frame: dict[str, Any]) -> int:
    return round(float(frame["tick"] * frame["tick_s"]) * 1e9)


def _heading_rad(robot: dict[str, Any]) -> float:
    """Where a robot looks; one without wheels looks where it goes."""
    heading_rad = robot.get("heading_rad")
    return float(robot["direction_rad"] if heading_rad is None else heading_rad)


def _filled(response: Any, answer: dict[str, Any]) -> Any:
    """The answer to a control as that of a Trigger: the status as JSON, or why it was refused."""
    response.success = answer["answer"] == "done"
    response.message = json.dumps(answer) if response.success else answer.get("explanation", "")
    return response


def main(arguments: Sequence[str]) -> int:
    """Runs the bridge, and returns its exit status."""
    parser = argparse.ArgumentParser("cars ros bridge", description="Shows a run in progress to ROS 2, and serves its controls.")
    parser.add_argument("--run", default=os.environ.get("CARS_RUN", "default"), help="name of the run")
    parser.add_argument("--connect", default=os.environ.get("CARS_CONNECT", "tcp/127.0.0.1:7447"), help="where its simulator listens")
    parser.add_argument("--zenoh-config", default=os.environ.get("CARS_ZENOH_CONFIG"), help="configuration file for a secured run")
    options = parser.parse_args(arguments)
    try:
        bridge = Bridge(options.run, options.connect, options.zenoh_config)
    except RosError as error:
        print(f"cars.ros: {error}", file=sys.stderr)
        return 2
    try:
        bridge.spin()
    except (KeyboardInterrupt, bridge._ros.executors.ExternalShutdownException):
        pass
    finally:
        bridge.close()
    return 0
