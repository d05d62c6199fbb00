"""Commands on the plan are a function of the tick that is shown: the plan never contradicts the log."""

import random

import pytest

from envelopes import SAMPLE, WATCH, agree, shown_by
from lab import eventually, newest, scrub, start_console, until

pytestmark = pytest.mark.thorough


@pytest.mark.parametrize(
    "speed, network", [("max", ""), (1, 'network.commands={ delay="3 s" }'), (5, "network.commands={ loss=0.5 }")]
)
def test_envelopes_are_where_the_log_says(launch, open_page, processes, speed, network):
    chance = random.Random(f"{speed} {network}")
    options = ["--set", "seed=7", "--set", 'duration="100 s"', "--speed", str(speed), "--stay"]
    run = launch(options=[*options, *(["--set", network] if network else [])])
    page = open_page(run.address)
    until(page, "window.carsConsole.frame() !== null")
    page.evaluate(WATCH)
    tick_s = page.evaluate("window.carsConsole.frame().tick_s")

    if speed == 1:
        # As slow as that nothing happens in a test's time: from a moment with commands on.
        run.control("step", "55")
        eventually("the step", lambda: (run.settled() or {}).get("tick") == 55)
    samples = []
    for _ in range(4):
        page.get_by_test_id("btn-start").click()
        for _ in range(chance.randint(5, 25)):
            samples.append(page.evaluate(SAMPLE))
            page.wait_for_timeout(30)
        if page.get_by_test_id("phase").inner_text().lower() == "ended":
            break
        page.get_by_test_id("btn-pause").click()
        tick = eventually("a stop", lambda: is_still(run))["tick"]
        agree(page, run, tick, tick_s)

    if is_still(run)["phase"] != "ended":
        run.control("speed", "max")
        run.control("start")
        eventually("the end", lambda: (is_still(run) or {}).get("phase") == "ended")
    events = run.events()
    for sample in samples:
        assert sample["shown"] == shown_by(events, sample["tick"], tick_s), sample

    # In the past, in a page that comes later, and in the recording, of ticks in which something happened to commands.
    eventful = [event["tick"] for event in events if event["event"].startswith("command_")]
    assert eventful
    later = open_page(run.address)
    recorded = open_page(start_console(processes, "--recording", run.run_folder))
    until(later, "window.carsConsole.frame() !== null")
    until(recorded, "window.carsConsole.frame() !== null")
    for one in (later, recorded):
        one.evaluate(WATCH)
    agree(later, run, is_still(run)["tick"], tick_s)
    for one in (page, later, recorded):
        for tick in chance.sample(eventful, min(4, len(eventful))):
            tick = min(tick + chance.randint(0, 5), newest(one))
            scrub(one, tick)
            agree(one, run, tick, tick_s)


def is_still(run):
    """The status of a run whose clock has stopped; `None` while it goes on."""
    status = run.settled()
    return status if status and status["phase"] in ("ready", "paused", "ended") else None


NAMED = """(flights) => import('./assets/flights.js').then(({Flights}) => {
    const all = new Flights();
    all.push(flights);
    return all.at(6, 0.5).filter(({isNamed}) => isNamed).map(({to, text, fate}) => `${to} ${text} ${fate}`).sort();
})"""


def test_the_text_of_a_broadcast_is_written_once(launch, open_page):
    page = open_page(launch().address)
    until(page, "window.carsConsole.frame() !== null")

    def flight(tick, to, seq, command, fate="sent"):
        return {"tick": tick, "from": "A", "to": to, "seq": seq, "command": command, "fate": fate}

    broadcasts = [flight(tick, to, 10 * tick + i, "table") for tick in (4, 5) for i, to in enumerate("BCD")]
    received = [flight(5, to, 40 + i, None, "delivered") for i, to in enumerate("BCD")]
    assert len(page.evaluate(NAMED, [*broadcasts, *received])) == 2, "one that is under way, and one that has arrived"
    single = [flight(4, "B", 1, "refill"), flight(5, "B", 2, "hurry"), flight(5, "B", 1, None, "dropped")]
    assert page.evaluate(NAMED, single) == ["B hurry sent", "B refill dropped"]
    single[2]["because"] = "too weak by fading"
    assert page.evaluate(NAMED, single) == ["B hurry sent", "B refill, too weak by fading dropped"]
