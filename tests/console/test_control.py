"""Every control of the page changes the real simulator."""

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, eventually, start_console, until


def tick(page):
    return int(page.get_by_test_id("tick").inner_text())


def shows(page, phase, at_tick=None):
    expect(page.get_by_test_id("phase")).to_have_text(phase, ignore_case=True)
    if at_tick is not None:
        expect(page.get_by_test_id("tick")).to_have_text(str(at_tick))


def test_step_start_pause_speed_and_init(launch, open_page):
    run = launch(options=("--speed", "20", "--duration", "100000 s"))
    page = open_page(run.address)
    shows(page, "ready", 0)

    for expected in (1, 2, 3):
        page.get_by_test_id("btn-step").click()
        shows(page, "paused", expected)
        assert run.status()["tick"] == expected
    assert page.evaluate("window.carsConsole.frame().tick") == 3
    expect(page.get_by_test_id("time")).to_contain_text("1.5")

    page.get_by_test_id("btn-start").click()
    shows(page, "running")
    until(page, "window.carsConsole.frame()?.tick > 20")
    assert run.status()["phase"] == "running"

    page.get_by_test_id("speed").select_option("5")
    eventually("the speed", lambda: run.status()["speed"] == 5)
    page.get_by_test_id("speed").select_option("max")
    eventually("the speed", lambda: run.status()["speed"] is None)
    page.get_by_test_id("speed").select_option("2")

    page.get_by_test_id("btn-pause").click()
    shows(page, "paused")
    held = eventually("the last tick", run.settled)
    assert held["phase"] == "paused"
    assert held["tick"] > 20
    # The last frame may be older than the tick at which the run paused.
    expect(page.get_by_test_id("tick")).to_have_text(str(held["tick"]))
    page.wait_for_timeout(500)
    assert run.status()["tick"] == held["tick"] == tick(page)

    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    shows(page, "ready", 0)
    again = run.status()
    assert again["epoch"] == 2
    assert again["tick"] == 0
    assert again["seed"] == held["seed"]
    page.get_by_test_id("btn-step").click()
    shows(page, "paused", 1)


@pytest.mark.thorough
def test_fast_clicks_on_step_are_all_counted(launch, open_page):
    run = launch()
    page = open_page(run.address)
    shows(page, "ready", 0)

    for _ in range(10):
        page.get_by_test_id("btn-step").click()

    shows(page, "paused", 10)
    assert run.status()["tick"] == 10


@pytest.mark.thorough
def test_stop_asks_for_confirmation_and_the_last_frame_stays(launch, open_page):
    run = launch(options=("--speed", "20"))
    page = open_page(run.address)
    shows(page, "ready", 0)
    page.get_by_test_id("btn-step").click()
    shows(page, "paused", 1)

    page.get_by_test_id("btn-stop").click()
    assert run.simulator.poll() is None, "the page asks for confirmation"
    page.get_by_test_id("btn-stop-confirm").click()
    assert run.simulator.wait(PATIENCE_S) == 0

    expect(page.get_by_test_id("connection")).to_have_text("no simulator")
    assert tick(page) == 1
    assert len(page.evaluate("window.carsConsole.frame().robots")) == 2
    assert run.events()[-1]["reason"] == "stopped"

    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("message")).to_contain_text("no simulator")


def test_two_browsers_see_the_same_run(launch, open_page):
    run = launch()
    one = open_page(run.address)
    other = open_page(run.address)
    shows(one, "ready", 0)
    shows(other, "ready", 0)

    one.get_by_test_id("btn-step").click()
    shows(other, "paused", 1)

    other.get_by_test_id("btn-init").click()
    other.get_by_test_id("end-run").click()
    shows(one, "ready", 0)


@pytest.mark.thorough
def test_a_reloaded_page_shows_the_same_again(launch, open_page):
    run = launch()
    page = open_page(run.address)
    shows(page, "ready", 0)
    page.get_by_test_id("btn-step").click()
    page.get_by_test_id("panel-Leguin").get_by_test_id("button-refill").click()
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("log")).to_contain_text("-> Leguin: refill")
    shows(page, "paused", 2)
    lines = page.get_by_test_id("log").locator(".line").count()

    page.reload()

    shows(page, "paused", 2)
    expect(page.get_by_test_id("panel-Leguin").get_by_test_id("face")).to_be_visible()
    expect(page.get_by_test_id("log").locator(".line")).to_have_count(lines)


@pytest.mark.thorough
def test_a_console_that_comes_late_shows_the_whole_log(launch, open_page):
    run = launch()
    page = open_page(run.address)
    for tick in range(1, 6):
        page.get_by_test_id("btn-step").click()
        shows(page, "paused", tick)
    log = page.get_by_test_id("log")
    expect(log).to_contain_text("initialized, seed 2002")

    late = open_page(start_console(run.processes, environment=run.environment))

    shows(late, "paused", 5)
    expect(late.get_by_test_id("log")).to_have_text(log.inner_text(), use_inner_text=True)
