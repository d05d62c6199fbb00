"""`cars launch --open`: the run waits for its browser, and the page explains the first steps."""

import pytest
from playwright.sync_api import expect

from lab import FITS, eventually, until

pytestmark = pytest.mark.thorough


@pytest.fixture
def fake_browser(tmp_path, monkeypatch):
    """A browser that leaves what it was started with in a file."""
    opened = tmp_path / "opened"
    browser = tmp_path / "browser.sh"
    browser.write_text(f'#!/bin/sh\ncat "$1" > {opened}.writing\nmv {opened}.writing {opened}\n')
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", str(browser))
    return opened


def ended(run):
    assert run.process.wait(timeout=60) == 0, run.output()
    verified = run.verify()
    assert verified.returncode == 0, verified.stdout + verified.stderr


@pytest.mark.parametrize("speed", [None, "max"])
def test_the_run_waits_for_its_browser_and_begins_there(launched, open_page, fake_browser, speed, screenshots):
    speeds = ("--speed", speed) if speed else ()
    run = launched("--open", "--duration", "30 s", *speeds)
    eventually("the browser", fake_browser.exists)
    status = eventually("the robots", lambda: (run.status() or {}).get("phase") == "ready" and run.status())
    assert (status["tick"], status["speed"]) == (0, 5.0 if speed is None else None)

    page = open_page(run.address)
    guide = page.get_by_test_id("guide")
    expect(guide.get_by_role("listitem")).to_have_count(5)
    expect(guide).to_contain_text("press Start")
    expect(page.get_by_test_id("guide-verify")).to_have_text(f"cars verify {run.RUN}")
    page.screenshot(path=screenshots / f"guide-{speed}.png")
    # It covers nothing of the plan, and is one line when the run goes on.
    plan, steps = page.get_by_test_id("plan").bounding_box(), guide.bounding_box()
    assert steps["y"] >= plan["y"] + plan["height"] - 1
    page.get_by_test_id("btn-start").click()
    expect(guide.get_by_role("listitem")).to_have_count(0)
    assert guide.bounding_box()["height"] < 50
    expect(page.get_by_test_id("phase")).to_have_text("ended", ignore_case=True)
    page.get_by_test_id("guide-fold").click()
    expect(guide.get_by_role("listitem")).to_have_count(5)
    expect(page.get_by_test_id("tick")).to_have_text("60")
    page.context.close()
    ended(run)


@pytest.mark.parametrize(("width", "height"), [(1024, 700), (1440, 900)])
def test_most_of_the_plan_is_seen_beside_the_guide(launched, open_page, fake_browser, width, height, screenshots):
    run = launched("--open", "--duration", "30 s")
    page = open_page(run.address, width=width, height=height)
    guide, plan = page.get_by_test_id("guide"), page.get_by_test_id("plan")
    expect(guide.get_by_role("listitem")).to_have_count(5)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    until(page, FITS)
    # What is left of its height, and no step has to be scrolled to.
    seen = plan.bounding_box()["height"]
    assert guide.evaluate("(guide) => guide.scrollHeight <= guide.clientHeight")
    page.screenshot(path=screenshots / f"guide-{width}x{height}.png")
    page.get_by_test_id("guide-close").click()
    expect(guide).to_be_hidden()
    until(page, FITS)
    assert seen >= 0.6 * plan.bounding_box()["height"]


def test_the_guide_is_put_away_for_good(launched, open_page, fake_browser, screenshots):
    run = launched("--open", "--duration", "30 s")
    page = open_page(run.address)
    guide = page.get_by_test_id("guide")
    expect(guide).to_be_visible()
    page.get_by_test_id("guide-close").click()
    expect(guide).to_be_hidden()
    page.reload()
    page.get_by_test_id("guide-dismiss").click()
    expect(guide).to_be_hidden()
    page.reload()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(guide).to_be_hidden()
    for width, height, scheme in ((390, 844, "light"), (1280, 720, "dark")):
        other = open_page(run.address, width=width, height=height, scheme=scheme)
        expect(other.get_by_test_id("guide")).to_be_visible()
        plan, steps = other.get_by_test_id("plan").bounding_box(), other.get_by_test_id("guide").bounding_box()
        assert steps["y"] >= plan["y"] + plan["height"] - 1
        other.screenshot(path=screenshots / f"guide-{width}-{scheme}.png")


def test_a_run_whose_browser_does_not_come_begins_without_it_and_says_so(launched, monkeypatch):
    monkeypatch.setenv("BROWSER", "true")
    monkeypatch.setenv("CARS_BROWSER_PATIENCE_S", "1")
    run = launched("--open", "--duration", "30 s", "--speed", "max")
    ended(run)
    assert "no browser has opened the page within 1 s: the run begins without one" in run.output()


def test_without_the_guide_a_page_shows_none(launched, open_page):
    run = launched("--paused")
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("guide")).to_be_hidden()
