"""The past of a run: one time line for runs in progress and recorded ones, and pages that refill what they missed."""

import math
import re
import signal
from collections import Counter

import pytest
from playwright.sync_api import expect

from lab import PATIENCE_S, eventually, newest, reaches, scrub, start_console, until

pytestmark = pytest.mark.thorough

TICK = "window.carsConsole.frame()?.tick"


def tick(page):
    return page.evaluate(TICK)


def step_to(page, last):
    for step in range(tick(page) + 1, last + 1):
        page.get_by_test_id("btn-step").click()
        expect(page.get_by_test_id("tick")).to_have_text(str(step))


def is_at_last(run, page):
    """Whether no tick is open and the page shows the last one."""
    status = run.settled()
    return status and tick(page) == status["tick"]


# Lines of the log with these texts are of these events.
OF_ROBOTS = re.compile(r"(emotion|behavior) [A-Z]|-> \w+: |receives command|takes part")
EVENTS_OF_ROBOTS = ("emotion", "behavior", "command_sent", "command_delivered", "joined")


def has_lines(run, page):
    """Waits for all lines of robots: those of a tick may come after its frame."""
    count = sum(event["event"] in EVENTS_OF_ROBOTS for event in run.events())
    expect(page.locator("[data-testid=log] .line", has_text=OF_ROBOTS)).to_have_count(count)


def lines(page):
    return page.locator("[data-testid=log] .line").all_inner_texts()


def samples(page):
    """Times and states of the history that the page draws charts and bands of. They are read from the recording, so there may be none yet."""
    return page.evaluate(
        "(() => { const {times_s, states} = window.carsConsole.history();"
        " return [times_s, Object.fromEntries([...states].map(([robot, {emotion, behavior}]) => [robot, {emotion, behavior}]))]; })()"
    )


def test_a_run_in_progress_is_scrubbed_while_it_goes_on(launch, open_page, screenshots):
    run = launch(options=("--speed", "10"))
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 60")
    expect(page.get_by_test_id("live")).to_be_disabled()
    expect(page.get_by_test_id("past-note")).to_have_count(0)

    scrub(page, 20)
    expect(page.get_by_test_id("tick")).to_have_text("20")
    expect(page.get_by_test_id("live")).to_be_enabled()
    # The run goes on, and the page stays at its tick.
    before = newest(page)
    eventually("the run goes on", lambda: newest(page) > before + 20)
    expect(page.get_by_test_id("tick")).to_have_text("20")
    expect(page.get_by_test_id("phase")).to_have_text("running")
    at_20 = page.evaluate("window.carsConsole.frame()")
    reports = [event for event in run.events() if event["tick"] <= 20 and event["event"] == "emotion"]
    emotions = {event["robot"]: event["to"] for event in reports}
    assert {robot["name"]: robot["emotion_state"] for robot in at_20["robots"]} == emotions
    expect(page.get_by_test_id("panel-Butler").locator(".buttons")).to_be_hidden()
    page.screenshot(path=screenshots / "timeline-live-1280x720-light.png")

    page.get_by_test_id("live").click()
    until(page, f"{TICK} > {before + 20}")
    scrub(page, 30)
    expect(page.get_by_test_id("tick")).to_have_text("30")
    page.keyboard.press("l")
    until(page, f"{TICK} > {before + 20}")

    # A link to a tick leads there, also on another page.
    other = page.context.new_page()
    other.goto(f"{page.url}#tick=25")
    expect(other.get_by_test_id("tick")).to_have_text("25")

    # It is played from the past on.
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    eventually("the last tick", lambda: is_at_last(run, page))
    last = tick(page)
    scrub(page, last - 20)
    expect(page.get_by_test_id("tick")).to_have_text(str(last - 20))
    page.get_by_test_id("play").click()
    expect(page.get_by_test_id("live")).to_be_disabled()
    expect(page.get_by_test_id("tick")).to_have_text(str(last))
    assert newest(page) == last


def test_clicks_seek(launch, open_page):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 40)

    has_lines(run, page)
    line = page.locator("[data-testid=log] .line", has_text="behavior").last
    before = lines(page)
    words = line.inner_text()
    line.click()
    time_s = float(re.match(r"\s*([\d.]+) s", words)[1])
    until(page, f"window.carsConsole.frame()?.time_s === {time_s}")
    expect(page.locator(".line.picked").first).to_be_visible()
    # The lines after it stay, for the next click. One that says for whom the clock waits may be new.
    assert not Counter(before) - Counter(lines(page))
    page.get_by_test_id("live").click()
    expect(page.get_by_test_id("tick")).to_have_text("40")
    expect(page.locator(".line.picked")).to_have_count(0)

    page.get_by_test_id("tab-charts").click()
    eventually("the charts of the whole run", lambda: page.evaluate("window.carsConsole.chartScale()") == [0, 20])
    expect(page.locator("#bands .band").first).to_be_visible()
    for test_id in ("chart", "bands"):
        place = page.locator(f"#{test_id}")
        box = place.bounding_box()
        left, right = 76, box["width"] - 24
        place.click(position={"x": left + 0.25 * (right - left), "y": 20})
        expect(page.get_by_test_id("tick")).to_have_text("10")
        expect(page.locator("#bands .cursor")).to_have_count(1)
        page.keyboard.press("l")
        expect(page.get_by_test_id("tick")).to_have_text("40")
        expect(page.locator("#bands .cursor")).to_have_count(0)


