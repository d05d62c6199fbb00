"""Forced colors: the system has a few colors for everything, and all states are still told apart."""

import re

import pytest
from playwright.sync_api import expect

from lab import FITS, Crowd, eventually, reaches, until
from test_plan import PIXEL, RING, color_of_emotion

pytestmark = pytest.mark.thorough


def style(place, name):
    return place.evaluate("(one, name) => getComputedStyle(one)[name]", name)


def system_color(page, name):
    """What the browser has for a color of the system."""
    return page.evaluate(
        "(name) => { const one = document.body.appendChild(document.createElement('i')); one.style.color = name;"
        " const {color} = getComputedStyle(one); one.remove(); return color; }",
        name,
    )


# Next to a robot that is selected, on the ring that says so.
SELECTED = """(name) => {
    const {frame, toClient} = window.carsConsole;
    const {body_m, robots} = frame(), {location} = robots.find((one) => one.name === name);
    const at = toClient(location.x, location.y), scale = toClient(location.x + 1, location.y).x - at.x;
    return [at.x, at.y + Math.max(9, body_m * scale / 2) + 9.5];
}"""


def rgb(color):
    return f"rgb({', '.join(map(str, color))})"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_states_are_told_apart_with_forced_colors(launch, open_page, screenshots, scheme):
    page = open_page(launch(options=("--set", "guests.count=20")).address, scheme=scheme, forced_colors="active")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    for tick in range(1, 4):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    canvas, text, highlight = (system_color(page, name) for name in ("Canvas", "CanvasText", "Highlight"))
    assert style(page.locator("body"), "backgroundColor") == canvas

    # A robot that is selected, and the tab.
    page.get_by_test_id("panel-Butler").get_by_role("button", name="Butler").click()
    chosen, other = page.get_by_test_id("panel-Butler"), page.get_by_test_id("panel-Leguin")
    assert (style(chosen, "outlineStyle"), style(chosen, "outlineColor")) == ("solid", highlight)
    assert style(other, "outlineStyle") == "none"
    assert style(page.get_by_test_id("tab-log"), "borderBottomColor") == highlight
    assert style(page.get_by_test_id("tab-charts"), "borderBottomColor") == canvas

    # Emotions keep their colors: badges, strips, legend, and rings on the plan, whose ground is the system's.
    wanted = color_of_emotion("HAPPY", scheme)
    badge = chosen.locator(".badge.state").first
    assert (badge.inner_text(), style(badge, "backgroundColor")) == ("HAPPY", rgb(wanted))
    assert style(page.get_by_test_id("legend-emotion").first.locator("rect"), "fill") == rgb(wanted)
    until(page, FITS)
    # A pixel of the ring may be touched by its edge.
    eventually("the ring", lambda: page.evaluate(PIXEL, page.evaluate(RING, "Butler")) == pytest.approx(wanted, abs=4))
    ground = [int(part) for part in re.findall(r"\d+", canvas)][:3]
    differ = lambda pixel: max(abs(a - b) for a, b in zip(pixel, ground, strict=True)) > 60
    eventually("the ring of the selected one", lambda: differ(page.evaluate(PIXEL, page.evaluate(SELECTED, "Butler"))))
    assert not differ(page.evaluate(PIXEL, page.evaluate(SELECTED, "Leguin")))
    box = page.get_by_test_id("plan").bounding_box()
    assert rgb(page.evaluate(PIXEL, [box["x"] + 3, box["y"] + box["height"] / 2])) == canvas
    page.get_by_test_id("tab-charts").click()
    band = page.locator(".bands .band[data-state=HAPPY]").first
    assert style(band.locator("rect"), "fill") == rgb(wanted)
    # White or black, and not that of the system's text: the band has its own color.
    assert style(band.locator("text"), "fill") in ("rgb(17, 17, 17)", "rgb(255, 255, 255)")

    # What has the focus.
    page.get_by_test_id("columns").focus()
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"

    # Marks, what has not been run, paused and the past.
    assert style(page.get_by_test_id("mark-epoch").first, "backgroundColor") == text
    assert "gradient" in style(page.locator(".coming"), "backgroundImage")
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    page.get_by_test_id("tab-log").click()
    reaches(page, 0)
    page.locator(".line", has_text="takes part").first.click()
    expect(page.get_by_test_id("when")).to_contain_text("past")
    frame = "(name) => getComputedStyle(document.body, '::after')[name]"
    assert page.evaluate(frame, "borderTopStyle") == "double" and page.evaluate(frame, "borderTopColor") == highlight
    picked = page.locator(".line.picked").first
    assert (style(picked, "backgroundColor"), style(picked, "color")) == (highlight, system_color(page, "HighlightText"))
    page.screenshot(path=screenshots / f"forced-colors-{scheme}.png")


def test_a_line_of_the_list_that_is_selected_is_seen_with_forced_colors(launch, open_page, screenshots):
    page = open_page(launch(kind=Crowd, robots=12, guests=20).address, forced_colors="active")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("line-Leguin3").click()
    assert style(page.get_by_test_id("line-Leguin3"), "borderLeftColor") == system_color(page, "Highlight")
    assert style(page.get_by_test_id("line-Leguin4"), "borderLeftStyle") == "none"
    page.screenshot(path=screenshots / "forced-colors-crowd.png")
