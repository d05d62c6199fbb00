"""The time line stays where it is, shows the same time as all other views, and the past is not to be mistaken for now."""

import re

import pytest
from playwright.sync_api import expect

from lab import ROOT, Crowd, eventually, reaches, scrub, until

pytestmark = pytest.mark.thorough

TICK = "window.carsConsole.frame()?.tick"


def tick(page):
    return page.evaluate(TICK)


def seek(page, to):
    scrub(page, to)
    until(page, f"{TICK} === {to}")


def open_at(launch, open_page, ticks, *sizes, options=(), **others):
    """A run that is held after some ticks, and a page that shows it."""
    run = launch(options=options, **others)
    run.control("step", str(ticks))
    page = open_page(run.address, *sizes)
    until(page, f"{TICK} === {ticks}")
    return run, page


def lane(page):
    """The box of the time line, and the number of its ticks."""
    bar = page.get_by_test_id("scrub")
    end = int(bar.get_attribute("max"))
    return page.get_by_test_id("timeline").bounding_box(), end


def test_five_pixels_are_the_ticks_that_five_pixels_stand_for(launch, open_page):
    # Wherever the handle is: this one finds it also in a bar that is no time line.
    _, page = open_at(launch, open_page, 200, 1280, 720)
    page.wait_for_timeout(2500)
    handle = page.get_by_test_id("scrub").evaluate(
        """bar => {
            const box = bar.getBoundingClientRect(), share = (bar.value - bar.min) / (bar.max - bar.min);
            return [box.x + 7 + share * (box.width - 14), box.y + box.height / 2, (bar.max - bar.min) / (box.width - 14)];
        }"""
    )
    x, y, ticks_per_px = handle
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 5, y)
    until(page, f"{TICK} < 200")
    # The page has drawn that it is in the past. The pointer stands still, and so does what it holds.
    page.wait_for_timeout(500)
    page.mouse.move(x - 5, y + 1)
    page.wait_for_timeout(300)
    page.mouse.up()
    assert abs(tick(page) - (200 - 5 * ticks_per_px)) <= 1 + ticks_per_px, tick(page)


def test_a_place_of_the_time_line_is_the_same_tick_while_the_run_goes_on(launch, open_page):
    run, page = open_at(launch, open_page, 200, 1280, 720)
    box, end = lane(page)
    assert end == 1200, "from 0 to the planned end"
    assert box["x"] + box["width"] > 1280 - 30 and box["x"] < 40, "over the full width of the page"
    reaches(page, 0)
    place = {"x": box["width"] * 100 / end, "y": box["height"] / 2}
    for ticks in (200, 600):
        page.get_by_test_id("timeline").click(position=place)
        eventually("tick 100", lambda: abs(tick(page) - 100) <= 1)
        assert lane(page) == (box, end), ticks
        run.control("step", "400")
        eventually("the run", lambda: run.settled() and run.settled()["tick"] == ticks + 400)
    # What has not been run is empty, and leads to now.
    page.get_by_test_id("timeline").click(position={"x": box["width"] * 0.99, "y": box["height"] / 2})
    until(page, f"{TICK} === 1000")
    done = page.get_by_test_id("timeline-run")
    expect(done).to_have_attribute("data-last", "1000")
    assert abs(done.bounding_box()["width"] - box["width"] * 1000 / end) < 1
    expect(page.locator("body")).to_have_attribute("data-time", "live")


def test_the_time_line_is_moved_by_keys(launch, open_page):
    _, page = open_at(launch, open_page, 40)
    reaches(page, 0)
    bar = page.get_by_role("slider", name="Tick")
    bar.focus()
    page.keyboard.press("ArrowLeft")
    until(page, f"{TICK} === 39")
    page.keyboard.press("Home")
    until(page, f"{TICK} === 0")
    expect(bar).to_have_attribute("aria-valuetext", "tick 0, 0.0 s; the run is at tick 40 of 1200")
    page.keyboard.press("End")
    until(page, f"{TICK} === 40")
    expect(bar).to_have_attribute("aria-valuetext", re.compile("^tick 40, 20.0 s"))


