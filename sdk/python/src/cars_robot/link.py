"""The robots' side of the bus: everything that arrives goes through one queue to the robots' loop, and a robot that needs
an answer in the middle of its tick keeps that queue moving while it waits."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from .board import Board
from .bus import Bus, BusError
from .cars import Interrupted, Lost
from .held import Held
from .keys import STATE, Keys, last_chunk
from .messages import (
    Clock,
    Command,
    CommandId,
    Malformed,
    Percept,
    PublicState,
    command_json,
    decode,
    encode,
    is_name,
    read_clock,
    read_command,
    read_percept,
    read_state,
)

QUEUE = 4096
"""Messages that may queue up before the link is slowed down."""
COMMAND_PATIENCE_S = 10.0
"""A command that a clock named is reported missing after this long. Meanwhile the simulator has asked everybody to repeat
several times, so only a command that really cannot come gets here."""
LOOK_AGAIN_S = 0.25
"""A robot that waits looks this often at what else limits its wait; after one of them it tells whom it waits for."""
LOOK_FOR_SIMULATOR_S = 60.0
"""How long to sleep where nothing is due: while the simulator is there its silence is its own affair."""
ASK_AGAIN_S = 0.5
"""Between two attempts to ask a robot that does not answer."""
MAX_REPEAT_TICKS = 2000
"""For how many ticks commands are kept at most, whatever the simulator says."""
UNUSED_TICKS = 64
"""What was not asked for in so many ticks is followed no more."""

T = TypeVar("T")
Event = Callable[[], None]
"""All that can happen to a process of robots: what is to be done about it, on the robots' own thread."""

_log = logging.getLogger(__name__)


class Terminated(BaseException):
    """The process was told to end."""


@dataclass(slots=True)
class _Followed:
    """Something that is asked for so often that it is sent without being asked."""

    subscription: Any
    last_used: int


