#!/usr/bin/env python3
"""Makes the wheel: builds the module and the programs, puts the programs beside it, and calls maturin.

    python3 sdk/python/build_wheel.py                    # target/wheels/cars_simulator-….whl, small and slow to build
    python3 sdk/python/build_wheel.py --profile release  # in the profile of the tests, which is built already

maturin is found by PATH: ``pip install maturin``.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
ROBOTS = ("cars-butler", "cars-leguin", "cars-vonda", "cars-bidder", "cars-scout")
PROGRAMS = ("cars", "cars-sim", "cars-console", *ROBOTS)
WITH_PROGRAMS = """
data = "cars_simulator.data"
"""


def build(profile: str, out: Path) -> Path:
    """Makes the wheel in a folder, and returns its path."""
    # The programs; maturin builds the module, and what both share has the same features and is compiled once.
    subprocess.run(["cargo", "build", "--profile", profile], cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"), profile)
    made = out.resolve()
    # A copy, so that programs never lie among the sources; within the project, whose toolchain and settings cargo finds from there,
    # wherever it builds.
    within = ROOT / "target"
    within.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=within) as folder:
        copy = Path(folder, "python")
        shutil.copytree(HERE, copy, ignore=shutil.ignore_patterns("__pycache__", "tests"))
        project = copy / "pyproject.toml"
        text = project.read_text().replace("../../crates", str(ROOT / "crates"))
        project.write_text(text.replace("[tool.maturin]\n", f"[tool.maturin]{WITH_PROGRAMS}"))
        scripts = copy / "cars_simulator.data" / "scripts"
        scripts.mkdir(parents=True)
        for program in PROGRAMS:
            subprocess.run(["strip", "-o", scripts / program, target / program], check=True)
        maturin = ["maturin", "build", "--profile", profile, "--strip", "--out", str(made)]
        subprocess.run(maturin, cwd=copy, check=True)
    return max(made.glob("*.whl"), key=lambda wheel: wheel.stat().st_mtime)


def main() -> None:
    """Makes the wheel and prints its path."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--profile", default="dist", help="profile of cargo; `dist` for what is given to others")
    parser.add_argument("--out", type=Path, default=ROOT / "target" / "wheels", help="folder of the wheel")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    wheel = build(given.profile, given.out)
    print(f"{wheel}: {wheel.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
