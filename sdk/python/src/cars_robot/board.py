"""What the robots of a process answer when they are queried: their last two reported states."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable
from typing import Protocol

from .keys import STATE, last_chunk, robot_of
from .messages import PublicState, answer_json, encode, state_json

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


class _NoState(Exception):
    """There is no state to answer with."""


class Board:
    """Shared between the robots' loop, which shows states, and the bus, whose thread asks for them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # The last two states of each robot, newest last. During a tick the others must see the state before it, however
        # far the robot already is.
        self._states: dict[str, list[PublicState]] = {}

    def host(self, robot: str) -> None:
        """A robot of this process begins an epoch; others are not asked about here."""
        with self._lock:
            self._states[robot] = []

    def show(self, robot: str, state: PublicState) -> None:
        """Shows a new state."""
        with self._lock:
            states = self._states[robot]
            states[:] = [old for old in states if old.epoch == state.epoch and old.tick < state.tick][-1:]
            states.append(state)

    def get(self, robot: str, epoch: int, tick: int) -> PublicState | None:
        """The state that ``robot``, one of this process, reported for ``tick``."""
        with self._lock:
            return _find(self._states[robot], epoch, tick)

    def ask(self, question: Question) -> None:
        """Answers a question."""
        try:
            with self._lock:
                state = self._judge(question)
        except _NoState as reason:
            question.refuse(str(reason))
            return
        what = last_chunk(question.key)
        answer = state_json(state) if what == STATE else answer_json(state, what)
        if answer is None:
            question.refuse(f"there is no query called {what}")
        else:
            question.answer(encode(answer))

    def _judge(self, question: Question) -> PublicState:
        """The state that answers it."""
        states = self._states.get(robot_of(question.key) or "")
        if states is None:
            raise _NoState("get one robot by its name")
        tick = _number(question, "tick")
        epoch = _number(question, "epoch")
        not_yet = _NoState("that tick has not been reported yet: ask again")
        if not states:
            raise not_yet
        newest = states[-1]
        if epoch is not None and epoch != newest.epoch:
            raise not_yet if epoch > newest.epoch else _NoState("that tick is over")
        if tick is None:
            return newest
        # Asked during tick t, every robot answers with the state it reported for t - 1.
        found = _find(states, newest.epoch, tick - 1)
        if found is not None:
            return found
        if tick - 2 == newest.tick:
            raise not_yet
        is_over = 0 < tick <= newest.tick
        raise _NoState("that tick is over" if is_over else "that tick is out of range")


def _find(states: Iterable[PublicState], epoch: int, tick: int) -> PublicState | None:
    return next((state for state in states if (state.epoch, state.tick) == (epoch, tick)), None)


def _number(question: Question, name: str) -> int | None:
    text = question.parameter(name)
    if text is None:
        return None
    if not _WHOLE_NUMBER.fullmatch(text):
        raise _NoState(f"parameter {name}: not a whole number")
    return int(text)
