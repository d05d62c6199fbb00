"""What decided a run whose robots are classes of Python: they are executed again from the start for each fork."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import cars
from cars import Action, Cars, Robot

SCENARIO = """
duration = "15 s"
[[robot]]
name = "Coin"
at = ["5 m", "5 m"]
"""
FLIP = 17
"""The tick in which the coin is thrown."""
HEADS = '{ robot = "Coin", variable = "heads", above = 0.5 }'


class Coin(Robot):
    """Throws a coin, by a generator of its own."""

    def init(self, cars: Cars) -> None:
        self.heads = 0
        self.reseed(cars)

    def reseed(self, cars: Cars) -> None:
        self.chance = cars.random.next_u64()

    def tick(self, cars: Cars) -> Action:
        if cars.tick == FLIP:
            self.heads = self.chance % 2
        return Action.stay(cars, state_variables={"heads": self.heads})


def run_with_heads(folder: Path, make: Any = Coin) -> cars.Run:
    """The first run in which the coin shows heads."""
    file = folder / "coin.toml"
    file.write_text(SCENARIO)
    for seed in range(100):
        run = cars.run(file, robots={"Coin": make}, seed=seed, out=folder, name=f"coin-{seed}")
        if run.summary["robots"]["Coin"]["state_variables"]["heads"] == 1:
            return run
    raise AssertionError("no run has heads")


@pytest.mark.thorough
def test_the_throw_that_decided_a_run_is_found(tmp_path: Path) -> None:
    run = run_with_heads(tmp_path)
    why = cars.why(run, HEADS, robots={"C*": Coin})
    (jump,) = why.answer["jumps"]
    assert jump["tick"] == FLIP and jump["after"]["value"] == 1.0, why
    assert jump["before"]["low"] <= 0.5 <= jump["before"]["high"], why
    assert jump["cause"]["what"] == "chance of robot.Coin", why
    assert str(run.why()) == str(why) == str(cars.why(run.folder.name, HEADS, robots={"Coin": Coin}, out=tmp_path))


def test_a_fork_goes_on_with_the_robots_of_its_run(tmp_path: Path) -> None:
    run = run_with_heads(tmp_path)
    robots: Any = {"Coin": Coin}
    same = cars.fork(run, "4 s", robots=robots, out=tmp_path, duration=20)
    assert same.folder.name == f"{run.folder.name}-fork-8" and same.summary["ticks"] == 40

    def heads(seed: int, at: int) -> float:
        forked = cars.fork(run, at, seed=seed, robots=robots)
        assert "seed = " in (forked.folder / "scenario.toml").read_text()
        return float(forked.summary["robots"]["Coin"]["state_variables"]["heads"])

    assert {heads(seed, FLIP - 1) for seed in range(1, 9)} == {0.0, 1.0}
    assert heads(1, FLIP) == 1.0
    # They are the forks of an answer: number n has the seed n + 1.
    cars.why(run, HEADS, robots=robots, budget=64)
    lines = next((run.folder / "why").glob("*.jsonl")).read_text().splitlines()[1:]
    for line in lines[:8]:
        fork = json.loads(line)
        assert fork["outcome"] == heads(fork["number"] + 1, fork["tick"]), fork

    with pytest.raises(cars.RefusedError, match="Coin cannot go on"):
        cars.fork(run, 8)
    with pytest.raises(cars.BadArgument, match="reseed"):
        cars.fork(run, 8, seed=1, reseed=["luck"], robots=robots)
    with pytest.raises(cars.BadArgument, match="needs a seed"):
        cars.fork(run, 8, reseed="network", robots=robots)
    with pytest.raises(TypeError, match="at must be"):
        cars.fork(run, None, robots=robots)  # type: ignore[arg-type]
    with pytest.raises(cars.BadArgument, match="would overwrite the run"):
        cars.fork(run, 8, name=run.folder.name, replace=True, out=tmp_path, robots=robots)

    class Fragile(Coin):
        def tick(self, cars: Cars) -> Action:
            if cars.tick > FLIP:
                raise ValueError("worn out")
            return super().tick(cars)

    with pytest.raises(ValueError, match="worn out"):
        cars.fork(run, FLIP, name="fragile", out=tmp_path, robots={"Coin": Fragile})
    assert not (tmp_path / "fragile").exists()


def test_an_answer_does_not_depend_on_jobs(tmp_path: Path) -> None:
    run = run_with_heads(tmp_path)
    answers = []
    for jobs in (1, 3):
        why = cars.why(run, HEADS, robots={"Coin": Coin}, budget=300, jobs=jobs)
        assert "The budget ended" in why.sentence
        answers.append(why.answer)
        shutil.rmtree(run.folder / "why")
    assert answers[0] == answers[1]


def test_what_cannot_be_executed_again_is_refused(tmp_path: Path) -> None:
    run = run_with_heads(tmp_path)
    with pytest.raises(cars.RefusedError, match="Coin cannot go on"):
        cars.why(run, HEADS)
    with pytest.raises(cars.UnknownRobot, match="no robot is called"):
        cars.why(run, HEADS, robots={"Coins": Coin})
    with pytest.raises(cars.RefusedError, match='no measure called "heads"'):
        cars.why(run, "heads", robots={"Coin": Coin})
    with pytest.raises(cars.BadArgument, match="budget"):
        cars.why(run, HEADS, robots={"Coin": Coin}, budget="soon")
    with pytest.raises(TypeError, match="budget"):
        cars.why(run, HEADS, robots={"Coin": Coin}, budget=1.5)  # type: ignore[arg-type]

    class Edited(Coin):
        def tick(self, cars: Cars) -> Action:
            action = super().tick(cars)
            action.behavior_state = "EDITED" if cars.tick == 9 else ""
            return action

    with pytest.raises(cars.RecordError, match="differs from its record at tick 9"):
        cars.why(run, HEADS, robots={"Coin": Edited})


def test_a_fork_whose_robot_raises_has_no_outcome(tmp_path: Path) -> None:
    class Fragile(Coin):
        def tick(self, cars: Cars) -> Action:
            if cars.tick == FLIP and self.chance % 2 == 0:
                raise ValueError("tails")
            return super().tick(cars)

    run = run_with_heads(tmp_path)
    why = cars.why(run, HEADS, robots={"Coin": Fragile}, budget=100)
    first = why.answer["curve"][0]
    assert 0 < first["n"] < 64 and first["value"] == 1.0, first
    assert first["n"] + first["failed"] == 64, first
    assert "a robot failed: they are left out" in why.sentence, why
    assert f"in tick {FLIP} Coin gives up: ValueError: tails" in why.sentence, why
    assert list(why.curve["failed"])[0] == first["failed"]
    again = cars.why(run, HEADS, robots={"Coin": Fragile}, budget=100)
    assert again.sentence == why.sentence, "what was kept says the same"


def test_a_class_that_is_no_robot_is_refused(tmp_path: Path) -> None:
    class Duck:
        def init(self, cars: Cars) -> None: ...

        def tick(self, cars: Cars) -> Action:
            return Action.stay(cars, state_variables={"heads": 1})

    robots: Any = {"Coin": Duck}
    run = run_with_heads(tmp_path)
    with pytest.raises(TypeError, match=r"robots\['Coin'\] must make an object of a class derived from cars.Robot"):
        cars.run(tmp_path / "coin.toml", robots=robots)
    with pytest.raises(TypeError, match=r"robots\['Coin'\] must make an object of a class derived from cars.Robot"):
        cars.why(run, HEADS, robots=robots)


def test_a_maker_that_raises_is_the_reason(tmp_path: Path) -> None:
    def broken() -> Robot:
        raise ValueError("no parts")

    run = run_with_heads(tmp_path)
    with pytest.raises(ValueError, match="no parts"):
        cars.why(run, HEADS, robots={"Coin": broken})
