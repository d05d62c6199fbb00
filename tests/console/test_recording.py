"""A recorded run."""

import csv
import json
import re
import signal
import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, PATIENCE_S, ROOT, eventually, newest, scrub, start_console, until

pytestmark = pytest.mark.thorough


@pytest.fixture
def recorded(launch, tmp_path):
    """The address of a console that shows the recording of a run of 200 ticks."""
    run = launch(options=("--speed", "max", "--duration", "100 s"))
    run.start("cars", "ctl", "start", "--run", run.RUN, "--connect", run.endpoint)
    assert run.simulator.wait(PATIENCE_S) == 0
    return start_console(run.processes, "--recording", run.run_folder)


def test_the_unit_is_the_scenarios_until_one_is_chosen(recorded, open_page):
    page = open_page(recorded)
    where = page.get_by_test_id("panel-Butler").locator(".where")
    expect(page.get_by_test_id("units")).to_have_value("ft")
    expect(where).to_contain_text("ft/s")

    page.get_by_test_id("units").select_option("m")
    expect(where).to_contain_text("m/s")
    page.reload()
    expect(page.get_by_test_id("units")).to_have_value("m")
    expect(where).to_contain_text("m/s")


def test_a_recording_is_scrubbed_and_played(recorded, open_page, screenshots):
    page = open_page(recorded)
    expect(page.get_by_test_id("scrub")).to_be_visible()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    assert page.get_by_test_id("scrub").get_attribute("max") == "200"
    assert newest(page) == 200
    assert page.get_by_test_id("btn-start").count() == 0, "there is nothing to control"
    expect(page.get_by_test_id("tab-setup")).to_be_hidden()

    scrub(page, 150)
    expect(page.get_by_test_id("tick")).to_have_text("150")
    expect(page.get_by_test_id("time")).to_contain_text("75.0")
    at_150 = page.evaluate("window.carsConsole.frame()")
    assert len(at_150["guests"]) == 100
    assert len(at_150["robots"]) == 2
    expect(page.get_by_test_id("panel-Butler")).to_contain_text(at_150["robots"][0]["emotion_state"])
    page.screenshot(path=screenshots / "recording-1440x900-light.png")

    scrub(page, 20)
    expect(page.get_by_test_id("tick")).to_have_text("20")
    assert page.evaluate("window.carsConsole.frame().guests") != at_150["guests"]
    scrub(page, 150)
    expect(page.get_by_test_id("tick")).to_have_text("150")
    assert page.evaluate("window.carsConsole.frame().guests") == at_150["guests"]

    page.get_by_test_id("play").click()
    until(page, "window.carsConsole.frame()?.tick > 160")
    page.get_by_test_id("play").click()
    held = page.get_by_test_id("tick").inner_text()
    page.wait_for_timeout(300)
    assert abs(int(page.get_by_test_id("tick").inner_text()) - int(held)) <= 1
    expect(page.get_by_test_id("log")).to_contain_text("initialized, seed 2002")
    verdicts = page.get_by_test_id("verdict")
    chip = page.get_by_test_id("verdicts-chip")
    expect(chip).to_have_accessible_name("6 of 6 open")
    chip.click()
    expect(verdicts).to_have_count(6)
    expect(verdicts.first).to_have_text("… open no robot overlaps another")

    page.get_by_test_id("speed").select_option("max")
    page.get_by_test_id("play").click()
    expect(page.get_by_test_id("tick")).to_have_text("200")
    expect(page.get_by_test_id("log")).to_contain_text("finished")
    # What is decided by the end of the run shows at its last tick. A call is on its way then.
    expect(chip).to_have_accessible_name("1 of 6 undecided, 2 not asked, 3 hold")
    expect(verdicts.nth(3)).to_have_text("✓ pass no robot overlaps another")
    expect(page.locator("li.verdict.undecided")).to_have_text("? undecided a call is answered or escalated")
    expect(page.get_by_test_id("log")).to_contain_text("pass: no robot overlaps another (it did not happen until tick 200")
    page.screenshot(path=screenshots / "verdicts-1440x900-light.png")