def test_the_log_seeks_by_keyboard(launch, open_page):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 64)

    has_lines(run, page)
    times_s = page.locator("[data-testid=log] .line").evaluate_all("(all) => all.map((line) => parseFloat(line.textContent))")
    *_, before_s, last_s = sorted(set(times_s))

    def is_shown(time_s):
        until(page, f"window.carsConsole.frame()?.time_s === {time_s}")
        expect(page.locator(".line.picked").first).to_have_text(re.compile(rf"^\s*{time_s:.1f} s"))

    page.get_by_test_id("log").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("ArrowUp")
    until(page, "window.carsConsole.frame()?.tick < 64")
    while page.evaluate("window.carsConsole.frame().time_s") > before_s:
        is_shown(last_s)
        page.keyboard.press("ArrowUp")
    is_shown(before_s)
    page.keyboard.press("ArrowDown")
    until(page, f"window.carsConsole.frame()?.time_s === {last_s}")
    page.keyboard.press("l")
    expect(page.locator(".line.picked")).to_have_count(0)
    expect(page.get_by_test_id("tick")).to_have_text("64")


def test_the_tools_of_a_run_in_progress_need_one_row(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 4)
    expect(page.get_by_test_id("link")).to_be_visible()
    heights = page.locator(".tools button:visible").evaluate_all("(all) => all.map((one) => one.getBoundingClientRect().top)")
    assert len(heights) == 5
    assert max(heights) - min(heights) < 4, heights
    page.screenshot(path=screenshots / "tools-1280.png")


def window(page):
    return [round(value, 2) for value in page.evaluate("window.carsConsole.window()")]


def test_charts_and_bands_zoom_together(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 40)
    page.get_by_test_id("tab-charts").click()
    expect(page.locator("#bands .band").first).to_be_visible()

    def drawn():
        """First and last time of chart and bands."""
        scale = page.evaluate("window.carsConsole.chartScale()")
        return [value is not None and round(value, 2) for value in scale]

    eventually("the whole run", lambda: window(page) == [0, 20] and drawn() == [0, 20])

    def settled(place):
        expect(page.get_by_test_id("window-all")).to_be_hidden()
        page.locator(place).scroll_into_view_if_needed()

    def height_of_bar():
        return page.locator("#chart").bounding_box()["y"] - page.locator("#chart-select").bounding_box()["y"]

    height = height_of_bar()

    def drag(place, begin, end):
        settled(place)
        box = page.locator(place).bounding_box()
        left, width = box["x"] + 76, box["width"] - 100
        page.mouse.move(left + begin * width, box["y"] + 20)
        page.mouse.down()
        page.mouse.move(left + (begin + end) / 2 * width, box["y"] + 20)
        page.mouse.move(left + end * width, box["y"] + 20)
        page.mouse.up()

    for place in ("#chart", "#bands"):
        drag(place, 0.25, 0.75)
        eventually("the window", lambda: abs(window(page)[0] - 5) < 0.1 and abs(window(page)[1] - 15) < 0.1)
        eventually("the chart", lambda: drawn() == window(page))
        expect(page.get_by_test_id("span")).to_have_count(1)
        expect(page.get_by_test_id("tick")).to_have_text("40")
        expect(page.get_by_test_id("window-all")).to_be_visible()
        assert height_of_bar() == height, "the button that comes with a shorter window moves nothing"
        page.screenshot(path=screenshots / f"timeline-zoom-{place[1:]}.png")
        page.locator(place).dblclick(position={"x": 300, "y": 20})
        eventually("the whole run", lambda: window(page) == [0, 20] and drawn() == [0, 20])
        expect(page.get_by_test_id("tick")).to_have_text("40")

        settled(place)
        box = page.locator(place).bounding_box()
        page.mouse.move(box["x"] + 76 + (box["width"] - 100) / 2, box["y"] + 20)
        # Bands that scroll do so by the wheel alone.
        with_control = place == "#bands"
        if with_control:
            page.keyboard.down("Control")
        page.mouse.wheel(0, -300)
        if with_control:
            page.keyboard.up("Control")
        eventually("a shorter window", lambda: window(page)[1] - window(page)[0] < 10)
        middle = sum(window(page)) / 2
        assert abs(middle - 10) < 0.5
        page.get_by_test_id("window-all").click()
        eventually("the whole run", lambda: window(page) == [0, 20])

    # A click within a window seeks, and the window stays.
    drag("#bands", 0.5, 0.75)
    eventually("the window", lambda: abs(window(page)[0] - 10) < 0.1)
    box = page.locator("#bands").bounding_box()
    page.mouse.click(box["x"] + 76 + (box["width"] - 100) * 0.4, box["y"] + 20)
    expect(page.get_by_test_id("tick")).to_have_text("24")
    assert abs(window(page)[0] - 10) < 0.1


