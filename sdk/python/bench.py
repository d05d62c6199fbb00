#!/usr/bin/env python3
"""Ticks per second with robots that only answer: in Python, as processes and all in one, beside as many in Rust.

Everything is measured in turn, as often as asked for, because the speed of a machine that others use drifts. The programs
of the project are found in the folder that CARS_BIN_DIR names, or by PATH:

    CARS_BIN_DIR=target/release python sdk/python/bench.py --rounds 3
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

IDLE = Path(__file__).parent / "examples" / "idle.py"


def program(name: str) -> str:
    """A program of the project."""
    found = shutil.which(name, path=os.environ.get("CARS_BIN_DIR")) or shutil.which(name)
    if found is None:
        sys.exit(f"there is no {name}: `cargo build --release`, and name its folder by CARS_BIN_DIR")
    return found


def rate(robots: int, commands: list[list[str]], ticks: int, scratch: Path) -> float:
    """Ticks per second, as the simulator measured it, of a run with these robots' processes."""
    scenario = scratch / "bare.toml"
    scenario.write_text(
        f'duration = "{ticks} s"\ntick = "1 s"\n'
        + "".join(
            f'[[robot]]\nname = "r{i}"\nat = ["{1 + i % 7 * 2} m", "{1 + i // 7 * 2} m"]\n' for i in range(robots)
        )
    )
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    simulator = [program("cars-sim"), str(scenario), "--out", str(scratch), "--run", "bench", "--listen", endpoint]
    environment = os.environ | {
        "CARS_RUN": "bench",
        "CARS_CONNECT": endpoint,
        "RUST_LOG": "error",
    }
    processes = [subprocess.Popen(command, env=environment) for command in [simulator, *commands]]
    try:
        statuses = [process.wait(timeout=300) for process in processes]
    finally:
        for process in processes:
            process.kill()
    if any(statuses):
        sys.exit(f"a process of the benchmark failed: {statuses}")
    summary = json.loads((scratch / "bench" / "summary.json").read_text())
    return float(summary["ticks"] / summary["wall"]["elapsed_s"])


def subjects(robots: int) -> dict[str, list[list[str]]]:
    """What is measured with so many robots: the commands of the processes that run them."""
    python = [sys.executable, str(IDLE)]
    names = [["--name", f"r{i}"] for i in range(robots)]
    measured = {
        "Python, a process each": [python + name for name in names],
        "Rust, a process each": [[program("cars-bench"), "robot", *name] for name in names],
    }
    if robots > 1:
        measured["Python, all in one process"] = [python + [word for name in names for word in name]]
    return measured


def main() -> None:
    """Measures, and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=3, help="times that everything is measured, in turn")
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 4, 16], help="numbers of robots")
    parser.add_argument(
        "--ticks", type=int, default=20_000, help="of each measurement, divided by the robots' number"
    )
    given = parser.parse_args()
    results: dict[tuple[int, str], list[float]] = {}
    for round_ in range(given.rounds):
        print(f"round {round_ + 1} of {given.rounds}", file=sys.stderr)
        for robots in given.robots:
            for what, commands in subjects(robots).items():
                with tempfile.TemporaryDirectory() as scratch:
                    ticks = max(given.ticks // robots, 500)
                    results.setdefault((robots, what), []).append(rate(robots, commands, ticks, Path(scratch)))
    print(f"{'robots':>6}  {'ticks per second':28}{'median':>8}{'best':>8}{'worst':>8}")
    for (robots, what), rates in results.items():
        print(f"{robots:6}  {what:28}{statistics.median(rates):8.0f}{max(rates):8.0f}{min(rates):8.0f}")


if __name__ == "__main__":
    main()
