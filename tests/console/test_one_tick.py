"""One tick, one truth: at every stop, and at every tick of the past, panels, plan, log and record say the same."""

import os
import random

import pytest
from playwright.sync_api import expect

from lab import eventually, scrub, start_console

pytestmark = pytest.mark.thorough

# What the page shows of a tick: of each robot the emotion and the behavior in its panel, whether the panel is its own, those of the
# plan, and the last emotion and behavior that the log has up to the tick.
SHOWN = """(() => {
    const frame = window.carsConsole.frame();
    if (!frame) return null;
    const said = {};
    for (const { source, kind, text, epoch, tick } of window.carsConsole.log()) {
        if (epoch !== frame.epoch || tick > frame.tick) continue;
        if (kind === "emotion" || kind === "behavior") (said[source] ??= {})[kind] = text.split(" ").at(-1);
    }
    const robots = {};
    for (const { name, emotion_state, behavior_state, presence, state_variables } of frame.robots) {
        const panel = document.querySelector(`[data-testid="panel-${name}"]`);
        const badges = [...panel.querySelectorAll(".badge.state")].map((badge) => badge.textContent);
        robots[name] = {
            panel: badges, plan: [emotion_state, behavior_state], log: [said[name]?.emotion, said[name]?.behavior],
            isOwn: !panel.querySelector('[data-testid="no-panel"]'), isHere: presence === "here",
        };
    }
    return { tick: frame.tick, shown: document.querySelector('[data-testid="tick"]').textContent, robots };
})()"""


class Record:
    """Emotion and behavior of each robot in each tick, by the events of a run."""

    def __init__(self, events):
        self.changes = [event for event in events if event["event"] in ("emotion", "behavior")]

    def at(self, tick):
        robots = {}
        for event in self.changes:
            if event["tick"] <= tick:
                robots.setdefault(event["robot"], {})[event["event"]] = event["to"]
        return {robot: [states.get("emotion"), states.get("behavior")] for robot, states in robots.items()}


def differences(shown, record, tick, needs_own):
    """What the views of a page say differently about a tick."""
    if not shown or shown["tick"] != tick or shown["shown"] != str(tick):
        return [f"the page shows {shown and (shown['tick'], shown['shown'])} and not {tick}"]
    found = []
    for name, views in shown["robots"].items():
        expected = record.at(tick).get(name)
        for view in ("panel", "plan", "log"):
            if views[view] != expected:
                found.append(f"tick {tick}: {view} of {name} is {views[view]}, by the record {expected}")
        if needs_own and views["isHere"] and not views["isOwn"]:
            found.append(f"tick {tick}: {name} has no panel of its own")
    return found


def agree(page, run, tick, needs_own, record=None):
    """Waits until all views show a tick and agree on it: what a page draws is a moment later than what it knows."""

    def look():
        nonlocal last
        last = differences(page.evaluate(SHOWN), record or Record(run.events()), tick, needs_own)
        return not last

    last = None
    try:
        eventually("agreement", look, patience_s=5.0)
    except AssertionError:
        pytest.fail("\n".join(last))


def compare(launch, open_page, processes, seed, speed, duration_s, stops, seeks):
    """One run: stops at moments drawn at random, then the end, then random ticks live and in its recording."""
    chance = random.Random(seed)
    options = ["--set", f"seed={seed}", "--set", f'duration="{duration_s} s"', "--speed", str(speed), "--stay"]
    run = launch(options=options)
    page = open_page(run.address, 1440, 900)
    expect(page.get_by_test_id("tick")).to_have_text("0")

    for _ in range(stops):
        page.get_by_test_id("btn-start").click()
        page.wait_for_timeout(chance.uniform(20, 600))
        if page.get_by_test_id("phase").inner_text() == "ended":
            break
        page.get_by_test_id("btn-pause").click()
        status = eventually("a stop", lambda: is_still(run))
        agree(page, run, status["tick"], needs_own=True)
        if status["phase"] == "ended":
            break
        # In the past as well, while the run is held.
        tick = chance.randint(0, status["tick"])
        scrub(page, tick)
        agree(page, run, tick, needs_own=False)
        # The newest tick is now, from which there is no way back.
        if tick < status["tick"]:
            page.get_by_test_id("live").click()
        agree(page, run, status["tick"], needs_own=True)

    if is_still(run)["phase"] != "ended":
        run.control("speed", "max")
        run.control("start")
    last = eventually("the end", lambda: (status := is_still(run)) and status["phase"] == "ended" and status["tick"])
    agree(page, run, last, needs_own=True)
    # Robots repeat an answer whose panel comes late; that is no mistake of theirs.
    assert run.status()["ignored"] == {}

    record = Record(run.events())
    recorded = open_page(start_console(processes, "--recording", run.run_folder), 1440, 900)
    expect(recorded.get_by_test_id("tick")).to_have_text("0")
    for one in (page, recorded):
        for _ in range(seeks // 2):
            tick = chance.randint(0, last)
            scrub(one, tick)
            agree(one, run, tick, needs_own=False, record=record)


def is_still(run):
    """The status of a run whose clock has stopped; `None` while it goes on."""
    status = run.settled()
    return status if status and status["phase"] in ("ready", "paused", "ended") else None


# One run at each speed; `CARS_VIEWS=10` is 100 stops and 500 ticks of the past.
@pytest.mark.parametrize("seed", range(int(os.environ.get("CARS_VIEWS", "3"))))
def test_no_view_contradicts_another_one(launch, open_page, processes, seed):
    speed = [1, 20, "max"][seed % 3]
    compare(launch, open_page, processes, seed, speed, duration_s=600, stops=10, seeks=50)
