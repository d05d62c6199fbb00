"""Layers from Python: in this process, as programs, and beside a robot in Rust."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from lab import Lab, assert_same
from sweeper import Sweeper

import cars
from cars import Action, Cars, LayerAction, LayerCell, LayerResult, Point, Robot, SensedLayer

SCENARIO = """
seed = 3
tick = "0.5 s"
duration = "15 s"
[field]
size = ["10 m", "8 m"]
[[layer]]
name = "dust"
cell = "0.3 m"
range = "1.5 m"
min = 0
peaks = [{ count = 9, at = "random", radius = "2 m", height = 1.1 }]
[[layer]]
name = "trail"
cell = "0.5 m"
range = "0.5 m"
decay = 0.3
diffuse = 0.07
[[expect]]
name = "something is swept"
eventually = { event = "layer_changed", layer = "dust" }
within = "15 s"
[[expect]]
name = "there is dust for a while"
eventually = { layer = { name = "dust", by = "sum" }, above = 1, for = "5 s" }
within = "15 s"
[[expect]]
name = "the trail fades"
never = { layer = { name = "trail", by = "mean", each = { above = 0.2 } }, above = 0.9 }
[[expect]]
name = "the trail is long"
eventually = { layer = { name = "trail", by = "count", each = { above = 0.05 } }, at_least = 12 }
within = "15 s"
[[robot]]
name = "A"
at = ["3 m", "4 m"]
[[robot]]
name = "B"
at = ["4 m", "5 m"]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Two robots that sweep the same floor."""
    file = tmp_path / "dust.toml"
    file.write_text(SCENARIO)
    return file


def test_the_same_run_in_one_process_and_as_programs_of_two_languages(lab: Lab, scenario: Path) -> None:
    python = str(Path(__file__).with_name("sweeper.py"))
    # The programs of the project have it only where they are built for tests.
    rust = lab.programs / "sweeper"
    robots = {"A": str(rust) if rust.exists() else python, "B": python}
    launched = lab.launch("launched", str(scenario), robots)
    both = {"A": Sweeper, "B": Sweeper}
    # What is launched expects nothing.
    own = cars.run(scenario, set={"expect": []}, robots=both, out=lab.folder, name="own")
    assert_same(launched, lab.events("own"))
    assert own.summary["digest"] in launched[-1]

    assert cars.run(scenario, robots=both, out=lab.folder, name="judged").verdict == "pass"

    # To judge the record, layers are computed again from what robots reported: to the last bit, as the reasons say.
    reasons = " ".join(event["because"] for event in lab.of_kind("judged", "judged"))
    found = re.search(r"layer dust \(sum\) is (\d+\.\d+)", reasons)
    assert found
    exact = lab.folder / "exact.toml"
    exact.write_text(
        f'[[expect]]\nname = "exact"\nwithin = "15 s"\neventually = {{ layer = {{ name = "dust", by = "sum" }}, is = {found[1]} }}\n'
    )
    assert "pass" in lab.cars("expect", "judged", "--expectations", str(exact), "--out", str(lab.folder))

    changed = lab.of_kind("own", "layer_changed")
    assert {event["layer"] for event in changed} == {"dust", "trail"}
    refused = lab.of_kind("own", "layer_refused")
    assert {(event["layer"], event["because"]) for event in refused} == {("mist", "unknown_layer")}
    assert "the same" in lab.cars("verify", "launched", "--out", str(lab.folder))

    # All that was swept is in the events, and the robots know of it, but for what they did in the last tick.
    events = own.events
    swept = events[(events.event == "layer_changed") & (events.layer == "dust") & (events.tick < 30)]
    variables = own.variables
    last = variables[(variables.variable == "swept") & (variables.tick == 30)]
    for robot in ("A", "B"):
        change = swept[swept.robot == robot].change.sum()
        assert change < -1
        assert float(last[last.robot == robot].value.iloc[0]) == pytest.approx(-change, abs=1e-9)


class Looker(Robot):
    """Notes what it senses, and changes a cell."""

    seen: list[tuple[tuple[SensedLayer, ...], tuple[LayerResult, ...]]] = []

    def tick(self, cars: Cars) -> Action:
        self.seen.append((cars.layers, cars.layer_results))
        assert cars.layer("mist") is None
        change = LayerAction("dust", cars.location, radius_m=0.5, set=2, add=0.5)
        return Action.stay(cars, layer_actions=[change])


FLOOR = """
duration = "1 s"
[field]
size = ["4 m", "4 m"]
[[layer]]
name = "dust"
cell = "1 m"
range = "1 m"
value = 1
[[robot]]
name = "A"
at = ["2.5 m", "1.5 m"]
"""


def test_a_robot_sees_cells_and_what_became_of_its_actions(scenario: Path, tmp_path: Path) -> None:
    scenario.write_text(FLOOR)
    Looker.seen.clear()
    cars.run(scenario, robots={"A": Looker}, out=tmp_path)
    first, second, _ = Looker.seen
    layer = SensedLayer("dust", 1.0, ((0, 2, (1.0,)), (1, 1, (1.0, 1.0, 1.0)), (2, 2, (1.0,))))
    assert first == ((layer,), ())
    assert second[1] == (LayerResult("dust", 1.5, None),)
    assert second[0][0].rows[1] == (1, 1, (1.0, 2.5, 1.0))

    assert list(layer.cells())[1] == LayerCell(1, 1, Point(1.5, 1.5), 1.0)
    assert layer.value_at(Point(3.999, 1.0)) == 1.0
    for place in (Point(4.0, 1.5), Point(0.9, 1.5), Point(2.5, 3.0), Point(2.5, -0.1)):
        assert layer.value_at(place) is None


class Careless(Robot):
    """Does what is no action on a layer."""

    wrong: object = None

    def tick(self, cars: Cars) -> Action:
        return Action.stay(cars, layer_actions=self.wrong)


def test_what_is_no_action_is_refused_with_its_reason(scenario: Path, tmp_path: Path) -> None:
    here = Point(2.5, 1.5)
    for wrong, reason in [
        (["dust"], "a sequence of cars.LayerAction"),
        ([LayerAction("dust", "here", set=1)], "at a cars.Point"),  # type: ignore[arg-type]
        ([LayerAction("dust", here, add="x")], "real number"),  # type: ignore[arg-type]
        ([LayerAction("dust", here)], "has set or add"),
        ([LayerAction("dust", here, radius_m=-1, set=1)], "less than zero"),
        ([LayerAction("dust", here, set=1)] * 65, "65 actions, more than the 64 allowed"),
    ]:
        Careless.wrong = wrong
        scenario.write_text(FLOOR)
        with pytest.raises((TypeError, cars.Error), match=reason):
            cars.run(scenario, robots={"A": Careless}, out=tmp_path)


PROGRAM = """
import json, sys
for line in sys.stdin:
    told = json.loads(line)
    if told["type"] == "end":
        break
    if told["type"] == "init" and told["tick"] > 0:
        continue
    row = next(row for row in told["layers"][0]["rows"] if row["row"] == 1)
    change = told.get("layer_results", [{"change": 0}])[0]["change"]
    print(json.dumps({"type": "log", "text": f"{row['values']} {change}"}))
    action = {"layer": "dust", "at": told["location"], "radius_m": 0.5, "add": 0.5}
    print(json.dumps({"type": "done", "layer_actions": [action]}), flush=True)
"""


def test_a_program_over_its_pipes_does_the_same(lab: Lab, scenario: Path, tmp_path: Path) -> None:
    scenario.write_text(FLOOR)
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    launch = tmp_path / "launch.toml"
    launch.write_text(
        f"scenario = {str(scenario)!r}\n[[process]]\nname = \"A\"\n"
        f"command = [\"cars\", \"exec\", \"--\", {sys.executable!r}, {str(program)!r}]\n"
    )
    lab.cars("launch", str(launch), "--run", "piped", "--out", str(lab.folder), "--no-console", "--quiet")
    said = [event["text"] for event in lab.of_kind("piped", "say")]
    assert said == ["[1.0, 1.0, 1.0] 0", "[1.0, 1.5, 1.0] 0.5", "[1.0, 2.0, 1.0] 0.5"]
