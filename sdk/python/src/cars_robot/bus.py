"""The bus: zenoh behind a few verbs, with the settings that a lock-step system needs. The only file that names it."""

from __future__ import annotations

import json
import logging
import os
import queue
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where a simulator listens unless told otherwise."""

QUERY_TIMEOUT_S = 2.0
"""Longest wait for an answer before the asker looks again whether the other side is still there."""

RUNTIME_VARIABLE = "ZENOH_RUNTIME"
ONE_THREAD = "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))"
"""All duties of the middleware on one thread: a message that crosses fewer threads arrives sooner."""

SETTINGS = {
    "scouting/delay": "0",
    "scouting/multicast/enabled": "false",
    "scouting/gossip/enabled": "false",
    # A process that hangs or a link that is cut is noticed within this time, milliseconds.
    "transport/link/tx/lease": "2000",
    "transport/link/tx/keep_alive": "4",
    # A receiver that does not read holds the sender for at most this long, microseconds.
    "transport/link/tx/queue/congestion_control/block/wait_before_close": "500000",
    "transport/link/rx/max_message_size": "4194304",
    # An attempt to connect into a cut link must not outlive the cut for long, milliseconds.
    "transport/unicast/open_timeout": "1000",
    "connect/retry": "{period_init_ms: 100, period_max_ms: 200, period_increase_factor: 2}",
}
"""What a session is set to, unless a configuration file says otherwise."""

_log = logging.getLogger(__name__)


class BusError(Exception):
    """The bus failed; the text says at what, and what the middleware says."""


class Publisher:
    """A place to put messages of one kind."""

    def __init__(self, publisher: zenoh.Publisher, key: str) -> None:
        self._publisher = publisher
        self._key = key
        self.is_watched = False
        """Whether anybody subscribes: pictures that nobody looks at need not be painted."""
        listener = zenoh.handlers.Callback(self._on_matching, indirect=False)
        self._listener = publisher.declare_matching_listener(listener)
        self.is_watched = self.is_watched or bool(publisher.matching_status)

    def _on_matching(self, status: zenoh.MatchingStatus) -> None:
        self.is_watched = status.matching

    def put(self, message: bytes) -> None:
        """Puts a message.

        :raises BusError: if the session is closed.
        """
        try:
            self._publisher.put(message)
        except zenoh.ZError as error:
            raise BusError(f"cannot put on {self._key}: {error}") from None


class Question:
    """A question that waits for an answer. One that is dropped unanswered ends at once at the asker."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.key = str(query.key_expr)

    def parameter(self, name: str) -> str | None:
        """The parameter called ``name``, as in ``?tick=12;epoch=1``."""
        return self._query.parameters.get(name)

    def answer(self, message: bytes) -> None:
        """Answers on its own key."""
        self._say(lambda query: query.reply(query.key_expr, message))

    def refuse(self, reason: str) -> None:
        """Refuses, in words."""
        self._say(lambda query: query.reply_err(reason))

    def _say(self, say: Callable[[zenoh.Query], object]) -> None:
        try:
            say(self._query)
        except zenoh.ZError as error:
            _log.debug("a question on %s could not be answered: %s", self.key, error)
        finally:
            # The asker waits until it is told that nothing else will come.
            self._query.drop()  # type: ignore[no-untyped-call]


