"""Draws the README's pictures: the plan of the console in the state of the paper's Figure 6, and the first exchange, moving.

    cargo build --release --workspace --bins --examples
    CARS_BIN=$PWD/target/release python3 tests/console/picture.py hall > docs/hall.svg
    CARS_BIN=$PWD/target/release python3 tests/console/picture.py exchange > docs/exchange.svg
"""

import pathlib
import subprocess
import sys
import tempfile

from playwright.sync_api import expect, sync_playwright

from conftest import CHROMIUM
from lab import BIN, ROOT, Processes, start_console
from moving import moving

SCENARIO = ROOT / "configs" / "hors_doeuvres.toml"


def draw(folder, seed, ticks):
    """A picture for each tick, by a console that shows the recording of a run."""
    command = [BIN / "cars", "run", SCENARIO, "--seed", seed, "--run", "hors_doeuvres", "--out", folder]
    subprocess.run(command, check=True, capture_output=True)

    pictures = []
    processes = Processes(folder)
    try:
        address = start_console(processes, "--recording", folder / "hors_doeuvres")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            size = {"width": 1280, "height": 760}
            context = browser.new_context(viewport=size, color_scheme="light", reduced_motion="reduce")
            page = context.new_page()
            page.goto(address)
            plain = page.url
            for tick in ticks:
                # One page may save no more than twenty files in a short time.
                page.close()
                page = context.new_page()
                page.goto(f"{plain}#tick={tick}")
                expect(page.get_by_test_id("tick")).to_have_text(str(tick))
                with page.expect_download() as download:
                    page.get_by_test_id("vector").click()
                pictures.append(pathlib.Path(download.value.path()).read_text())
            browser.close()
    finally:
        processes.end()

    return pictures


def hall(folder):
    """The state of the paper's Figure 6."""
    found = subprocess.run([BIN / "examples" / "picture"], check=True, capture_output=True, text=True, cwd=ROOT)
    seed, tick = found.stdout.split()
    return draw(folder, seed, [tick])[0]


def exchange(folder):
    """From Butler's first call for treats until both are on their way back, in the run of the README: 26 s to 41.5 s."""
    pictures = draw(folder, "2002", range(52, 84))
    return moving(pictures, "Butler calls, grows concerned and frustrated, and meets Leguin; both are happy after the exchange")


if __name__ == "__main__":
    picture = {"hall": hall, "exchange": exchange}[sys.argv[1]]
    with tempfile.TemporaryDirectory() as scratch:
        sys.stdout.write(picture(pathlib.Path(scratch)))
