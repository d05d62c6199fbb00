"""The transcripts of ``docs/vectors``: what came to a robot in a real run is said again, and what it says is compared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import zenoh
from lab import EXAMPLES, ROOT
from stage import Json, Stage

from cars_robot import stream

VECTORS = ROOT / "docs" / "vectors"
ECHO = Path(__file__).with_name("echo.py")


class Replay:
    """A transcript, played to a robot line by line."""

    def __init__(self, file: Path, script: Path) -> None:
        self.lines: list[Json] = [json.loads(line) for line in file.read_text().splitlines()]
        self.name = self.lines[0]["robot"]
        self.script = script
        self.stage = Stage("vectors")
        self.said: set[tuple[str, bytes]] = set()
        # Whether and when it asks, or follows the key, is a robot's own affair.
        self.answers = {
            (line["key"], line.get("parameters", "")): line["answer"]
            for line in self.lines
            if line["way"] == "ask" and "/join" not in line["key"]
        }
        others = {key for key, _ in self.answers}
        self.queryables = [self.stage.session.declare_queryable(key, self.answer) for key in sorted(others)]

    def answer(self, query: zenoh.Query) -> None:
        """Answers what the robot asks another one, as it was answered then."""
        with query:
            found = self.answers.get((str(query.key_expr), str(query.parameters)))
            if found is not None:
                query.reply(query.key_expr, json.dumps(found))

    def play(self) -> int:
        """Plays all of it, and gives the robot's exit status."""
        process = None
        with self.stage:
            for number, line in enumerate(self.lines, start=1):
                key = line.get("key", "").removeprefix("cars/vectors/")
                match line["way"]:
                    case "ask" if key.startswith("join"):
                        self.welcome_with(line["answer"])
                        if "generation" in line["answer"] and self.lines[number]["way"] == "token":
                            if process is not None:
                                process.kill()
                                self.stage.until_alive()
                            process = self.stage.robot("--name", self.name, script=self.script)
                    case "token":
                        self.stage.until_alive(self.name)
                    case "to":
                        following = self.lines[number] if number < len(self.lines) else {}
                        if following.get("key", "").startswith("cars/vectors/join"):
                            # The clock of a new epoch makes it join again.
                            self.welcome_with(following["answer"])
                        self.stage.put(key, line["message"])
                    case "from":
                        self.compare(number, key, line["message"])
                    case "asked":
                        said = self.stage.ask(key.rsplit("/", 1)[-1], line.get("parameters", ""), self.name)
                        assert said == line.get("answer", line.get("refused")), f"line {number}"
            assert process is not None
            if self.lines[-1]["way"] == "to" and self.lines[-1]["message"].get("end"):
                return process.wait(20)
            return 0

    def welcome_with(self, answer: Json) -> None:
        """What a request to join is answered from now on."""
        self.stage.welcome = lambda _: answer

    def compare(self, number: int, key: str, expected: Json) -> None:
        """The robot says what it said then; a command may come more often."""
        if key.endswith("/waiting"):
            return  # Only if something really takes time.
        heard = self.stage.heard_bytes(key)
        while "/command/" in key and json.loads(heard) != expected and (key, heard) in self.said:
            heard = self.stage.heard_bytes(key)
        self.said.add((key, heard))
        assert json.loads(heard) == expected, f"line {number}"


@pytest.mark.parametrize(
    ("transcript", "script"),
    [("echo.jsonl", ECHO), ("return.jsonl", ECHO), ("leguin.jsonl", EXAMPLES / "leguin.py")],
)
def test_a_transcript_is_followed_to_the_letter(transcript: str, script: Path) -> None:
    assert Replay(VECTORS / transcript, script).play() == 0


def test_streams_are_those_of_the_page() -> None:
    vectors: list[dict[str, Any]] = json.loads((VECTORS / "streams.json").read_text())
    for vector in vectors:
        draws, units = (stream(vector["seed"], vector["stream"]) for _ in range(2))
        assert [str(draws.next_u64()) for _ in vector["draws"]] == vector["draws"]
        assert [units.unit() for _ in vector["units"]] == vector["units"]
