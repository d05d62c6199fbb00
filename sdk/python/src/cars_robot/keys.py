"""Key expressions: where each message of a run is said. ``cars/{run}/...``, robots addressed by name."""

from __future__ import annotations

QUERIES = ("location", "speed", "direction", "state_variables", "emotion_state", "behavior_state")
"""The six queries of the common robot interface, as the last chunk of their keys."""
STATE = "state"
"""All six answers in one."""


class Keys:
    """The keys of one run.

    >>> Keys("demo").report("Leguin")
    'cars/demo/robot/Leguin/report'
    """

    def __init__(self, run: str) -> None:
        self._root = f"cars/{run}"

    def clock(self) -> str:
        """Simulator to all: a tick is granted."""
        return f"{self._root}/clock"

    def join(self, robot: str) -> str:
        """Queryable at the simulator: this robot asks to take part; its name is in the key, so that access control can
        pin it."""
        return f"{self._root}/join/{robot}"

    def report(self, robot: str) -> str:
        """Robot to simulator: its tick is done."""
        return self.query(robot, "report")

    def waiting(self, robot: str) -> str:
        """Robot to simulator: it waits for another robot's answer."""
        return self.query(robot, "waiting")

    def command(self, to: str, sender: str) -> str:
        """Robot to simulator: a command; target and sender are in the key, so that access control can pin the sender."""
        return f"{self._root}/robot/{to}/command/{sender}"

    def news(self, robot: str) -> str:
        """Simulator to robot: what is new for it in a tick."""
        return self.query(robot, "news")

    def query(self, robot: str, what: str) -> str:
        """Queryable at the robot: ``what`` is one of :data:`QUERIES` or :data:`STATE`."""
        return f"{self._root}/robot/{robot}/{what}"

    def panel(self, robot: str) -> str:
        """Robot to observers: what it chooses to display."""
        return self.query(robot, "panel")

    def alive_sim(self) -> str:
        """Liveliness token of the simulator."""
        return f"{self._root}/alive/sim"

    def alive_robot(self, robot: str) -> str:
        """Liveliness token of a robot; declared last, so that it means "ready"."""
        return f"{self._root}/alive/robot/{robot}"


def robot_of(key: str) -> str | None:
    """The robot that a key under ``.../robot/{name}`` is about."""
    _, _, rest = key.partition("/robot/")
    return rest.split("/", 1)[0] or None


def last_chunk(key: str) -> str:
    """The last chunk of a key: what a query asks for."""
    return key.rsplit("/", 1)[-1]
