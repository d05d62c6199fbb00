"""The space-time diagram of a recorded run."""

import re
from xml.etree import ElementTree

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, download, eventually, start_console, until

pytestmark = pytest.mark.thorough


@pytest.fixture
def recorded(launch):
    """The address of a console that shows the recording of a run with losses, 400 ticks, and its events."""
    run = launch(options=("--speed", "max", "--duration", "200 s", "--set", "network.commands.loss=0.4"))
    run.start("cars", "ctl", "start", "--run", run.RUN, "--connect", run.endpoint)
    assert run.simulator.wait(PATIENCE_S) == 0
    return start_console(run.processes, "--recording", run.run_folder), run.events()


def open_diagram(page):
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_be_visible()


def window(page):
    """First and last tick of the diagram."""
    data = page.locator(".diagram svg").evaluate("svg => [svg.dataset.from, svg.dataset.to]")
    return [int(tick) for tick in data]


def shown_tick(page):
    return int(page.get_by_test_id("tick").inner_text())


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_click_on_a_command_shows_its_tick(recorded, open_page, screenshots, scheme):
    address, events = recorded
    page = open_page(address, scheme=scheme)
    open_diagram(page)
    for _ in range(2):
        page.get_by_test_id("diagram-out").click()
    eventually("the whole run", lambda: window(page) == [0, 400])

    sent = [event["tick"] for event in events if event["event"] == "command_sent"]
    commands = page.locator(".diagram .command")
    expect(commands).to_have_count(len(sent))
    dropped = [event for event in events if event["event"] == "command_dropped"]
    expect(page.locator(".diagram .break")).to_have_count(len(dropped))
    page.screenshot(path=screenshots / f"diagram-1440x900-{scheme}.png")

    tick = sent[len(sent) // 2]
    commands.nth(len(sent) // 2).locator(".start").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(tick))
    # The mark of the shown tick is where the command begins.
    middle = "one => { const box = one.getBoundingClientRect(); return box.x + box.width / 2; }"
    begin = commands.nth(len(sent) // 2).locator(".start").evaluate(middle)
    eventually(f"the mark at {begin}", lambda: abs(page.locator(".diagram .cursor").evaluate(middle) - begin) < 1.5)


@pytest.mark.parametrize("scheme, width", [("dark", 1440), ("light", 390)])
def test_a_diagram_is_saved_light_and_of_a_stated_size(recorded, open_page, screenshots, scheme, width):
    page = open_page(recorded[0], scheme=scheme, width=width)
    open_diagram(page)
    assert "180 mm" in page.get_by_test_id("diagram-save").get_attribute("title")
    kept = screenshots / f"diagram-saved-{width}.svg"
    assert download(page, "diagram-save", kept) == "console-test-ticks-0-119.svg"

    text = kept.read_text()
    root = ElementTree.fromstring(text)
    assert root.get("height").endswith("mm") and 100 < float(root.get("width").removesuffix("mm")) <= 180
    # Its style is its own, and the same on a dark screen.
    assert "@media" not in text
    file = open_page(kept.as_uri(), scheme=scheme)
    assert file.locator(".paper").first.evaluate("paper => getComputedStyle(paper).fill") == "rgb(255, 255, 255)"
    words = " ".join("".join(one.itertext()) for one in root.iter("{http://www.w3.org/2000/svg}text"))
    for word in ("console-test, seed 2002", "ticks 0 to 119", "HAPPY", "SERVE", "command", "Butler"):
        assert word in words, words


def test_a_click_beside_everything_shows_the_tick_of_its_place(recorded, open_page):
    address, _ = recorded
    page = open_page(address)
    open_diagram(page)
    knots = page.locator(".diagram svg").get_attribute("data-scale").split(", ")
    (left, first), (right, end) = (map(float, knots[i].split(" ")) for i in (0, -1))

    page.locator(".diagram svg").click(position={"x": left + (right - left) * 0.6, "y": 30})
    expected = int(first + (end - first) * 0.6)
    eventually("the tick", lambda: abs(shown_tick(page) - expected) <= 1)


def test_the_window_is_moved_and_follows_playback(recorded, open_page):
    address, _ = recorded
    page = open_page(address)
    open_diagram(page)
    assert window(page) == [0, 119]

    expect(page.get_by_test_id("diagram-previous")).to_be_disabled()
    page.get_by_test_id("diagram-next").click()
    eventually("the next window", lambda: window(page) == [60, 179])
    expect(page.get_by_test_id("tick")).to_have_text("60")
    page.get_by_test_id("diagram-previous").click()
    eventually("the window before", lambda: window(page) == [0, 119])
    page.get_by_test_id("diagram-in").click()
    eventually("a shorter window", lambda: window(page) == [0, 59])

    page.get_by_test_id("speed").select_option("max")
    page.get_by_test_id("play").click()
    until(page, "window.carsConsole.frame()?.tick === 400")
    eventually("the window of the last tick", lambda: window(page)[1] == 400)


def test_a_state_has_one_color_in_bands_and_diagram(recorded, open_page):
    address, events = recorded
    page = open_page(address)
    open_diagram(page)
    for _ in range(2):
        page.get_by_test_id("diagram-out").click()
    eventually("the whole run", lambda: window(page) == [0, 400])
    in_diagram = {}
    for kind in ("emotion", "behavior"):
        for band in page.locator(f".diagram .{kind}").all():
            state = re.search(rf": {kind} (\S+),", band.locator("title").text_content())[1]
            in_diagram[state] = band.locator("rect").evaluate("rect => getComputedStyle(rect).fill")
    states = {event["to"] for event in events if event["event"] in ("emotion", "behavior")}
    assert set(in_diagram) == states

    page.get_by_test_id("tab-charts").click()
    fill = "band => [band.dataset.state, getComputedStyle(band.querySelector('rect')).fill]"

    def in_bands():
        return dict(page.locator(".bands .band").evaluate_all(f"bands => bands.map({fill})"))

    eventually("all states", lambda: set(in_bands()) == states)
    assert in_bands() == in_diagram


def test_names_without_a_color_of_their_own_have_the_colors_of_the_diagram(recorded, open_page):
    """The rule of the page is that of the crate: its tests have the same values."""
    page = open_page(recorded[0])
    page.wait_for_load_state("networkidle")
    classes = page.evaluate(
        "import('./assets/palette.js').then(({orderNames, stateClass}) => {"
        "orderNames({emotion: ['LONELY', 'HAPPY', 'CONTENT', 'ärgerlich', 'RESTLESS'], behavior: []});"
        "return ['LONELY', 'HAPPY', 'CONTENT', 'ärgerlich', 'RESTLESS', 'new'].map((name) => stateClass('emotion', name))"
        ".concat(stateClass('behavior', 'DANCE'))})"
    )
    assert classes == ["e7", "e0", "e8", "e9", "e10", "e11", "b8"]


def test_names_have_the_order_of_the_recording(recorded, open_page):
    """A guess of the page gives way to what was recorded."""
    address, events = recorded
    page = open_page(address)
    names = page.evaluate("fetch('recording/names?epoch=1').then((answer) => answer.json())")
    for kind in ("emotion", "behavior"):
        in_order = list(dict.fromkeys(event["to"] for event in events if event["event"] == kind))
        assert names[kind] == in_order
