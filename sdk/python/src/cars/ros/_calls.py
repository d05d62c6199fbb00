"""Calls of a node that are noticed or refused while it is executed as a robot: elsewhere in the process they do what they always do."""

from __future__ import annotations

import _thread
import functools
import threading
from typing import Any

from ._load import RosError
from ._world import world_inside

THREADS = ((_thread, "start_new_thread"), (threading, "_start_new_thread"), (_thread, "start_joinable_thread"), (threading, "_start_joinable_thread"))
"""What starts threads, as far as this version of Python has it: Python tells of none before 3.12."""


def watch(ros: Any) -> None:
    """Watches the calls of all nodes of the process. A second time nothing happens."""
    node = ros.node.Node
    if hasattr(node.create_publisher, "__wrapped__"):
        return
    node.create_publisher = _followed(node.create_publisher)
    node.create_timer = _simulated(ros, node.create_timer)
    ros.clock.Clock.sleep_until = _refused("sleeps", ros.clock.Clock.sleep_until)
    ros.timer.Rate.sleep = _refused("sleeps at a rate", ros.timer.Rate.sleep)
    for module, name in THREADS:
        if hasattr(module, name):
            setattr(module, name, _without_threads(getattr(module, name)))


def _followed(create: Any) -> Any:
    """Makes a publisher; what it publishes from its first message on is read."""

    @functools.wraps(create)
    def create_publisher(node: Any, msg_type: Any, topic: str, *arguments: Any, **named: Any) -> Any:
        world = world_inside()
        if world is None or node.context is not world.context:
            return create(node, msg_type, topic, *arguments, **named)
        # Before it is made: a topic of another type is refused with a reason, and what a constructor publishes is not lost.
        connected = world.follow(node.resolve_topic_name(topic), msg_type)
        publisher = create(node, msg_type, topic, *arguments, **named)
        connected()
        return publisher

    return create_publisher


def _simulated(ros: Any, create: Any) -> Any:
    """Makes a timer, of simulated time."""

    @functools.wraps(create)
    def create_timer(node: Any, timer_period_sec: Any, callback: Any, callback_group: Any = None, clock: Any = None, *more: Any, **named: Any) -> Any:
        is_other = clock is not None and clock.clock_type != ros.clock.ClockType.ROS_TIME
        if is_other and world_inside() is not None:
            raise RosError(
                f"the node makes a timer of the clock {clock.clock_type.name}, which goes on by itself: no two runs would be the same. "
                "Leave `clock` out, or run the node as a process of its own"
            )
        return create(node, timer_period_sec, callback, callback_group, clock, *more, **named)

    return create_timer


def _refused(does: str, sleep: Any) -> Any:
    """Sleeps, but not in a callback of a robot: the clock goes on when all callbacks have returned."""

    @functools.wraps(sleep)
    def sleep_or_refuse(*arguments: Any, **named: Any) -> Any:
        if world_inside() is not None:
            raise RosError(
                f"the node {does} in a callback, and the clock of the run goes on when all callbacks have returned: use a timer, or run "
                "the node as a process of its own"
            )
        return sleep(*arguments, **named)

    return sleep_or_refuse


def _without_threads(start: Any) -> Any:
    """Starts a thread, but none of a robot's node, which would publish when it likes: no tick could be known to be complete."""

    @functools.wraps(start)
    def start_or_refuse(function: Any, *arguments: Any, **named: Any) -> Any:
        if world_inside() is None:
            return start(function, *arguments, **named)
        name = getattr(getattr(function, "__self__", None), "name", "without a name")
        raise RosError(
            f"the node starts a thread ({name}): what it does then is not the same in each run. Use a timer, or run the node as a "
            "process of its own"
        )

    return start_or_refuse