class Link:
    """What arrives for the robots of a process, and what they ask for."""

    def __init__(self, bus: Bus, keys: Keys, gone_patience_s: float) -> None:
        self.bus = bus
        self.keys = keys
        self.board = Board()
        self.current = (0, 0)
        """The clock that is being answered: epoch and tick."""
        self.simulator_gone_at: float | None = None
        """Since when the simulator is away."""
        self._gone_patience_s = gone_patience_s
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._has_room = threading.Event()
        self._has_room.set()
        self._is_closed = False
        self._clocks: deque[Clock] = deque()
        self._commands: dict[str, Held] = {}
        self._states: dict[tuple[str, int, int], PublicState] = {}
        self._percepts: dict[tuple[str, int, int], Percept] = {}
        self._followed: dict[str, _Followed] = {}
        self._sent: deque[tuple[str, str, Command]] = deque()
        self._repeat_ticks = 2

    # What arrives. These run on the middleware's thread: they hand over and return.

    def host(self, robot: str) -> None:
        """Names a robot of this process, so that commands and questions to it have a place."""
        self._commands[robot] = Held()
        self.board.host(robot)
        self.bus.subscribe(
            self.keys.commands_to(robot),
            lambda key, data: self._hand_over(lambda: self._on_command(robot, key, data)),
        )

    def listen(self) -> None:
        """Listens to the clock, and to whether the simulator is there."""
        key = self.keys.clock()
        # A state or a command that was put before a clock is still handed over before it: only the clock comes later.
        self.bus.subscribe(key, lambda _, data: self._hand_over(lambda: self._on_clock(key, data)), has_thread=True)
        self.bus.watch(self.keys.alive_sim(), lambda is_there: self._hand_over(lambda: self._on_simulator(is_there)))

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

    def _pump(self, patience_s: float) -> bool:
        """Waits for one event and files it. Returns whether there was one."""
        try:
            event = self._events.get(timeout=patience_s)
        except queue.Empty:
            return False
        if not self._has_room.is_set() and self._events.qsize() < QUEUE:
            self._has_room.set()
        try:
            event()
        except Malformed as error:
            _log.warning("%s", error)
        return True

    def _on_clock(self, key: str, data: bytes) -> None:
        clock = decode(key, "simulator", data, read_clock)
        # The clock of the tick that is under way, again: somebody misses something, and waits.
        if (clock.epoch, clock.tick) == self.current and clock.end is None:
            self.repeat_commands()
        if len(self._clocks) < QUEUE:
            self._clocks.append(clock)

    def _on_command(self, to: str, key: str, data: bytes) -> None:
        sender = last_chunk(key)
        if not is_name(sender):
            return
        command = decode(key, sender, data, read_command)
        if command.epoch >= self.current[0]:
            self._commands[to].hold(sender, command)

    def _on_state(self, of: str, key: str, data: bytes) -> None:
        state = decode(key, of, data, read_state)
        epoch, tick = self.current
        # Nobody asks for anything else, and an answer does not change within a tick.
        if state.epoch == epoch and abs(state.tick - tick) <= 1:
            self._states.setdefault((of, state.epoch, state.tick), state)

    def _on_percept(self, of: str, key: str, data: bytes) -> None:
        percept = decode(key, "simulator", data, read_percept)
        epoch, tick = self.current
        if abs(percept.epoch - epoch) <= 1 and percept.tick - 1 <= tick:
            self._percepts.setdefault((of, percept.epoch, percept.tick), percept)

    def _on_simulator(self, is_there: bool) -> None:
        if is_there:
            if self.simulator_gone_at is not None:
                _log.warning("the simulator is back after %.1f s", time.monotonic() - self.simulator_gone_at)
            self.simulator_gone_at = None
        elif self.simulator_gone_at is None:
            _log.warning(
                "the simulator, or the link to it, is gone: waiting for it up to %g s", self._gone_patience_s
            )
            self.simulator_gone_at = time.monotonic()

    # The lock-step.

    def patience_left_s(self) -> float:
        """How long to wait for a simulator that is gone; above 0 while it is there."""
        if self.simulator_gone_at is None:
            return LOOK_FOR_SIMULATOR_S
        return max(0.0, self._gone_patience_s - (time.monotonic() - self.simulator_gone_at))

    def next_clock(self) -> Clock | None:
        """The next clock, or ``None`` once the simulator has been gone for longer than there is patience."""
        while True:
            while self._clocks:
                clock = self._clocks.popleft()
                if clock.end is not None or not self._is_superseded(clock):
                    return clock
            if not self._pump(self.patience_left_s()) and self.patience_left_s() == 0.0:
                return None

    def _is_superseded(self, clock: Clock) -> bool:
        """Where the simulator has gone on without us, only its last clock can still be answered; the first clock of an
        epoch or of an incarnation must be seen all the same."""
        if clock.tick == 0 or any(news.joined is not None for news in clock.news.values()):
            return False
        return any((later.epoch, later.tick) > (clock.epoch, clock.tick) for later in self._clocks)

    def begin(self, epoch: int, tick: int) -> None:
        """A tick begins: what was known for the one before is of no use any more."""
        if epoch != self.current[0]:
            for held in self._commands.values():
                held.begin(epoch)
            self._sent.clear()
        self.current = (epoch, tick)
        if self._states:
            self._states = {key: one for key, one in self._states.items() if key[1:] >= (epoch, tick - 1)}
        if self._percepts:
            self._percepts = {key: one for key, one in self._percepts.items() if key[1:] >= (epoch, tick)}
        for key in [key for key, one in self._followed.items() if tick - one.last_used >= UNUSED_TICKS]:
            self._followed.pop(key).subscription.undeclare()
        while self._sent and self._sent[0][2].tick + self._repeat_ticks <= tick:
            self._sent.popleft()

    def repeat_commands(self) -> None:
        """Sends again what others may have missed."""
        for sender, to, command in self._sent:
            self._put(self.keys.command(to, sender), command_json(command))

    def keep_commands(self, ticks: int) -> None:
        """A robot of this process was told for how many ticks it must be able to repeat its commands."""
        self._repeat_ticks = max(self._repeat_ticks, min(ticks, MAX_REPEAT_TICKS))

    # What robots need during a tick (:class:`cars_robot.cars.Network`).

    def state_of(self, target: str, epoch: int, tick: int) -> PublicState:
        """The state that ``target`` reported for ``tick``."""
        if target in self._commands:
            state = self.board.get(target, epoch, tick)
            if state is None:
                raise Lost
            return state
        key = self.keys.query(target, STATE)
        # Asked during a tick, everybody answers with the state reported for the tick before.
        return self._obtain(key, tick + 1, target, self._on_state, lambda: self._states.get((target, epoch, tick)))

    def percept(self, robot: str, epoch: int, tick: int) -> Percept:
        """What ``robot`` senses around itself as of ``tick``."""
        key = self.keys.percept(robot)
        return self._obtain(key, tick, robot, self._on_percept, lambda: self._percepts.get((robot, epoch, tick)))

    def send(self, sender: str, to: str, command: Command) -> None:
        """Sends a command from one robot to another."""
        self._put(self.keys.command(to, sender), command_json(command))
        self._sent.append((sender, to, command))

    def receive(self, to: str, epoch: int, command: CommandId) -> Command | None:
        """The command that a clock named; ``None`` if it never came."""
        try:
            return self._wait(command.sender, lambda: self._commands[to].take(command, epoch), COMMAND_PATIENCE_S)
        except (Interrupted, Lost):
            return None

    def _obtain(
        self,
        key: str,
        tick: int,
        of: str,
        file: Callable[[str, str, bytes], None],
        here: Callable[[], T | None],
    ) -> T:
        """What ``here`` finds, asked for where it is not here yet."""
        followed = self._followed.get(key)
        if followed is not None:
            followed.last_used = self.current[1]
        asked_at: float | None = None

        def look() -> T | None:
            nonlocal asked_at
            found = here()
            # A question that finds nobody ends at once and without an error: it is asked again.
            if found is None and (asked_at is None or time.monotonic() - asked_at >= ASK_AGAIN_S):
                asked_at = time.monotonic()
                self._ask(key, tick, of, file)
            return found

        return self._wait(of, look, None)

    def _ask(self, key: str, tick: int, of: str, file: Callable[[str, str, bytes], None]) -> None:
        """Asks for a message once, and follows its key from then on: whoever serves it sends it without being asked,
        before what must come after it, so that the next question finds its answer here already."""

        def on_answer(data: bytes, is_refusal: bool) -> None:
            if is_refusal:
                _log.debug("a query to %s was refused: %s", of, data.decode(errors="replace"))
            elif self._events.qsize() < QUEUE:
                # A full queue drops the answer, and it is asked again.
                self._events.put(lambda: file(of, key, data))

        try:
            self.bus.ask_then(f"{key}?tick={tick};epoch={self.current[0]}", on_answer)
        except BusError as error:
            _log.warning("%s", error)
        if key not in self._followed:
            subscription = self.bus.subscribe(key, lambda key, data: self._hand_over(lambda: file(of, key, data)))
            self._followed[key] = _Followed(subscription, self.current[1])

    def _wait(self, who: str, ready: Callable[[], T | None], patience_s: float | None) -> T:
        """Keeps the queue moving until ``ready`` has something, the epoch is over, or ``patience_s`` is."""
        begun = time.monotonic()
        has_told = False
        while True:
            found = ready()
            if found is not None:
                return found
            if self._is_interrupted() or self.patience_left_s() == 0.0:
                raise Interrupted
            if patience_s is not None and time.monotonic() - begun > patience_s:
                raise Lost
            has_news = self._pump(LOOK_AGAIN_S)
            if not has_news and not has_told and who not in self._commands:
                has_told = True
                self._tell_waiting(who)

    def _is_interrupted(self) -> bool:
        """Whether a clock has arrived that ends the tick under way before it is done: the run is over, the next epoch
        begins, or the simulator has gone on without us."""
        return any(clock.end is not None or (clock.epoch, clock.tick) > self.current for clock in self._clocks)

    def _tell_waiting(self, on: str) -> None:
        epoch, tick = self.current
        for robot in sorted(self._commands):
            self._put(self.keys.waiting(robot), {"epoch": epoch, "tick": tick, "on": on})

    def _put(self, key: str, message: object) -> None:
        try:
            self.bus.put(key, encode(message))
        except BusError as error:
            _log.warning("%s", error)


def _terminate() -> None:
    raise Terminated
