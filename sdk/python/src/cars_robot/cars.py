"""What a robot can do during a tick: the calls of the paper's "Inter-Robot Communication", sensing, chance, the log."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from .messages import (
    MAX_ENTRIES,
    MAX_TEXT_BYTES,
    News,
    Percept,
    Point,
    PublicState,
    SensedRobot,
    StateVariables,
    Welcome,
    shortened,
)
from .parameters import BadParameters, build
from .streams import Stream

MAX_LOG_BYTES = 1 << 18
"""What a robot may log in a tick, UTF-8: a quarter of a message."""

P = TypeVar("P")


class CallError(Exception):
    """Why a call between robots gave nothing."""


class UnknownRobot(CallError):
    """No robot of the roster has this name."""

    def __init__(self, name: str, roster: tuple[str, ...]) -> None:
        super().__init__(f"no robot is called {name!r}; the roster is {', '.join(roster)}")


class Unreachable(CallError):
    """The network between the two is cut, or the other one is lost."""

    def __init__(self, name: str) -> None:
        super().__init__(f"{name} is unreachable")


class TooEarly(CallError):
    """Before tick 1 nobody has reported anything."""

    def __init__(self) -> None:
        super().__init__("nothing is known before tick 1")


class Interrupted(CallError):
    """The tick is over: a newer clock is here, or the run ends. A robot may let it through."""

    def __init__(self) -> None:
        super().__init__("the tick is over")


StateOf = Callable[[str, int, int], PublicState]
"""``state_of(robot, epoch, tick)``: the state that another robot reported for a tick. It raises :class:`Unreachable` or
:class:`Interrupted`."""


class Cars:
    """The simulation, as one robot sees it during one tick."""

    __slots__ = (
        "_has_bodies",
        "_log",
        "_logged_bytes",
        "_sent",
        "_state_of",
        "news",
        "random",
        "tick",
        "welcome",
    )

    def __init__(
        self, welcome: Welcome, tick: int, news: News, random: Stream, has_bodies: bool, state_of: StateOf
    ) -> None:
        self.welcome = welcome
        """What it was told when it joined: field, roster, ranges, where it started."""
        self.tick = tick
        """The current tick; 0 is the initial state."""
        self.news = news
        """What is new for it in this tick."""
        self.random = random
        """Its own random stream, derived from the seed and its name: the only chance it may use."""
        self._has_bodies = has_bodies
        self._state_of = state_of
        self._sent: list[tuple[str, str]] = []
        self._log: list[str] = []
        self._logged_bytes = 0

    @property
    def name(self) -> str:
        """Its own name (``getName``)."""
        return self.welcome.name

    @property
    def tick_s(self) -> float:
        """Length of a tick, simulated seconds."""
        return self.welcome.tick_s

    @property
    def time_s(self) -> float:
        """Simulated time, seconds."""
        return self.tick * self.welcome.tick_s

    @property
    def was_blocked(self) -> bool:
        """Whether its last move was refused, so that it still stands where it was."""
        correction = self.news.correction
        return correction is not None and correction.blocked

    @property
    def sensed_robots(self) -> tuple[SensedRobot, ...]:
        """Robots within its sensing range now. Sensing is physical: no cut network hides anybody."""
        return self.news.sensed

    def parameters(self, kind: type[P]) -> P:
        """Its parameters, as an instance of the dataclass ``kind``: numbers in SI units. Plain: ``welcome.parameters``.

        :raises BadParameters: which parameter is wrong, missing or unknown.
        """
        try:
            return build(kind, self.welcome.parameters)
        except ValueError as error:
            raise BadParameters(self.name, str(error)) from None

    def percept(self) -> Percept:
        """All bodies within its sensing range now: obstacles, guests, robots.

        :raises RuntimeError: if the robot's ``senses_bodies`` is false.
        """
        if not self._has_bodies:
            raise RuntimeError(f"{self.name} calls percept() and its senses_bodies is False")
        return Percept(self.welcome.epoch, self.tick, self.news.bodies)

    def log(self, line: str) -> None:
        """Writes a line to the log of the run. It is cut to what a message may hold, and so is their number in a tick."""
        line = shortened(line, MAX_TEXT_BYTES)
        self._logged_bytes += len(line.encode())
        # Room is left for what the seat itself may have to say, and in the message for all the rest.
        if len(self._log) < MAX_ENTRIES // 2 and self._logged_bytes <= MAX_LOG_BYTES:
            self._log.append(line)

    def set_robot_command(self, to: str, command: str) -> int:
        """Sends a command to another robot (``setRobotCommand``) and returns its number in this tick, from 1.

        It arrives at a later tick, if the network lets it.

        :raises UnknownRobot: if nobody has this name.
        :raises ValueError: if it is longer than 4096 bytes, or more than 1024 are sent in a tick.
        """
        to = self._known(to)
        if len(command.encode()) > MAX_TEXT_BYTES:
            raise ValueError(f"a command may be {MAX_TEXT_BYTES} bytes long; shorten {shortened(command, 60)!r}...")
        if len(self._sent) >= MAX_ENTRIES:
            raise ValueError(f"{self.name} sends more than {MAX_ENTRIES} commands in a tick; send fewer")
        self._sent.append((to, command))
        return len(self._sent)

    def get_robot_location(self, of: str) -> Point:
        """Where another robot stood at the last tick, meters (``getRobotLocation``); raises as
        :meth:`get_robot_state`, and so do the other queries."""
        return self.get_robot_state(of).location

    def get_robot_speed(self, of: str) -> float:
        """How fast another robot was at the last tick, m/s (``getRobotSpeed``)."""
        return self.get_robot_state(of).speed_mps

    def get_robot_direction(self, of: str) -> float:
        """Where another robot was heading at the last tick, radians (``getRobotDirection``)."""
        return self.get_robot_state(of).direction_rad

    def get_robot_state_variables(self, of: str) -> StateVariables:
        """What another robot published of itself at the last tick (``getRobotStateVariables``)."""
        return self.get_robot_state(of).state_variables

    def get_robot_emotion_state(self, of: str) -> str:
        """Another robot's emotion at the last tick (``getRobotEmotionState``)."""
        return self.get_robot_state(of).emotion_state

    def get_robot_behavior_state(self, of: str) -> str:
        """Another robot's behavior at the last tick (``getRobotBehaviorState``)."""
        return self.get_robot_state(of).behavior_state

    def get_robot_state(self, of: str) -> PublicState:
        """All six answers at once. The first query to a robot in a tick may cost a round trip, further ones are free.

        :raises UnknownRobot: if nobody has this name.
        :raises Unreachable: if the network is cut, or the other one is lost.
        :raises TooEarly: in tick 0.
        :raises Interrupted: if the tick is over.
        """
        of = self._known(of)
        if self.tick == 0:
            raise TooEarly
        if of in self.news.unreachable:
            raise Unreachable(of)
        return self._state_of(of, self.welcome.epoch, self.tick - 1)

    def _known(self, name: str) -> str:
        if name not in self.welcome.roster:
            raise UnknownRobot(name, self.welcome.roster)
        return name
