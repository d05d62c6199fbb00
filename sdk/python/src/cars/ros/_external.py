"""A node in a process of its own, in any language, as a robot: a tick ends when the answer that is declared for it has come."""

from __future__ import annotations

import os
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Optional, Union

from .._robot import Action
from ._adapter import RosRobot
from ._load import RosError
from ._topics import SENT, Topics, ros_name

if TYPE_CHECKING:
    from .._cars import Cars

STAMP = "stamp"
"""The answer to a tick is a TwistStamped with the time of the tick."""
REPEAT_S = 1.0
"""How long to wait before a tick is published once more, wall clock: a node that has just been started has missed it."""


class ExternalRobot(RosRobot):
    """Publishes what the robot perceives, and waits for the answer of a node of which nothing else is known.

    It waits as long as it takes: what the clock does meanwhile is the scenario's ``on_late``, and the record has the ticks that the
    robot missed.
    """

    def __init__(self, answer: Union[str, int], *, cmd_vel_timeout_s: Optional[float] = None) -> None:
        """``answer`` is :data:`STAMP`, or the number of Twists on ``cmd_vel`` that answer a tick."""
        if answer != STAMP and not (isinstance(answer, int) and answer > 0):
            raise RosError(f"the answer to a tick is 'stamp' or a number of messages above 0, not {answer!r}")
        super().__init__(object, cmd_vel_timeout_s=cmd_vel_timeout_s)
        self._answer = answer
        self._context: Any = None
        self._reader: Any = None

    def init(self, cars: Cars) -> None:
        """Makes the topics anew; the node stays, and finds the clock set back in a new epoch."""
        self.close()
        self._begin(cars)
        # On this machine and in the domain of the environment, as every node that is started here.
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        ros = self._ros
        self._context = ros.context.Context()
        self._context.init([])
        name = ros_name(cars.name)
        topics = Topics(ros, self._context, name, is_external=True)
        sent = [topic for topic in SENT if topic != "scan" or cars.welcome.rays is not None]
        twist = ros.geometry.TwistStamped if self._answer == STAMP else ros.geometry.Twist
        kinds = {"cmd_vel": twist, **dict.fromkeys(("emotion", "behavior", "variables", "send"), ros.std.String)}
        self._node = SimpleNamespace(
            subscriptions=[SimpleNamespace(topic_name=f"/{name}/{topic}") for topic in sent],
        )
        for topic, kind in kinds.items():
            topics.follow(f"/{name}/{topic}", kind)
        self._topics = topics
        self._reader = ros.executors.SingleThreadedExecutor(context=self._context)
        self._reader.add_node(topics.node)
        self._cmd_vel = f"/{name}/cmd_vel"

    def reseed(self, cars: Cars) -> None:
        """The node's chance is its own."""

    def tick(self, cars: Cars) -> Action:
        """Publishes, and waits for the answer."""
        topics = self._topics
        if topics is None:
            raise RosError("a robot of ROS is used before it was initialized")
        if cars.pose is not None:
            self._heading_rad = cars.pose.heading_rad
        # What is published to nobody is lost.
        while not topics.is_met(self._cmd_vel):
            self._reader.spin_once(timeout_sec=0.1)
        topics.publish(cars, self._node, self._heading_rad, self._velocity(cars))
        answers = 0
        while not self._is_answered(answers):
            if topics.arrived:
                kind, message = topics.arrived.pop(0)
                if kind == "cmd_vel":
                    if not self._belongs(cars, message):
                        continue
                    answers += 1
                self._take(cars, kind, message)
                continue
            self._reader.spin_once(timeout_sec=REPEAT_S)
            if not topics.arrived and self._answer == STAMP:
                # Its answer has the stamp of the tick, so a second one is known as such. Counted ones would be too many.
                topics.publish(cars, self._node, self._heading_rad, self._velocity(cars))
        self._last = cars.location
        return self._action(cars)

    def close(self) -> None:
        """Ends the topics. Nothing happens if there are none."""
        context, self._context = getattr(self, "_context", None), None
        if context is None:
            return
        if self._reader is not None:
            self._reader.shutdown()
        if self._topics is not None:
            self._topics.destroy_node()
        self._topics = None
        context.try_shutdown()

    def __del__(self) -> None:
        if not sys.is_finalizing():
            self.close()

    def _is_answered(self, answers: int) -> bool:
        return answers >= (1 if self._answer == STAMP else int(self._answer))

    def _belongs(self, cars: Cars, message: Any) -> bool:
        """Whether an answer is one to this tick, and not to one before that the clock has left behind."""
        if self._answer != STAMP:
            return True
        stamp = message.header.stamp
        return bool(stamp.sec * 10**9 + stamp.nanosec == round(cars.time_s * 1e9))