def test_the_time_line_of_a_very_long_run_is_zoomed(launch, open_page, screenshots):
    run = launch(options=("--speed", "max", "--duration", "18000 s"))
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    last = 700
    run.control("step", str(last))
    expect(page.get_by_test_id("tick")).to_have_text(str(last))
    reaches(page, last)
    lane, seen, scrub_bar = (page.get_by_test_id(name) for name in ("timeline", "timeline-run", "scrub"))
    width = lambda: seen.bounding_box()["width"]
    before = width()
    assert before < lane.bounding_box()["width"] * (last + 1) / 36_000 + 2
    expect(page.get_by_test_id("timeline-whole")).to_have_count(0)

    # By the wheel, around what is pointed at.
    box = lane.bounding_box()
    x, y = box["x"] + before / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    pointed = page.locator(".lane .crosshair").get_attribute("data-words")
    for _ in range(3):
        page.mouse.wheel(0, -300)
    eventually("a shorter time", lambda: width() > 6 * before)
    expect(page.get_by_test_id("timeline-whole")).to_be_visible()
    page.mouse.move(x + 1, y)
    page.mouse.move(x, y)
    now = page.locator(".lane .crosshair").get_attribute("data-words")
    assert abs(float(now.split()[0]) - float(pointed.split()[0])) < 20
    # Strips, marks and the handle are where their ticks are.
    page.mouse.click(x, y)
    eventually("the tick", lambda: abs(tick(page) / 2 - float(now.split()[0])) <= 3)
    rights = page.get_by_test_id("strips").locator("rect").evaluate_all("(all) => all.map((one) => one.getBoundingClientRect().right)")
    run_box = seen.bounding_box()
    assert max(rights) == pytest.approx(run_box["x"] + run_box["width"], abs=3)
    page.screenshot(path=screenshots / "timeline-zoomed-1280x720.png")

    page.mouse.dblclick(x, y)
    eventually("the whole run", lambda: abs(width() - before) < 1)
    expect(page.get_by_test_id("timeline-whole")).to_have_count(0)
    # By keys, around what is shown.
    page.mouse.move(640, 200)
    scrub_bar.focus()
    shown = tick(page)
    for _ in range(4):
        page.keyboard.press("+")
    eventually("a shorter time", lambda: width() > 6 * before)
    least, most = (int(scrub_bar.get_attribute(name)) for name in ("min", "max"))
    assert least <= shown <= most and most - least == pytest.approx(36_000 / 16, abs=2)
    page.keyboard.press("-")
    eventually("a longer time", lambda: width() < 6 * before)
    page.keyboard.press("0")
    eventually("the whole run", lambda: abs(width() - before) < 1)
    assert tick(page) == shown


def test_a_page_that_is_opened_late_has_everything(launch, open_page):
    run = launch(options=("--speed", "max", "--duration", "50000 s"))
    first = open_page(run.address)
    expect(first.get_by_test_id("tick")).to_have_text("0")
    first.get_by_test_id("btn-start").click()
    until(first, f"{TICK} > 1000")
    first.get_by_test_id("btn-pause").click()
    expect(first.get_by_test_id("phase")).to_have_text("paused")
    eventually("the last tick", lambda: is_at_last(run, first))
    last = tick(first)

    late = open_page(run.address)
    until(late, f"{TICK} === {last}")
    assert_complete(run, late, last)
    # The page that was there has what it skipped, too: it shows few of so many ticks.
    assert_complete(run, first, last)


def assert_complete(run, page, last):
    """Charts, bands and log have every tick of the record up to the last one."""

    def has_all():
        times, _ = samples(page)
        return times[:1] == [0] and times[-1] == last / 2 and len(times) >= last // math.ceil((last + 1) / 3000)

    eventually("all samples", has_all)
    events = run.events()
    for kind in ("emotion", "behavior"):
        changes = {"Butler": [], "Leguin": []}
        for event in events:
            if event["event"] == kind:
                changes[event["robot"]].append([event["to"], event["tick"] / 2])

        def spans():
            _, states = samples(page)
            return {robot: [[span["state"], span["from_s"]] for span in of[kind]] for robot, of in states.items()}

        eventually(f"the spans of {kind}", lambda: spans() == changes)

    said = sum(event["event"] in ("emotion", "behavior", "command_sent", "joined", "init") for event in events)
    eventually("the log", lambda: page.evaluate("window.carsConsole.lines()") >= said)
    unlike = page.evaluate("window.carsConsole.unlikeLines()")
    assert unlike == page.evaluate("window.carsConsole.lines()"), "a line is there twice"


