"""A simulator that says what a test wants, for what a real one says only when something is broken: clocks that come twice,
news that get lost, messages that are damaged. Robots are real processes."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh
from lab import environment, eventually, free_endpoint

PATIENCE_S = 90.0
PROBE = Path(__file__).with_name("probe.py")
Json = dict[str, Any]


class Stage:
    """A router and a simulator in one, for robots A, B and C of run ``r`` unless a test says otherwise."""

    def __init__(self, run: str = "r") -> None:
        self.run = run
        self.root = f"cars/{run}"
        self.endpoint = free_endpoint()
        config = zenoh.Config()
        for key, value in {
            "mode": '"router"',
            "listen/endpoints": json.dumps([self.endpoint]),
            "scouting/delay": "0",
            "scouting/multicast/enabled": "false",
            "scouting/gossip/enabled": "false",
        }.items():
            config.insert_json5(key, value)
        self.session = zenoh.open(config)
        self.joins: list[Json] = []
        """Requests to join, and with each whether the robot already listened to the clock, and showed its token."""
        self.welcome: Callable[[Json], Json] = lambda request: welcome(name=request["name"])
        """What is answered to a request."""
        self.alive: set[str] = set()
        self.said: list[str] = []
        """The keys on which robots have put something, in that order."""
        self._heard: dict[str, queue.Queue[bytes]] = {}
        self._lock = threading.Lock()
        self._processes: list[subprocess.Popen[str]] = []
        self._clock = self.session.declare_publisher(
            f"{self.root}/clock", congestion_control=zenoh.CongestionControl.BLOCK
        )
        self._keep: list[object] = [
            self.session.declare_queryable(f"{self.root}/join/**", self._on_join),
            self.session.declare_subscriber(f"{self.root}/robot/**", self._on_message),
            self.session.liveliness().declare_subscriber(f"{self.root}/alive/robot/*", self._on_token, history=True),
            self.session.liveliness().declare_token(f"{self.root}/alive/sim"),
        ]

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            if process.poll() is None:
                process.kill()
            process.communicate()
        self.session.close()  # type: ignore[no-untyped-call]

    # What robots say.

    def _on_join(self, query: zenoh.Query) -> None:
        with query:
            request = json.loads(query.payload.to_bytes() if query.payload else b"null")
            listens = self._clock.matching_status
            self.joins.append(
                request | {"key": str(query.key_expr), "listens": listens, "alive": request["name"] in self.alive}
            )
            query.reply(query.key_expr, json.dumps(self.welcome(request)))

    def _on_message(self, sample: zenoh.Sample) -> None:
        self.said.append(str(sample.key_expr).removeprefix(f"{self.root}/"))
        self._queue(str(sample.key_expr)).put(sample.payload.to_bytes())

    def _on_token(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rsplit("/", 1)[-1]
        (self.alive.add if sample.kind == zenoh.SampleKind.PUT else self.alive.discard)(name)

    def _queue(self, key: str) -> queue.Queue[bytes]:
        with self._lock:
            return self._heard.setdefault(key, queue.Queue())

    # What the test says.

    def robot(self, *arguments: str, script: Path = PROBE, **more: str) -> subprocess.Popen[str]:
        """Starts a robot, by default A."""
        process = subprocess.Popen(
            [sys.executable, str(script), *arguments],
            env=environment(CARS_RUN=self.run, CARS_CONNECT=self.endpoint, **more),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._processes.append(process)
        return process

    def ready(self, *arguments: str, name: str = "A") -> subprocess.Popen[str]:
        """Starts a robot and waits until it shows its token."""
        process = self.robot(*arguments)
        self.until_alive(name)
        return process

    def until_alive(self, *names: str) -> None:
        """Waits until these robots, and no others, show their tokens."""
        eventually(f"{names} to be there", lambda: self.alive == set(names) or None, PATIENCE_S)

    def clock(self, tick: int, epoch: int = 1, end: str | None = None, **news: Json) -> None:
        """Grants a tick, with news for some robots."""
        for name, what in news.items():
            self.news(name, tick, epoch, **what)
        message: Json = {"epoch": epoch, "tick": tick, "news": sum(map(flag, news)), "unknown": [1]}
        self.put("clock", message | ({"end": end} if end else {}))

    def news(self, name: str, tick: int, epoch: int = 1, **what: Any) -> None:
        """Puts news for a robot."""
        self.put(f"robot/{name}/news", {"epoch": epoch, "tick": tick, "unknown": [1]} | what)

    def put(self, key: str, message: Json | bytes) -> None:
        """Puts something on a key of the run."""
        data = message if isinstance(message, bytes) else json.dumps(message).encode()
        if key == "clock":
            self._clock.put(data)
        else:
            self.session.put(f"{self.root}/{key}", data, congestion_control=zenoh.CongestionControl.BLOCK)

    def heard_bytes(self, key: str, patience_s: float = PATIENCE_S) -> bytes:
        """What was put next on a key of the run."""
        try:
            return self._queue(f"{self.root}/{key}").get(timeout=patience_s)
        except queue.Empty:
            raise AssertionError(f"nothing was put on {key}") from None

    def heard(self, key: str) -> Json:
        """The message that was put next on a key of the run."""
        message = json.loads(self.heard_bytes(key))
        assert isinstance(message, dict)
        return message

    def all_heard(self, key: str) -> set[bytes]:
        """What was put on a key and not looked at yet; repetitions count once."""
        found = set()
        while not self.nothing_more(key):
            found.add(self.heard_bytes(key))
        return found

    def nothing_more(self, key: str) -> bool:
        """Whether all that was put on a key has been looked at."""
        return self._queue(f"{self.root}/{key}").empty()

    def tick(self, tick: int, epoch: int = 1, **news: Json) -> Json:
        """Grants a tick and returns A's report of it."""
        self.clock(tick, epoch, None, **news)
        report = self.heard("robot/A/report")
        assert (report["epoch"], report["tick"]) == (epoch, tick), report
        return report

    def ask(self, what: str, parameters: str = "", name: str = "A") -> Json | str:
        """Asks a robot something: the answer, or the refusal in words."""
        replies = self.session.get(
            f"{self.root}/robot/{name}/{what}?{parameters}", target=zenoh.QueryTarget.ALL, timeout=PATIENCE_S
        )
        for reply in replies:
            if reply.ok is not None:
                answer = json.loads(reply.ok.payload.to_bytes())
                assert isinstance(answer, dict)
                return answer
            assert reply.err is not None
            return str(reply.err.payload.to_string())
        raise AssertionError(f"nobody answered {what}?{parameters}")


def flag(name: str) -> int:
    """The flag of a robot in the clock."""
    return 1 << ["A", "B", "C"].index(name)


def welcome(**more: Any) -> Json:
    """What a simulator answers to a robot that it lets in."""
    facts = {
        "answer": "welcome",
        "protocol": 2,
        "run": "r",
        "name": "A",
        "generation": 1,
        "epoch": 1,
        "tick": 0,
        "seed": 42,
        "stream": "robot/A",
        "tick_s": 0.5,
        "field_m": [20, 10],
        "body_m": 0.6,
        "sensing_range_m": 2.0,
        "location": {"x": 3.0, "y": 4.0},
        "roster": ["A", "B", "C"],
        "parameters": {"speed_mps": 1.0},
        "news_flag": flag(more.get("name", "A")),
        "from_the_future": {"a": 1},
    }
    return facts | more
