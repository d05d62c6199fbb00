"""``python -m cars.ros my_package.module:MyNode --name Rosie``: a node of ROS 2 as a robot's program."""

from __future__ import annotations

import argparse
import functools
import math
import sys
from collections.abc import Callable, Sequence
from typing import Optional

from .. import _entry
from . import _bridge, node
from ._adapter import RosRobot
from ._external import STAMP, ExternalRobot
from ._load import RosError

USAGE = "python -m cars.ros MODULE:CLASS [--name NAME] [options of a robot's program] [--cmd-vel-timeout-s S] [--ros-args ...]"


def _seconds(text: str) -> float:
    """A number of seconds of the command line."""
    seconds = float(text)
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is no number of seconds above 0")
    return seconds


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs the program, and returns its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["bridge"]:
        return _bridge.main(given[1:])
    own, ros_args = given, list[str]()
    if "--ros-args" in given:
        at = given.index("--ros-args")
        own, ros_args = given[:at], given[at + 1 :]
        # As in ROS, what follows is no longer of ROS.
        if "--" in ros_args:
            end = ros_args.index("--")
            own, ros_args = own + ros_args[end + 1 :], ros_args[:end]
    # As launch files of ROS give it to each node: not its own name, but that of the robot, is in the names of topics.
    parser = argparse.ArgumentParser("cars.ros", usage=USAGE, description="A node of ROS 2 as a robot.", allow_abbrev=False)
    parser.add_argument("--external", action="store_true", help="the node is a process of its own, in any language")
    parser.add_argument(
        "--answer",
        type=lambda text: text if text == STAMP else int(text),
        default=STAMP,
        metavar="stamp|N",
        help="what ends a tick of an external node: a TwistStamped with its stamp, or N Twists on cmd_vel",
    )
    parser.add_argument(
        "--cmd-vel-timeout-s", type=_seconds, help="stop this long after the last cmd_vel, simulated seconds; otherwise go on"
    )
    parser.epilog = "All other options are those of every robot's program, such as --name, --run and --connect."
    # First, and not found by the parser: to it, the value of an option that it does not know would be the node.
    named = own[0] if own and not own[0].startswith("-") else None
    options, others = parser.parse_known_args(own if named is None else own[1:])

    made: list[RosRobot] = []
    if options.external == (named is not None):
        parser.error("name the class of a node, or give --external for one that is a process of its own")
    make: Callable[[], RosRobot]
    default_name = "Rosie"
    try:
        if options.external:
            make = functools.partial(ExternalRobot, options.answer, cmd_vel_timeout_s=options.cmd_vel_timeout_s)
            make().close()
        else:
            make = node(named or "", ros_args=ros_args, cmd_vel_timeout_s=options.cmd_vel_timeout_s)
            default_name = (named or "").partition(":")[2]
    except RosError as error:
        print(f"cars.ros: {error}", file=sys.stderr)
        return 2

    def robot(_name: str) -> RosRobot:
        made.append(make())
        return made[-1]

    try:
        return _entry.main(default_name, robot, others)
    finally:
        for one in made:
            one.close()


if __name__ == "__main__":
    sys.exit(main())