def test_a_console_that_was_killed_is_replaced_without_loss(launch, browser):
    run = launch(options=("--speed", "20"))
    # What a browser says when its server is gone is expected.
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = context.new_page()
    page.goto(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 100")
    console = run.processes.all[-1]
    console.send_signal(signal.SIGKILL)
    console.wait(PATIENCE_S)
    expect(page.get_by_test_id("connection")).to_have_text("console not reachable")
    lost_at = tick(page)
    eventually("the run goes on", lambda: run.status()["tick"] > lost_at + 100)

    page.goto(run.console())
    until(page, f"{TICK} > {lost_at + 100}")
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    eventually("the last tick", lambda: is_at_last(run, page))
    assert_complete(run, page, tick(page))
    scrub(page, lost_at + 50)
    expect(page.get_by_test_id("tick")).to_have_text(str(lost_at + 50))
    context.close()


def test_the_launcher_tells_the_console_the_folder(launched, open_page):
    run = launched("--speed", "20")
    page = open_page(run.address)
    until(page, f"{TICK} > 60")
    scrub(page, 10)
    expect(page.get_by_test_id("tick")).to_have_text("10")
    eventually("the charts from the beginning", lambda: samples(page)[0][:1] == [0])


def test_a_reconnected_page_fills_the_gap(launch, browser):
    run = launch(options=("--speed", "20"))
    context = browser.new_context()
    sockets = []
    is_open = [True]

    def relay(socket):
        if not is_open[0]:
            socket.close()
            return
        socket.connect_to_server()
        sockets.append(socket)

    page = context.new_page()
    page.route_web_socket("**/ws", relay)
    page.goto(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 50")
    is_open[0] = False
    sockets[-1].close()
    expect(page.get_by_test_id("connection")).to_have_text("console not reachable")
    lost_at = tick(page)
    eventually("the run goes on", lambda: run.status()["tick"] > lost_at + 100)
    is_open[0] = True
    until(page, f"{TICK} > {lost_at + 100}")
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    eventually("the last tick", lambda: is_at_last(run, page))
    assert_complete(run, page, tick(page))
    context.close()


def test_without_the_folder_the_page_has_what_it_saw_and_says_so(launch, open_page, screenshots):
    run = launch(knows_folder=False)
    first = open_page(run.address, 1280, 720)
    expect(first.get_by_test_id("tick")).to_have_text("0")
    step_to(first, 20)
    late = open_page(run.address, 1280, 720)
    expect(late.get_by_test_id("tick")).to_have_text("20")
    expect(late.get_by_test_id("past-note")).to_contain_text("from 10.0 s on")
    expect(late.get_by_test_id("past-note")).to_contain_text("--folder")
    # A page that is slow gets fewer frames, and without the folder it has no others.
    for step in range(21, 31):
        step_to(late, step)
        expect(first.get_by_test_id("tick")).to_have_text(str(step))

    # What it did not see is marked, and leads to what it saw first.
    expect(late.get_by_test_id("timeline-run")).to_have_attribute("data-first", "20")
    late.get_by_test_id("timeline").click(position={"x": 2, "y": 10})
    expect(late.get_by_test_id("tick")).to_have_text("20")
    at_24 = None
    for page in (first, late):
        scrub(page, 24)
        expect(page.get_by_test_id("tick")).to_have_text("24")
        frame = page.evaluate("(({guests, robots}) => [guests, robots])(window.carsConsole.frame())")
        assert at_24 is None or frame == at_24
        at_24 = frame
    late.screenshot(path=screenshots / "timeline-memory-1280x720.png")
    late.get_by_test_id("tab-diagram").click()
    expect(late.get_by_test_id("no-diagram")).to_contain_text("--folder")
    scrub(first, 5)
    expect(first.get_by_test_id("tick")).to_have_text("5")
    first.get_by_test_id("live").click()
    expect(first.get_by_test_id("tick")).to_have_text("30")


def test_marks_are_the_events_of_the_record(launch, open_page, screenshots):
    run = launch(scenario="configs/partition.toml", options=("--speed", "max"))
    page = open_page(run.address, 1280, 720, "light")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", timeout=PATIENCE_S * 1000)
    events = run.events()

    def marks(of, kind):
        # All at once: they are drawn anew while they are read.
        return of.get_by_test_id(f"mark-{kind}").evaluate_all("(marks) => marks.map((mark) => Number(mark.dataset.tick))")

    cuts = sorted({event["tick"] for event in events if event["event"] in ("link_cut", "link_healed")})
    exchanges = {event["tick"] for event in events if event["event"] == "behavior" and event["to"] == "EXCHANGE"}
    assert len(cuts) == 2 and exchanges
    eventually("the cuts", lambda: marks(page, "cut") == cuts)
    eventually("the exchanges", lambda: marks(page, "exchange") and set(marks(page, "exchange")) <= exchanges)
    expect(page.get_by_test_id("mark-epoch").first).to_have_attribute("title", re.compile("epoch 1 initialized"))
    first = page.get_by_test_id("mark-cut").first
    expect(first).to_have_attribute("title", re.compile("Butler to Leguin are cut"))
    first.click()
    expect(page.get_by_test_id("tick")).to_have_text(str(cuts[0]))
    page.screenshot(path=screenshots / "timeline-marks-1280x720-light.png")

    assert run.simulator.wait(PATIENCE_S) == 0
    other = open_page(start_console(run.processes, "--recording", run.run_folder), 390, 844, "dark")
    expect(other.get_by_test_id("tick")).to_have_text("0")
    eventually("the cuts", lambda: marks(other, "cut") == cuts)
    eventually("the exchanges", lambda: marks(other, "exchange") and set(marks(other, "exchange")) <= exchanges)
    expect(other.get_by_test_id("live")).to_have_count(0)
    other.screenshot(path=screenshots / "timeline-marks-390x844-dark.png", full_page=True)


def test_a_crash_and_the_return_are_marked(launch, open_page):
    run = launch(options=("--set", "on_late=continue", "--set", "deadline=0.5 s"))
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 3)
    run.kill("Leguin")
    eventually("the loss", lambda: page.get_by_test_id("btn-step").click() or any(e["event"] == "lost" for e in run.events()))
    expect(page.get_by_test_id("mark-fault").first).to_have_attribute("title", re.compile("Leguin is lost"))


def test_epochs_are_chosen(launch, open_page, screenshots):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("epoch")).to_have_count(0)
    step_to(page, 12)
    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    until(page, "window.carsConsole.frame()?.epoch === 2")
    expect(page.get_by_test_id("phase")).to_have_text("ready")
    step_to(page, 5)

    page.get_by_test_id("epoch").select_option("1")
    until(page, "window.carsConsole.frame()?.epoch === 1")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    scrub(page, 12)
    expect(page.get_by_test_id("tick")).to_have_text("12")
    eventually("the charts of the epoch", lambda: samples(page)[0][-1:] == [6])
    page.screenshot(path=screenshots / "timeline-epochs-1280x720.png")
    page.get_by_test_id("live").click()
    until(page, "window.carsConsole.frame()?.epoch === 2")
    expect(page.get_by_test_id("tick")).to_have_text("5")
    eventually("the charts of now", lambda: samples(page)[0][-1:] == [2.5])

    def has_both_epochs(other):
        expect(other.get_by_test_id("epoch")).to_be_visible()
        expect(other.get_by_test_id("epoch")).to_have_value("2")
        other.get_by_test_id("epoch").select_option("1")
        until(other, "window.carsConsole.frame()?.epoch === 1")
        scrub(other, 11)
        expect(other.get_by_test_id("tick")).to_have_text("11")
        expect(other.get_by_test_id("log")).to_contain_text("initialized")

    # A late page and a recording have both epochs, and the log of both.
    has_both_epochs(open_page(run.address))
    run.control("stop")
    assert run.simulator.wait(PATIENCE_S) == 0
    has_both_epochs(open_page(start_console(run.processes, "--recording", run.run_folder)))


