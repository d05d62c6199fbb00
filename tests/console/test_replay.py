"""A replay: a recorded run on the keys of a run in progress."""

import subprocess

import pytest
from playwright.sync_api import expect

from lab import BIN, PATIENCE_S, ROOT, Processes, eventually, free_port, start_console

pytestmark = pytest.mark.thorough

RUN = "replayed"


class Replay:
    """A replay of a run of 200 ticks, paused at tick 0, and a console."""

    def __init__(self, folder):
        self.folder = folder
        self.out = folder / "runs"
        self.processes = Processes(folder)
        self.cars("run", ROOT / "configs/hors_doeuvres.toml", "--run", RUN, "--duration", "100 s", "--quiet", "--set", "expect=[]")

        endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.processes.start("cars", "replay", RUN, "--paused", "--listen", endpoint, "--out", self.out)
        eventually("replay", (self.out / RUN / "endpoint").exists)
        environment = {"CARS_RUN": RUN, "CARS_CONNECT": endpoint}
        self.address = start_console(self.processes, environment=environment)

    def cars(self, *arguments):
        command = [BIN / "cars", *arguments, "--out", self.out]
        subprocess.run(command, check=True, timeout=PATIENCE_S, cwd=self.folder, stdout=subprocess.DEVNULL)


@pytest.fixture
def replay(tmp_path):
    replay = Replay(tmp_path)
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
        replay.cars("ctl", "seek", str(tick), "--run", RUN)
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
