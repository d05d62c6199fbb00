"""Draws the README's picture: the plan of the console in the state of the paper's Figure 6.

    cargo build --release --workspace --bins --examples
    CARS_BIN=$PWD/target/release python3 tests/console/picture.py > docs/hall.svg
"""

import pathlib
import subprocess
import sys
import tempfile

from playwright.sync_api import expect, sync_playwright

from conftest import CHROMIUM
from lab import BIN, ROOT, Processes, start_console

SCENARIO = ROOT / "configs" / "hors_doeuvres.toml"


def draw(folder):
    """The picture, by a console that shows the recording of a run."""
    found = subprocess.run([BIN / "examples" / "picture"], check=True, capture_output=True, text=True, cwd=ROOT)
    seed, tick = found.stdout.split()
    command = [BIN / "cars", "run", SCENARIO, "--seed", seed, "--run", "hors_doeuvres", "--out", folder]
    subprocess.run(command, check=True, capture_output=True)

    processes = Processes(folder)
    try:
        address = start_console(processes, "--recording", folder / "hors_doeuvres")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 760}, color_scheme="light", reduced_motion="reduce")
            page.goto(address)
            page.goto(f"{page.url}#tick={tick}")
            expect(page.get_by_test_id("tick")).to_have_text(tick)
            with page.expect_download() as download:
                page.get_by_test_id("vector").click()
            picture = pathlib.Path(download.value.path()).read_text()
            browser.close()
    finally:
        processes.end()

    return picture


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        sys.stdout.write(draw(pathlib.Path(scratch)))