def test_an_epoch_that_comes_late_is_still_the_one_that_was_chosen(launch, open_page):
    run = launch()
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 12)
    page.get_by_test_id("btn-init").click()
    page.get_by_test_id("end-run").click()
    until(page, "window.carsConsole.frame()?.epoch === 2")
    expect(page.get_by_test_id("phase")).to_have_text("ready")
    step_to(page, 3)

    # What is recorded of the epoch in progress is asked for all the time. Whole ticks are, where one is to be shown.
    asked, held = [], []
    whole_ticks = re.compile(r"/recording/ticks\?from=0&count=32&epoch=1$")
    page.on("request", lambda request: asked.append(request.url) if request.url.endswith("/recording") else None)
    page.route(whole_ticks, lambda route: held.append(route))
    page.get_by_test_id("epoch").select_option("1")
    eventually("a request for the ticks", lambda: page.evaluate("1") and held)
    before = len(asked)
    eventually("what is recorded now", lambda: page.evaluate("1") and len(asked) > before + 2)
    for route in held:
        route.continue_()
    page.unroute(whole_ticks)

    until(page, "window.carsConsole.frame()?.epoch === 1")
    expect(page.get_by_test_id("timeline-run")).to_have_attribute("data-last", "12")
    scrub(page, 12)
    expect(page.get_by_test_id("tick")).to_have_text("12")
    assert page.evaluate("window.carsConsole.frame().epoch") == 1


def test_the_diagram_of_a_run_in_progress(launch, open_page, screenshots):
    run = launch(options=("--speed", "10", "--set", "network.commands.loss=0.4"))
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 150")
    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_be_visible()

    def end():
        return int(page.locator(".diagram svg").get_attribute("data-to"))

    seen = end()
    eventually("further ticks", lambda: end() > seen)
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    last = eventually("the last tick", run.settled)["tick"]
    eventually("the last tick in the diagram", lambda: end() == last)

    def is_whole():
        if int(page.locator(".diagram svg").get_attribute("data-from")) == 0:
            return True
        # By itself: Playwright would wait for a button that is disabled because the longest window has been requested.
        page.get_by_test_id("diagram-out").evaluate("button => button.click()")
        return False

    eventually("a longer window", is_whole)
    sent = [event["tick"] for event in run.events() if event["event"] == "command_sent"]
    expect(page.locator(".diagram .command")).to_have_count(len(sent))
    page.locator(".diagram .command").first.locator(".start").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(sent[0]))
    page.screenshot(path=screenshots / "timeline-diagram-1280x720.png")


