"""What the robots of a process show to askers: their last two reported states, and questions that came early."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable
from typing import Protocol

from .keys import STATE, last_chunk, robot_of
from .messages import PublicState, answer_json, encode, state_json

MAX_EARLY = 1024
"""Questions that are kept until the state they ask for exists; more are refused."""

_WHOLE_NUMBER = re.compile(r"\+?[0-9]{1,20}", re.ASCII)


class Question(Protocol):
    """A question that waits for an answer."""

    key: str

    def parameter(self, name: str) -> str | None:
        """The parameter called ``name``, as in ``?tick=12;epoch=1``."""

    def answer(self, message: bytes) -> None:
        """Answers on its own key."""

    def refuse(self, reason: str) -> None:
        """Refuses, in words."""


class _Never(Exception):
    """There will never be an answer."""


class Board:
    """Shared between the robots' loop, which shows states, and the bus, whose thread asks for them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # The last two states of each robot, newest last. During a tick the others must see the state before it, however
        # far the robot already is.
        self._states: dict[str, list[PublicState]] = {}
        self._early: list[Question] = []

    def host(self, robot: str) -> None:
        """A robot of this process; others are not asked about here."""
        with self._lock:
            self._states.setdefault(robot, [])

    def show(self, robot: str, state: PublicState) -> None:
        """Shows a new state, and answers who asked for it too early."""
        with self._lock:
            states = self._states.setdefault(robot, [])
            states[:] = [old for old in states if old.epoch == state.epoch and old.tick < state.tick][-1:]
            states.append(state)
            early, self._early = self._early, []
            for question in early:
                self._respond(question)

    def get(self, robot: str, epoch: int, tick: int) -> PublicState | None:
        """The state that ``robot``, one of this process, reported for ``tick``."""
        with self._lock:
            return _find(self._states.get(robot, ()), epoch, tick)

    def ask(self, question: Question) -> None:
        """Answers a question now, or when there is something to answer."""
        with self._lock:
            self._respond(question)

    def _respond(self, question: Question) -> None:
        try:
            state = self._judge(question)
        except _Never as reason:
            question.refuse(str(reason))
            return
        if state is not None:
            _reply(question, state)
        elif len(self._early) < MAX_EARLY:
            self._early.append(question)
        else:
            question.refuse("too many questions are waiting already")

    def _judge(self, question: Question) -> PublicState | None:
        """The state that answers it; ``None`` if there will be one."""
        states = self._states.get(robot_of(question.key) or "")
        if states is None:
            raise _Never("ask one robot by its name")
        if not states:
            return None
        newest = states[-1]
        tick = _number(question, "tick")
        if tick is None:
            return newest
        epoch = _number(question, "epoch")
        if epoch is not None and epoch != newest.epoch:
            if epoch > newest.epoch:
                return None
            raise _Never("that epoch is over")
        # Asked during tick t, everybody answers with the state reported for t - 1.
        found = _find(states, newest.epoch, tick - 1)
        if found is not None:
            return found
        if tick - 2 == newest.tick:
            return None
        raise _Never("that tick is far away" if tick > newest.tick else "that tick is over")


def _find(states: Iterable[PublicState], epoch: int, tick: int) -> PublicState | None:
    return next((state for state in states if (state.epoch, state.tick) == (epoch, tick)), None)


def _number(question: Question, name: str) -> int | None:
    text = question.parameter(name)
    if text is None:
        return None
    if not _WHOLE_NUMBER.fullmatch(text):
        raise _Never(f"parameter {name}: not a whole number")
    return int(text)


def _reply(question: Question, state: PublicState) -> None:
    what = last_chunk(question.key)
    answer = state_json(state) if what == STATE else answer_json(state, what)
    if answer is None:
        question.refuse(f"there is no query called {what}")
    else:
        question.answer(encode(answer))
