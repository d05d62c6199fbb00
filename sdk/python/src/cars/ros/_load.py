"""rclpy, which is loaded when it is needed, and the classes of nodes."""

from __future__ import annotations

import importlib
import inspect
import os
import sys
from types import SimpleNamespace
from typing import Any, Union

from .._errors import Error

RMW = "rmw_fastrtps_cpp"
"""The middleware of a node in this process: it delivers in the thread that publishes, so that nothing is on its way when
``publish`` returns."""
MODULES = {
    "rclpy": "rclpy",
    "clock": "rclpy.clock",
    "context": "rclpy.context",
    "executors": "rclpy.executors",
    "node": "rclpy.node",
    "qos": "rclpy.qos",
    "timer": "rclpy.timer",
    "utilities": "rclpy.utilities",
    "geometry": "geometry_msgs.msg",
    "nav": "nav_msgs.msg",
    "rosgraph": "rosgraph_msgs.msg",
    "sensor": "sensor_msgs.msg",
    "std": "std_msgs.msg",
}


class RosError(Error):
    """ROS is not there, or a node cannot be a robot; the text says what to do."""


def load() -> Any:
    """The modules of ROS that are used here, by short names.

    :raises RosError: if they are not installed, or another middleware is loaded.
    """
    if "rclpy" not in sys.modules:
        # Read when rclpy calls its middleware for the first time.
        os.environ["RMW_IMPLEMENTATION"] = RMW
        # What is published is in the reader's history when `publish` returns, and not when a thread of Fast DDS has had its turn.
        os.environ["RMW_FASTRTPS_PUBLICATION_MODE"] = "SYNCHRONOUS"
    try:
        modules = {short: importlib.import_module(name) for short, name in MODULES.items()}
    except ImportError as error:
        raise RosError(
            f"ROS 2 cannot be loaded ({error}): `pip install 'cars-simulator[ros]'` (CPython 3.11), or source the setup file of an "
            "installation of ROS 2 Kilted or later before Python is started"
        ) from error

    ros: Any = SimpleNamespace(**modules)
    loaded = ros.utilities.get_rmw_implementation_identifier()
    if loaded != RMW:
        raise RosError(
            f"the middleware of ROS in this process is {loaded}; a node is a robot over {RMW} only, which delivers at once: "
            f"set RMW_IMPLEMENTATION={RMW}"
        )
    return ros


def node_class(of: Union[str, type]) -> type:
    """The class of a node: itself, or what ``"module:Class"`` names.

    :raises RosError: if there is none.
    """
    ros = load()
    found: Any = _named(of) if isinstance(of, str) else of
    if not inspect.isclass(found):
        raise RosError(
            f"{of!r} is no class of a node but {found!r}: a function such as main() spins its node by itself, so nobody could know "
            "when a tick has been handled. Name the class, as in module:MyNode"
        )
    if not issubclass(found, ros.node.Node):
        raise RosError(f"{of!r} is a class that is not derived from rclpy.node.Node")
    try:
        inspect.signature(found).bind()
    except TypeError as error:
        raise RosError(f"{of!r} cannot be made without arguments ({error}): derive a class whose constructor gives them") from error
    return found


def _named(of: str) -> Any:
    module_name, colon, name = of.partition(":")
    if not (module_name and colon and name):
        raise RosError(f"{of!r} names no node: write the module, a colon and the class, as in my_package.module:MyNode")
    # As for `python -m`: what lies where it was started is found.
    if "" not in sys.path and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not (module_name + ".").startswith(error.name + "."):
            raise
        raise RosError(
            f"there is no module {error.name!r}: start where it lies, or add its folder to PYTHONPATH, or install its package"
        ) from error
    if not hasattr(module, name):
        classes = [one for one, value in vars(module).items() if inspect.isclass(value) and value.__module__ == module_name]
        raise RosError(f"{module_name} has no {name!r}; its classes are {', '.join(classes) or 'none'}")
    return getattr(module, name)