CONTROLS = ("btn-init", "btn-start", "btn-pause", "btn-step", "btn-stop", "speed", "play", "step", "live", "scrub", "timeline")


def boxes(page):
    """Where all controls are. The one that plays is the one that plays again."""
    found = {}
    for test_id in CONTROLS:
        one = page.locator("[data-testid=play], [data-testid=watch-again]") if test_id == "play" else page.get_by_test_id(test_id)
        box = one.bounding_box()
        found[test_id] = box and {side: round(value, 1) for side, value in box.items()}
    return found


@pytest.mark.parametrize("width, height", [(1280, 720), (390, 844), (844, 390)])
def test_no_control_moves(launch, open_page, width, height):
    # Two ticks per second: also on a slow machine there is time enough before the end.
    run = launch(options=("--speed", "1", "--stay", "--duration", "150 s"))
    page = open_page(run.address, width, height)
    until(page, f"{TICK} === 0")
    ready = boxes(page)
    assert all(ready.values()), ready

    run.control("speed", "max")
    run.control("step", "120")
    until(page, f"{TICK} === 120")
    run.control("speed", "1")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 120")
    assert boxes(page) == ready, "live"
    seek(page, 20)
    expect(page.locator("body")).to_have_attribute("data-time", "past")
    expect(page.get_by_test_id("when")).to_contain_text("past: 10.0 s")
    assert boxes(page) == ready, "in the past"
    page.get_by_test_id("play").click()
    until(page, f"{TICK} > 20")
    assert boxes(page) == ready, "while the past is played"
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    assert boxes(page) == ready, "paused"
    page.get_by_test_id("live").click()
    run.control("speed", "max")
    run.control("start")
    expect(page.get_by_test_id("phase")).to_have_text("ended")
    expect(page.get_by_test_id("watch-again")).to_be_enabled()
    assert boxes(page) == ready, "ended"


def test_strips_have_the_colors_of_the_bands(launch, open_page):
    _, page = open_at(launch, open_page, 300)
    page.get_by_test_id("tab-charts").click()
    fills = "all => all.map(one => [one.dataset.state, getComputedStyle(one.querySelector('rect') ?? one).fill])"
    strips = page.get_by_test_id("strips")

    def colors(of):
        return sorted(set(map(tuple, of.evaluate_all(fills))))

    eventually("the strips", lambda: len(colors(strips.locator("rect"))) >= 4)
    emotions = [state for state, _ in colors(strips.locator("rect"))]
    bands = page.locator("#bands .band")
    eventually("the same", lambda: [one for one in colors(bands) if one[0] in emotions] == colors(strips.locator("rect")))

    # Each robot has one, and what was not run has no color.
    robots = strips.locator("rect").evaluate_all("all => [...new Set(all.map(one => one.dataset.robot))]")
    assert robots == ["Butler", "Leguin"]
    box, end = lane(page)
    right = max(strips.locator("rect").evaluate_all("all => all.map(one => one.getBoundingClientRect().right)"))
    assert abs(right - box["x"] - box["width"] * 300 / end) < 3


def test_the_strips_of_many_robots_are_few(launch, open_page):
    run = launch(kind=Crowd, robots=24, guests=20)
    run.control("step", "20")
    page = open_page(run.address, 1280, 720)
    until(page, f"{TICK} === 20")
    strips = page.get_by_test_id("strips").locator("rect")

    def robots():
        return strips.evaluate_all("all => [...new Set(all.map(one => one.dataset.robot))]")

    eventually("eight strips", lambda: len(robots()) == 8)
    assert lane(page)[0]["height"] <= 44
    page.get_by_test_id("line-Leguin20").click()
    eventually("that of the chosen robot", lambda: "Leguin20" in robots() and len(robots()) == 8)


