"""A recorded run."""

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, Processes, eventually, start_console, until


@pytest.fixture
def recorded(launch, tmp_path):
    """The address of a console that shows the recording of a run of 200 ticks."""
    run = launch(options=("--speed", "max", "--duration", "100 s"))
    run.start("cars", "ctl", "start", "--run", run.RUN, "--connect", run.endpoint)
    assert run.simulator.wait(PATIENCE_S) == 0
    return start_console(run.processes, "--recording", run.run_folder)


def move(page, tick):
    """Moves the scrub bar and fires its events."""
    page.get_by_test_id("scrub").evaluate(
        "(bar, tick) => { bar.value = tick; bar.dispatchEvent(new Event('input', {bubbles: true}));"
        " bar.dispatchEvent(new Event('change', {bubbles: true})); }",
        tick,
    )


def test_a_recording_is_scrubbed_and_played(recorded, open_page, screenshots):
    page = open_page(recorded)
    expect(page.get_by_test_id("scrub")).to_be_visible()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    assert page.get_by_test_id("scrub").get_attribute("max") == "200"
    assert page.get_by_test_id("btn-start").count() == 0, "there is nothing to control"
    expect(page.get_by_test_id("tab-setup")).to_be_hidden()

    move(page, 150)
    expect(page.get_by_test_id("tick")).to_have_text("150")
    expect(page.get_by_test_id("time")).to_contain_text("75.0")
    at_150 = page.evaluate("window.carsConsole.frame()")
    assert len(at_150["guests"]) == 100
    assert len(at_150["robots"]) == 2
    expect(page.get_by_test_id("panel-Butler")).to_contain_text(at_150["robots"][0]["emotion_state"])
    page.screenshot(path=screenshots / "recording-1440x900-light.png")

    move(page, 20)
    expect(page.get_by_test_id("tick")).to_have_text("20")
    assert page.evaluate("window.carsConsole.frame().guests") != at_150["guests"]
    move(page, 150)
    expect(page.get_by_test_id("tick")).to_have_text("150")
    assert page.evaluate("window.carsConsole.frame().guests") == at_150["guests"]

    page.get_by_test_id("play").click()
    until(page, "window.carsConsole.frame().tick > 160")
    page.get_by_test_id("play").click()
    held = page.get_by_test_id("tick").inner_text()
    page.wait_for_timeout(300)
    assert abs(int(page.get_by_test_id("tick").inner_text()) - int(held)) <= 1
    expect(page.get_by_test_id("log")).to_contain_text("initialized, seed 2002")

    page.get_by_test_id("speed").select_option("max")
    page.get_by_test_id("play").click()
    expect(page.get_by_test_id("tick")).to_have_text("200")
    expect(page.get_by_test_id("log")).to_contain_text("finished")
