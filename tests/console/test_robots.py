"""Panels and presence of robots, and that no content of a panel is executed."""

import random

import pytest
from playwright.sync_api import expect

from lab import eventually, until

pytestmark = pytest.mark.thorough

THREE = {"scenario": "configs/three_robots.toml", "robots": ("Butler", "Leguin", "Vonda")}


def test_three_robots_show_three_panels(launch, open_page):
    run = launch(**THREE)
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()

    seen = []
    for name in THREE["robots"]:
        panel = page.get_by_test_id(f"panel-{name}")
        expect(panel.get_by_test_id("face")).to_be_visible()
        expect(panel.get_by_test_id("presence")).to_have_text("here")
        panel.locator("summary", has_text="Details").click()
        expect(panel.locator(".details table").first).to_be_visible()
        seen.append(panel.inner_text().replace(name, ""))

    assert len(set(seen)) == 3, seen
    butler, leguin, vonda = seen
    assert "served" in butler and "served" not in leguin + vonda
    assert "waiter" in leguin and "waiter" in vonda


def test_a_button_of_a_panel_commands_the_robot(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()

    page.get_by_test_id("panel-Leguin").get_by_test_id("button-refill").click()
    expect(page.get_by_test_id("message")).to_contain_text("refill")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("2")
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("panel-Leguin")).to_contain_text("REFILL")

    sent = [event for event in run.events() if event["event"] == "command_sent" and event["from"] == "operator"]
    assert [(event["to"], event["command"]) for event in sent] == [("Leguin", "refill")]
    expect(page.get_by_test_id("log")).to_contain_text("-> Leguin: refill")

    page.get_by_test_id("log-filter-robot").select_option("Butler")
    expect(page.get_by_test_id("log")).not_to_contain_text("-> Leguin: refill")

    page.get_by_test_id("log-filter-robot").select_option("")
    page.get_by_test_id("log-filter-kind").select_option("command")
    expect(page.get_by_test_id("log")).to_contain_text("-> Leguin: refill")
    expect(page.get_by_test_id("log")).not_to_contain_text("behavior")