def test_a_diagram_of_ten_thousand_events_is_drawn_window_by_window(launch, open_page):
    run = launch(options=("--speed", "max", "--duration", "3000 s", "--set", "network.queries.loss=0.9"))
    page = open_page(run.address, 1280, 720)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("phase")).to_have_text("ended", timeout=PATIENCE_S * 1000)
    last = tick(page)
    assert len(run.events()) > 10_000

    page.get_by_test_id("tab-diagram").click()
    expect(page.locator(".diagram svg")).to_have_attribute("data-to", str(last))
    page.get_by_test_id("diagram-queries").check()
    expect(page.locator(".diagram .query").first).to_be_visible()
    things = page.locator(".diagram svg *").count()
    assert things < 5000, "a window has what is in it, and no more"
    # Everything at once is drawn, or the page says why it is not and keeps what it showed.
    while page.get_by_test_id("diagram-out").is_enabled():
        page.get_by_test_id("diagram-out").click()
    page.get_by_test_id("diagram-queries").uncheck()
    eventually("the whole run", lambda: page.locator(".diagram svg").get_attribute("data-from") == str(max(0, last + 1 - 4096)))
    page.get_by_test_id("scrub").focus()
    scrub(page, 40)
    expect(page.get_by_test_id("tick")).to_have_text("40")


@pytest.mark.parametrize(
    "width, height, scheme",
    [(390, 844, "light"), (1280, 720, "dark")],
)
def test_everything_has_room(launch, open_page, screenshots, width, height, scheme):
    run = launch(options=("--speed", "max", "--duration", "50000 s"))
    page = open_page(run.address, width, height, scheme)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    page.get_by_test_id("btn-start").click()
    until(page, f"{TICK} > 400")
    page.get_by_test_id("btn-pause").click()
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    scrub(page, 200)
    expect(page.get_by_test_id("tick")).to_have_text("200")
    for tab in ("charts", "diagram", "log"):
        page.get_by_test_id(f"tab-{tab}").click()
        if tab == "diagram":
            expect(page.locator(".diagram svg")).to_be_visible()
        too_wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
        assert too_wide <= 0, f"{tab} is {too_wide} px wider than the window"
        page.screenshot(path=screenshots / f"timeline-{tab}-{width}x{height}-{scheme}.png", full_page=width < 1000)
    for test_id in ("scrub", "live", "play", "step"):
        box = page.get_by_test_id(test_id).bounding_box()
        assert box and box["x"] >= 0 and box["x"] + box["width"] <= width, f"{test_id}: {box}"


