"""The package, its examples and its tests are typed."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import missing

pytestmark = pytest.mark.thorough


def test_mypy_has_nothing_to_say(tmp_path: Path) -> None:
    if importlib.util.find_spec("mypy") is None:
        missing("there is no mypy: `pip install './sdk/python[test]'`")
    root = Path(__file__).parent.parent
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path)]
    checked = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr
