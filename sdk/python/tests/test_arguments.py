"""What is wrong with an argument is said with its name, and with what it may be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import cars


class Still(cars.Robot):
    """Stands where it stands."""

    def tick(self, cars_: cars.Cars) -> cars.Action:
        return cars.Action.stay(cars_)


RUN: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"scenario": 3}, TypeError, "scenario must be a path or a name .*, not 3"),
    ({"seed": "7"}, TypeError, "seed must be a whole number from 0 to .*, not '7'"),
    ({"seed": True}, TypeError, "seed must be a whole number"),
    ({"seed": 1.5}, TypeError, "seed must be a whole number"),
    ({"seed": -1}, ValueError, "seed must be a whole number from 0 to .*, not -1"),
    ({"seed": 2**60}, ValueError, "seed must be a whole number from 0 to"),
    ({"set": 3}, TypeError, "set must be a mapping from paths to values, such as .*, not 3"),
    ({"set": ["guests.count=3"]}, TypeError, "set must be a mapping"),
    ({"set": {3: 4}}, TypeError, "set must be a mapping .*: its keys are texts, not 3"),
    ({"set": {"guests.count": None}}, TypeError, r"set\['guests.count'\] must be a number, a text, .*, not None"),
    ({"set": {"guests": {"count": [1, {2}]}}}, TypeError, r"set\['guests'\]\['count'\]\[1\] must be"),
    ({"set": {"": 3}}, ValueError, "set: "),
    ({"duration": [1]}, TypeError, r"duration must be seconds, or a text with a unit .*, not \[1\]"),
    ({"duration": "long"}, ValueError, "duration: "),
    ({"duration": float("nan")}, ValueError, "duration must be seconds"),
    ({"speed": {}}, TypeError, "speed must be simulated seconds per second, or a text such as 'max', not {}"),
    ({"speed": "fast"}, ValueError, "speed: "),
    ({"name": 3}, TypeError, "name must be a text, not 3"),
    ({"name": "a/b"}, ValueError, "name: "),
    ({"out": 3}, TypeError, "out must be a path"),
    ({"robots": [Still]}, TypeError, "robots must be a mapping from names or patterns of robots to classes"),
    ({"robots": {"Butler": Still()}}, TypeError, r"robots\['Butler'\] must be a class derived from cars.Robot, or a function"),
    ({"robots": {"Butler": dict}}, TypeError, r"robots\['Butler'\] must make an object of a class derived from cars.Robot"),
]


@pytest.mark.parametrize(("arguments", "kind", "reason"), RUN)
def test_arguments_of_a_run(tmp_path: Path, arguments: dict[str, Any], kind: type[Exception], reason: str) -> None:
    given = {"scenario": "hors_doeuvres", "duration": "1 s", "out": tmp_path, **arguments}
    with pytest.raises(kind, match=reason):
        cars.run(given.pop("scenario"), **given)
    assert list(tmp_path.glob("*/events.jsonl")) == []


EXPERIMENT: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"file": None}, TypeError, "file must be a path or a name"),
    ({"out": 3}, TypeError, "out must be a path or a name"),
    ({"scenario": 3}, TypeError, "scenario must be a path or a name"),
    ({"seeds": "12"}, TypeError, "seeds must be a number of seeds, or the seeds, not '12'"),
    ({"seeds": 1.5}, TypeError, "seeds must be a number of seeds, or the seeds, not 1.5"),
    ({"seeds": [1, "2"]}, TypeError, r"seeds\[1\] must be a whole number"),
    ({"seeds": 1}, ValueError, "seeds must be a whole number from 2 to 100000, not 1"),
    ({"seeds": [-1, 2]}, ValueError, r"seeds\[0\] must be a whole number from 0"),
    ({"seeds": [1, 1]}, ValueError, "seeds: seeds are 2 to 100000 whole numbers"),
    ({"duration": ()}, TypeError, "duration must be seconds"),
    ({"set": "a=b"}, TypeError, "set must be a mapping"),
    ({"jobs": 0}, ValueError, "jobs must be a whole number from 1 to 4096, not 0"),
    ({"jobs": "2"}, TypeError, "jobs must be a whole number"),
    ({"retry_failed": "yes"}, TypeError, "retry_failed must be True or False, not 'yes'"),
]


@pytest.mark.parametrize(("arguments", "kind", "reason"), EXPERIMENT)
def test_arguments_of_an_experiment(tmp_path: Path, arguments: dict[str, Any], kind: type[Exception], reason: str) -> None:
    given = {"file": "deadlock", "out": tmp_path / "own", **arguments}
    with pytest.raises(kind, match=reason):
        cars.experiment(given.pop("file"), **given)
    assert not (tmp_path / "own").exists()


def test_other_arguments(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="run must be a path or a name"):
        cars.load(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="robots must be a mapping from names to robots"):
        cars.take_part([Still()])  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"robots\['A'\] must be an object of a class derived from cars.Robot"):
        cars.take_part({"A": Still})  # type: ignore[dict-item]
    with pytest.raises(TypeError, match="patience_s must be a number of seconds, not 'long'"):
        cars.take_part({"A": Still()}, patience_s="long")  # type: ignore[arg-type]
    run = cars.run("hors_doeuvres", duration=1, out=tmp_path)
    with pytest.raises(TypeError, match="start must be a tick, or a time such as '120 s', not 1.5"):
        run.diagram(1.5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="queries must be True or False, not 1"):
        run.diagram(queries=1)  # type: ignore[arg-type]
