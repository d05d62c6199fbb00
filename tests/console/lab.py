"""A real launch to test the console with: simulator, robots and console, each in its own process."""

import json
import math
import os
import pathlib
import re
import select
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "python"))

from ports import free_port

BIN = pathlib.Path(os.environ["CARS_BIN"])
PATIENCE_S = 60.0


def eventually(what, ready, patience_s=PATIENCE_S):
    """Waits until `ready()` returns a true value, and returns it."""
    end = time.monotonic() + patience_s

    while True:
        found = ready()
        if found:
            return found
        assert time.monotonic() < end, f"no {what} within {patience_s} s"
        time.sleep(0.02)


def until(page, expression):
    """Waits until an expression is true in the page, whose policy forbids Playwright's own `wait_for_function`."""
    try:
        return eventually(expression, lambda: page.evaluate(expression))
    except AssertionError as error:
        raise AssertionError(f"{error}; the page says: {page.locator('#notice').inner_text()!r}") from None


def reaches(page, tick):
    """Waits until a tick can be shown: a page has what it saw until it has found the recording."""
    run = """document.querySelector('[data-testid="timeline-run"]')?.dataset"""
    until(page, f"Number({run}?.first ?? Infinity) <= {tick} && {tick} <= Number({run}?.last ?? -1)")


def download(page, button, place):
    """Presses a button that saves a file, and keeps the file at a place. Returns the name that the page gives it."""
    with page.expect_download() as event:
        page.get_by_test_id(button).click()
    event.value.save_as(place)
    return event.value.suggested_filename


def scrub(page, tick):
    """Moves the time line to a tick."""
    reaches(page, tick)
    page.get_by_test_id("scrub").evaluate(
        "(bar, tick) => { bar.value = tick; bar.dispatchEvent(new Event('input', {bubbles: true})); }", tick
    )


def newest(page):
    """The last tick that the time line can show."""
    return int(page.get_by_test_id("timeline-run").get_attribute("data-last"))


# The plan is drawn anew in the frame after the page was laid out; until then its places are where they were.
FITS = """(() => {
    const plan = document.getElementById("plan"), ratio = Math.min(2, devicePixelRatio);
    return plan.width === Math.round(plan.clientWidth * ratio) && plan.height === Math.round(plan.clientHeight * ratio);
})()"""


class Processes:
    """Processes, each with a log file."""

    def __init__(self, folder):
        self.folder = folder
        self.all = []

    def start(self, name, *arguments, environment=None, cwd=ROOT, **options):
        log = open(self.folder / f"{name}-{len(self.all)}.log", "wb")
        environment = {**os.environ, **(environment or {})}
        command = [str(BIN / name), *map(str, arguments)]

        process = subprocess.Popen(command, cwd=cwd, env=environment, stdin=subprocess.DEVNULL, stderr=log, **options)
        log.close()

        self.all.append(process)
        return process

    def end(self):
        for process in self.all:
            process.kill()
        for process in self.all:
            process.wait()

    def logs(self):
        return "\n".join(f"== {file.name}\n{file.read_text()}" for file in sorted(self.folder.glob("*.log")))


def start_console(processes, *arguments, bind="127.0.0.1:0", **options):
    """Starts a console and returns its URL."""
    arguments = ("--bind", bind, *arguments)
    process = processes.start("cars-console", *arguments, stdout=subprocess.PIPE, **options)

    assert select.select([process.stdout], [], [], PATIENCE_S)[0], "the console prints no URL"

    line = process.stdout.readline().decode()
    found = re.fullmatch(r"console: (http://\S+)\n", line)
    assert found, f"{line!r}\n{processes.logs()}"
    return found[1]


