"""A robot that asks a node of ROS what to do."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Optional

from .._data import Point, StateVariables
from .._robot import Action, Robot
from ._calls import watch
from ._load import RosError, load
from ._motion import Twist, moved, read_twist
from ._spin import goes_on_after, spin_until_idle
from ._topics import Topics, ros_name
from ._world import RosWorld

if TYPE_CHECKING:
    from .._cars import Cars


class RosRobot(Robot):
    """A node as a robot. In a tick it publishes what the robot perceives, has the node handle it until nothing is ready, and does
    what the node has published. It adds no rule to the lock-step."""

    senses_bodies = True
    senses_ranges = True

    def __init__(self, kind: type, *, ros_args: Sequence[str] = (), cmd_vel_timeout_s: Optional[float] = None) -> None:
        """Takes the class of the node, which is made in :meth:`init`. For arguments see :func:`cars.ros.node`."""
        self._kind: Any = kind
        self._ros = load()
        watch(self._ros)
        self._ros_args = tuple(ros_args)
        self._timeout_s = cmd_vel_timeout_s
        self._world: Optional[RosWorld] = None
        self._node: Any = None
        self._executor: Any = None
        self._topics: Optional[Topics] = None
        self._is_over = False

    def init(self, cars: Cars) -> None:
        """Makes the node, and ends the one before.

        :raises RosError: the node starts threads, or a topic of it cannot be connected.
        """
        self.close()
        name = ros_name(cars.name)
        arguments = [*_parameters(cars.welcome.parameters), *Topics.remaps(name), *self._ros_args]
        # The user's own arguments stand behind: of two values of a parameter the last counts.
        arguments = ["-r", f"__ns:=/{name}", "-p", "use_sim_time:=true", *arguments]
        world = RosWorld(self._ros, arguments, cars.random.next_u64())
        self._world = world
        self._begin(cars)
        with world.entered():
            topics = self._topics = Topics(self._ros, world.context, name)
            world.follow = topics.follow
            goes_on = goes_on_after(self._make)
            if not goes_on or not world.context.ok():
                # It says so in the first tick.
                self._node = None
                return
            self._executor = self._ros.executors.SingleThreadedExecutor(context=world.context)
            self._executor.add_node(self._node)
        topics.check_connected(self._node)

    def _make(self) -> None:
        self._node = self._kind()

    def _begin(self, cars: Cars) -> None:
        """Back to the initial state, but for the node."""
        self._is_over = False
        self._twist, self._twist_s = Twist(), 0.0
        self._emotion, self._behavior = "", ""
        self._variables: dict[str, Any] = {}
        self._heading_rad = 0.0 if cars.pose is None else cars.pose.heading_rad
        self._last: Point = cars.location

    def resume(self, cars: Cars, last: StateVariables) -> None:
        """A robot without wheels looks where its previous incarnation looked; the node begins anew."""
        before = cars.welcome.last_state
        if cars.pose is None and before is not None:
            self._heading_rad = float(before.get("direction_rad", 0.0))

    def reseed(self, cars: Cars) -> None:
        """The node's random numbers are others from now on."""
        if self._world is not None:
            self._world.seed(cars.random.next_u64())

    def tick(self, cars: Cars) -> Action:
        """Publishes, spins until nothing is ready, and reads what the node has published."""
        world, topics = self._world, self._topics
        if world is None or topics is None:
            raise RosError("a robot of ROS is used before it was initialized")
        if cars.pose is not None:
            self._heading_rad = cars.pose.heading_rad
        if not self._is_over:
            goes_on = False
            with world.entered():
                if self._node is not None:
                    topics.publish(cars, self._node, self._heading_rad, self._velocity(cars))
                    goes_on = spin_until_idle(self._ros, self._executor, lambda: self._read(cars, is_idle=False))
                if world.context.ok():
                    self._read(cars, is_idle=True)
            if goes_on and not self._node.get_clock().ros_time_is_active:
                raise RosError(f"the node of {cars.name} has set use_sim_time to false: its clock is not that of the run")
            if not goes_on:
                cars.log("its node has ended; it stays where it is")
                self._is_over = True
                self._twist = Twist()
        self._last = cars.location
        return self._action(cars)

    def close(self) -> None:
        """Ends the node. Nothing happens if there is none."""
        world, self._world = self._world, None
        if world is None:
            return
        # The node before its context, as in a program that ends by itself. A node that has called rclpy.shutdown() has ended all.
        if world.context.ok():
            with world.entered():
                if self._executor is not None:
                    self._executor.shutdown()
                for node in (self._node, self._topics):
                    if node is not None:
                        node.destroy_node()
        self._executor = self._node = self._topics = None
        world.close()

    def __del__(self) -> None:
        # At the end of Python modules are gone, and the context ends with the process.
        if not sys.is_finalizing() and getattr(self, "_world", None) is not None:
            self.close()

    def _velocity(self, cars: Cars) -> Twist:
        """How it moved in the last tick, in the world's frame if it has no wheels."""
        if cars.pose is not None:
            return Twist(cars.pose.velocity.linear_mps, 0.0, cars.pose.velocity.angular_radps)
        x_mps = (cars.location.x - self._last.x) / cars.tick_s
        y_mps = (cars.location.y - self._last.y) / cars.tick_s
        return Topics.in_frame(self._heading_rad, x_mps, y_mps, self._twist.turn_radps)

    def _read(self, cars: Cars, *, is_idle: bool) -> None:
        """Takes what the node has published since the last time."""
        topics = self._topics
        assert topics is not None, "read in a tick only"
        for kind, message in topics.taken(is_idle=is_idle):
            self._take(cars, kind, message)

    def _take(self, cars: Cars, kind: str, message: Any) -> None:
        """Takes a message of the node."""
        if kind == "cmd_vel":
            self._twist, self._twist_s = read_twist(cars.name, message), cars.time_s
        elif kind == "emotion":
            self._emotion = message.data
        elif kind == "behavior":
            self._behavior = message.data
        elif kind == "variables":
            self._variables.update(_object(cars.name, kind, message.data))
        else:
            _send(cars, _object(cars.name, kind, message.data))

    def _action(self, cars: Cars) -> Action:
        twist = self._twist
        # Half a tick of room: the difference of times is not exact.
        if self._timeout_s is not None and cars.time_s - self._twist_s > self._timeout_s - cars.tick_s / 2:
            twist = Twist()
        published = (self._emotion, self._behavior, dict(self._variables))
        if cars.pose is not None:
            action = Action.drive(cars, twist.forward_mps, twist.turn_radps)
            action.emotion_state, action.behavior_state, action.state_variables = published
            return action
        there, heading_rad = moved(cars, self._heading_rad, twist)
        speed_mps = cars.location.distance_m(there) / cars.tick_s
        self._heading_rad = heading_rad
        # Its heading, also where it moves sideways: its rays begin there.
        return Action(there, speed_mps, heading_rad, *published)