class Bus:
    """A session of the middleware: a client of the simulator, or of a router, at one endpoint."""

    def __init__(self, connect: str, patience_s: float, config_file: Path | None = None) -> None:
        """Opens a session; ``config_file`` then replaces the built-in settings.

        :raises BusError: names the address that was tried and what went wrong.
        """
        # Read once, when the first session opens.
        os.environ.setdefault(RUNTIME_VARIABLE, ONE_THREAD)
        hint = ""
        if connect.startswith("tls/"):
            if config_file is None:
                raise BusError(
                    f"{connect} wants a certificate: name a file zenoh.json5 that `cars secure init` made, by "
                    "--zenoh-config or CARS_ZENOH_CONFIG"
                )
            threads = os.environ[RUNTIME_VARIABLE]
            if threads != ONE_THREAD:
                raise BusError(
                    f"{connect} is encrypted, and zenoh's TLS link is unsafe with the threads of {RUNTIME_VARIABLE}="
                    f"{threads!r} (eclipse-zenoh/zenoh issue 2557); unset {RUNTIME_VARIABLE}, or use the one thread that this "
                    "SDK sets"
                )
            hint = (
                " (are both certificates of the same `cars secure init`, valid, and the simulator's for this host?)"
            )
        try:
            self._session = zenoh.open(_configuration(connect, patience_s, config_file))
        except zenoh.ZError as error:
            raise BusError(
                f"cannot reach the simulator at {connect}: {_reason(error)}{hint}; start it first, or say by --connect or "
                "CARS_CONNECT where it listens"
            ) from None
        self._declared: list[object] = []

    @property
    def id(self) -> str:
        """An identity that no other session has."""
        return str(self._session.zid())

    def publisher(self, key: str, may_drop: bool = False) -> Publisher:
        """Declares that messages will be put on ``key``.

        ``may_drop`` is for what observers see: nobody who watches may hold the clock. All else waits, because a
        lock-step system cannot afford a lost message.
        """
        control = zenoh.CongestionControl.DROP if may_drop else zenoh.CongestionControl.BLOCK
        return Publisher(self._session.declare_publisher(key, congestion_control=control), key)

    def put(self, key: str, message: bytes) -> None:
        """Puts one message.

        :raises BusError: if the session is closed.
        """
        try:
            self._session.put(key, message, congestion_control=zenoh.CongestionControl.BLOCK)
        except zenoh.ZError as error:
            raise BusError(f"cannot put on {key}: {error}") from None

    def subscribe(
        self, keys: str, handle: Callable[[str, bytes], None], has_thread: bool = False
    ) -> zenoh.Subscriber[None]:
        """Calls ``handle(key, bytes)`` for each message put on ``keys``. It must hand over and return.

        It runs on the thread that reads the link, so that what was put first is handed over first, also over several
        keys; or, with ``has_thread``, later on a thread of its own. For what comes in every tick that is faster by a
        fifth: a thread that Python did not start is made known to it anew for each message. It ends when the result is
        undeclared.
        """

        def take(sample: zenoh.Sample) -> None:
            handle(str(sample.key_expr), sample.payload.to_bytes())

        return self._session.declare_subscriber(keys, zenoh.handlers.Callback(take, indirect=has_thread))

    def serve(self, key: str, handle: Callable[[Question], None]) -> None:
        """Calls ``handle`` for each question asked on ``key``. It must hand over and return."""

        def take(query: zenoh.Query) -> None:
            handle(Question(query))

        callback = zenoh.handlers.Callback(take, indirect=False)
        self._declared.append(self._session.declare_queryable(key, callback))

    def ask(self, key: str, body: bytes, timeout_s: float = QUERY_TIMEOUT_S) -> bytes | None:
        """Asks, and waits for the one answer: ``None`` if nobody answers. A refusal in words is an answer."""
        answers: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._get(key, lambda answer, _: answers.put(answer), lambda: answers.put(None), body, timeout_s)
        try:
            # The middleware ends every question; the second is for the case that it forgets.
            return answers.get(timeout=timeout_s + 1.0)
        except queue.Empty:
            return None

    def ask_then(self, selector: str, then: Callable[[bytes, bool], None]) -> None:
        """Asks; ``then(answer, is_refusal)`` is called with an answer, or never where nobody answers.

        :raises BusError: if the session is closed.
        """
        self._get(selector, then, None, None, QUERY_TIMEOUT_S)

    def _get(
        self,
        selector: str,
        then: Callable[[bytes, bool], None],
        end: Callable[[], None] | None,
        body: bytes | None,
        timeout_s: float,
    ) -> None:
        def take(reply: zenoh.Reply) -> None:
            if (sample := reply.ok) is not None:
                then(sample.payload.to_bytes(), False)
            elif (error := reply.err) is not None and (text := error.payload.to_bytes()) != b"Timeout":
                then(text, True)

        try:
            self._session.get(
                selector,
                zenoh.handlers.Callback(take, end, indirect=False),
                payload=body,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
                timeout=timeout_s,
            )
        except zenoh.ZError as error:
            raise BusError(f"cannot ask {selector}: {error}") from None

    def token(self, key: str) -> None:
        """Shows that something is there, until the session is closed or gone. To be declared last: who sees it knows
        that everything declared before is in effect."""
        self._declared.append(self._session.liveliness().declare_token(key))

    def watch(self, key: str, handle: Callable[[bool], None]) -> None:
        """Calls ``handle(is_there)`` when the token ``key`` is there, comes or goes."""

        def take(sample: zenoh.Sample) -> None:
            handle(sample.kind == zenoh.SampleKind.PUT)

        callback = zenoh.handlers.Callback(take, indirect=False)
        declared = self._session.liveliness().declare_subscriber(key, callback, history=True)
        self._declared.append(declared)

    def close(self) -> None:
        """Takes back the tokens and closes the session after everything that was put has left."""
        self._declared.clear()
        try:
            self._session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError as error:
            _log.debug("closing the session: %s", error)


def _reason(error: zenoh.ZError) -> str:
    """What the middleware says, without the places in its source."""
    return re.sub(r"\s+at \S+\.rs:\d+\.?", "", str(error))


def _configuration(connect: str, patience_s: float, config_file: Path | None) -> zenoh.Config:
    try:
        config: zenoh.Config = zenoh.Config() if config_file is None else zenoh.Config.from_file(config_file)
    except zenoh.ZError as error:
        raise BusError(f"{config_file}: {error}") from None
    settings: dict[str, Any] = {
        "mode": '"client"',
        "connect/endpoints": json.dumps([connect]),
        "connect/timeout_ms": str(round(patience_s * 1000)),
    }
    if config_file is None:
        settings.update(SETTINGS)
    for key, value in settings.items():
        config.insert_json5(key, value)
    return config
