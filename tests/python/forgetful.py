"""A robot over eclipse-zenoh alone that knows nothing of what arrived before it has read its welcome, for a system test.

Its callbacks look at a variable that the main thread sets when it has read the welcome, as is easily written. From the epoch and tick of
``--hangs-from`` on it answers no clock, until it is asked to join again. ``--deletes`` puts DELETE samples on keys of the simulator.
"""

from __future__ import annotations

import argparse
import json
import queue
import sys
import time
from typing import Any

import zenoh

Json = dict[str, Any]
SETTINGS = {
    "mode": '"client"',
    "scouting/multicast/enabled": "false",
    "scouting/gossip/enabled": "false",
    "connect/timeout_ms": "20000",
    "connect/retry": "{period_init_ms: 100, period_max_ms: 200, period_increase_factor: 2}",
}


class Robot:
    """One robot: its session, and what it knows since its welcome."""

    def __init__(self, run: str, name: str, connect: str, hangs_from: tuple[int, int] | None) -> None:
        self.run, self.name, self.hangs_from = run, name, hangs_from
        config = zenoh.Config()
        for key, value in {**SETTINGS, "connect/endpoints": json.dumps([connect])}.items():
            config.insert_json5(key, value)
        self.session = zenoh.open(config)
        self.inbox: queue.SimpleQueue[tuple[str, Json]] = queue.SimpleQueue()
        self.welcome: Json | None = None

        own = f"cars/{run}/robot/{name}"
        self.declared: list[object] = [
            self.session.declare_subscriber(f"cars/{run}/clock", lambda sample: self.take("clock", sample)),
            self.session.declare_subscriber(f"{own}/news", lambda sample: self.take("news", sample)),
        ]
        block = zenoh.CongestionControl.BLOCK
        self.report = self.session.declare_publisher(f"{own}/report", congestion_control=block)
        self.join()
        self.declared.append(self.session.liveliness().declare_token(f"cars/{run}/alive/robot/{name}"))

    def take(self, kind: str, sample: zenoh.Sample) -> None:
        """A message arrived: dropped while the robot has no welcome, unless it shows that the robot has to ask for one."""
        message = json.loads(sample.payload.to_bytes())
        if "end" in message:
            self.inbox.put(("end", message))
        if self.welcome is None:
            return
        is_later = kind == "clock" and message["epoch"] > self.welcome["epoch"]
        if is_later or (kind == "news" and message.get("rejoin") == self.welcome["generation"]):
            self.welcome = None
            self.inbox.put(("join", message))
        elif message["epoch"] == self.welcome["epoch"]:
            self.inbox.put((kind, message))

    def join(self) -> None:
        """Asks until the simulator welcomes the robot, and begins anew."""
        request = {"protocol": 2, "run": self.run, "name": self.name, "instance": str(self.session.zid())}
        welcome: Json | None = None
        while welcome is None:
            replies = self.session.get(
                f"cars/{self.run}/join/{self.name}",
                payload=json.dumps(request),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=2.0,
            )
            for reply in replies:
                if reply.ok is not None:
                    welcome = json.loads(reply.ok.payload.to_bytes())
            if welcome is None:
                time.sleep(0.1)
        if welcome["answer"] != "welcome":
            sys.exit(f"error: {welcome['explanation']}")
        self.news: dict[int, Json] = {}
        self.pending: Json | None = None
        self.answered: Json | None = None
        self.has_begun = self.is_hung = False
        self.location = welcome["location"]
        self.welcome = self.own = welcome

    def play(self) -> None:
        """Plays until the end of the run."""
        while True:
            kind, message = self.inbox.get()
            if kind == "end":
                break
            if kind == "join":
                self.join()
            elif message["epoch"] == self.own["epoch"]:
                self.on_clock(message) if kind == "clock" else self.news.update({message["tick"]: message})
                self.run_if_possible()
        self.declared.clear()
        self.session.close()  # type: ignore[no-untyped-call]

    def on_clock(self, clock: Json) -> None:
        """A clock of the epoch: for the first time, or again."""
        if self.hangs_from is not None and (clock["epoch"], clock["tick"]) >= self.hangs_from:
            self.hangs_from, self.is_hung = None, True
        if self.is_hung:
            return
        if self.answered is not None and self.answered["tick"] >= clock["tick"]:
            if self.answered["tick"] == clock["tick"]:
                self.report.put(json.dumps(self.answered))
            return
        self.pending = clock

    def run_if_possible(self) -> None:
        """Reports where it stands, once the news of the clock are here."""
        clock = self.pending
        if clock is None or (clock.get("news", 0) & self.own["news_flag"] and clock["tick"] not in self.news):
            return
        self.pending = None
        news = self.news.pop(clock["tick"], {})
        begins = clock["tick"] == 0 and self.own["generation"] == 1
        if not self.has_begun and not begins and news.get("joined") != self.own["generation"]:
            return
        self.has_begun = True
        if (correction := news.get("correction")) is not None:
            self.location = correction["location"]
        self.answered = {
            "epoch": clock["epoch"],
            "tick": clock["tick"],
            "generation": self.own["generation"],
            "proposal": self.location,
            "speed_mps": 0,
            "direction_rad": 0,
            "emotion_state": "CALM",
            "behavior_state": "IDLE",
            "state_variables": {},
        }
        self.report.put(json.dumps(self.answered))

    def delete(self) -> None:
        """Puts DELETE samples where the simulator subscribes."""
        own = f"cars/{self.run}/robot/{self.name}"
        for key in (f"{own}/report", f"{own}/outbox", f"{own}/waiting", f"{own}/command/operator"):
            self.session.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="a robot that forgets what came before its welcome")
    for required in ("--run", "--name", "--connect"):
        parser.add_argument(required, required=True)
    parser.add_argument("--hangs-from", nargs=2, type=int)
    parser.add_argument("--deletes", action="store_true")
    args = parser.parse_args()
    robot = Robot(args.run, args.name, args.connect, tuple(args.hangs_from) if args.hangs_from else None)
    if args.deletes:
        robot.delete()
    robot.play()