def _parameters(of: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Parameters of the scenario as those of the node."""
    arguments = []
    for key, value in of.items():
        if isinstance(value, Mapping):
            arguments += _parameters(value, f"{prefix}{key}.")
        else:
            arguments += ["-p", f"{prefix}{key}:={json.dumps(value)}"]
    return arguments


def _object(name: str, topic: str, text: str) -> dict[str, Any]:
    try:
        read = json.loads(text)
    except ValueError as error:
        raise RosError(f"{name}: its node published on {topic} what is no JSON ({error}): {text[:80]!r}") from error
    if not isinstance(read, dict):
        raise RosError(f"{name}: its node published on {topic} what is no JSON object: {text[:80]!r}")
    return read


def _send(cars: Cars, command: dict[str, Any]) -> None:
    text, to = command.get("command"), command.get("to")
    unknown = set(command) - {"command", "to", "payload"}
    if not isinstance(text, str) or not (to is None or isinstance(to, str)) or unknown:
        raise RosError(
            f'{cars.name}: its node published on send {command!r}; a command is {{"to": "Leguin", "command": "refill"}}, to all without '
            '"to", and may have a "payload"'
        )
    if to is None:
        cars.broadcast(text, command.get("payload"))
    else:
        cars.send(to, text, command.get("payload"))
