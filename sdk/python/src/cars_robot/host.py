"""The lock-step loop over the bus, for one robot or several in a process. They share one session: what several robots say
in a tick leaves in one batch."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from .bus import DEFAULT_ENDPOINT, Bus, BusError, Publisher
from .cars import Interrupted
from .keys import QUERIES, STATE, Keys
from .link import LOOK_FOR_SIMULATOR_S, Link
from .messages import (
    MAX_MESSAGE_BYTES,
    NO_NEWS,
    PROTOCOL_VERSION,
    Clock,
    News,
    Refused,
    Report,
    Welcome,
    command_json,
    decode,
    encode,
    is_name,
    read_clock,
    read_join_answer,
    read_news,
    report_json,
    state_json,
)
from .panel import panel_json
from .robot import Robot
from .seat import Seat
from .version import __version__

PANEL_INTERVAL_S = 0.05
"""A panel is for eyes: no more often than this."""
MAX_COMMANDED = 64
"""Most robots for which a publisher of commands is declared. Without one, zenoh compares each command's key with all keys that
anyone has declared in the network; with one, it does so once."""
JOIN_AGAIN_S = 0.1
"""Between two attempts to join."""
MAX_NEWS = 4
"""Most news that are kept while their clock is not here. Only the newest clock is ever run."""


class HostError(Exception):
    """Why robots cannot go on; the text says what to do."""


@dataclass(frozen=True, slots=True)
class HostOptions:
    """How to reach a run."""

    run: str = "default"
    """The run."""
    connect: str = DEFAULT_ENDPOINT
    """Endpoint of its simulator or router."""
    patience_s: float = 20.0
    """How long to try to reach it and to be let in, seconds."""
    gone_patience_s: float = 600.0
    """How long to wait for it once it is gone: it ended, or the link to it is cut, which look the same from here."""
    zenoh_config: Path | None = None
    """A configuration file of the middleware instead of the built-in settings."""

    @staticmethod
    def from_environment() -> HostOptions:
        """What ``CARS_RUN``, ``CARS_CONNECT``, ``CARS_PATIENCE_S``, ``CARS_GONE_PATIENCE_S`` and ``CARS_ZENOH_CONFIG``
        say, as a launcher sets them.

        :raises ValueError: a patience is not a number.
        """
        default = HostOptions()
        zenoh_config = os.environ.get("CARS_ZENOH_CONFIG")
        return HostOptions(
            run=os.environ.get("CARS_RUN", default.run),
            connect=os.environ.get("CARS_CONNECT", default.connect),
            patience_s=float(os.environ.get("CARS_PATIENCE_S", default.patience_s)),
            gone_patience_s=float(os.environ.get("CARS_GONE_PATIENCE_S", default.gone_patience_s)),
            zenoh_config=Path(zenoh_config) if zenoh_config else None,
        )


class Host:
    """Robots of one process, connected."""

    def __init__(
        self, robots: Mapping[str, Robot], options: HostOptions, on_open: Callable[[], None] = lambda: None
    ) -> None:
        """Connects, calls ``on_open``, joins with every robot, and shows that they are ready.

        :raises HostError: what is in the way: nobody there, or refused and why.
        :raises BusError: the simulator cannot be reached.
        """
        for name in [options.run, *robots]:
            if not is_name(name):
                raise HostError(
                    f"{name!r} is not a usable name: 1 to 64 letters, digits, '_', '-' or '.', not beginning with '.'"
                )
        self._options = options
        self._robots = robots
        self._bus = Bus(options.connect, options.patience_s, options.zenoh_config)
        self._keys = Keys(options.run)
        self._members: dict[str, _Member] = {}
        self._left: str | HostError | None = None
        """How the run ended, or why these robots leave it."""
        names = sorted(robots)
        self.link = Link(self._bus, self._keys, names, options.gone_patience_s, self._is_interrupted)
        try:
            on_open()
            self._take_part(names)
        except BaseException:
            self._close()
            raise

    def _take_part(self, names: list[str]) -> None:
        # What was put before a clock is still handed over before it: only the clock has a thread of its own.
        self.link.subscribe(self._keys.clock(), "simulator", read_clock, self._on_clock, has_thread=True)
        for name in names:
            self._listen(name)
        for name in names:
            welcome = self._join(name, self._options.patience_s)
            if welcome is None:
                return
            seat = Seat(self._robots[name], welcome)
            self._members[name] = _Member(self.link, seat)
        # Last, so that who sees the token knows that everything above is in effect.
        for name in names:
            self._bus.token(self._keys.alive_robot(name))

    def _listen(self, name: str) -> None:
        def on_news(news: News) -> None:
            member = self._members.get(name)
            if member is not None and not member.on_news(news):
                self._left = self._left or _replaced(name)

        self.link.subscribe(self._keys.news(name), "simulator", read_news, on_news)
        for what in (*QUERIES, STATE):
            self._bus.serve(self._keys.query(name, what), self.link.board.ask)

    def _join(self, name: str, patience_s: float) -> Welcome | None:
        """Asks until the simulator answers; ``None`` if the run ends meanwhile."""
        request = {
            "protocol": PROTOCOL_VERSION,
            "run": self._options.run,
            "name": name,
            "instance": self._bus.id,
            "bodies": self._robots[name].senses_bodies,
            "sdk": f"python/{__version__}",
        }
        begun = time.monotonic()
        while self._left is None:
            is_last_try = time.monotonic() - begun > patience_s
            answer = self._ask_to_join(name, encode(request))
            if isinstance(answer, Welcome):
                return answer
            if isinstance(answer, Refused):
                # A process that was admitted before is refused its own name only if another one has taken its place.
                if answer.reason == "name_taken" and name in self._members:
                    self._left = self._left or _replaced(name)
                # The end of the run may be in the queue.
                self.link.drain()
                if self._left is not None:
                    return None
                # A predecessor that was killed is noticed within its lease.
                if answer.reason != "name_taken" or is_last_try:
                    raise HostError(f"{name} may not join: {answer}") from answer
            elif is_last_try:
                raise HostError(
                    f"no simulator of run {self._options.run} answers at {self._options.connect}; is it running, and "
                    "is the run's name right? (--run, or CARS_RUN)"
                )
            again_at = time.monotonic() + JOIN_AGAIN_S
            while (left_s := again_at - time.monotonic()) > 0.0:
                self._pump(left_s)
        return None

    def _ask_to_join(self, name: str, request: bytes) -> Welcome | Refused | None:
        key = self._keys.join(name)
        answer = self._bus.ask(key, request)
        return None if answer is None else decode(key, "simulator", answer, read_join_answer)

    def run(self) -> str:
        """Runs until the run ends, and returns how: ``finished``, ``stopped`` or ``aborted``.

        :raises HostError: it cannot go on.
        """
        try:
            while self._left is None:
                if not any([self._advance(member) for member in self._members.values()]):
                    self._pump()
            if isinstance(self._left, HostError):
                raise self._left
            return self._left
        finally:
            self._close()

    def _close(self) -> None:
        self.link.close()
        self._bus.close()

    def _pump(self, patience_s: float = LOOK_FOR_SIMULATOR_S) -> None:
        if self.link.patience_left_s() == 0.0:
            raise HostError(f"the simulator has been gone for {self._options.gone_patience_s:g} s")
        self.link.pump(patience_s)

    def _on_clock(self, clock: Clock) -> None:
        if clock.end is not None:
            self._left = self._left or clock.end
            return
        for member in self._members.values():
            member.on_clock(clock)

    def _is_interrupted(self) -> bool:
        # Only the welcome shows whether the tick that runs is of no use any more.
        for member in self._members.values():
            self._join_again(member)
        return self._left is not None or any(member.is_interrupted for member in self._members.values())

    def _join_again(self, member: _Member) -> None:
        """Joins with the same process in the next epoch, or as a further incarnation, if a robot must."""
        if self._left is None and member.must_join:
            welcome = self._join(member.name, math.inf)
            if welcome is not None:
                member.admit(welcome)

    def _advance(self, member: _Member) -> bool:
        """Runs a robot's tick if it is its turn. Returns whether it was."""
        self._join_again(member)
        return self._left is None and member.advance()


