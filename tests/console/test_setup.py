"""The set-up, on the plan and in the form."""

import json

import pytest
from playwright.sync_api import expect

from lab import FITS, download, eventually, until

pytestmark = pytest.mark.thorough

BODY_M = 0.6096


def set_up(page):
    expect(page.get_by_test_id("phase")).to_have_text("ready", ignore_case=True)
    page.get_by_test_id("tab-setup").click()
    expect(page.get_by_test_id("setup-guests")).to_be_visible()


def at(page, x_m, y_m):
    until(page, FITS)
    place = page.evaluate("([x, y]) => window.carsConsole.toClient(x, y)", [x_m, y_m])
    return place["x"], place["y"]


def apply(page, run, epoch=2, ends_a_run=False):
    page.get_by_test_id("setup-apply").click()
    if ends_a_run:
        page.get_by_test_id("end-run").click()
    eventually("the epoch", lambda: run.status()["epoch"] == epoch and run.status()["phase"] == "ready")
    until(page, f"window.carsConsole.frame()?.epoch === {epoch}")


def test_obstacles_that_are_clicked_block_a_robot(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()
    set_up_from_paused(page)

    # Leguin is at 4 ft, 4 ft, beside the food table: the walls block all other directions.
    corner = 2 * BODY_M
    walls = [(1, 0), (1, 1), (0, 1), (1, -1), (-1, 1)]
    for right, up in walls:
        page.mouse.click(*at(page, corner + right * BODY_M, corner + up * BODY_M))
    apply(page, run, ends_a_run=True)
    assert len(page.evaluate("window.carsConsole.frame().obstacles")) == 1 + len(walls)

    page.get_by_test_id("btn-step").click()
    page.get_by_test_id("panel-Leguin").get_by_test_id("button-refill").click()
    for _ in range(12):
        page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("13")

    blocked = [event for event in run.events() if event["event"] == "blocked" and event["robot"] == "Leguin"]
    assert blocked, run.events()
    assert blocked[0]["by"] == "obstacle", run.events()
    panel = page.get_by_test_id("panel-Leguin")
    panel.locator("summary", has_text="Details").click()
    expect(panel.locator("tr", has_text="blocked for").locator("td").last).not_to_have_text("0.0 s")


def set_up_from_paused(page):
    expect(page.get_by_test_id("tick")).to_have_text("1")
    page.get_by_test_id("tab-setup").click()
    expect(page.get_by_test_id("setup-guests")).to_be_visible()


def test_a_second_click_removes_an_obstacle(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    set_up(page)
    page.mouse.click(*at(page, 10 * BODY_M, 20 * BODY_M))
    page.mouse.click(*at(page, 15 * BODY_M, 20 * BODY_M))
    page.mouse.click(*at(page, 10 * BODY_M, 20 * BODY_M))
    apply(page, run)

    placed = page.evaluate("window.carsConsole.frame().obstacles")[1:]
    assert len(placed) == 1
    assert placed[0] == pytest.approx([15 * BODY_M, 20 * BODY_M], abs=BODY_M / 2)


def test_a_dragged_robot_starts_there(launch, open_page):
    run = launch(options=("--set", "guests.count=0"))
    page = open_page(run.address)
    set_up(page)
    before = page.evaluate("window.carsConsole.frame().robots.find(r => r.name === 'Butler').location")

    page.mouse.move(*at(page, before["x"], before["y"]))
    page.mouse.down()
    page.mouse.move(*at(page, 6.0, 9.0), steps=5)
    page.mouse.move(*at(page, 3.5, 10.5), steps=5)
    page.mouse.up()
    apply(page, run)

    after = page.evaluate("window.carsConsole.frame().robots.find(r => r.name === 'Butler').location")
    assert after["x"] == pytest.approx(3.5, abs=0.1)
    assert after["y"] == pytest.approx(10.5, abs=0.1)
    joined = [event for event in run.events() if event["event"] == "joined" and event["robot"] == "Butler"]
    assert joined[0]["at"] == after


def test_fields_are_applied(launch, open_page):
    run = launch()
    page = open_page(run.address)
    page.get_by_test_id("units").select_option("m")
    set_up(page)

    for name, value in {
        "guests": "17",
        "seed": "77",
        "field-width": "12",
        "field-height": "10",
        "speed-min": "0.1",
        "speed-mode": "0.2",
        "speed-max": "0.3",
        "duration-min": "1",
        "duration-mode": "2",
        "duration-max": "3",
        "run-duration": "50",
        "log-name": "other.log",
    }.items():
        page.get_by_test_id(f"setup-{name}").fill(value)
    apply(page, run)

    frame = page.evaluate("window.carsConsole.frame()")
    assert len(frame["guests"]) == 17
    assert frame["seed"] == 77
    assert frame["field_m"] == [12, 10]
    assert frame["duration_s"] == 50

    page.get_by_test_id("btn-step").click()
    eventually("the log", lambda: (run.run_folder / "other.log").exists())
    scenario = (run.run_folder / "scenario.toml").read_text()
    assert "77" in scenario
    assert "other.log" in scenario


def test_a_refused_set_up_is_explained_beside_the_field(launch, open_page):
    run = launch()
    page = open_page(run.address)
    set_up(page)

    # The page does not check for this: the simulator refuses it.
    page.get_by_test_id("setup-log-name").fill("events.jsonl")
    page.get_by_test_id("setup-apply").click()
    error = page.get_by_test_id("error-log_file.name")
    expect(error).to_contain_text("the run keeps something else")
    expect(error).to_be_in_viewport()
    expect(page.get_by_test_id("message")).not_to_be_empty()
    assert run.status()["epoch"] == 1, "nothing has changed"

    page.get_by_test_id("setup-log-name").fill("cars.log")
    expect(error).to_be_empty()

    for field, name, value in [
        ("guests", "guests", "many"),
        ("guest_speed_mps", "speed-min", "99"),
        ("seed", "seed", "-1"),
        ("duration_s", "run-duration", "0"),
        ("field_m", "field-width", "0.1"),
    ]:
        before = page.get_by_test_id(f"setup-{name}").input_value()
        page.get_by_test_id(f"setup-{name}").fill(value)
        page.get_by_test_id("setup-apply").click()
        expect(page.get_by_test_id(f"error-{field}")).not_to_be_empty()
        page.get_by_test_id(f"setup-{name}").fill(before)
        expect(page.get_by_test_id(f"error-{field}")).to_be_empty()

    assert run.status()["epoch"] == 1, "nothing has changed"
    apply(page, run)


def test_a_set_up_is_saved_and_loaded(launch, open_page, tmp_path):
    run = launch(options=("--seed", "11"))
    page = open_page(run.address)
    set_up(page)

    saved = tmp_path / "saved.toml"
    download(page, "setup-save", saved)
    assert "seed = 11" in saved.read_text()

    changed = tmp_path / "changed.toml"
    changed.write_text(saved.read_text().replace("seed = 11", "seed = 12"))
    page.get_by_test_id("setup-load").set_input_files(changed)
    eventually("the epoch", lambda: run.status()["epoch"] == 2)
    assert run.status()["seed"] == 12

    changed.write_text("seed = 13\n[gusts]\ncount = 1\n")
    page.get_by_test_id("setup-load").set_input_files(changed)
    expect(page.get_by_test_id("message")).to_contain_text("gusts")
    assert run.status()["epoch"] == 2
