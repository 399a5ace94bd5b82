"""The command line starts fast because it leaves the heavy libraries for later."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

HEAVY = ("numba", "pandas", "pyarrow", "matplotlib", "scipy", "pymunk", "pytest", "pint")
LIMIT = 0.5  # seconds: the requirement on `ninedisk --help`


def test_the_command_line_loads_no_heavy_library() -> None:
    code = f"import sys, ninedisk.harness.cli.app; print(*sorted(set(sys.modules) & set({HEAVY})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def test_a_run_stores_its_tables_without_pandas(tmp_path: Path) -> None:
    words = ["run", "incline-block", "-e", "pymunk", "--set", "duration=0.05", "--store", str(tmp_path)]
    code = f"import sys\nfrom ninedisk.harness.cli.app import app\napp({words}, standalone_mode=False)\nassert 'pandas' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("runs/*/series.parquet"))


@pytest.mark.timing
def test_help_comes_at_once() -> None:
    seconds = []
    for _ in range(5):  # the best of five: other work on the machine only ever adds
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "ninedisk", "--help"], check=True, capture_output=True, timeout=60)
        seconds.append(time.perf_counter() - begin)
    assert min(seconds) < LIMIT, f"{min(seconds):.2f} s"
