"""Nodes of ROS 2 as robots: a plain rclpy node, which knows nothing of CARS, takes part in the lock-step.

In this process:

>>> cars.run("hall.toml", robots={"Rosie": cars.ros.node("my_package.wall_avoider:WallAvoider")})

As a program of its own: ``python -m cars.ros my_package.wall_avoider:WallAvoider --name Rosie``. The page ``docs/ros.md`` has all topics.
It needs rclpy: ``pip install 'cars-simulator[ros]'``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Optional, Union

from .. import _arguments
from ._adapter import RosRobot
from ._load import RosError, node_class

__all__ = ["RosError", "RosRobot", "node"]


def node(
    of: Union[str, type],
    *,
    ros_args: Sequence[str] = (),
    cmd_vel_timeout_s: Optional[float] = None,
) -> Callable[[], RosRobot]:
    """What makes robots of a node, for :func:`cars.run` and the others that take classes of robots.

    :param of: the class of the node, or where it is: ``"my_package.module:MyNode"``.
    :param ros_args: arguments of ROS, as they stand behind ``--ros-args``: ``["-r", "/base_scan:=scan", "-p", "gain:=2.0"]``.
    :param cmd_vel_timeout_s: the robot stops this long after the last ``cmd_vel``, simulated seconds; without it, it goes on.
    :raises RosError: there is no rclpy, or no such node; the text says what to do.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """
    timeout_s = cmd_vel_timeout_s
    if timeout_s is not None:
        timeout_s = _arguments.number("cmd_vel_timeout_s", timeout_s, "a number of seconds")
    kind: Any = node_class(of)
    return functools.partial(RosRobot, kind, ros_args=tuple(ros_args), cmd_vel_timeout_s=timeout_s)