def _replaced(name: str) -> HostError:
    return HostError(f"another process is {name} now")


class _Member:
    """One robot of the process: what arrived for it, and what it has answered. It follows the rules of the ``Participant``
    of the Rust crate ``lockstep``."""

    def __init__(self, link: Link, seat: Seat) -> None:
        self.name = name = seat.welcome.name
        self.must_join = False
        """Whether a clock of a later epoch than its own has arrived, or news that ask it to join again."""
        self._seat = seat
        self._welcome = seat.welcome
        """The newest welcome. The seat has it from the next tick on that begins."""
        self._link = link
        self._is_seated = False
        """Whether it has run a tick as what it was welcomed as."""
        self._has_rejoined = False
        """Whether it was another incarnation before, in the same epoch."""
        self._pending: Clock | None = None
        """The newest clock that has not been run, of its epoch."""
        self._later: Clock | None = None
        """The newest clock of a later epoch. Only a welcome to that epoch shows that it has begun."""
        self._news: dict[tuple[int, int], News] = {}
        """News of ticks that have not been run."""
        self._running: tuple[int, int] | None = None
        self._is_void = False
        """Whether the tick that runs is one of what it is no more."""
        self._held_back: Report | None = None
        """What came of a tick while it was to join again."""
        self._answered = (0, -1)
        """Epoch and tick of the last answer."""
        self._commands: list[tuple[str, bytes]] = []
        self._own_state = self._own_report = b""
        """What came of the last tick, for the case that something got lost; no state where no robot follows it."""
        keys = link.keys
        self._report: Publisher = link.bus.publisher(keys.report(name))
        self._state: Publisher = link.bus.publisher(keys.query(name, STATE))
        self._panel: Publisher = link.bus.publisher(keys.panel(name), may_drop=True)
        self._commanded: dict[str, Publisher] = {}
        """Publishers of the commands to the robots that it has commanded, by key."""
        self._painted_at = float("-inf")
        self._show_predecessor()

    def _show_predecessor(self) -> None:
        """Others may still ask for what the previous incarnation reported last."""
        for last in (self._welcome.state_before, self._welcome.last_state):
            if last is not None:
                self._link.board.show(self.name, last)

    def admit(self, welcome: Welcome) -> None:
        """It has joined again. Clocks of a later epoch than that of the welcome are ignored, and so are their news: both are
        repeated."""
        before, self._welcome = self._welcome, welcome
        self.must_join = False
        if self._later is not None and self._later.epoch == welcome.epoch:
            self._pending = self._later
        self._later = None
        self._news = {of: news for of, news in self._news.items() if of[0] <= welcome.epoch}
        held_back, self._held_back = self._held_back, None
        if (welcome.epoch, welcome.generation) == (before.epoch, before.generation):
            if held_back is not None:
                self._answer_with(held_back)
            return

        self._has_rejoined = welcome.epoch == before.epoch
        self._is_seated = False
        self._is_void = self._running is not None
        self._running = None
        self._answered = (0, -1)
        self._link.board.host(self.name)
        self._show_predecessor()

    def on_clock(self, clock: Clock) -> None:
        """A clock arrived."""
        at = (clock.epoch, clock.tick)
        epoch = self._welcome.epoch
        if clock.epoch > epoch:
            self.must_join = True
            if self._later is None or at >= (self._later.epoch, self._later.tick):
                self._later = clock
            return
        if clock.epoch < epoch or at == self._running:
            return
        if at <= self._answered:
            if at == self._answered and self._running is None:
                self._put()
            return
        newest = self._running or (0, -1)
        if self._pending is not None:
            newest = max(newest, (self._pending.epoch, self._pending.tick))
        if at >= newest:
            self._pending = clock

    def on_news(self, news: News) -> bool:
        """News arrived. Returns whether it is still this process that takes part."""
        at = (news.epoch, news.tick)
        welcome = self._welcome
        is_replaced = news.epoch == welcome.epoch and news.joined is not None and news.joined > welcome.generation
        # While it joins again, a higher generation may become its own.
        if is_replaced and not self.must_join:
            return False
        if news.epoch == welcome.epoch and news.rejoin == welcome.generation:
            self.must_join = True
        if news.epoch >= welcome.epoch and at > max(self._answered, self._running or (0, -1)):
            self._news[at] = news
            # Those of later epochs, which only a welcome confirms, take no room from the others.
            of_same = [of for of in self._news if (of[0] > welcome.epoch) == (at[0] > welcome.epoch)]
            if len(of_same) > MAX_NEWS:
                del self._news[min(of_same)]
        return True

    @property
    def is_interrupted(self) -> bool:
        """Whether the tick that it runs is of no use any more."""
        return self._is_void or (self._running is not None and self._pending is not None)

    def advance(self) -> bool:
        """Runs the pending clock if all that belongs to it is here and it is this robot's turn. Returns whether it was."""
        clock, welcome = self._pending, self._welcome
        if clock is None or self.must_join:
            return False
        at = (clock.epoch, clock.tick)
        news = self._news.get(at)
        if clock.news & welcome.news_flag and news is None:
            return False  # They were lost: both are repeated.

        self._pending = None
        self._news = {of: one for of, one in self._news.items() if of > at}
        is_named = news is not None and news.joined == welcome.generation
        begins = clock.tick == 0 and not self._has_rejoined
        if clock.epoch < welcome.epoch or not (self._is_seated or begins or is_named):
            return False
        is_first = not self._is_seated
        if is_first:
            self._seat.start_over(welcome)
        self._is_seated = True
        self._running = at
        self._link.begin(*at)
        try:
            report = self._seat.run(clock.tick, news or NO_NEWS, is_first, self._link.state_of)
        except Interrupted:
            return True
        finally:
            is_void, self._is_void = self._is_void, False
            self._running = None
        self._link.drain()
        # What was run as what it is no more is thrown away.
        if self.must_join and not is_void:
            self._held_back = report
        elif not is_void:
            self._answer_with(report)
        return True

    def _answer_with(self, report: Report) -> None:
        data = encode(report_json(report))
        if len(data) > MAX_MESSAGE_BYTES:
            # The simulator would refuse it and wait for another one for ever.
            raise HostError(
                f"the report of {self.name} is {len(data)} bytes long, more than {MAX_MESSAGE_BYTES}: publish fewer or "
                "shorter state variables"
            )
        self._answered = (report.state.epoch, report.state.tick)
        self._commands = [
            (self._link.keys.command(to, self.name), encode(command_json(report, number, text)))
            for number, (to, text) in enumerate(report.commands, start=1)
        ]
        self._own_state = encode(state_json(report.state)) if self._state.is_watched else b""
        self._own_report = data
        # First what others may ask for, then the report: after it the clock may go on and they will ask.
        self._link.board.show(self.name, report.state)
        self._put()
        if self._panel.is_watched:
            self._paint()

    def _put(self) -> None:
        """Puts what came of the last tick. Who follows has the state before the next clock, because both come the same
        way."""
        for key, command in self._commands:
            if key not in self._commanded and len(self._commanded) < MAX_COMMANDED:
                self._commanded[key] = self._link.bus.publisher(key)
            publisher = self._commanded.get(key)
            if publisher is None:
                self._link.put(key, command)
            else:
                publisher.put(command)
        if self._own_state:
            self._state.put(self._own_state)
        self._report.put(self._own_report)

    def _paint(self) -> None:
        now = time.monotonic()
        if now - self._painted_at >= PANEL_INTERVAL_S:
            self._painted_at = now
            self._panel.put(encode(panel_json(self._seat.panel())))


__all__ = ["BusError", "Host", "HostError", "HostOptions"]
