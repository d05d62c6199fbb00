"""Nodes of ROS in the style of tutorials, which know nothing of CARS."""

from __future__ import annotations

import math
import random

import rclpy
from geometry_msgs.msg import PoseArray, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String


class WallAvoider(Node):  # type: ignore[misc]
    """Drives ahead, and turns to a side that it draws while something is near."""

    def __init__(self) -> None:
        super().__init__("wall_avoider")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        self.create_subscription(LaserScan, "/scan", self.on_scan, qos_profile_sensor_data)
        self.near_m = self.declare_parameter("near_m", 0.8).value
        self.side = 0.0

    def on_scan(self, scan: LaserScan) -> None:
        fifth = len(scan.ranges) // 5
        ahead = min([*scan.ranges[:fifth], *scan.ranges[-fifth:]])
        twist = Twist()
        if ahead > self.near_m:
            self.side = 0.0
            twist.linear.x = 0.4
        else:
            self.side = self.side or random.choice([-1.0, 1.0])
            twist.angular.z = 0.8 * self.side
        self.publisher.publish(twist)


class GoToGoal(Node):  # type: ignore[misc]
    """Drives to one goal after another, by odometry, in a timer."""

    GOALS = ((6.0, 3.0), (7.0, 3.0), (6.0, 2.0))

    def __init__(self) -> None:
        super().__init__("go_to_goal")
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.mood = self.create_publisher(String, "emotion", 10)
        self.create_subscription(Odometry, "odom", self.on_odom, 10)
        self.create_timer(0.5, self.on_timer)
        self.pose: tuple[float, float, float] | None = None
        self.goal = 0

    def on_odom(self, odom: Odometry) -> None:
        pose = odom.pose.pose
        self.pose = pose.position.x, pose.position.y, 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)

    def on_timer(self) -> None:
        if self.pose is None:
            return
        x, y, heading = self.pose
        dx, dy = self.GOALS[self.goal][0] - x, self.GOALS[self.goal][1] - y
        if dx * dx + dy * dy < 0.1:
            self.goal = (self.goal + 1) % len(self.GOALS)
            self.mood.publish(String(data="HAPPY"))
            self.get_logger().info(f"goal {self.goal} at {self.get_clock().now().nanoseconds}")
        turn = (math.atan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi
        twist = Twist()
        twist.linear.x = 0.5 if abs(turn) < 0.3 else 0.0
        twist.angular.z = max(-1.0, min(1.0, 2.0 * turn))
        self.publisher.publish(twist)


class Chatty(Node):  # type: ignore[misc]
    """Answers each odometry over a chain of its own topics and a timer, with a stamp; counts what it was given."""

    def __init__(self) -> None:
        super().__init__("chatty")
        self.out = self.create_publisher(TwistStamped, "cmd_vel", 10)
        self.inner = self.create_publisher(String, "inner", 10)
        self.facts = self.create_publisher(String, "variables", 10)
        self.send = self.create_publisher(String, "send", 10)
        self.create_subscription(Odometry, "odom", self.on_odom, 10)
        self.create_subscription(PoseArray, "bodies", self.on_bodies, 10)
        self.create_subscription(String, "command", self.on_command, 10)
        self.create_subscription(String, "inner", self.on_inner, 200)
        self.create_timer(1.0, self.on_timer)
        self.odoms = self.inners = self.fired = self.commands = self.bodies = 0

    def on_odom(self, _odom: Odometry) -> None:
        self.odoms += 1
        for _ in range(100):
            self.inner.publish(String(data="x"))

    def on_bodies(self, bodies: PoseArray) -> None:
        self.bodies = len(bodies.poses)

    def on_command(self, _command: String) -> None:
        self.commands += 1

    def on_inner(self, _text: String) -> None:
        self.inners += 1
        twist = TwistStamped()
        twist.header.stamp = self.get_clock().now().to_msg()
        twist.twist.linear.x = 0.001 * (self.inners % 100)
        self.out.publish(twist)
        counted = (self.odoms, self.inners, self.fired, self.commands, self.bodies)
        names = ("odoms", "inners", "fired", "commands", "bodies")
        text = ", ".join(f'"{name}": {count}' for name, count in zip(names, counted, strict=True))
        self.facts.publish(String(data="{" + text + "}"))

    def on_timer(self) -> None:
        self.fired += 1
        self.send.publish(String(data='{"command": "hello", "payload": {"n": %d}}' % self.fired))


def main() -> None:
    """As tutorials end."""
    rclpy.init()
    rclpy.spin(WallAvoider())


class Answers(Node):  # type: ignore[misc]
    """A node of a process of its own: answers each odometry with its stamp, or without one."""

    def __init__(self, is_stamped: bool) -> None:
        super().__init__("answers")
        self.is_stamped = is_stamped
        self.out = self.create_publisher(TwistStamped if is_stamped else Twist, "cmd_vel", 100)
        self.create_subscription(Odometry, "odom", self.on_odom, 100)

    def on_odom(self, odom: Odometry) -> None:
        twist = Twist()
        twist.linear.x = 0.4 if odom.pose.pose.position.x < 4.0 else 0.1
        twist.angular.z = 0.2
        if self.is_stamped:
            stamped = TwistStamped(twist=twist)
            stamped.header.stamp = odom.header.stamp
            self.out.publish(stamped)
        else:
            self.out.publish(twist)
            self.out.publish(twist)


if __name__ == "__main__":
    import sys

    rclpy.init(args=["--ros-args", "-r", "__ns:=/Rosie"])
    rclpy.spin(Answers(sys.argv[1] == "stamp"))
