"""The topics of a robot: what it perceives goes to its node, and what the node publishes is read."""

from __future__ import annotations

import functools
import json
import math
import re
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from ._load import RosError
from ._motion import Twist, rotated

if TYPE_CHECKING:
    from .._cars import Cars

DEPTH = 1000
"""Most messages that one callback of a node may publish on a topic of texts."""
CONNECT_S = 10.0
"""Longest wait for topics of one process to be connected, which happens while they are made."""
SENT = ("odom", "scan", "bodies", "blocked", "command")
"""Topics to the node, beside the clock."""
ABSOLUTE = ("bodies", "behavior", "blocked", "cmd_vel", "command", "emotion", "odom", "scan", "send", "variables")
"""Topics that nodes name with a slash as well."""


def ros_name(name: str) -> str:
    """A robot's name where names are letters, digits and ``_`` and begin with none of the digits."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    plain = re.sub(r"_+", "_", plain)
    return plain if plain[:1].isalpha() else f"robot{plain}" if plain.startswith("_") else f"robot_{plain}"


class Topics:
    """Publishers and subscriptions of the adapter of one robot."""

    def __init__(self, ros: Any, context: Any, name: str, *, is_external: bool = False) -> None:
        """Makes the publishers, in a node of their own. To an external node messages are on their way for a while: its are received
        by :attr:`node`'s callbacks, and none may be lost."""
        self._ros = ros
        self._is_external = is_external
        self.arrived: list[tuple[str, Any]] = []
        """What an external node has published, and nobody has read yet."""
        qos = ros.qos
        # Not with the arguments of the process: the namespace and the parameters are those of the user's node.
        self.node = ros.node.Node(
            "cars",
            namespace=f"/{name}",
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        kinds = {
            "odom": ros.nav.Odometry,
            "scan": ros.sensor.LaserScan,
            "bodies": ros.geometry.PoseArray,
            "blocked": ros.std.Bool,
            "command": ros.std.String,
        }
        # Reliable: both kinds of subscriptions can be connected.
        sent = qos.QoSProfile(depth=DEPTH, reliability=qos.ReliabilityPolicy.RELIABLE)
        self._clock = self.node.create_publisher(ros.rosgraph.Clock, "/clock", 10)
        self._publishers = {topic: self.node.create_publisher(kind, topic, sent) for topic, kind in kinds.items()}

        # Best effort: both kinds of publishers can be connected. Nothing is lost within a process.
        last = qos.QoSProfile(depth=1, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
        many = qos.QoSProfile(depth=DEPTH, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
        if is_external:
            last = many = sent
        geometry, text = ros.geometry, (ros.std.String,)
        self._readable = {
            f"/{name}/cmd_vel": ((geometry.Twist, geometry.TwistStamped), last),
            f"/{name}/emotion": (text, last),
            f"/{name}/behavior": (text, last),
            f"/{name}/variables": (text, many),
            f"/{name}/send": (text, many),
        }
        self._counting = {topic for topic, (_, how) in self._readable.items() if how is many}
        self._subscriptions: dict[str, Any] = {}

    def follow(self, topic: str, kind: type) -> Callable[[], None]:
        """Subscribes to what a node is about to publish, with its type: one participant has one type for a topic. Other topics are not
        read. Returns what waits, when the publisher is made, until both are connected.

        :raises RosError: if the type is another one than those that are read.
        """
        if topic not in self._readable:
            return lambda: None
        kinds, qos = self._readable[topic]
        subscription = self._subscriptions.get(topic)
        read = kinds if subscription is None else (subscription.msg_type,)
        if kind not in read:
            names = " or ".join(one.__name__ for one in read)
            raise RosError(f"the node publishes {kind.__name__} on {topic}; what is read there is {names}: remap the topic")
        if subscription is None:
            receive = functools.partial(self._receive, topic.rpartition("/")[2])
            subscription = self._subscriptions[topic] = self.node.create_subscription(kind, topic, receive, qos)
        before = subscription.get_publisher_count()
        return lambda: _wait(lambda: subscription.get_publisher_count() > before, f"the node's publisher of {topic} cannot be connected")

    def _receive(self, topic: str, message: Any) -> None:
        """Called for external nodes only: otherwise the adapter's node is in no executor, and what it has is taken."""
        self.arrived.append((topic, message))

    def is_met(self, answer: str) -> bool:
        """Whether an external node is there: it publishes the answer, and subscribes to something."""
        publishers = [self._clock, *self._publishers.values()]
        return self._subscriptions[answer].get_publisher_count() > 0 and any(
            one.get_subscription_count() > 0 for one in publishers
        )

    @staticmethod
    def remaps(name: str) -> list[str]:
        """Arguments by which a node that names its topics with a slash finds those of the robot: it is alone in its context."""
        return [word for topic in ABSOLUTE for word in ("-r", f"/{topic}:=/{name}/{topic}")]

    def check_connected(self, node: Any) -> None:
        """Waits until each subscription of the node to one of these topics is connected.

        :raises RosError: if one cannot be, because it asks for more than is offered.
        """
        wanted: dict[str, int] = {}
        for subscription in node.subscriptions:
            wanted[subscription.topic_name] = wanted.get(subscription.topic_name, 0) + 1
        for publisher in (self._clock, *self._publishers.values()):
            count = wanted.get(publisher.topic_name, 0)
            _wait(
                lambda publisher=publisher, count=count: publisher.get_subscription_count() >= count,  # type: ignore[misc]
                f"the node's subscription to {publisher.topic_name} cannot be connected: its type must be "
                f"{publisher.msg_type.__name__}, and its durability volatile",
            )

    def publish(self, cars: Cars, node: Any, heading_rad: float, velocity: Twist) -> None:
        """Publishes what the robot perceives in this tick, the clock first."""
        ros = self._ros
        sec, nanosec = divmod(round(cars.time_s * 1e9), 10**9)
        clock = ros.rosgraph.Clock()
        clock.clock.sec, clock.clock.nanosec = sec, nanosec
        stamp = clock.clock
        self._clock.publish(clock)

        # What nobody reads is not made. The list is the node's own, and not what has been discovered so far.
        topics = {subscription.topic_name for subscription in node.subscriptions}
        makes: dict[str, Callable[[], Any]] = {
            "odom": lambda: self._odometry(cars, stamp, heading_rad, velocity),
            "scan": lambda: self._scan(cars, stamp),
            "bodies": lambda: self._bodies(cars, stamp),
            "blocked": lambda: ros.std.Bool(data=cars.was_blocked),
        }
        for topic, make in makes.items():
            publisher = self._publishers[topic]
            if publisher.topic_name in topics:
                message = make()
                if message is not None:
                    publisher.publish(message)
        commands = self._publishers["command"]
        if commands.topic_name in topics:
            for command in cars.commands:
                text = {"sender": command.sender, "command": command.text}
                if command.payload is not None:
                    text["payload"] = command.payload
                commands.publish(ros.std.String(data=json.dumps(text)))

    def _odometry(self, cars: Cars, stamp: Any, heading_rad: float, velocity: Twist) -> Any:
        odometry = self._ros.nav.Odometry()
        odometry.header.stamp = stamp
        odometry.header.frame_id = "odom"
        odometry.child_frame_id = "base_link"
        pose, twist = odometry.pose.pose, odometry.twist.twist
        pose.position.x, pose.position.y = float(cars.location.x), float(cars.location.y)
        pose.orientation.w, pose.orientation.z = rotated(heading_rad / 2)
        twist.linear.x, twist.linear.y = float(velocity.forward_mps), float(velocity.left_mps)
        twist.angular.z = float(velocity.turn_radps)
        return odometry

    def _scan(self, cars: Cars, stamp: Any) -> Any:
        rays = cars.welcome.rays
        if rays is None:
            raise RosError(
                f"the node of {cars.name} subscribes to a scan, and the scenario has no rays: give it some, as in "
                '[sensing] rays = { count = 36, range = "3 m" }'
            )
        scan = self._ros.sensor.LaserScan()
        scan.header.stamp = stamp
        scan.header.frame_id = "base_link"
        scan.angle_increment = math.tau / rays.count
        scan.angle_max = scan.angle_increment * (rays.count - 1)
        scan.scan_time = float(cars.tick_s)
        scan.range_max = float(rays.range_m)
        # As REP 117 has it: what is out of range is infinitely far.
        scan.ranges = [math.inf if range_m >= rays.range_m else range_m for range_m in cars.ranges]
        return scan

    def _bodies(self, cars: Cars, stamp: Any) -> Any:
        geometry = self._ros.geometry
        bodies = geometry.PoseArray()
        bodies.header.stamp = stamp
        bodies.header.frame_id = "odom"
        for _, place in cars.bodies:
            pose = geometry.Pose()
            pose.position.x, pose.position.y = float(place.x), float(place.y)
            bodies.poses.append(pose)
        return bodies

    @staticmethod
    def in_frame(heading_rad: float, x_mps: float, y_mps: float, turn_radps: float) -> Twist:
        """A velocity of the world in the frame of the robot."""
        cos, sin = rotated(heading_rad)
        return Twist(cos * x_mps + sin * y_mps, cos * y_mps - sin * x_mps, turn_radps)

    def taken(self, *, is_idle: bool) -> Iterator[tuple[str, Any]]:
        """What the node has published since the last time, topic by topic. Until it is idle, only where every message counts: of the
        others the last one of the tick does."""
        for topic, subscription in self._subscriptions.items():
            if not (is_idle or topic in self._counting):
                continue
            count = 0
            while True:
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
                if taken is None:
                    break
                count += 1
                if count >= DEPTH:
                    raise RosError(f"one callback of the node published {DEPTH} messages or more on {topic}")
                yield topic.rpartition("/")[2], taken[0]

    def destroy_node(self) -> None:
        """Ends publishers and subscriptions."""
        self.node.destroy_node()


def _wait(is_connected: Callable[[], bool], otherwise: str) -> None:
    """Waits for what is connected in a moment, or never."""
    deadline_s = time.monotonic() + CONNECT_S
    while not is_connected():
        if time.monotonic() > deadline_s:
            raise RosError(otherwise)
        time.sleep(0.001)
