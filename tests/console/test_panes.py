"""Panes have the sizes that a person has given them."""

import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, ROOT, eventually, free_port, start_console

pytestmark = pytest.mark.thorough


def size(page, pane, side):
    return page.locator(pane).bounding_box()[side]


def sizes(page):
    return [round(size(page, *of)) for of in ((".plan", "width"), ("#panels", "height"), ("#deck", "height"))]


def has(page, wanted):
    """Whether the panes have these sizes, but for the rounding of pixels."""
    return sizes(page) == pytest.approx(wanted, abs=1)


def drag(page, splitter, right, down):
    box = page.get_by_test_id(splitter).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right / 2, y + down / 2)
    page.mouse.move(x + right, y + down)
    page.mouse.up()


def test_panes_stay_as_they_were_put(launch, open_page, screenshots):
    run = launch(options=("--set", "guests.count=20"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    before = sizes(page)
    drag(page, "columns", -120, 0)
    drag(page, "rows", 0, 80)
    chosen = sizes(page)
    assert chosen == pytest.approx([before[0] - 120, before[1] + 80, before[2] - 80], abs=2)

    for tab in ("charts", "diagram", "setup", "log"):
        page.get_by_test_id(f"tab-{tab}").click()
        assert has(page, chosen), (tab, sizes(page), chosen)
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("1")
    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    assert has(page, chosen)
    page.screenshot(path=screenshots / "panes-1440x900-light.png")

    # Another window has the same shares, and a window of the same size the same sizes.
    page.set_viewport_size({"width": 1000, "height": 700})
    eventually("a smaller plan", lambda: size(page, ".plan", "width") < chosen[0] - 100)
    page.set_viewport_size({"width": 1440, "height": 900})
    eventually("the sizes before", lambda: has(page, chosen))
    page.reload()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    eventually("the sizes before", lambda: has(page, chosen))

    page.get_by_test_id("columns").dblclick()
    page.get_by_test_id("rows").focus()
    page.keyboard.press("Enter")
    eventually("the sizes that the page chooses", lambda: has(page, before))
    page.reload()
    eventually("the sizes that the page chooses", lambda: has(page, before))


def test_the_borders_of_panes_are_moved_by_keys(launch, open_page):
    page = open_page(launch().address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    for name, less, more in (("columns", "ArrowLeft", "ArrowRight"), ("rows", "ArrowUp", "ArrowDown")):
        bar = page.get_by_test_id(name)
        expect(bar).to_have_attribute("role", "separator")
        bar.focus()
        value = lambda: int(bar.get_attribute("aria-valuenow"))
        eventually("a value", lambda: value() != 50)
        before = value()
        page.keyboard.press(more)
        page.keyboard.press(more)
        eventually("more", lambda: abs(value() - before - 4) <= 1)
        page.keyboard.press(less)
        eventually("less", lambda: abs(value() - before - 2) <= 1)
        # No pane is lost.
        for key in ("Home", "End"):
            page.keyboard.press(key)
            for pane in (".plan", "#panels", "#deck"):
                box = page.locator(pane).bounding_box()
                assert box["width"] >= 260 and box["height"] >= 60, (name, key, pane, box)
                assert box["x"] >= 0 and box["x"] + box["width"] <= 1440 and box["y"] + box["height"] <= 900
        page.keyboard.press("Enter")
        eventually("the value before", lambda: value() == before)


def test_another_run_at_the_same_address_has_the_same_panes(processes, open_page, tmp_path):
    bind = f"127.0.0.1:{free_port()}"

    def console(run):
        command = [BIN / "cars", "run", "configs/hors_doeuvres.toml", "--duration", "5 s", "--run", run, "--out", tmp_path]
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
        return start_console(processes, "--recording", tmp_path / run, bind=bind)

    page = open_page(console("one"))
    expect(page.get_by_test_id("run")).to_have_text("one")
    drag(page, "columns", 150, 0)
    chosen = sizes(page)
    page.goto("about:blank")
    processes.end()
    page.goto(console("two"))
    expect(page.get_by_test_id("run")).to_have_text("two")
    eventually("the same panes", lambda: has(page, chosen))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_on_its_side_shows_the_whole_plan(launch, open_page, screenshots, scheme):
    page = open_page(launch().address, width=844, height=390, scheme=scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    for tab in ("log", "charts", "diagram", "setup", "experiment"):
        page.get_by_test_id(f"tab-{tab}").click()
        page.evaluate("scrollTo(0, 0)")
        assert page.evaluate("document.documentElement.scrollWidth") <= 844
        bar, plan, timeline = (page.locator(one).bounding_box() for one in ("#bar", ".plan-view", "#timeline"))
        assert bar["y"] + bar["height"] <= plan["y"] and plan["y"] + plan["height"] <= timeline["y"], (bar, plan, timeline)
        assert plan["height"] >= 200
        page.screenshot(path=screenshots / f"{tab}-844x390-{scheme}.png")
    for name in ("init", "start", "pause", "step", "stop"):
        box = page.get_by_test_id(f"btn-{name}").bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 844
        expect(page.get_by_test_id(f"btn-{name}")).to_have_accessible_name(name.capitalize())