def crosshairs(page):
    """The times of all cross-hairs that can be seen, by view."""
    return page.evaluate(
        """() => Object.fromEntries([...document.querySelectorAll(".crosshair")].filter((one) => one.offsetParent)
            .map((one) => [one.parentElement.dataset.testid ?? one.parentElement.id, one.dataset.words]))"""
    )


def test_one_crosshair_in_all_views(launch, open_page):
    _, page = open_at(launch, open_page, 100, 1440, 1000)
    page.get_by_test_id("tab-charts").click()
    expect(page.locator("#bands .band").first).to_be_visible()

    def expect_time(words, *views):
        eventually(f"{words} in {views}", lambda: crosshairs(page) == {view: words for view in views})
        expect(page.get_by_test_id("plan-time")).to_have_text(f"50.0 s · pointer {words}")

    def x_of(selector):
        box = page.locator(selector).bounding_box()
        return box["x"] + box["width"] / 2

    box, end = lane(page)
    page.mouse.move(box["x"] + box["width"] * 60 / end, box["y"] + box["height"] / 2)
    expect_time("30.0 s", "timeline", "chart", "bands")
    # It is at this time in all of them.
    left, width = page.locator("#chart").bounding_box()["x"] + 76, page.locator("#chart").bounding_box()["width"] - 100
    for view in ("#chart", "#bands"):
        assert abs(x_of(f"{view} .crosshair") - (left + width * 0.6)) < 2
    # The key has the values of this time, when they have been read.
    recorded = (
        "(() => { const {times_s, variables} = window.carsConsole.history();"
        " return variables.get('intensity')?.get('Butler')?.[times_s.indexOf(30)] ?? null; })()"
    )
    until(page, f"{recorded} !== null")
    value = page.evaluate(recorded)
    page.get_by_test_id("chart-variable").select_option("intensity")
    page.mouse.move(box["x"] + box["width"] * 60 / end, box["y"] + box["height"] / 2)
    expect(page.locator(".key li", has_text="Butler").locator("b")).to_have_text(f"{value:.3f}".rstrip("0").rstrip("."))

    for view in ("#chart", "#bands"):
        place = page.locator(view).bounding_box()
        page.mouse.move(place["x"] + 76 + (place["width"] - 100) * 0.25, place["y"] + 20)
        expect_time("12.5 s", "timeline", "chart", "bands")

    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_be_visible()
    knots = page.locator(".diagram svg").get_attribute("data-scale").split(", ")
    (first_px, first), (last_px, last) = (map(float, knots[i].split(" ")) for i in (0, -1))
    svg = page.locator(".diagram svg").bounding_box()
    page.mouse.move(svg["x"] + first_px + (last_px - first_px) * (40.5 - first) / (last - first), svg["y"] + 40)
    expect_time("20.0 s", "timeline", "diagram")
    page.mouse.move(5, 5)
    eventually("no cross-hair", lambda: crosshairs(page) == {})
    expect(page.get_by_test_id("plan-time")).to_have_text("50.0 s")


def test_the_past_is_not_to_be_mistaken_for_now(launch, open_page, screenshots):
    run, page = open_at(launch, open_page, 241, 1280, 800)
    expect(page.get_by_test_id("when")).to_have_text("120.5 s of 600.0 s")
    expect(page.get_by_test_id("live")).to_be_disabled()
    color = "one => getComputedStyle(one).backgroundColor"
    now = page.locator("#bar").evaluate(color)
    seek(page, 82)
    expect(page.get_by_test_id("when")).to_have_text("past: 41.0 s, the run is at 120.5 s")
    expect(page.get_by_test_id("plan-time")).to_have_text("past: 41.0 s")
    assert page.locator("#bar").evaluate(color) != now
    page.screenshot(path=screenshots / "past-1280x800.png")
    run.control("step", "1")
    expect(page.get_by_test_id("when")).to_have_text("past: 41.0 s, the run is at 121.0 s")
    page.get_by_test_id("live").click()
    until(page, f"{TICK} === 242")
    expect(page.get_by_test_id("when")).to_have_text("121.0 s of 600.0 s")
    expect(page.locator("body")).to_have_attribute("data-time", "live")

    # Another person begins the next epoch: what is shown is named.
    seek(page, 82)
    run.control("init")
    expect(page.get_by_test_id("when")).to_have_text("past: epoch 1, 41.0 s, the run is at epoch 2, 0.0 s")
    page.keyboard.press("l")
    expect(page.get_by_test_id("when")).to_have_text("0.0 s of 600.0 s")