def test_the_legend_names_the_emotions_by_color(launch, open_page):
    run = launch()
    page = open_page(run.address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    step_to(page, 10)
    names = {event["to"] for event in run.events() if event["event"] == "emotion"}
    entries = page.get_by_test_id("legend-emotion")
    eventually("the emotions", lambda: {text.strip() for text in entries.all_inner_texts()} == names)
    page.get_by_test_id("tab-charts").click()
    for entry in entries.all():
        fill = entry.locator("rect").evaluate("rect => getComputedStyle(rect).fill")
        band = page.locator(f"#bands .band[data-state={entry.inner_text().strip()}] rect").first
        assert band.evaluate("rect => getComputedStyle(rect).fill") == fill


MODULES = """async () => {
  const [{Memory}, {Marks}, {History}, {TimeWindow}, {Store}, {LogView}, {Units}] = await Promise.all(
    ['memory', 'marks', 'history', 'window', 'store', 'log', 'units'].map((name) => import(`./assets/${name}.js`)));
  const BODY
}"""


def run_module(page, body):
    return page.evaluate(MODULES.replace("const BODY", body))


@pytest.fixture
def page(launch, open_page):
    page = open_page(launch(knows_folder=False).address)
    expect(page.get_by_test_id("tick")).to_have_text("0")
    return page


def test_what_a_page_keeps_is_bounded(page):
    """At the bound every second frame goes, the newest one stays, and every time stays in reach."""
    found = run_module(
        page,
        """
        const frame = (tick, guests) => ({tick, epoch: 1, guests: Array(guests).fill([0, 0]), robots: []});
        const memory = new Memory();
        const sizes = [];
        for (let tick = 0; tick < 20000; tick += 1) { memory.add(frame(tick, 1), new Map()); sizes.push(memory.seen.length); }
        const gap = Math.max(...memory.seen.slice(1).map((one, i) => one.frame.tick - memory.seen[i].frame.tick));
        const crowd = new Memory();
        for (let tick = 0; tick < 300; tick += 1) crowd.add(frame(tick, 10000), new Map());
        const bodies = crowd.seen.reduce((sum, one) => sum + one.guests_m.length / 2, 0);
        memory.forget(19990);
        return [Math.max(...sizes), memory.at(5).frame.tick, gap, crowd.seen.length, bodies, crowd.seen.at(-1).frame.tick, memory.first];
        """,
    )
    most, _, gap, crowd, bodies, newest_tick, first = found
    assert most <= 3000
    assert gap <= 40
    assert bodies <= 500_000 and crowd >= 20 and newest_tick == 299
    assert first > 19990

    marks = run_module(
        page,
        """
        const line = (tick) => ({epoch: 1, tick, time_s: tick / 2, source: 'Butler', kind: 'membership', text: 'is lost'});
        const marks = new Marks();
        for (let tick = 0; tick < 5000; tick += 1) { marks.add([line(tick)]); marks.add([line(tick)]); }
        const drawn = marks.of(1, 0, 4999, 100);
        return [marks.lines.size, marks.isCut, drawn.length, drawn.at(-1).tick, drawn.at(-1).words.split('\\n').length];
        """,
    )
    assert marks[0] == 2000 and marks[1]
    assert marks[2] <= 101 and marks[3] > 4900 and marks[4] <= 7


def test_lines_of_record_and_of_the_run_are_merged_once(page):
    found = run_module(
        page,
        """
        const line = (tick, text, epoch = 1) => ({epoch, tick, time_s: tick / 2, source: 'Butler', kind: 'say', text});
        const texts = (store) => store.log.map(({tick, text}) => `${tick}${text}`).join(' ');
        const store = new Store();
        // The run tells its last lines, the record has all before and, here, some of them.
        store.addLines([line(5, 'b'), line(6, 'a'), line(6, 'a'), line(7, 'late')]);
        store.addRecorded([line(0, 'a'), line(4, 'x'), line(5, 'a'), line(5, 'b'), line(6, 'a'), line(6, 'a')]);
        const first = texts(store);
        // What the record had already arrives from the run, too.
        store.addRecorded([line(8, 'c'), line(8, 'd')]);
        store.addLines([line(8, 'c')]);
        store.addLines([line(8, 'd'), line(9, 'e'), line(0, 'next', 2)]);
        const second = texts(store);
        // At the bound the oldest ones go.
        store.addRecorded(Array.from({length: 30000}, (_, i) => line(i, `m${i}`, 3)));
        return [first, second, store.log.length, store.log[0].text, store.logCount];
        """,
    )
    assert found[0] == "0a 4x 5a 5b 6a 6a 7late"
    assert found[1] == "0a 4x 5a 5b 6a 6a 7late 8c 8d 9e 0next"
    assert found[2:4] == [10000, "m20000"]


def test_lines_that_arrive_while_the_tick_moves_are_shown_once(page):
    found = run_module(
        page,
        """
        const line = (tick) => ({epoch: 1, tick, time_s: tick / 2, source: 'Butler', kind: 'say', text: `m${tick}`});
        const place = document.createElement('div');
        const store = new Store();
        const log = new LogView(place, store, new Units(), () => {});
        const shown = (tick) => {
          log.showUntil({epoch: 1, tick});
          log.render();
          return [...place.querySelectorAll('.log-rows .line')].map((row) => log.lines.get(row).tick);
        };
        const first = shown(0);
        store.addRecorded([line(0), line(2), line(4), line(6)]);
        const second = shown(4);
        store.addRecorded([line(8), line(9)]);
        return [first, second, shown(8), shown(9), shown(2)];
        """,
    )
    assert found == [[], [0, 2, 4], [0, 2, 4, 6, 8], [0, 2, 4, 6, 8, 9], [0, 2]]


def test_what_is_recorded_replaces_what_was_seen(page):
    found = run_module(
        page,
        """
        const robot = (emotion, value, presence = 'here') =>
          [{name: 'B', location: {x: value, y: 0}, presence, emotion_state: emotion, behavior_state: 'S', state_variables: {v: value}}];
        const stay = (state, begin, end, kind = 'emotion') => ({robot: 'B', kind, state, begin, end});
        const history = new History();
        const spans = () => structuredClone(history.states.get('B').emotion.map(({state, from_s, to_s}) => [state, from_s, to_s]));
        const now = () => [history.times_s.slice(), history.variables.get('v').get('B').slice(), spans()];
        const seen = [];
        history.see(0, 1, robot('A', 0));
        history.see(10, 1, robot('C', 10));
        history.see(21, 1, robot('C', 21));
        seen.push(now());

        history.cutFrom(0);
        seen.push([history.times_s.length, spans()]);
        // The end of the first ticks is within a stay.
        history.record({end: 8, ticks: [0, 5].map((tick) => ({tick, robots: robot('X', tick)})), spans: [stay('A', 0, 6), stay('B', 6, null)]}, 1);
        seen.push(now());
        history.see(9, 1, robot('C', 9));
        history.see(10, 1, robot('C', 10));
        seen.push(now());
        history.cutFrom(8);
        history.record({end: 15, ticks: [{tick: 10, robots: robot('X', 10)}], spans: [stay('B', 6, 8), stay('C', 8, 12), stay('D', 12, null)]}, 1);
        // A frame that the record has overtaken is a sample, and changes no stay.
        history.see(13, 1, robot('C', 13));
        seen.push(now());

        // A robot that is lost is in no state, and begins its state anew when it is back.
        for (const [time, presence] of [[15, 'here'], [16, 'lost'], [17, 'lost'], [18, 'here'], [19, 'here']]) history.see(time, 1, robot('D', time, presence));
        seen.push(spans());
        history.cutFrom(15);
        history.record({end: 17, ticks: [], spans: [stay('D', 12, 16)]}, 1);
        history.see(17, 1, robot('D', 17, 'lost'));
        history.see(18, 1, robot('D', 18));
        seen.push(spans(), [...history.emotions]);

        for (let i = 20; i < 50000; i += 1) history.see(i, 1, robot(`E${i}`, i));
        const all = [...Array(50000).keys()].map((i) => stay('E', i, i + 1, 'behavior'));
        history.record({end: 50000, ticks: [], spans: all}, 1);
        const { emotion, behavior } = history.states.get('B');
        return [...seen, [history.times_s.length, emotion.length, behavior.length, history.emotions.size]];
        """,
    )
    gap, empty, first, further, exact, back, lost, emotions, counts = found
    assert gap == [[0, 10, 10.011, 21], [0, 10, None, 21], [["A", 0, 10], ["C", 10, 10], ["C", 21, 21]]]
    assert empty == [0, []]
    assert first == [[0, 5], [0, 5], [["A", 0, 6], ["B", 6, 7]]]
    assert further == [[0, 5, 9, 10], [0, 5, 9, 10], [["A", 0, 6], ["B", 6, 9], ["C", 9, 10]]]
    assert exact == [[0, 5, 10, 13], [0, 5, 10, 13], [["A", 0, 6], ["B", 6, 8], ["C", 8, 12], ["D", 12, 14]]]
    assert back[3:] == [["D", 12, 16], ["D", 18, 19]]
    assert lost[3:] == [["D", 12, 16], ["D", 18, 18]]
    assert emotions == ["A", "C", "B", "D"], "of stays, not of samples"
    assert counts[0] <= 6000 and counts[1:] == [4000, 4000, 64]


def test_the_newest_tick_is_a_sample_also_of_a_long_run(page):
    times = run_module(
        page,
        """
        const robots = [{name: 'B', location: {x: 0, y: 0}, emotion_state: 'A', behavior_state: 'S', state_variables: {}}];
        const store = new Store();
        store.live = {tick: 7, time_s: 3.5, robots};
        store.refill(0, {end: 8, ticks: [0, 2, 4, 6].map((tick) => ({tick, robots})), spans: []}, 0.5);
        return store.liveHistory.times_s;
        """,
    )
    assert times == [0, 1, 2, 3, 3.5]


def test_the_window_stays_within_the_run(page):
    found = run_module(
        page,
        """
        let last = 100;
        const shown = new TimeWindow(() => [0, last]);
        const at = () => shown.range_s().map((one) => Math.round(100 * one) / 100).join(' ');
        const seen = [at()];
        shown.show(20, 40); seen.push(at());
        shown.zoom(0.5, 20); seen.push(at());
        shown.move(-500); seen.push(at());
        shown.move(500); seen.push(at());
        last = 200; seen.push(at());
        shown.zoom(0.0001); seen.push(at());
        shown.zoom(1e9); seen.push(at() + shown.isWhole);
        shown.show(30, 30.01); seen.push(at());
        shown.reset(); seen.push(at());
        return seen;
        """,
    )
    assert found == [
        "0 100", "20 40", "20 30", "0 10", "90 100",
        # It was at the end, and goes on with the run.
        "190 200", "199 200", "0 200true", "30 31", "0 200",
    ]


def test_gaps_stay_gaps(page):
    """Between what was read and what was seen, between frames that are far apart, and after old samples were dropped."""
    found = run_module(
        page,
        """
        const robots = [{name: 'B', location: {x: 0, y: 0}, emotion_state: 'A', behavior_state: 'S', state_variables: {v: 1}}];
        const store = new Store();
        store.live = {tick: 100, time_s: 50, tick_s: 0.5, robots};
        const spans = [{robot: 'B', kind: 'emotion', state: 'A', begin: 0, end: null}];
        store.refill(0, {end: 41, ticks: [0, 20, 40].map((tick) => ({tick, robots})), spans}, 0.5);
        const read = [store.history.times_s.slice(), store.history.states.get('B').emotion.map(({from_s, to_s}) => [from_s, to_s])];

        const history = new History();
        for (const tick of [0, 1, 11, 22, 23]) history.see(tick, 1, robots);
        const seen = history.variables.get('v').get('B').slice();

        const long = new History();
        for (let i = 0; i < 20000; i += 1) long.add(i, robots, i === 3000);
        const at = long.gaps.indexOf(1);
        const unlimited = new History();
        for (let i = 0; i < 20000; i += 1) unlimited.add(i, robots, true);
        const twice = unlimited.gaps.some((gap, i) => gap && unlimited.gaps[i + 1]);
        return [...read, seen, [long.times_s[at - 1], long.times_s[at + 1]], long.gaps.filter(Boolean).length, unlimited.times_s.length, twice];
        """,
    )
    times_s, spans, seen, around, count, most, twice = found
    assert times_s == [0, 10, 20, 20.03, 50]
    assert spans == [[0, 20], [50, 50]]
    assert seen == [1, 1, 1, None, 1, 1], "eleven ticks are too many, ten are not"
    assert around[0] < 3000 <= around[1] and around[1] - around[0] < 40 and count == 1
    assert most <= 6000 and not twice
