"""A page outlives the end of a run, and its console."""

import os
import signal

import pytest
from playwright.sync_api import expect

from lab import eventually

pytestmark = pytest.mark.thorough


def test_the_run_ends_and_init_starts_the_next_one(launched, open_page, screenshots):
    run = launched("--paused", "--duration", "5 s", "--speed", "max")
    page = open_page(run.address)
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    expect(page.get_by_test_id("tick")).to_have_text("10")
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    expect(page.locator("#panel-log")).to_contain_text("its processes stay")
    page.screenshot(path=screenshots / "ended.png")

    # It is watched again, and the page returns to its end.
    page.get_by_test_id("watch-again").click()
    expect(page.get_by_test_id("live")).to_be_enabled()
    eventually("an earlier tick", lambda: int(page.get_by_test_id("tick").text_content()) < 10)
    expect(page.get_by_test_id("live")).to_be_disabled(timeout=30_000)
    expect(page.get_by_test_id("tick")).to_have_text("10")
    expect(page.get_by_test_id("watch-again")).to_be_visible()

    # The page is loaded again, which the simulator outlives.
    page.reload()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    page.get_by_test_id("btn-init").click()
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("btn-start").click()
    eventually("the second end", lambda: run.status()["epoch"] == 2 and run.status()["phase"] == "ended")
    assert run.process.poll() is None

    # When nobody looks any more, the launch ends by itself.
    page.context.close()
    assert run.process.wait(timeout=60) == 0, run.output()
    assert run.verify().returncode == 0


def test_ctrl_c_ends_everything(launched, open_quietly):
    run = launched("--paused", "--duration", "5 s", "--speed", "max")
    page = open_quietly(run.address)
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    run.process.send_signal(signal.SIGINT)
    assert run.process.wait(timeout=60) == 130, run.output()
    expect(page.get_by_test_id("connection")).to_have_text("console not reachable")


def test_a_page_outlives_its_console(launched, open_quietly):
    run = launched("--paused", "--duration", "600 s")
    page = open_quietly(run.address)
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    console = eventually("the console", lambda: run.pid("cars-console"))
    os.kill(console, signal.SIGKILL)
    eventually("another console", lambda: run.pid("cars-console") not in (None, console))
    expect(page.get_by_test_id("connection")).to_have_text("connected")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