def shows_epoch(page, epoch, at_tick):
    until(page, f"(({{epoch, tick}}) => epoch === {epoch} && tick === {at_tick})(window.carsConsole.frame())")
    expect(page.get_by_test_id("tick")).to_have_text(str(at_tick))
    expect(page.locator("body")).to_have_attribute("data-time", "live")


def test_init_asks_and_goes_live(launch, open_page):
    run, page = open_at(launch, open_page, 50)
    seek(page, 20)

    page.get_by_test_id("btn-init").click()
    question = page.get_by_test_id("question")
    expect(question).to_contain_text("ends the run in progress at 25.0 s of 600.0 s")
    page.get_by_test_id("end-run-cancel").click()
    expect(question).to_be_hidden()
    assert run.status()["epoch"] == 1
    assert tick(page) == 20

    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    shows_epoch(page, 2, 0)
    expect(page.get_by_test_id("phase")).to_have_text("ready")
    # Nothing is lost by another one.
    page.get_by_test_id("btn-init").click()
    shows_epoch(page, 3, 0)
    expect(question).to_be_hidden()


def test_start_and_step_go_live(launch, open_page):
    _, page = open_at(launch, open_page, 50)
    seek(page, 20)
    page.get_by_test_id("btn-step").click()
    shows_epoch(page, 1, 51)
    seek(page, 20)
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 51")
    expect(page.locator("body")).to_have_attribute("data-time", "live")


def test_load_and_apply_ask_and_go_live(launch, open_page):
    run, page = open_at(launch, open_page, 50)
    page.get_by_test_id("tab-setup").click()
    expect(page.get_by_test_id("setup-guests")).to_be_visible()

    seek(page, 20)
    page.get_by_test_id("setup-load").set_input_files(ROOT / "configs" / "partition.toml")
    expect(page.get_by_test_id("question")).to_contain_text("ends the run in progress at 25.0 s")
    page.keyboard.press("Escape")
    assert run.status()["epoch"] == 1
    page.get_by_test_id("setup-load").set_input_files(ROOT / "configs" / "partition.toml")
    page.get_by_test_id("end-run").click()
    shows_epoch(page, 2, 0)

    run.control("step", "50")
    until(page, f"{TICK} === 50")
    seek(page, 20)
    page.get_by_test_id("setup-apply").click()
    expect(page.get_by_test_id("question")).to_contain_text("ends the run in progress at 25.0 s")
    assert run.status()["epoch"] == 2
    page.get_by_test_id("end-run").click()
    shows_epoch(page, 3, 0)


def spans(page, robot="Butler"):
    return page.evaluate(
        f"window.carsConsole.history().states.get('{robot}')?.emotion.map(({{from_s, to_s}}) => [from_s, to_s]) ?? []"
    )