class Launch:
    """A run in progress, with a console."""

    RUN = "console-test"

    def __init__(
        self, folder, scenario="configs/hors_doeuvres.toml", robots=("Butler", "Leguin"), options=(), knows_folder=True
    ):
        self.folder = folder
        self.run_folder = folder / "runs" / self.RUN
        self.processes = Processes(folder)
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.environment = {
            "CARS_RUN": self.RUN,
            "CARS_CONNECT": self.endpoint,
            "CARS_LISTEN": self.endpoint,
        }

        self.simulator = self.start("cars-sim", scenario, "--out", folder / "runs", "--paused", "--no-verdict", *options)
        self.robots = self.start_robots(robots)
        self.address = self.console(knows_folder)
        eventually("the robots", lambda: (self.status() or {}).get("phase") == "ready")

    def start(self, name, *arguments):
        return self.processes.start(name, *arguments, environment=self.environment)

    def console(self, knows_folder=True):
        """Starts a console and returns its address. The launcher tells it the run's folder; on another machine there is none."""
        folder = ("--folder", self.run_folder) if knows_folder else ()
        return start_console(self.processes, *folder, environment=self.environment)
    def start_robots(self, names):
        return {name: self.start(f"cars-{name.lower()}", "--name", name) for name in names}

    def control(self, *request):
        """Sends a request to the simulator, as a person does."""
        command = [BIN / "cars", "ctl", *request, "--run", self.RUN, "--connect", self.endpoint]
        subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE_S, cwd=self.folder)

    def kill(self, robot):
        self.robots[robot].send_signal(signal.SIGKILL)
        self.robots[robot].wait()

    def restart(self, robot):
        self.robots[robot] = self.start(f"cars-{robot.lower()}", "--name", robot)

    def status(self):
        """The simulator's status; `None` if it does not answer."""
        command = [BIN / "cars", "ctl", "status", "--json", "--run", self.RUN, "--connect", self.endpoint]

        answer = subprocess.run(command, capture_output=True, timeout=PATIENCE_S, cwd=self.folder)
        return json.loads(answer.stdout) if answer.returncode == 0 else None

    def settled(self):
        """The status when no tick is open; `None` while one is."""
        status = self.status()
        return status if status and not status["awaiting"] else None

    def events(self):
        lines = (self.run_folder / "events.jsonl").read_text().splitlines()
        return [json.loads(line) for line in lines if line.endswith("}")]

    def put(self, key, message):
        """Puts a message on a key of the run, as any zenoh client can."""
        helper = BIN / "examples" / "put"
        command = [helper, self.endpoint, f"cars/{self.RUN}/{key}"]

        subprocess.run(command, input=json.dumps(message).encode(), check=True, timeout=PATIENCE_S)

    def put_panel(self, robot, widgets):
        """Puts a panel of the tick that the run is at, as the robot does."""
        status = self.status()
        self.put(f"robot/{robot}/panel", {"epoch": status["epoch"], "tick": status["tick"], "widgets": widgets})

    def end(self):
        self.processes.end()


class Crowd(Launch):
    """Many robots on a wide field: Butler and refillers, all refillers in one process."""

    def __init__(self, folder, robots=64, guests=1000, options=()):
        names = ["Butler", *(f"Leguin{number}" for number in range(1, robots))]
        side = math.ceil(math.sqrt(robots))
        width = f"{max(8 * side, math.ceil(1.5 * math.sqrt(guests)))} m"
        lines = ["seed = 2002", 'duration = "100000 s"', "[field]", f'size = ["{width}", "{width}"]', "[guests]", f"count = {guests}"]
        lines += ["[[obstacle]]", 'at = ["2 ft", "2 ft"]']
        for number, name in enumerate(names):
            row, column = divmod(number, side)
            lines += ["[[robot]]", f'name = "{name}"', f'at = ["{8 * column + 4} m", "{8 * row + 4} m"]']
        scenario = folder / "crowd.toml"
        scenario.write_text("\n".join(lines) + "\n")

        # What is looked at is the page: the recording of a crowd would only be work for the machine.
        super().__init__(folder, scenario, names, ("--set", "record.frames=false", *options))

    def start_robots(self, names):
        butler, *refillers = names
        several = [argument for name in refillers for argument in ("--name", name)]
        return {butler: self.start("cars-butler", "--name", butler), "refillers": self.start("cars-leguin", *several)}


class Launched:
    """A run that `cars launch` has started, with its console: it can stop, kill and restart processes."""

    RUN = "console-launched"

    def __init__(self, folder, *options):
        self.folder = folder
        self.run_folder = folder / "runs" / self.RUN
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        file = folder / "launch.toml"
        file.write_text(
            f'scenario = "{ROOT / "configs/hors_doeuvres.toml"}"\n[console]\nbind = "127.0.0.1:0"\n'
            '[[process]]\nname = "Butler"\ncommand = ["cars-butler"]\n'
            '[[process]]\nname = "Leguin"\ncommand = ["cars-leguin"]\n'
        )
        arguments = ("launch", file, "--run", self.RUN, "--out", folder / "runs", "--listen", self.endpoint, *options)
        self.printed = folder / "launched.txt"
        command = [str(BIN / "cars"), *map(str, arguments)]
        with open(self.printed, "wb") as printed:
            self.process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=printed, stderr=printed)
        found = eventually("the address", lambda: re.search(r"console: (http://\S+)", self.output()))
        self.address = found[1]

    def output(self):
        return self.printed.read_text(errors="replace")

    status = Launch.status
    events = Launch.events

    def pid(self, program):
        """The newest process of a program below this launch."""
        found = subprocess.run(["pgrep", "--newest", "--parent", str(self.process.pid), program], capture_output=True)
        return int(found.stdout) if found.returncode == 0 else None

    def verify(self):
        command = [BIN / "cars", "verify", self.RUN, "--out", self.folder / "runs"]
        return subprocess.run(command, capture_output=True, timeout=PATIENCE_S, cwd=ROOT, text=True)

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGQUIT)
        self.process.wait(timeout=PATIENCE_S)
