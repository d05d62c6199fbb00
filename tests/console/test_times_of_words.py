"""Words and numbers on the page are true of the tick that is shown."""

import json
import re
import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, PATIENCE_S, ROOT, eventually, scrub, until

pytestmark = pytest.mark.thorough


def ended(launch, open_page):
    """A page of a run of 300 ticks that has ended."""
    run = launch(options=("--set", "seed=7", "--set", 'duration="150 s"', "--speed", "max", "--stay"))
    page = open_page(run.address)
    run.control("start")
    eventually("the end", lambda: run.status()["phase"] == "ended")
    expect(page.get_by_test_id("tick")).to_have_text("300")
    return run, page


def test_a_reason_says_of_which_time_it_is(launch, open_page, tmp_path):
    """It has numbers, such as of treats, of the tick in which its episode began."""
    options = ("--set", "seed=7", "--set", 'duration="150 s"')
    command = [BIN / "cars", "run", "configs/hors_doeuvres.toml", "--run", "known", "--out", tmp_path, "--quiet", *options]
    subprocess.run(command, check=True, timeout=PATIENCE_S, cwd=ROOT)
    known = [json.loads(line) for line in (tmp_path / "known/events.jsonl").read_text().splitlines()]
    changes = [event for event in known if event["event"] == "emotion" and event["robot"] == "Butler"]
    assert len(changes) > 1
    began = {}
    for change, following in zip(changes, [*changes[1:], {"tick": 301}]):
        for tick in (change["tick"], following["tick"] - 1):
            began[tick] = change["tick"]

    # The clock is held after each tick that is looked at: of others a busy machine may leave out the panels.
    run = launch(options=(*options, "--speed", "max", "--stay"))
    page = open_page(run.address)
    at = 0
    for tick in filter(None, sorted(began)):
        run.control("step", str(tick - at))
        eventually(f"tick {tick}", lambda: (run.settled() or {}).get("tick") == tick)
        at = tick
    eventually("the end", lambda: run.status()["phase"] == "ended")
    expect(page.get_by_test_id("tick")).to_have_text("300")
    of_butler = [event for event in run.events() if event["event"] == "emotion" and event["robot"] == "Butler"]
    assert of_butler == changes
    for tick, since in began.items():
        scrub(page, tick)
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
        panel = page.get_by_test_id("panel-Butler")
        expect(panel.get_by_test_id("no-panel")).to_have_count(0)
        expect(panel).to_contain_text(f"At {since * 0.5:.1f} s, when this began: ")


def test_the_paper_s_free_activation_is_named_as_in_english(launch, open_page):
    run, page = ended(launch, open_page)
    happy = [event["tick"] for event in run.events() if event["event"] == "emotion" and event["to"] == "HAPPY"]
    assert happy
    scrub(page, happy[0])
    expect(page.locator("#panels")).to_contain_text("free activation")


@pytest.mark.parametrize("unit, place", [("m", r"takes part, at [\d.]+ m, [\d.]+ m"), ("ft", r"takes part, at [\d.]+ ft, [\d.]+ ft")])
def test_the_log_has_the_unit_of_the_page(launch, open_page, unit, place):
    page = open_page(launch().address)
    expect(page.get_by_test_id("log")).to_contain_text("takes part")
    page.get_by_test_id("units").select_option(unit)
    expect(page.get_by_test_id("log")).to_contain_text(re.compile(place))


def test_charts_open_on_what_moves(launch, open_page):
    _, page = ended(launch, open_page)
    page.get_by_test_id("tab-charts").click()
    variable = page.get_by_test_id("chart-variable")
    until(page, "document.querySelector('[data-testid=chart-variable]').value !== ''")
    assert not variable.input_value().endswith("_s"), variable.input_value()


@pytest.mark.parametrize("width, height", [(1024, 700), (1440, 900)])
def test_the_choice_of_units_has_its_label(launch, open_page, width, height):
    page = open_page(launch().address, width, height)
    label = page.locator(".plan-bar .field.inline > span")
    expect(label).to_be_visible()
    assert label.bounding_box()["width"] > 20


def test_the_diagram_reaches_the_tick_that_is_shown(launch, open_page):
    _, page = ended(launch, open_page)
    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_be_visible()
    eventually("the end", lambda: page.locator(".diagram svg").get_attribute("data-to") == "300")
    expect(page.get_by_test_id("diagram-lag")).to_have_count(0)