def test_what_was_not_seen_is_a_gap(launch, open_page):
    """Without the folder of the run a page has what it saw, and nothing else."""
    run = launch(knows_folder=False)
    page = open_page(run.address, 1440, 1000)
    until(page, f"{TICK} === 0")
    for ticks in (20, 200, 1):
        run.control("step", str(ticks))
        eventually("the ticks", lambda: (status := run.settled()) and tick(page) == status["tick"])

    times_s = page.evaluate("window.carsConsole.history().times_s")
    values = page.evaluate("window.carsConsole.history().variables.get('intensity').get('Butler')")
    seen = [time_s for time_s, value in zip(times_s, values) if value is not None]
    unseen = [(begin, end) for begin, end in zip(seen, seen[1:]) if end - begin > 5]
    assert unseen, "the page saw all ticks, which proves nothing"
    for begin, end in unseen:
        assert any(begin < time_s < end for time_s in times_s), f"the chart has a line from {begin} s to {end} s"
        assert not any(first <= begin and end <= last for first, last in spans(page)), f"a band covers {begin} s to {end} s"


def test_a_gap_is_read_as_soon_as_it_is_recorded(launch, open_page):
    """While the clock stands a page asks often for what it has not seen, and its bands are whole again at once."""
    run = launch()
    page = open_page(run.address, 1440, 1000)
    until(page, f"{TICK} === 0 && window.carsConsole.history().times_s.length > 0")
    asked = []

    def answer(route):
        # What is recorded arrives late.
        asked.append(route)
        recorded = route.fetch().json()
        route.fulfill(json={**recorded, "ticks": 0})

    page.route("**/recording", answer)
    # What is recorded of tick 0 has been read, and is answered from then on.
    until(page, "window.carsConsole.history().known_s === 0")
    run.control("step", "30")
    until(page, f"{TICK} === 30")
    asked.clear()
    page.evaluate("performance.clearResourceTimings()")
    eventually("five questions", lambda: page.evaluate("1") and len(asked) > 5)
    pauses_ms = page.evaluate("""() => {
        const asked = performance.getEntriesByType("resource").filter(({ name }) => name.endsWith("/recording"));
        return asked.slice(1).map((next, i) => next.startTime - asked[i].responseEnd);
    }""")
    # The least one: on a loaded machine others are longer.
    assert min(pauses_ms) < 700, f"each second would be too seldom: {pauses_ms}"
    assert page.evaluate("window.carsConsole.history().hasGap")

    page.unroute("**/recording")
    until(page, "!window.carsConsole.history().hasGap")
    assert [spans(page)[0][0], spans(page)[-1][1]] == [0, 15]


def test_what_has_not_been_read_is_a_gap(launch, open_page):
    """A page that comes late reads what is recorded. Until it has, there is nothing between that and what the page sees."""
    run = launch()
    run.control("step", "300")
    eventually("the ticks", lambda: (status := run.settled()) and status["tick"] == 300)
    page = open_page("about:blank", 1440, 1000)
    held = []
    page.route("**/recording/ticks*", lambda route: held.append(route))
    page.goto(run.address)
    until(page, f"{TICK} === 300")
    page.get_by_test_id("tab-charts").click()
    eventually("a request", lambda: page.evaluate("1") and held)
    assert page.evaluate("window.carsConsole.window()") == [0, 150], "the whole run, of which only the end is drawn"
    assert spans(page) == [[150, 150]]
    band = page.locator("#bands .band rect").first.bounding_box()
    assert band["width"] < 3
    for route in held:
        route.continue_()
    page.unroute("**/recording/ticks*")
    eventually("all of it", lambda: spans(page)[0][0] == 0 and spans(page)[-1][1] == 150)


def test_the_diagram_marks_the_shown_tick_or_none(launch, open_page):
    _, page = open_at(launch, open_page, 100)
    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_be_visible()
    held = []
    page.route("**/recording", lambda route: held.append(route))
    page.route("**/recording/**", lambda route: held.append(route))
    page.get_by_test_id("btn-step").click()
    until(page, f"{TICK} === 101")
    eventually("a request", lambda: page.evaluate("1") and held)
    page.wait_for_timeout(300)
    # The newest tick is not in the diagram: a line at an earlier one would be wrong.
    expect(page.locator(".diagram .cursor")).to_have_count(0)
    for route in held:
        route.continue_()
