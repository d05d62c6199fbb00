"""What the tests stand on: the programs of the project, and a folder for runs."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import pytest
from lab import Lab

# A shell that starts the tests in the background has them ignore interrupts, and so would every process that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Tests in Rust that run at the same time end all processes of a run with the name of theirs that no other test has marked.
os.environ["CARS_TEST"] = f"{os.getpid()}/pytest"


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """A folder of its own for runs, and the programs to execute them."""
    folder = os.environ.get("CARS_BIN_DIR")
    cars = shutil.which("cars", path=folder) or shutil.which("cars")
    if cars is None:
        missing("the program cars is not there: `cargo build --release`, and name its folder by CARS_BIN_DIR")
    with Lab(Path(cars).resolve().parent, tmp_path) as made:
        yield made


def missing(what: str) -> NoReturn:
    """A tool is missing: a reason to skip a test, and a failure where everything must be checked."""
    if os.environ.get("CI"):
        pytest.fail(what)
    pytest.skip(what)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Says loudly what was not tested."""
    skipped = terminalreporter.stats.get("skipped", [])
    if skipped:
        terminalreporter.write_line(f"\nSKIPPED: {len(skipped)} tests; the reasons are above\n", red=True)
