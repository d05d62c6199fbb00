"""A robot in Python in the place of the same robot in Rust: the same run, byte for byte."""

from __future__ import annotations

import json
import sys

import pytest
from lab import EXAMPLES, PYTHON, ROOT, RUST, Lab, assert_same

import cars

LOSSY = (
    'network.commands={ loss = 0.2, duplication = 0.3, delay = { min = "0 s", mode = "1 s", max = "10 s" }, '
    "burst = { enter = 0.05, leave = 0.2 } }"
)


HALL = "hors_doeuvres.toml"
TWO = ["Butler", "Leguin"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("scenario", "team", "changes"),
    [
        (HALL, TWO, ["--seed", "7"]),
        (HALL, TWO, ["--set", LOSSY, "--set", "network.queries.loss=0.2"]),
        (HALL, TWO, ["--set", "robot.Leguin.params.affect=off"]),
        (HALL, TWO, ["--set", "guests.count=180", "--seed", "99"]),
        ("partition.toml", TWO, []),
        ("museum.toml", TWO, ["--seed", "12345"]),
        ("three_robots.toml", [*TWO, "Vonda"], ["--set", "robot.Butler.params.refiller=Vonda"]),
    ],
)
def test_leguin_in_python_gives_the_same_run_elsewhere(
    lab: Lab, scenario: str, team: list[str], changes: list[str]
) -> None:
    assert_leguin_is_the_same(lab, scenario, team, changes)


def test_leguin_in_python_gives_the_same_run(lab: Lab) -> None:
    assert_leguin_is_the_same(lab, HALL, TWO, [])


def assert_leguin_is_the_same(lab: Lab, scenario: str, team: list[str], changes: list[str]) -> None:
    """Byte for byte, as the Rust Leguin, as a process and in one process."""
    python = lab.launch("python", scenario, {name: PYTHON[name] for name in team}, *changes)
    assert len(python) > 1200
    assert_same(python, lab.launch("rust", scenario, {name: RUST[name] for name in team}, *changes))
    assert_same(python, lab.play("local", scenario, *changes))


FAULTS = {
    "a crash while the run goes on": 'robot = "Leguin", do = "crash", at = "100 s", until = "120 s"',
    "a crash that is waited for": 'robot = "Leguin", do = "crash", at = "100 s", for = "0.5 s"',
    # Long enough that its link is given up, too.
    "a hang that is waited for": 'robot = "Leguin", do = "hang", at = "100 s", for = "3 s"',
}


@pytest.mark.thorough
@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_leguin_that_falters_gives_the_same_run(lab: Lab, fault: str) -> None:
    """What happens to a process is part of the seed, too; who returns takes over as in Rust."""
    on_late = "wait" if "waited" in fault else "continue"
    changes = ["--set", f"fault=[{{ {FAULTS[fault]} }}]", "--set", f"on_late={on_late}", "--duration", "140 s"]
    # A fault that is due before the launcher listens to the simulator does not happen.
    changes += ["--speed", "50"]
    names = ("Butler", "Leguin")
    python = lab.launch("python", "hors_doeuvres.toml", {name: PYTHON[name] for name in names}, *changes)
    assert_same(python, lab.launch("rust", "hors_doeuvres.toml", {name: RUST[name] for name in names}, *changes))
    returned = [event["robot"] for event in lab.of_kind("python", "joined") if event["tick"] > 0]
    assert returned == ([] if fault == "a hang that is waited for" else ["Leguin"])


def test_a_change_that_a_robot_refuses_gives_the_same_run(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a process that is started again with it, and in one process: she keeps what she had, and the record is executed again."""
    change = {"at": "20 s", "set": ["robot.Leguin.params.policy=nonsense"]}
    text = f'change=[{{ at = "20 s", set = {json.dumps(change["set"])} }}]'
    team = {name: PYTHON[name] for name in ("Butler", "Leguin")}
    launched = lab.launch("launched", "hors_doeuvres.toml", team, "--set", text, "--duration", "40 s", "--speed", "50")

    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])
    from leguin import Leguin

    lab.cars("verify", "launched", "--out", str(lab.folder))
    with pytest.warns(RuntimeWarning, match="policy must be one of emotion, rules, timer, neither, not 'nonsense'"):
        cars.run(
            ROOT / "configs/hors_doeuvres.toml",
            set={"change": [change], "expect": []},
            duration="40 s",
            out=lab.folder,
            name="own",
            robots={"Leguin": Leguin},
        )
    assert_same(launched, lab.events("own"))
    assert "error: refuses its new parameters" in (lab.folder / "own/cars.log").read_text()
    assert "not 'nonsense'" in (lab.folder / "launched/logs/Leguin.log").read_text()
    assert [event["robot"] for event in lab.of_kind("own", "joined") if event["tick"] > 0] == ["Leguin"]
