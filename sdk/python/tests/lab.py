"""Runs of real processes, in a folder of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from ports import free_port

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "sdk" / "python" / "examples"
PATIENCE_S = 90.0
"""Longest that anything here may take before it counts as hung."""
KIT_PATIENCE_S = 400.0
"""The same for the conformance kit, which starts the robot hundreds of times."""
RUST = {"Butler": "cars-butler", "Leguin": "cars-leguin", "Vonda": "cars-vonda"}
"""Program of each robot, in Rust."""
PYTHON = RUST | {"Leguin": "leguin.py", "Vonda": "leguin.py"}
"""The same, in Python where there is one."""

T = TypeVar("T")


def eventually(what: str, ready: Callable[[], T | None], patience_s: float = PATIENCE_S) -> T:
    """Waits until ``ready`` gives something, and fails if it never does."""
    begun = time.monotonic()
    while True:
        found = ready()
        if found is not None:
            return found
        assert time.monotonic() - begun < patience_s, f"waited in vain for {what}"
        time.sleep(0.01)


def is_of_run(variable: str) -> bool:
    """Whether a variable tells processes of a run, which those of these tests are not to know."""
    return variable.startswith("CARS_") and variable != "CARS_TEST"


def environment(**more: str) -> dict[str, str]:
    """The environment of a process that knows no run but what ``more`` says."""
    own = {name: value for name, value in os.environ.items() if not is_of_run(name)}
    # Scripts find the interpreter of these tests.
    own["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), own.get("PATH", "")])
    return own | more


# The exit status of a run is that of the verdict on it, which is of no concern here.
EXPECTS_NOTHING = ("--set", "expect=[]")


class Lab:
    """The programs of the project, and a folder for their runs."""

    def __init__(self, programs: Path, folder: Path) -> None:
        self.programs = programs
        self.folder = folder
        self._processes: list[subprocess.Popen[str]] = []
        self._simulators: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Lab:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            if process.poll() is None:
                process.kill()
            process.communicate()

    def cars(self, *arguments: str) -> str:
        """Runs ``cars`` to its end and returns what it printed; it must succeed."""
        done = self._run(*arguments)
        assert done.returncode == 0, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def until_ready(self, *ctl: str) -> None:
        """Waits until the simulator of a run has all its robots."""

        def is_ready() -> bool | None:
            # A simulator that has not begun to listen is one that cannot be asked.
            asked = self._run("ctl", *ctl, "status")
            return (asked.returncode == 0 and "ready" in asked.stdout) or None

        eventually("the robots", is_ready)

    def step(self, ticks: int, *ctl: str) -> None:
        """Steps a run and waits until the last tick is complete: while the clock is held, the answer comes before."""
        self.cars("ctl", *ctl, "step", str(ticks))

        def is_settled() -> bool | None:
            status = json.loads(self.cars("ctl", *ctl, "status", "--json"))
            return (status["pending_steps"] == 0 and not status["awaiting"]) or None

        eventually("the last step", is_settled)

    def _run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [str(self.programs / "cars"), *arguments]
        patience_s = KIT_PATIENCE_S if arguments[0] == "conform" else PATIENCE_S
        return subprocess.run(
            command, cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=patience_s, check=False
        )

    def start(self, command: list[str], **more: str) -> subprocess.Popen[str]:
        """Starts a process and leaves it running, to the end of the test at most."""
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment(**more),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._processes.append(process)
        return process

    def robot(self, script: str, *arguments: str, **more: str) -> subprocess.Popen[str]:
        """Starts a robot in Python."""
        return self.start([sys.executable, str(EXAMPLES / script), *arguments], **more)

    def simulator(self, run: str, scenario: str, *arguments: str, protocol: str = "tcp") -> dict[str, str]:
        """Starts a simulator of this scenario; gives the environment of those who take part."""
        file = self.folder / f"{run}.toml"
        file.write_text(scenario)
        endpoint = f"{protocol}/127.0.0.1:{free_port()}"
        out = ["--run", run, "--listen", endpoint, "--out", str(self.folder)]
        self._simulators[run] = self.start([str(self.programs / "cars-sim"), str(file), *out, *arguments])
        return {"CARS_RUN": run, "CARS_CONNECT": endpoint}

    def ended(self, run: str) -> None:
        """Waits until a run's simulator has written everything and ended."""
        assert self._simulators[run].wait(PATIENCE_S) == 0

    def launch(self, run: str, scenario: str, robots: dict[str, str], *changes: str) -> list[str]:
        """Launches a scenario of ``configs/`` with a process for each robot; gives the lines of its events.

        A robot's program is one of the project, or a script of the examples.
        """
        text = f'scenario = "{ROOT / "configs" / scenario}"\nspeed = "max"\n'
        for name, program in robots.items():
            path = str(EXAMPLES / program) if program.endswith(".py") else program
            text += f'[[process]]\nname = "{name}"\ncommand = ["{path}"]\n'
        file = self.folder / f"{run}-launch.toml"
        file.write_text(text)
        out = ["--no-console", "-q", "--out", str(self.folder), "--run", run, *EXPECTS_NOTHING]
        self.cars("launch", str(file), *out, *changes)
        return self.events(run)

    def play(self, run: str, scenario: str, *changes: str) -> list[str]:
        """Plays a scenario of ``configs/`` in one process, in Rust; gives the lines of its events."""
        self.cars("run", f"configs/{scenario}", "-q", "--out", str(self.folder), "--run", run, *EXPECTS_NOTHING, *changes)
        return self.events(run)

    def events(self, run: str) -> list[str]:
        """The lines of a run's events."""
        return (self.folder / run / "events.jsonl").read_text().splitlines(keepends=True)

    def of_kind(self, run: str, kind: str) -> list[dict[str, Any]]:
        """A run's events of one kind."""
        return [event for event in map(json.loads, self.events(run)) if event["event"] == kind]


def assert_same(left: list[str], right: list[str]) -> None:
    """Two runs are the same, byte for byte; shows the first event that differs if not."""
    for number, (one, other) in enumerate(zip(left, right, strict=False), start=1):
        assert one == other, f"the runs differ from line {number} on:\n  {one}  {other}"
    assert len(left) == len(right)
