"""What decided a run: an answer of ``cars why``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Optional

from . import _cars
from ._errors import Error
from ._frames import Frame, of_columns


class WhyFrames(NamedTuple):
    """The numbers of an answer."""

    curve: Frame
    """A row for each tick after which forks were played."""
    jumps: Frame
    """A row for each tick in which the expected outcome jumps."""


class Why:
    """What decided a run, as ``cars why`` found it. See :meth:`cars.Run.why`."""

    def __init__(self, answer: Mapping[str, Any]) -> None:
        """Use :meth:`cars.Run.why`."""
        self.answer = answer
        """What of the file of the answer is shown."""
        self._frames: dict[Optional[str], WhyFrames] = {}

    def __repr__(self) -> str:
        return f"<Why {self.question!r}: {self.sentence}>"

    def __str__(self) -> str:
        return self.sentence

    @property
    def question(self) -> str:
        """What was asked: the name of an expectation or of a measure, a condition, or the path of a number of the summary."""
        return str(self.answer["question"]["name"])

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        return str(self.answer["sentence"])

    @property
    def curve(self) -> Frame:
        """The expected outcome over the run: a row for each tick after which forks with other chance were played.

        ``value`` is their mean, a probability if the question is whether something happens; ``low`` and ``high`` are its interval of
        95 %, ``n`` the number of forks, and ``failed`` the number of those left out because a robot failed.
        """
        return self.frames().curve

    @property
    def jumps(self) -> Frame:
        """A row for each tick in which the expected outcome jumps: before and after it, the cause, and the outcome without it."""
        return self.frames().jumps

    def frames(self, kind: Optional[str] = None) -> WhyFrames:
        """Both tables as frames.

        :param kind: ``"pandas"`` or ``"polars"``; without it pandas where it is installed, else polars.
        :raises Error: if that is not installed.
        """
        if kind not in self._frames:
            self._frames[kind] = WhyFrames(self._curve(kind), self._jumps(kind))
        return self._frames[kind]

    def _curve(self, kind: Optional[str]) -> Frame:
        points = self.answer["curve"]
        columns = self._moments(points)
        columns |= {name: [point[name] for point in points] for name in ("value", "low", "high", "n")}
        columns["failed"] = [point.get("failed", 0) for point in points]
        return of_columns(columns, kind)

    def _jumps(self, kind: Optional[str]) -> Frame:
        jumps = self.answer["jumps"]
        columns = self._moments(jumps)
        for of in ("before", "after"):
            columns |= {f"{of}_{name}": [jump[of][name] for jump in jumps] for name in ("value", "low", "high", "n")}
        causes = [jump["cause"] for jump in jumps]
        columns["cause"] = [cause and cause["what"] for cause in causes]
        columns["without"] = [cause and cause["without"]["value"] for cause in causes]
        columns["events"] = ["; ".join(jump["events"]) for jump in jumps]
        return of_columns(columns, kind)

    def _moments(self, rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
        """The ticks and times of rows."""
        ticks = [row["tick"] for row in rows]
        return {"tick": ticks, "time_s": [tick * self.answer["tick_s"] for tick in ticks]}


def answer(run: Path, question: Optional[str]) -> tuple[Why, list[str]]:
    """The answer to a question about a run, or the only one, and what cannot be read of the answers, a sentence each.

    :raises Error: if there is none.
    """
    texts, notes = _cars.answers(run)
    answers = [Why(json.loads(text)) for text in texts]
    found = [one for one in answers if question in (None, one.question)]
    if len(found) == 1 or (found and question is not None):
        return found[0], notes
    known = ", ".join(repr(one.question) for one in answers)
    if found:
        raise Error(f"several questions were asked about the run, so name one: {known}")
    has = f"; those that were asked: {known}" if known else ""
    raise Error(" ".join([f"nothing is known of what decided the run: ask by `cars why {run}`{has}", *notes]))