# What is hidden before pages are compared, because the other one does not have it: commands of an operator and the answers,
# and what a recording is played with: the time line with its tick, and the marks of that tick in the charts. The bar at the top,
# which controls a run, is not compared.
NOT_RECORDED = ".panel .buttons, #notice, #timeline"
NOT_LIVE = "#timeline, #bands .cursor, #chart .cursor"

# By tab, what is compared while it is shown.
SAME = {"log": ["#plan", "#panels", "[data-testid=log]"], "charts": ["#chart", "#bands"]}


# A page that was painted part by part has other shades at the edges of round corners than one that was painted at once.
REPAINT = """async () => {
  const frame = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  for (const display of ["none", ""]) {
    document.querySelector("#panels").style.display = display;
    await frame();
  }
}"""


def pixels(page, hidden):
    """What can be seen of a run at its tick, by region."""
    hide = "(hidden) => document.querySelectorAll(hidden).forEach((one) => { one.style.display = 'none'; })"
    found = {}
    for tab, regions in SAME.items():
        page.get_by_test_id(f"tab-{tab}").click()
        page.evaluate(hide, hidden)
        page.locator("#zoom-all").click()
        page.evaluate(REPAINT)
        for region in regions:
            found[region] = page.locator(region).screenshot()
    return found


def differing(live, recorded, screenshots):
    """The regions in which two pages differ. What differed is kept, and named where a test fails."""
    one = pixels(live, NOT_RECORDED)
    other = pixels(recorded, NOT_LIVE)
    found = [region for region in one if one[region] != other[region]]

    for region in found:
        name = re.sub(r"\W", "", region)
        (screenshots / f"differs-{name}-live.png").write_bytes(one[region])
        (screenshots / f"differs-{name}-recorded.png").write_bytes(other[region])
    print("regions that differ:", found)
    return found


def test_a_tick_has_the_same_pixels_live_and_recorded(launch, open_page, screenshots):
    run = launch()
    live = open_page(run.address, height=1500)
    expect(live.get_by_test_id("tick")).to_have_text("0")

    def step(tick):
        live.get_by_test_id("btn-step").click()
        expect(live.get_by_test_id("tick")).to_have_text(str(tick))

    # The clock was held, the robots have turned to their tasks, and Leguin has been commanded.
    for tick in range(1, 41):
        if tick == 20:
            run.robots["Butler"].send_signal(signal.SIGSTOP)
            live.get_by_test_id("btn-step").click()
            expect(live.get_by_test_id("log")).to_contain_text("waiting for Butler")
            run.robots["Butler"].send_signal(signal.SIGCONT)
            expect(live.get_by_test_id("tick")).to_have_text("20")
            continue
        if tick == 30:
            live.get_by_test_id("panel-Leguin").get_by_test_id("button-refill").click()
            expect(live.get_by_test_id("message")).to_contain_text("refill")
        step(tick)

    # What there is of a run that is held is written after a second.
    def recording_to(tick):
        address = start_console(run.processes, "--recording", run.run_folder)
        page = open_page(address, height=1500)
        expect(page.get_by_test_id("scrub")).to_be_visible()
        return page if newest(page) == tick else None

    def record_of(tick):
        page = eventually(f"tick {tick} in the recording", lambda: recording_to(tick))
        scrub(page, tick)
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
        return page

    tick = 40
    recorded = record_of(tick)
    # A recording shows for whom the clock was held in a tick, a run in progress only while it is held.
    while recorded.evaluate("window.carsConsole.frame().awaiting.length"):
        tick += 1
        step(tick)
        recorded = record_of(tick)

    eventually("the same pixels", lambda: differing(live, recorded, screenshots) == [])
    live.screenshot(path=screenshots / "tick-40-live.png")
    recorded.screenshot(path=screenshots / "tick-40-recorded.png")

    # They are the pixels of this tick.
    scrub(recorded, tick - 1)
    expect(recorded.get_by_test_id("tick")).to_have_text(str(tick - 1))
    eventually("other pixels", lambda: {"#plan", "#panels"} <= set(differing(live, recorded, screenshots)))


