"""Sites and sensing from Python: in this process, as programs, and beside a robot in Rust."""

from __future__ import annotations

from pathlib import Path

import pytest
from forager import Forager
from lab import Lab, assert_same

import cars
from cars import Action, Cars, KnownSite, Rays, Robot, SensedSite, SiteAction, SiteResult

SCENARIO = """
seed = 3
tick = "0.5 s"
duration = "15 s"
[field]
size = ["10 m", "8 m"]
[sensing]
range = "3 m"
misses = 0.1
noise = "0.05 m"
rays = { count = 8, range = "4 m" }
[[obstacle]]
at = ["8 m", "4 m"]
[[site]]
name = "T"
count = 12
kind = "task"
at = "random"
range = "2 m"
on_conflict = "first"
state = { stock = { start = 4, min = 0 }, open = true, last = "" }
[[site]]
name = "U"
at = ["4 m", "4 m"]
on_conflict = "refuse"
state = { stock = 9, open = true, last = "" }
[[measure]]
name = "left"
variable = { sites = "T*", by = "sum", name = "stock", as = "end" }
[[expect]]
name = "a site is emptied"
eventually = { event = "site_changed", key = "stock", to = 0 }
within = "15 s"
[[robot]]
name = "A"
at = ["2 m", "4 m"]
[[robot]]
name = "B"
at = ["2 m", "5 m"]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Two robots that take from the same sites."""
    file = tmp_path / "sites.toml"
    file.write_text(SCENARIO)
    return file


def test_the_same_run_in_one_process_and_as_programs_of_two_languages(lab: Lab, scenario: Path) -> None:
    python = str(Path(__file__).with_name("forager.py"))
    # The programs of the project have it only where they are built for tests.
    rust = lab.programs / "forager"
    robots = {"A": str(rust) if rust.exists() else python, "B": python}
    launched = lab.launch("launched", str(scenario), robots)
    # What is launched expects nothing.
    both = {"A": Forager, "B": Forager}
    own = cars.run(scenario, set={"expect": []}, robots=both, out=lab.folder, name="own")
    assert_same(launched, lab.events("own"))
    assert own.summary["digest"] in launched[-1]

    assert cars.run(scenario, robots=both, out=lab.folder, name="judged").verdict == "pass"

    of_tasks = [event for event in lab.of_kind("own", "site_changed") if event["site"].startswith("T") and event["key"] == "stock"]
    assert own.summary["measures"]["left"] == {"state": "value", "value": 48.0 - len(of_tasks)}

    changed = lab.of_kind("own", "site_changed")
    refused = lab.of_kind("own", "site_refused")
    assert {event["because"] for event in refused} == {"bound", "conflict"}
    assert {event["key"] for event in changed} == {"stock", "last"}
    assert "the same" in lab.cars("verify", "launched", "--out", str(lab.folder))
    events = own.events
    assert set(events[events.event == "site_changed"].site) >= {"U"}


class Looker(Robot):
    """Notes what it senses, and claims a site."""

    senses_ranges = True
    seen: list[tuple[tuple[SensedSite, ...], tuple[SiteResult, ...], Rays | None, int]] = []

    def tick(self, cars: Cars) -> Action:
        self.seen.append((cars.sites, cars.site_results, cars.welcome.rays, len(cars.ranges)))
        claim = SiteAction("U", set={"open": False}, add={"stock": -1.5}, only_if={"open": True})
        return Action.stay(cars, site_actions=[claim])


def test_a_robot_sees_sites_and_what_became_of_its_actions(scenario: Path, tmp_path: Path) -> None:
    text = SCENARIO.replace("misses = 0.1\nnoise = \"0.05 m\"\n", "").replace("count = 12", "count = 0").replace('sites = "T*"', 'sites = "U"')
    scenario.write_text(text)
    Looker.seen.clear()
    cars.run(scenario, robots={"A": Looker, "B": Looker}, out=tmp_path, duration="1 s")
    of_a = Looker.seen[0::2]
    site = SensedSite("U", "site", cars.Point(4.0, 4.0), {"last": "", "open": True, "stock": 9.0})
    assert of_a[0] == ((site,), (), Rays(8, 4.0), 8)
    assert of_a[1][1] == (SiteResult("U", "conflict"),)
    assert of_a[1][0] == (site,)


class Informed(Robot):
    """Keeps what it knows when it joins."""

    known: tuple[KnownSite, ...] = ()

    def init(self, cars: Cars) -> None:
        Informed.known = cars.welcome.known_sites

    def tick(self, cars: Cars) -> Action:
        return Action.stay(cars)


def test_a_robot_knows_of_known_sites_wherever_it_is(scenario: Path, tmp_path: Path) -> None:
    known = "name = \"U\"\nkind = \"task\"\nknown = true"
    scenario.write_text(SCENARIO.replace('name = "U"', known).replace('at = ["4 m", "4 m"]', 'at = ["9 m", "7 m"]'))
    cars.run(scenario, robots={"A": Informed, "B": Looker}, out=tmp_path, duration="1 s", set={"expect": []})
    assert Informed.known == (KnownSite("U", "task", cars.Point(9.0, 7.0)),)


class Careless(Robot):
    """Does what is no action on a site."""

    wrong: object = None

    def tick(self, cars: Cars) -> Action:
        return Action.stay(cars, site_actions=self.wrong)


def test_what_is_no_action_is_refused_with_its_reason(scenario: Path, tmp_path: Path) -> None:
    for wrong, reason in [
        (["T1"], "a sequence of cars.SiteAction"),
        ([SiteAction("T1", add={"stock": "x"})], "adds numbers"),  # type: ignore[dict-item]
        ([SiteAction("T1", set={"stock": 1.0})] * 65, "65 actions, more than the 64 allowed"),
    ]:
        Careless.wrong = wrong
        with pytest.raises((TypeError, cars.Error), match=reason):
            cars.run(scenario, robots={"A": Careless, "B": Careless}, out=tmp_path)
