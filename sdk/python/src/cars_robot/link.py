"""The robots' side of the bus: everything that arrives goes through one queue to the robots' loop, and a robot that needs
an answer in the middle of its tick keeps that queue moving while it waits."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from .board import Board
from .bus import Bus, BusError
from .cars import Interrupted, Unreachable
from .keys import STATE, Keys
from .messages import Malformed, PublicState, decode, encode, read_state

QUEUE = 4096
"""Messages that may queue up before the link is slowed down."""
LOOK_AGAIN_S = 0.25
"""A robot that waits looks this often at what else limits its wait, and after this long it puts whom it waits for."""
LOOK_FOR_SIMULATOR_S = 60.0
"""How long to sleep where nothing is due: while the simulator is there its silence is its own affair."""
ASK_AGAIN_S = 0.5
"""Between two attempts to ask a robot that does not answer."""
UNUSED_TICKS = 64
"""A robot that was not queried for so many ticks is followed no more."""

T = TypeVar("T")
Event = Callable[[], None]
"""All that can happen to a process of robots: what is to be done about it, on the robots' own thread."""

_log = logging.getLogger(__name__)


class Terminated(BaseException):
    """The process was told to end."""


@dataclass(slots=True)
class _Followed:
    """Another robot, whose states are sent without being queried."""

    subscription: Any
    last_used: int