KINDS = ("emotion", "behavior")
FAULTS = """fault=[
    { robot = "Leguin", do = "crash", at = "10 s", until = "25 s" },
    { robot = "Butler", do = "hang", at = "30 s", until = "34 s" },
    { robot = "Leguin", do = "crash", at = "2090 s", until = "2110 s" },
    { robot = "Leguin", do = "crash", at = "2900 s" },
]"""
PARTITION = 'network.partition=[{ groups = [["Butler"], ["Leguin"]], from = "36 s", until = "46 s" }]'


@pytest.fixture
def faulty(tmp_path):
    """The folder of a run of 6000 ticks, of which not all are samples of charts, in which robots crash and hang."""
    scenario = ROOT / "configs" / "hors_doeuvres.toml"
    settings = ("--set", FAULTS, "--set", PARTITION, "--set", "on_late=continue")
    run = [BIN / "cars", "run", scenario, "--run", "faulty", "--duration", "3000 s", *settings, "--out", tmp_path, "--quiet"]
    # The verdict is another test's.
    assert subprocess.run(run, timeout=PATIENCE_S, check=False).returncode in (0, 1)
    return tmp_path / "faulty"


def stays(folder):
    """State, begin and end in ticks of each stay by robot and kind, from the events of a run; and which robots are lost in which ticks."""
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    last = max(event["tick"] for event in events)
    found, states, lost, absences = {}, {}, {}, []

    def end(robot, kind, tick):
        state, begin = states.get((robot, kind), (None, tick))
        if (begin < tick or tick == last) and robot not in lost:
            found.setdefault((robot, kind), []).append([state, begin, tick])

    for event in events:
        robot, tick = event.get("robot"), event["tick"]
        if event["event"] in KINDS:
            end(robot, event["event"], tick)
            states[robot, event["event"]] = (event["to"], tick)
        elif event["event"] == "lost":
            for kind in KINDS:
                end(robot, kind, tick)
            lost[robot] = tick
        elif event["event"] == "joined" and robot in lost:
            absences.append((robot, lost.pop(robot), tick))
            for kind in KINDS:
                states[robot, kind] = (states[robot, kind][0], tick)
    for robot, kind in states:
        end(robot, kind, last)
    absences += [(robot, tick, last + 1) for robot, tick in lost.items()]
    return found, absences


def test_bands_are_the_stays_of_the_record(faulty, processes, open_page):
    expected, absences = stays(faulty)
    assert [robot for robot, *_ in absences] == ["Leguin"] * 3
    assert all(len(expected[robot, kind]) > 20 for robot in ("Butler", "Leguin") for kind in KINDS)

    page = open_page(start_console(processes, "--recording", faulty))
    page.get_by_test_id("tab-charts").click()

    def bands():
        states = page.evaluate("[...window.carsConsole.history().states]")
        ticks = lambda span: [span["state"], span["from_s"] * 2, span["to_s"] * 2]
        return {(robot, kind): [ticks(span) for span in of[kind]] for robot, of in states for kind in KINDS}

    eventually("the whole record", lambda: page.evaluate("window.carsConsole.history().known_s") == 3000)
    assert bands() == expected

    # Those that are drawn say so; what is too narrow is not drawn.
    drawn = page.locator("#bands .band title")
    eventually("the bands", lambda: drawn.count() > 20)
    for title in drawn.all_text_contents():
        robot, kind, state, begin_s, end_s = re.fullmatch(r"(\S+), (\S+) (\S+), (\S+) s to (\S+) s", title).groups()
        assert [state, float(begin_s) * 2, float(end_s) * 2] in expected[robot, kind], title

    # The exported table has the same, but nothing of what a robot would have said in a tick that it missed.
    tables = faulty.parent / "tables"
    subprocess.run([BIN / "cars", "export", faulty, "--csv", "-o", tables], timeout=PATIENCE_S, check=True)
    rows = list(csv.DictReader((tables / "states.csv").open()))
    assert len(rows) == 2 * 6001
    for row in rows:
        robot, tick = row["robot"], int(row["tick"])
        is_lost = any(robot == one and begin <= tick < end for one, begin, end in absences)
        for kind in KINDS:
            states = [state for state, begin, end in expected[robot, kind] if begin <= tick < end]
            if tick < 6000 and (is_lost or row["missed"] == "false"):
                assert states == ([] if is_lost else [row[kind]]), row
