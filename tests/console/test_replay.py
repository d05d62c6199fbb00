"""A replay: a recorded run on the keys of a run in progress."""

import json
import subprocess

import pytest
from playwright.sync_api import expect

from envelopes import WATCH, agree
from lab import BIN, PATIENCE_S, ROOT, Processes, eventually, free_port, scrub, start_console, until

pytestmark = pytest.mark.thorough

RUN = "replayed"


class Replay:
    """A replay of a run of 200 ticks, paused at tick 0, and a console."""

    def __init__(self, folder, *options):
        self.folder = folder
        self.out = folder / "runs"
        self.processes = Processes(folder)
        self.cars("run", ROOT / "configs/hors_doeuvres.toml", "--run", RUN, "--duration", "100 s", "--quiet", "--set", "expect=[]", *options)

        endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.processes.start("cars", "replay", RUN, "--paused", "--listen", endpoint, "--out", self.out)
        eventually("replay", (self.out / RUN / "endpoint").exists)
        self.environment = {"CARS_RUN": RUN, "CARS_CONNECT": endpoint}
        self.address = start_console(self.processes, environment=self.environment)

    def cars(self, *arguments):
        command = [BIN / "cars", *arguments, "--out", self.out]
        subprocess.run(command, check=True, timeout=PATIENCE_S, cwd=self.folder, stdout=subprocess.DEVNULL)

    def seek(self, tick):
        self.cars("ctl", "seek", str(tick), "--run", RUN)

    def events(self):
        """Those of the recorded run."""
        return [json.loads(line) for line in (self.out / RUN / "events.jsonl").read_text().splitlines()]


@pytest.fixture
def replay(tmp_path, request):
    replay = Replay(tmp_path, *getattr(request, "param", ()))
    yield replay
    replay.processes.end()
    print(replay.processes.logs())


def test_the_page_follows_a_replay(replay, open_page, screenshots):
    page = open_page(replay.address)
    expect(page.get_by_test_id("connection")).to_have_text(f"replay of {RUN}")
    expect(page.get_by_test_id("tick")).to_have_text("0")
    expect(page.get_by_test_id("tab-setup")).to_be_hidden()

    # The panel of a tick between two panels is of the same emotion.
    for tick in (120, 21, 122):
        replay.seek(tick)
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
        assert page.evaluate("window.carsConsole.frame().tick") == tick
        expect(page.get_by_test_id("log")).to_contain_text(f"the replay continues at tick {tick}")
        expect(page.get_by_test_id("panel-Butler")).to_contain_text(
            page.evaluate("window.carsConsole.frame().robots[0].emotion_state")
        )
    page.screenshot(path=screenshots / "replay-1440x900-light.png")

    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text("123")
    page.get_by_test_id("speed").select_option("max")
    page.get_by_test_id("btn-start").click()
    expect(page.get_by_test_id("tick")).to_have_text("200")
    expect(page.get_by_test_id("phase")).to_have_text("paused")
    expect(page.get_by_test_id("log")).to_contain_text("finished")
    page.get_by_test_id("btn-init").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")


@pytest.mark.parametrize("replay", [["--set", 'network.commands={ delay="3 s" }']], indirect=True)
def test_after_a_jump_the_plan_shows_the_commands_under_way_and_no_others(replay, open_page):
    page = open_page(replay.address)
    recorded = open_page(start_console(replay.processes, "--recording", replay.out / RUN))
    for one in (page, recorded):
        until(one, "window.carsConsole.frame() !== null")
        one.evaluate(WATCH)
    tick_s = page.evaluate("window.carsConsole.frame().tick_s")
    sent = [event["tick"] for event in replay.events() if event["event"] == "command_sent"]
    assert len(sent) >= 4, "commands to jump among"

    # Into the time of a command under way, on to that of another one, far back, and where one has just been received; the
    # first one of each pair is shown while the replay is moved.
    for tick in (sent[1] + 2, sent[3] + 1, sent[0] + 3, sent[2] + 7, sent[0] - 1, sent[-1] + 4):
        replay.seek(tick)
        expect(page.get_by_test_id("tick")).to_have_text(str(tick))
        agree(page, replay, tick, tick_s)
        scrub(recorded, tick)
        agree(recorded, replay, tick, tick_s)

    # It goes on as the recording does, and what the page saw before the last jump stays as it was.
    page.get_by_test_id("btn-step").click()
    expect(page.get_by_test_id("tick")).to_have_text(str(sent[-1] + 5))
    agree(page, replay, sent[-1] + 5, tick_s)
    scrub(page, sent[0] - 1)
    agree(page, replay, sent[0] - 1, tick_s)
    page.get_by_test_id("btn-init").click()
    expect(page.get_by_test_id("tick")).to_have_text("0")
    agree(page, replay, 0, tick_s)