def test_a_killed_robot_is_shown_as_gone_and_returns(launch, open_page):
    run = launch(options=("--speed", "20"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 5")

    run.kill("Leguin")
    presence = page.get_by_test_id("panel-Leguin").get_by_test_id("presence")
    expect(presence).to_have_text("gone")
    expect(page.get_by_test_id("awaiting")).to_contain_text("Leguin")
    expect(page.get_by_test_id("panel-Butler").get_by_test_id("presence")).not_to_have_text("gone")

    held = page.evaluate("window.carsConsole.frame().tick")
    run.restart("Leguin")
    expect(presence).to_have_text("returned")
    expect(page.get_by_test_id("awaiting")).to_be_hidden()
    until(page, f"window.carsConsole.frame()?.tick > {held + 5}")
    expect(page.get_by_test_id("log")).to_contain_text("is back as incarnation 2")


def test_a_robot_that_the_run_goes_on_without_is_lost(launch, open_page):
    options = ("--speed", "20", "--set", "on_late=continue", "--set", "deadline=0.5 s")
    run = launch(options=options)
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 5")

    run.kill("Leguin")
    expect(page.get_by_test_id("panel-Leguin").get_by_test_id("presence")).to_have_text("lost")
    lost_at = page.evaluate("window.carsConsole.frame().tick")
    until(page, f"window.carsConsole.frame()?.tick > {lost_at + 5}")

    run.restart("Leguin")
    expect(page.get_by_test_id("panel-Leguin").get_by_test_id("presence")).to_have_text("returned")


MARKUP = "<script>window.hacked=1</script><img src=x onerror='window.hacked=1'><b id='injected'>bold</b>"
SVG = (
    "<svg xmlns='http://www.w3.org/2000/svg' width='40' height='40' onload='window.hacked=1;alert(1)'>"
    "<script>window.hacked=1;parent.hacked=1;alert(2)</script><circle cx='20' cy='20' r='15' fill='red'/>"
    "<foreignObject width='40' height='40'><body xmlns='http://www.w3.org/1999/xhtml' onload='parent.hacked=1'>"
    "<iframe srcdoc='&lt;script&gt;parent.parent.hacked=1&lt;/script&gt;'/></body></foreignObject>"
    "<image href='http://127.0.0.1:1/leak.png'/><set attributeName='onmouseover' to='window.hacked=1'/></svg>"
)
HOSTILE = {
    "widgets": [
        {"widget": "text", "label": MARKUP, "text": MARKUP},
        {"widget": "badge", "label": MARKUP, "text": MARKUP, "tone": "bad"},
        {"widget": "bar", "label": MARKUP, "value": 1e308, "min": -1e308, "max": 1e308},
        {"widget": "bar", "label": "upside down", "value": 5, "min": 1, "max": 0},
        {"widget": "sparkline", "label": MARKUP, "values": [1e308, -1e308] * 500},
        {"widget": "sparkline", "label": "empty", "values": []},
        {"widget": "table", "rows": [[MARKUP, MARKUP], [], ["x"] * 100]},
        {"widget": "svg", "label": MARKUP, "svg": SVG},
        {"widget": "svg", "label": "broken", "svg": "<svg"},
        {"widget": "svg", "label": "escape", "svg": "'/><script>window.hacked=1</script>"},
        {"widget": "button", "label": MARKUP, "command": "javascript:window.hacked=1"},
    ]
}


def test_content_of_a_panel_or_line_is_not_executed(launch, open_page):
    run = launch()
    page = open_page(run.address)
    requests = []
    page.on("request", lambda request: requests.append(request.url))
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()
    panel = page.get_by_test_id("panel-Leguin")
    expect(panel.get_by_test_id("face")).to_be_visible()

    panel.locator("summary", has_text="Details").click()
    run.put_panel("Leguin", HOSTILE["widgets"])
    expect(panel).to_contain_text("<script>window.hacked=1</script>")
    expect(panel.locator(".details table")).to_be_visible()
    page.wait_for_timeout(500)
    assert page.locator("#injected").count() == 0

    picture = panel.locator("img").first
    expect(picture).to_be_visible()
    picture.hover()
    button = panel.locator("button", has_text="<script>")
    button.click()
    expect(page.get_by_test_id("message")).to_contain_text("javascript:")

    line = {"epoch": 1, "tick": 1, "time_s": 0.5, "source": MARKUP, "kind": "say", "text": MARKUP}
    run.put("log", line)
    expect(page.get_by_test_id("log")).to_contain_text("<b id='injected'>")

    # Malformed panels, frames and unknown robots are ignored.
    for wrong in ({}, [], HOSTILE):
        run.put("robot/Leguin/panel", wrong)
    for widgets in ([{"widget": "html", "html": MARKUP}], [HOSTILE["widgets"][1]] * 100):
        run.put_panel("Leguin", widgets)
    run.put_panel("Unknown", HOSTILE["widgets"])
    run.put("world", {"tick": 10**9})

    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("2")
    assert page.evaluate("typeof window.hacked") == "undefined"
    assert page.locator("#injected").count() == 0
    assert page.locator("script:not([src^='assets/'])").count() == 0
    foreign = [url for url in requests if not url.startswith((page.url, "data:", "ws:"))]
    assert foreign == []
    assert run.simulator.poll() is None


ODD_TEXTS = ("", " ", MARKUP, "${window.hacked=1}", "{{constructor}}", "\u202e\u0000\ufeff", "x" * 4000, "\n\n\t", "🤖" * 200, "NaN")
ODD_NUMBERS = (0, -0.0, -1, 1, 0.5, 1e308, -1e308, 5e-324, 2**53, -(2**63))
FACES = ("happy", "sad", "surprised", "disgusted", "angry", "fearful", "neutral")


def odd_widget(chance):
    """A widget with unusual content, sometimes malformed."""

    def text():
        return chance.choice(ODD_TEXTS)

    def number():
        return chance.choice(ODD_NUMBERS)

    widget = chance.choice(
        (
            {"widget": "text", "label": text(), "text": text()},
            {"widget": "badge", "label": text(), "text": text(), "tone": chance.choice(("good", "neutral", "warning", "bad"))},
            {"widget": "bar", "label": text(), "value": number(), "min": number(), "max": number()},
            {"widget": "face", "face": chance.choice(FACES), "intensity": number()},
            {"widget": "sparkline", "label": text(), "values": [number() for _ in range(chance.choice((0, 1, 2, 900)))]},
            {"widget": "table", "rows": [[text() for _ in range(chance.randrange(5))] for _ in range(chance.randrange(5))]},
            {"widget": "svg", "label": text(), "svg": chance.choice((SVG, SVG[: chance.randrange(len(SVG))], *ODD_TEXTS))},
            {"widget": "button", "label": text(), "command": text()},
        )
    )

    if chance.random() < 0.1:
        widget[chance.choice(list(widget))] = chance.choice((None, [], {}, True, "odd", 3))
    return widget


def test_the_page_works_with_any_content_of_a_panel(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-step").click()
    panel = page.get_by_test_id("panel-Leguin")
    expect(panel.get_by_test_id("face")).to_be_visible()
    panel.locator("summary", has_text="Details").click()

    chance = random.Random(2002)
    for number in range(60):
        run.put_panel("Leguin", [odd_widget(chance) for _ in range(chance.randrange(20))])
        if number % 10 == 9:
            run.put_panel("Leguin", [{"widget": "text", "label": "number", "text": f"shown {number}"}])
            expect(panel).to_contain_text(f"shown {number}")

    assert page.evaluate("typeof window.hacked") == "undefined"
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("2")


def test_the_number_of_log_rows_is_bounded(launch, open_page):
    run = launch(options=("--speed", "max", "--duration", "1000000 s"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, "window.carsConsole.frame()?.tick > 4000")
    assert page.get_by_test_id("log").locator(".line").count() <= 2000

    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused", ignore_case=True)
    eventually("the last frame", lambda: run.status()["tick"] == page.evaluate("window.carsConsole.frame().tick"))
