#!/usr/bin/env python3
"""A whole robot over eclipse-zenoh alone, to be read beside ``docs/protocol.md``, whose rules the comments name.

It walks to and fro, turns where it is blocked or when somebody says ``turn``, and counts its steps. It asks no other robot. Whoever
wants to write a robot in Python uses the package ``cars`` instead, which does all this; whoever writes one in a language that has
neither finds here how much there is to do: ``pip install eclipse-zenoh``, then ``cars conform -- examples/plain_zenoh.py``.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import queue
import sys
import threading
import time
from typing import Any

import zenoh

SPEED_MPS = 0.5
QUERIES = ("location", "speed", "direction", "state_variables", "emotion_state", "behavior_state")
SETTINGS = {
    "mode": '"client"',
    "scouting/multicast/enabled": "false",
    "scouting/gossip/enabled": "false",
    "transport/link/tx/lease": "2000",
    "transport/link/tx/keep_alive": "4",
    "transport/link/tx/queue/congestion_control/block/wait_before_close": "500000",
    "transport/link/rx/max_message_size": "4194304",
    "transport/unicast/open_timeout": "1000",
    "connect/retry": "{period_init_ms: 100, period_max_ms: 200, period_increase_factor: 2}",
}
Json = dict[str, Any]


class Walker:
    """What the robot does. Everything below is the same for every robot."""

    def __init__(self, welcome: Json) -> None:
        self.x, self.y = point(welcome["location"])
        self.step_m = SPEED_MPS * welcome["tick_s"]
        self.steps = 0

    def tick(self, blocked: bool, commands: list[tuple[str, str]], log: list[str]) -> Json:
        """One tick, at ``x`` and ``y``: where to be at the next one, and what others may know."""
        for sender, command in commands:
            if command == "turn":
                self.step_m = -self.step_m
            else:
                log.append(f"does not know what {sender} means by {command!r}"[:1000])
        self.steps += not blocked
        if blocked:
            self.step_m = -self.step_m
        return {
            "proposal": {"x": self.x + self.step_m, "y": self.y},
            "speed_mps": SPEED_MPS,
            # number.angles: pi, rounded.
            "direction_rad": 0.0 if self.step_m > 0 else 3.141593,
            "emotion_state": "ANNOYED" if blocked else "CALM",
            "behavior_state": "WALK",
            "state_variables": {"steps": self.steps},
        }


# Reading: what is not as it must be raises a ValueError (robust.malformed).


def whole(value: object) -> int:
    """A whole number, written without a fraction (number.integers)."""
    if type(value) is not int or not 0 <= value < 1 << 53:
        raise ValueError(f"{value!r} is not a whole number")
    return value


def number(value: object) -> float:
    """A finite number."""
    if type(value) not in (int, float) or not math.isfinite(value):  # type: ignore[arg-type]
        raise ValueError(f"{value!r} is not a number")
    return float(value)  # type: ignore[arg-type]


def text(value: object) -> str:
    """A text of a message."""
    if not isinstance(value, str) or len(value.encode()) > 4096:
        raise ValueError(f"{str(value)[:60]!r} is not a text of a message")
    return value


def point(value: Json) -> tuple[float, float]:
    """A location."""
    return number(value["x"]), number(value["y"])


def items(value: object) -> list[Json]:
    """A list of objects. How many commands arrive in a tick is limited by their bytes, not by their number."""
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise ValueError("not a list of objects")
    return value


def read_clock(message: Json) -> Json:
    """A clock, with what may be absent."""
    end = message.get("end")
    if end not in (None, "finished", "stopped", "aborted"):
        raise ValueError(f"{end!r} is no end")
    at = (whole(message["epoch"]), whole(message["tick"]))
    return {"at": at, "news": whole(message.get("news", 0)), "end": end}


def read_news(message: Json) -> Json:
    """The news of a tick, with what may be absent (compat.unknown-fields)."""
    news: Json = {"at": (whole(message["epoch"]), whole(message["tick"])), "location": None, "blocked": False}
    for name in ("joined", "rejoin"):
        news[name] = whole(message.get(name) or 0)
    if (correction := message.get("correction")) is not None:
        news["location"] = point(correction["location"])
        news["blocked"] = correction.get("blocked", False)
        if not isinstance(news["blocked"], bool):
            raise ValueError("blocked is neither true nor false")
    news["commands"] = [(text(one["from"]), text(one["command"])) for one in items(message.get("commands", []))]
    return news


class Link:
    """The robot on the bus, and its place in the lock-step."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.run = os.environ.get("CARS_RUN", "default")
        self.patience_s = float(os.environ.get("CARS_PATIENCE_S", "20"))
        self.gone_patience_s = float(os.environ.get("CARS_GONE_PATIENCE_S", "600"))
        self.session = zenoh.open(self.configuration())
        self.inbox: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self.lock = threading.Lock()
        # The last two states: during a tick everybody sees the one before it (query.tick).
        self.states: list[Json] = []

        # First everything that listens, so that no message is missed. Callbacks hand over and return; what they serve is kept in
        # variables, because it is undeclared when it is dropped.
        own = f"cars/{self.run}/robot/{name}"
        alive = f"cars/{self.run}/alive"
        self.declared: list[object] = [
            self.session.declare_subscriber(f"cars/{self.run}/clock", self.handing_over("clock")),
            self.session.declare_subscriber(f"{own}/news", self.handing_over("news")),
            *(self.declare_queryable(f"{own}/{what}", what) for what in ("state", *QUERIES)),
            self.session.liveliness().declare_subscriber(f"{alive}/sim", self.on_simulator, history=True),
        ]
        block = zenoh.CongestionControl.BLOCK  # wire.qos
        self.report = self.session.declare_publisher(f"{own}/report", congestion_control=block)
        self.state = self.session.declare_publisher(f"{own}/state", congestion_control=block)

        self.welcome: Json = {}
        self.is_seated = self.has_rejoined = self.must_join = False
        self.pending: Json | None = None
        self.later: Json | None = None
        self.news: dict[tuple[int, int], Json] = {}
        self.answered = (0, -1)
        self.answer_bytes = (b"", b"")
        self.join()
        # join.ready-last: who sees the token knows that all of the above is in effect.
        self.declared.append(self.session.liveliness().declare_token(f"{alive}/robot/{name}"))

    def configuration(self) -> zenoh.Config:
        """The settings of the page, or those of a file."""
        file = os.environ.get("CARS_ZENOH_CONFIG")
        config: zenoh.Config = zenoh.Config.from_file(file) if file else zenoh.Config()
        connect = os.environ.get("CARS_CONNECT", "tcp/127.0.0.1:7447")
        settings = {} if file else SETTINGS
        endpoint = {"connect/endpoints": json.dumps([connect]), "connect/timeout_ms": str(round(self.patience_s * 1000))}
        for key, value in {**settings, "mode": '"client"', **endpoint}.items():
            config.insert_json5(key, value)
        return config

    def handing_over(self, kind: str) -> Any:
        """A callback that puts messages into the inbox, in the order in which they arrive."""
        return zenoh.handlers.Callback(
            lambda sample: self.inbox.put((kind, sample.payload.to_bytes())), indirect=False
        )

    def on_simulator(self, sample: zenoh.Sample) -> None:
        """The simulator's token came or went."""
        self.inbox.put(("simulator", b"here" if sample.kind == zenoh.SampleKind.PUT else b"gone"))

    def declare_queryable(self, key: str, what: str) -> object:
        """query.once: replies on its own key, also to a get with a wildcard."""
        return self.session.declare_queryable(key, lambda query: self.answer(query, key, what))

    def answer(self, query: zenoh.Query, key: str, what: str) -> None:
        """query.at-once: answered on zenoh's thread, also while the robot computes. query.once: then released."""
        with query:
            with self.lock:
                found = self.asked_for(query.parameters.get("tick"), query.parameters.get("epoch"))
            if found is None:
                query.reply_err("that tick is not known here: it is over, or not reported yet")
                return
            field = {"speed": "speed_mps", "direction": "direction_rad"}.get(what, what)
            one = {"performative": "tell", "epoch": found["epoch"], "tick": found["tick"], "value": found.get(field)}
            query.reply(key, json.dumps(found if what == "state" else one))

    def asked_for(self, tick: str | None, epoch: str | None) -> Json | None:
        """The state that answers a query; with ``tick=T`` it is that of T - 1."""
        if any(asked is not None and not (asked.isascii() and asked.isdigit()) for asked in (tick, epoch)):
            return None
        newest = self.states[-1] if self.states else None
        if newest is None or (epoch is not None and int(epoch) != newest["epoch"]):
            return None
        if tick is None:
            return newest
        return next((state for state in self.states if state["tick"] == int(tick) - 1), None)

    def join(self) -> None:
        """Asks until the simulator answers (join.request, join.refused)."""
        request = {"protocol": 2, "run": self.run, "name": self.name, "sdk": "plain zenoh"}
        request["instance"] = str(self.session.zid())
        begun = time.monotonic()
        while True:
            replies = self.session.get(
                f"cars/{self.run}/join/{self.name}",
                payload=json.dumps(request),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=2.0,
            )
            answers = [json.loads(reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None]
            is_over = not self.welcome and time.monotonic() - begun > self.patience_s
            if answers and answers[0]["answer"] == "welcome":
                self.seat(answers[0])
                return
            if answers:
                is_own = answers[0]["reason"] == "name_taken" and self.welcome
                if answers[0]["reason"] != "name_taken" or is_own or is_over:
                    self.leave(f"{self.name} may not join: {answers[0]['explanation']}")
            elif is_over:
                self.leave(f"no simulator of run {self.run} answers")
            time.sleep(0.1)

    def seat(self, welcome: Json) -> None:
        """Takes a place in an epoch, or goes on if it is the one that it has (epoch.init, return.generation)."""
        before, self.welcome = self.welcome, welcome
        self.must_join = False
        if self.later is not None and self.later["at"][0] == welcome["epoch"]:
            self.pending = self.later
        self.later = None
        epoch = welcome["epoch"]
        self.news = {at: news for at, news in self.news.items() if at[0] == epoch}
        if before and (before["epoch"], before["generation"]) == (epoch, welcome["generation"]):
            return
        self.has_rejoined = bool(before) and before["epoch"] == epoch
        self.is_seated = False
        self.answered = (0, -1)
        with self.lock:
            self.states = [state for name in ("state_before", "last_state") if (state := welcome.get(name))]

    def leave(self, reason: str = "") -> None:
        """Takes the token back, closes the session, so that nothing that was put is lost, and ends."""
        self.declared.clear()
        self.session.close()  # type: ignore[no-untyped-call]
        sys.exit(f"error: {reason}" if reason else 0)

    def play(self) -> None:
        """Plays until the end of the run."""
        gone_at: float | None = None
        while True:
            left_s = None if gone_at is None else max(gone_at + self.gone_patience_s - time.monotonic(), 0.0)
            try:
                kind, payload = self.inbox.get(timeout=left_s)
            except queue.Empty:
                self.leave("the simulator has been gone for too long")  # end.gone
            while kind:
                if kind == "simulator":
                    gone_at = None if payload == b"here" else time.monotonic()
                else:
                    self.take(kind, payload)
                # Of several clocks that have arrived only the newest is run.
                try:
                    kind, payload = self.inbox.get_nowait()
                except queue.Empty:
                    kind = ""
            if self.must_join:
                self.join()
            self.advance()

    def take(self, kind: str, payload: bytes) -> None:
        """A message arrived."""
        try:
            message = json.loads(payload)
            if not isinstance(message, dict):
                raise ValueError("not an object")
            self.on_clock(read_clock(message)) if kind == "clock" else self.on_news(read_news(message))
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            print(f"a malformed message, {kind}: {error!r}"[:500], file=sys.stderr, flush=True)

    def on_clock(self, clock: Json) -> None:
        """A clock arrived (end.clock, epoch.init, clock.late, clock.duplicate)."""
        if clock["end"] is not None:
            self.leave()
        epoch = self.welcome["epoch"]
        if clock["at"][0] > epoch:
            self.must_join = True
            self.later = clock if self.later is None or clock["at"] >= self.later["at"] else self.later
        elif clock["at"][0] == epoch and clock["at"] == self.answered:
            self.put()
        elif clock["at"][0] == epoch and clock["at"] > self.answered:
            self.pending = clock if self.pending is None or clock["at"] >= self.pending["at"] else self.pending

    def on_news(self, news: Json) -> None:
        """News arrived (return.replaced, return.rejoin)."""
        own = self.welcome["generation"]
        is_of_epoch = news["at"][0] == self.welcome["epoch"]
        if is_of_epoch and news["joined"] > own and not self.must_join:
            self.leave(f"another process is {self.name} now")
        self.must_join |= is_of_epoch and news["rejoin"] == own
        if news["at"] > self.answered:
            self.news[news["at"]] = news
            if len(self.news) > 64:
                del self.news[min(self.news)]

    def advance(self) -> None:
        """Runs the newest clock, if its news are here and it is this robot's turn (news.wait, epoch.late)."""
        clock = self.pending
        if clock is None or self.must_join:
            return
        at = clock["at"]
        news = self.news.get(at)
        if clock["news"] & self.welcome.get("news_flag", 0) and news is None:
            return  # They are repeated with the clock.
        self.pending = None
        self.news = {other: kept for other, kept in self.news.items() if other > at}
        is_named = news is not None and news["joined"] == self.welcome["generation"]
        begins = at[1] == 0 and not self.has_rejoined
        if at[0] == self.welcome["epoch"] and (self.is_seated or is_named or begins):
            self.run_tick(at, news or {"location": None, "blocked": False, "commands": []})

    def run_tick(self, at: tuple[int, int], news: Json) -> None:
        """A tick: state first, then the report (tick.correction, tick.state-first, tick.answer)."""
        if not self.is_seated:
            self.walker = Walker(self.welcome)
            self.proposal = (self.walker.x, self.walker.y)
        self.is_seated = True
        stands = news["location"] or self.proposal
        self.walker.x, self.walker.y = stands
        log: list[str] = []
        did = self.walker.tick(news["blocked"], news["commands"], log)
        proposal = did.pop("proposal")
        self.proposal = (proposal["x"], proposal["y"])
        epoch, tick = at
        state = {"epoch": epoch, "tick": tick, "location": {"x": stands[0], "y": stands[1]}, **did}
        generation = self.welcome["generation"]
        report = {"epoch": epoch, "tick": tick, "generation": generation, "proposal": proposal, "log": log, **did}
        with self.lock:
            self.states = [*self.states, state][-2:]
        self.answered = at
        self.answer_bytes = (json.dumps(state).encode(), json.dumps(report).encode())
        self.put()

    def put(self) -> None:
        """Puts what came of the last tick; again, byte for byte the same."""
        state, report = self.answer_bytes
        self.state.put(state)
        self.report.put(report)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="a robot over plain zenoh")
    parser.add_argument("--name", default="Walker", help="which robot of the roster this is")
    # All duties of zenoh on one thread: a message that crosses fewer threads arrives sooner.
    one_thread = "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))"
    os.environ.setdefault("ZENOH_RUNTIME", one_thread)
    Link(parser.parse_args().name).play()
