"""The lock-step loop over the bus, for one robot or several in a process. They share one session: what several robots say
in a tick leaves in one batch."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from .bus import DEFAULT_ENDPOINT, Bus, BusError, Publisher
from .cars import Interrupted
from .keys import QUERIES, STATE, Keys
from .link import Link
from .messages import (
    MAX_MESSAGE_BYTES,
    PROTOCOL_VERSION,
    Clock,
    Refused,
    Report,
    Welcome,
    decode,
    encode,
    is_name,
    read_join_answer,
    report_json,
    state_json,
)
from .panel import panel_json
from .robot import Robot
from .seat import Seat
from .version import __version__

PANEL_INTERVAL_S = 0.05
"""A panel is for eyes: no more often than this."""
JOIN_AGAIN_S = 0.1
"""Between two attempts to join."""

_log = logging.getLogger(__name__)


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
        names = sorted(robots)
        self._bus = Bus(options.connect, options.patience_s, options.zenoh_config)
        self._keys = Keys(options.run)
        self.link = Link(self._bus, self._keys, options.gone_patience_s)
        self._members: list[_Member] = []
        try:
            on_open()
            self._take_part(names, robots)
        except BaseException:
            self._close()
            raise

    def _take_part(self, names: list[str], robots: Mapping[str, Robot]) -> None:
        self.link.listen()
        for name in names:
            self.link.host(name)
            for what in (*QUERIES, STATE):
                self._bus.serve(self._keys.query(name, what), self.link.board.ask)
        for name in names:
            welcome = self._join(name)
            # Others may still ask for what the previous incarnation reported last.
            for last in (welcome.state_before, welcome.last_state):
                if last is not None:
                    self.link.board.show(name, last)
            self._members.append(_Member(self._bus, self._keys, Seat(robots[name], welcome)))
        # Last, so that who sees the token knows that everything above is in effect.
        for name in names:
            self._bus.token(self._keys.alive_robot(name))

    def _join(self, name: str) -> Welcome:
        options = self._options
        request = {
            "protocol": PROTOCOL_VERSION,
            "run": options.run,
            "name": name,
            "instance": self._bus.id,
            "sdk": f"python/{__version__}",
        }
        begun = time.monotonic()
        while True:
            is_last_try = time.monotonic() - begun > options.patience_s
            answer = self._ask_to_join(name, encode(request))
            if isinstance(answer, Welcome):
                self.link.keep_commands(answer.repeat_ticks)
                return answer
            if isinstance(answer, Refused):
                # A predecessor that was killed is noticed within its lease.
                if answer.reason != "name_taken" or is_last_try:
                    raise HostError(f"{name} may not join: {answer}") from answer
            elif is_last_try:
                raise HostError(
                    f"no simulator of run {options.run} answers at {options.connect}; is it running, and is the run's "
                    "name right? (--run, or CARS_RUN)"
                )
            time.sleep(JOIN_AGAIN_S)

    def _ask_to_join(self, name: str, request: bytes) -> Welcome | Refused | None:
        key = self._keys.join(name)
        answer = self._bus.ask(key, request)
        return None if answer is None else decode(key, "simulator", answer, read_join_answer)

    def run(self) -> str:
        """Runs until the run ends, and returns how: ``finished``, ``stopped`` or ``aborted``.

        :raises HostError: it cannot go on.
        """
        try:
            while True:
                clock = self.link.next_clock()
                if clock is None:
                    raise HostError(f"the simulator has been gone for {self._options.gone_patience_s:g} s")
                if clock.end is not None:
                    return clock.end
                self._on_clock(clock)
        finally:
            self._close()

    def _close(self) -> None:
        self.link.close()
        self._bus.close()

    def _on_clock(self, clock: Clock) -> None:
        """One tick of every robot of the process, in the order of their names."""
        asked = (clock.epoch, clock.tick)
        if asked < self.link.current:
            return  # An echo: the clock has gone on since.
        if asked > self.link.current:
            self.link.begin(clock.epoch, clock.tick)
        for member in self._members:
            if clock.tick == 0 and member.seat.welcome.epoch < clock.epoch:
                self._rejoin(member, clock)
            member.answer(clock, self.link)

    def _rejoin(self, member: _Member, clock: Clock) -> None:
        """``init``: the same robot, with what holds for the new epoch."""
        welcome = self._join(member.name)
        if welcome.epoch == clock.epoch:
            member.start_over(welcome)


class _Member:
    """One robot of the process."""

    def __init__(self, bus: Bus, keys: Keys, seat: Seat) -> None:
        self.name = name = seat.welcome.name
        self.seat = seat
        self._is_seated = False
        """Whether the clock that names it has come, and it takes part."""
        self._report: Publisher = bus.publisher(keys.report(name))
        self._state: Publisher = bus.publisher(keys.query(name, STATE))
        self._panel: Publisher = bus.publisher(keys.panel(name), may_drop=True)
        self._painted_at = float("-inf")
        self._last: tuple[tuple[int, int], bytes] | None = None
        """Epoch and tick of the last report, and the report, for the case that it got lost."""

    def start_over(self, welcome: Welcome) -> None:
        """The same robot in a new epoch."""
        self.seat.start_over(welcome)
        self._is_seated = False
        self._last = None

    def answer(self, clock: Clock, link: Link) -> None:
        """Answers a clock, if it is this robot's turn."""
        welcome = self.seat.welcome
        if clock.epoch != welcome.epoch:
            return  # An echo of an earlier epoch.
        news = clock.news.get(self.name)
        joined = None if news is None else news.joined
        if joined is not None and joined > welcome.generation:
            raise HostError(f"another process is {self.name} now")
        asked = (clock.epoch, clock.tick)
        if self._last is not None and self._last[0] >= asked:
            if self._last[0] == asked:
                link.repeat_commands()
                self._report.put(self._last[1])
            return
        try:
            report = self._tick(clock, joined == welcome.generation, link)
        except Interrupted:
            self.seat.abandon()
            return
        if report is None:
            return
        # First what others may ask for, then the report: after it the clock may go on and they will ask. Who follows has
        # the state before the next clock, because both come the same way.
        if self._state.is_watched:
            self._state.put(encode(state_json(report.state)))
        link.board.show(self.name, report.state)
        data = encode(report_json(report))
        if len(data) > MAX_MESSAGE_BYTES:
            # The simulator would refuse it and wait for another one for ever.
            raise HostError(
                f"the report of {self.name} is {len(data)} bytes long, more than {MAX_MESSAGE_BYTES}: publish fewer or "
                "shorter state variables, or send shorter commands"
            )
        self._report.put(data)
        self._last = (asked, data)
        if self._panel.is_watched:
            self._paint()

    def _tick(self, clock: Clock, joins: bool, link: Link) -> Report | None:
        if self._is_seated:
            return self.seat.tick(clock, link)
        if clock.tick > 0 and not joins:
            return None  # Its turn has not come: the clock that names it is still to be granted.
        self._is_seated = True
        return self.seat.init(clock, link) if clock.tick == 0 else self.seat.resume(clock, link)

    def _paint(self) -> None:
        now = time.monotonic()
        if now - self._painted_at >= PANEL_INTERVAL_S:
            self._painted_at = now
            self._panel.put(encode(panel_json(self.seat.panel())))


__all__ = ["BusError", "Host", "HostError", "HostOptions"]