class Link:
    """What arrives for the robots of a process, and what they ask for."""

    def __init__(
        self, bus: Bus, keys: Keys, robots: list[str], gone_patience_s: float, is_interrupted: Callable[[], bool]
    ) -> None:
        """``is_interrupted`` says whether the tick that runs is of no use any more."""
        self.bus = bus
        self.keys = keys
        self.board = Board()
        self._current = (0, 0)
        self._robots = robots
        self._simulator_gone_at: float | None = None
        self._gone_patience_s = gone_patience_s
        self._is_interrupted = is_interrupted
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._has_room = threading.Event()
        self._has_room.set()
        self._is_closed = False
        self._states: dict[tuple[str, int, int], PublicState] = {}
        self._followed: dict[str, _Followed] = {}
        for robot in robots:
            self.board.host(robot)
        bus.watch(keys.alive_sim(), lambda is_there: self._hand_over(lambda: self._on_simulator(is_there)))

    # What arrives. These run on the middleware's thread: they hand over and return.

    def subscribe(
        self, key: str, sender: str, read: Callable[[Any], T], file: Callable[[T], None], has_thread: bool = False
    ) -> Any:
        """Calls ``file`` on the robots' thread with each message that arrives on ``key``."""

        def take(_: str, data: bytes) -> None:
            self._hand_over(lambda: file(decode(key, sender, data, read)))

        return self.bus.subscribe(key, take, has_thread)

    def _hand_over(self, event: Event) -> None:
        # A full queue holds the link: back-pressure instead of loss.
        while self._events.qsize() >= QUEUE and not self._is_closed:
            self._has_room.clear()
            if self._events.qsize() >= QUEUE and not self._is_closed:
                self._has_room.wait()
        self._events.put(event)

    def close(self) -> None:
        """Nobody will look at what arrives: nothing may wait for room any more."""
        self._is_closed = True
        self._has_room.set()

    def stop(self) -> None:
        """Ends the robots' loop from a signal handler."""
        self._events.put(_terminate)

    # What becomes of it, on the robots' own thread.

    def pump(self, patience_s: float = LOOK_FOR_SIMULATOR_S) -> None:
        """Waits for an event, and files all that have arrived."""
        try:
            self._file(self._events.get(timeout=min(patience_s, self.patience_left_s())))
        except queue.Empty:
            return
        self.drain()

    def drain(self) -> None:
        """Files the events that have arrived."""
        for _ in range(self._events.qsize()):
            self._file(self._events.get())

    def _file(self, event: Event) -> None:
        if not self._has_room.is_set() and self._events.qsize() < QUEUE:
            self._has_room.set()
        try:
            event()
        except Malformed as error:
            _log.warning("%s", error)

    def _on_state(self, of: str, state: PublicState) -> None:
        epoch, tick = self._current
        # Only states near the present tick are ever asked for, and an answer does not change within a tick.
        if state.epoch == epoch and abs(state.tick - tick) <= 1:
            self._states.setdefault((of, state.epoch, state.tick), state)

    def _on_simulator(self, is_there: bool) -> None:
        if is_there:
            if self._simulator_gone_at is not None:
                _log.warning("the simulator is back after %.1f s", time.monotonic() - self._simulator_gone_at)
            self._simulator_gone_at = None
        elif self._simulator_gone_at is None:
            _log.warning(
                "the simulator, or the link to it, is gone: waiting for it up to %g s", self._gone_patience_s
            )
            self._simulator_gone_at = time.monotonic()

    def patience_left_s(self) -> float:
        """How long to wait for a simulator that is gone; above 0 while it is there."""
        if self._simulator_gone_at is None:
            return LOOK_FOR_SIMULATOR_S
        return max(0.0, self._gone_patience_s - (time.monotonic() - self._simulator_gone_at))

    # What robots need during a tick.

    def begin(self, epoch: int, tick: int) -> None:
        """A robot runs a tick: what was known for the one before is of no use any more."""
        if (epoch, tick) == self._current:
            return
        self._current = (epoch, tick)
        if self._states:
            self._states = {key: one for key, one in self._states.items() if key[1:] >= (epoch, tick - 1)}
        for name in [name for name, one in self._followed.items() if abs(tick - one.last_used) >= UNUSED_TICKS]:
            self._followed.pop(name).subscription.undeclare()

    def state_of(self, robot: str, epoch: int, tick: int) -> PublicState:
        """The state that another robot reported for ``tick``.

        :raises Unreachable: it is a robot of this process that reported none.
        :raises Interrupted: the tick that runs is of no use any more.
        """
        if robot in self._robots:
            state = self.board.get(robot, epoch, tick)
            if state is None:
                raise Unreachable(robot)
            return state

        self._follow(robot)
        begun_at = time.monotonic()
        asked_at = float("-inf")
        has_told = False
        while (found := self._states.get((robot, epoch, tick))) is None:
            if self._is_interrupted() or self.patience_left_s() == 0.0:
                raise Interrupted
            now = time.monotonic()
            # A query that finds no robot ends at once and without an error.
            if now - asked_at >= ASK_AGAIN_S:
                asked_at = now
                self._ask(robot)
            if now - begun_at >= LOOK_AGAIN_S and not has_told:
                has_told = True
                self._tell_waiting(robot)
            self.pump(LOOK_AGAIN_S)
        return found

    def _follow(self, robot: str) -> None:
        """Subscribes to a robot's states: it puts them before its reports, so that the next query finds its answer here
        already."""
        followed = self._followed.get(robot)
        if followed is None:
            key = self.keys.query(robot, STATE)
            subscription = self.subscribe(key, robot, read_state, lambda state: self._on_state(robot, state))
            followed = self._followed[robot] = _Followed(subscription, 0)
        followed.last_used = self._current[1]

    def _ask(self, robot: str) -> None:
        key = self.keys.query(robot, STATE)
        epoch, tick = self._current

        def on_answer(data: bytes, is_refusal: bool) -> None:
            if is_refusal:
                _log.debug("a query to %s was refused: %s", robot, data.decode(errors="replace"))
            elif self._events.qsize() < QUEUE:
                # A full queue drops the answer, and it is asked again.
                self._events.put(lambda: self._on_state(robot, decode(key, robot, data, read_state)))

        try:
            # Asked during a tick, every robot answers with the state reported for the tick before.
            self.bus.ask_then(f"{key}?tick={tick};epoch={epoch}", on_answer)
        except BusError as error:
            _log.warning("%s", error)

    def _tell_waiting(self, on: str) -> None:
        epoch, tick = self._current
        for robot in self._robots:
            self.put(self.keys.waiting(robot), encode({"epoch": epoch, "tick": tick, "on": on}))

    def put(self, key: str, message: bytes) -> None:
        """Puts a message; one that is lost is repeated when the clock is."""
        try:
            self.bus.put(key, message)
        except BusError as error:
            _log.warning("%s", error)


def _terminate() -> None:
    raise Terminated
