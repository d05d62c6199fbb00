"""How fast the page is with 64 robots, 1,000 guests and charts: a benchmark for people, not a test.

It plays one run and opens one page after another on it, in turn for each set of the page's files that is given, so that two
versions of the page see the same load of the machine:

    git worktree add /tmp/before HEAD~1
    CARS_BIN=$PWD/target/release python3 tests/console/bench_speed.py \\
        --assets before=/tmp/before/crates/console/assets --assets after=crates/console/assets

For each it prints medians and the least and the greatest value of: animation frames per second; the share of time that the main
thread is busy (`TaskDuration` of the Chrome DevTools Protocol), which includes time that it waits for a processor; the processor
time of the main thread, by time and by frame, which does not; and that of all threads of the page, and of the browser's process
that draws. Chromium draws by software here, as on a machine without a graphics card.
"""

import argparse
import os
import pathlib
import statistics
import tempfile
import time

from playwright.sync_api import sync_playwright

from conftest import CHROMIUM
from lab import PATIENCE_S, Crowd, eventually

COUNT = """() => {
    window.benchmarkFrames = 0;
    const count = () => { window.benchmarkFrames += 1; requestAnimationFrame(count); };
    requestAnimationFrame(count);
}"""


def main_thread_s(process):
    """Processor time of the main thread of a process, which has the number of the process."""
    try:
        fields = pathlib.Path(f"/proc/{process}/task/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Meter:
    """What a page has used so far."""

    def __init__(self, browser, page):
        self.browser_session = browser.new_browser_cdp_session()
        self.session = page.context.new_cdp_session(page)
        self.session.send("Performance.enable")
        self.page = page
        processes = self.browser_session.send("SystemInfo.getProcessInfo")["processInfo"]
        # Other pages are closed. A process that waits for the next page uses nothing.
        self.pages = [one["id"] for one in processes if one["type"] == "renderer"]

    def read(self):
        metrics = {one["name"]: one["value"] for one in self.session.send("Performance.getMetrics")["metrics"]}
        processes = self.browser_session.send("SystemInfo.getProcessInfo")["processInfo"]
        cpu_s = {kind: sum(one["cpuTime"] for one in processes if one["type"] == kind) for kind in ("renderer", "GPU")}
        frames = self.page.evaluate("window.benchmarkFrames")
        main_s = sum(main_thread_s(process) for process in self.pages)
        return time.monotonic(), frames, metrics["TaskDuration"], main_s, cpu_s["renderer"], cpu_s["GPU"]


def measure(browser, address, assets, options):
    """Opens the page with these files and measures it."""
    context = browser.new_context(viewport={"width": options.width, "height": options.height})
    page = context.new_page()

    def serve(route):
        path = route.request.url.split("/assets/")[1].split("?")[0]
        file = assets / path
        # The style of diagrams is not a file: the server makes it.
        return route.fulfill(path=file) if file.is_file() else route.continue_()

    if assets:
        page.route("**/assets/**", serve)
    page.goto(address)
    eventually("a frame", lambda: page.evaluate("(window.carsConsole?.frame()?.tick ?? 0) > 0"))
    page.get_by_test_id(f"tab-{options.tab}").click()
    if options.tab == "charts":
        page.get_by_test_id("chart-variable").select_option(options.variable)
    if options.trails:
        page.get_by_test_id("trails").check()
    page.evaluate(COUNT)
    meter = Meter(browser, page)
    page.wait_for_timeout(1000 * options.warm)

    first = meter.read()
    tick = page.evaluate("window.carsConsole.frame().tick")
    page.wait_for_timeout(1000 * options.seconds)
    last = meter.read()
    ticks = page.evaluate("window.carsConsole.frame().tick") - tick
    if options.screenshot:
        page.screenshot(path=options.screenshot)
    context.close()

    passed, frames, busy, main, cpu, drawing = (b - a for a, b in zip(first, last))
    return {
        "frames/s": frames / passed,
        "main thread, % of time": 100 * busy / passed,
        "main thread, % of a core": 100 * main / passed,
        "main thread, ms/frame": 1000 * main / max(1, frames),
        "page, cores": cpu / passed,
        "drawing, cores": drawing / passed,
        "ticks/s": ticks / passed,
    }


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--assets", action="append", default=[], metavar="NAME=FOLDER", help="the page's files; default: the program's")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=8)
    parser.add_argument("--warm", type=float, default=3, help="seconds before the measurement")
    parser.add_argument("--robots", type=int, default=64)
    parser.add_argument("--guests", type=int, default=1000)
    parser.add_argument("--speed", default="5")
    parser.add_argument("--tab", default="charts")
    parser.add_argument("--variable", default="intensity", help="of the chart")
    parser.add_argument("--trails", action="store_true")
    parser.add_argument("--width", type=int, default=1440)
    parser.add_argument("--height", type=int, default=900)
    parser.add_argument("--screenshot", help="a picture of the last page")
    return parser.parse_args()


def main():
    options = arguments()
    sets = dict(one.split("=", 1) for one in options.assets) or {"page": ""}
    found = {name: [] for name in sets}

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        crowd = Crowd(pathlib.Path(folder), options.robots, options.guests, options=("--speed", options.speed))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            crowd.control("start")
            eventually("ticks", lambda: (crowd.status() or {}).get("tick", 0) > 5, PATIENCE_S)
            for number in range(options.rounds):
                for name, assets in sets.items():
                    one = measure(browser, crowd.address, pathlib.Path(assets) if assets else None, options)
                    found[name].append(one)
                    print(number + 1, name, {key: round(value, 2) for key, value in one.items()}, flush=True)
        finally:
            browser.close()
            crowd.end()

    print(f"\n{options.robots} robots, {options.guests} guests, tab {options.tab}, {options.speed} x, n = {options.rounds}")
    for name, all_of in found.items():
        for key in all_of[0]:
            values = [one[key] for one in all_of]
            print(f"{name:12} {key:26} median {statistics.median(values):8.2f}   {min(values):8.2f} to {max(values):8.2f}")


if __name__ == "__main__":
    main()
