"""What a robot shows to askers."""

from __future__ import annotations

import json

from cars_robot.board import Board
from cars_robot.messages import Point, PublicState

NOT_YET = "that tick has not been reported yet: ask again"


class Asked:
    """A question, and what became of it."""

    def __init__(self, what: str = "state", robot: str = "A", **parameters: str) -> None:
        self.key = f"cars/r/robot/{robot}/{what}"
        self.parameters = parameters
        self.said: object = None

    def parameter(self, name: str) -> str | None:
        return self.parameters.get(name)

    def answer(self, message: bytes) -> None:
        self.said = json.loads(message).get("tick")

    def refuse(self, reason: str) -> None:
        self.said = reason


def board(*shown: tuple[int, int]) -> Board:
    made = Board()
    made.host("A")
    for epoch, tick in shown:
        made.show("A", PublicState(epoch, tick, Point(0, 0), 0, 0, {}, "", ""))
    return made


def said(made: Board, question: Asked) -> object:
    made.ask(question)
    return question.said


def test_the_last_two_states_are_kept() -> None:
    made = board((1, 0), (1, 1), (1, 2))
    asked = {tick: said(made, Asked(tick=str(tick), epoch="1")) for tick in (0, 1, 2, 3, 4, 5)}
    out, over = "that tick is out of range", "that tick is over"
    assert asked == {0: out, 1: over, 2: 1, 3: 2, 4: NOT_YET, 5: out}
    assert said(made, Asked()) == 2
    assert [made.get("A", 1, tick) is not None for tick in (0, 1, 2)] == [False, True, True]


def test_questions_that_cannot_be_answered_are_refused() -> None:
    made = board((2, 5))
    for question, reason in [
        (Asked(robot="B"), "get one robot by its name"),
        (Asked(robot="*"), "get one robot by its name"),
        (Asked(what="mood"), "there is no query called mood"),
        (Asked(tick="-1"), "parameter tick: not a whole number"),
        (Asked(tick="6", epoch="1.5"), "parameter epoch: not a whole number"),
        (Asked(tick="6", epoch="1"), "that tick is over"),
    ]:
        assert said(made, question) == reason


def test_early_questions_are_refused_and_may_be_asked_again() -> None:
    made = board()
    early = {"tick": "1", "epoch": "1"}
    assert [said(made, Asked(**early)), said(made, Asked())] == [NOT_YET, NOT_YET]
    made.show("A", PublicState(1, 0, Point(0, 0), 0, 0, {}, "", ""))
    assert [said(made, Asked(**early)), said(made, Asked())] == [0, 0]
    assert said(made, Asked(tick="1", epoch="2")) == NOT_YET


def test_a_new_epoch_forgets_the_old_one() -> None:
    made = board((1, 8), (1, 9), (2, 0))
    assert made.get("A", 1, 9) is None and made.get("A", 2, 0) is not None
