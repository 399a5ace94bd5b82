"""A package of fake cases and engines, found by its entry points like anyone's."""

from __future__ import annotations

import importlib
import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from ninedisk.harness.api import registry
from ninedisk.harness.results.schema import CELL_COLUMNS
from ninedisk.harness.results.tables import CaseResult

MEASURED_ANEW = {"setup_s", "warm_up_s", "advance_s", "cpu_s", "cpu_spread", "reference_s", "repeats"}
"""Columns of cells that are other ones in each run."""

SOURCE = Path(__file__).parent / "data" / "ninedisk_fakes.py"


@pytest.fixture(scope="session")
def fake_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on which Python finds the package ``ninedisk-fakes`` with its entry points."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(SOURCE, folder)
    about = folder / "ninedisk_fakes-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: ninedisk-fakes\nVersion: 1.0\n")
    behaviours = SOURCE.read_text().partition("BEHAVIOURS = (")[2].partition(")")[0]
    engines = [f"fake-{name.strip().strip(chr(34))}" for name in behaviours.split(",") if name.strip()]
    lines = [
        "[ninedisk.cases]",
        "fake/fall = ninedisk_fakes:CASE",
        "fake/spin = ninedisk_fakes:CASES",
        "[ninedisk.engines]",
    ]
    lines += [f"{name} = ninedisk_fakes:ENGINES" for name in engines]
    lines += ["fake-broken = ninedisk_fakes:NOWHERE"]
    (about / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture
def fakes(fake_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module of the fakes, registered in this process."""
    monkeypatch.syspath_prepend(str(fake_folder))
    registry.case_table.cache_clear()
    registry.engine_table.cache_clear()
    yield importlib.import_module("ninedisk_fakes")
    registry.case_table.cache_clear()
    registry.engine_table.cache_clear()


@pytest.fixture(scope="session")
def fake_environment(fake_folder: Path) -> dict[str, str]:
    """Environment in which a child process finds the fakes."""
    known = [path for path in (os.environ.get("PYTHONPATH"),) if path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(fake_folder), *known])}


@pytest.fixture(scope="session")
def hears_signals() -> Callable[[], None]:
    """For ``preexec_fn``: the process heeds the signals that ask for its end, also where the caller ignores them (nohup, ``&``)."""

    def set_default() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    return set_default


@pytest.fixture(scope="session")
def dies() -> Callable[[int], bool]:
    """Whether a process is gone, or a zombie that waits for init, within the time that a killed one may take on a busy machine."""

    def of(pid: int) -> bool:
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            try:
                state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
            except (FileNotFoundError, ProcessLookupError):
                return True
            if state == "Z":
                return True
            time.sleep(0.02)
        return False

    return of


@pytest.fixture(scope="session")
def bits() -> Callable[[CaseResult], bytes]:
    """All of a result but its timings, floats to the last bit and NaN included: equal for equal results only."""

    def of(result: CaseResult) -> bytes:
        cell = {name: result.cell[name] for name in CELL_COLUMNS if name not in MEASURED_ANEW}
        curves = [
            {name: np.asarray(column).tolist() for name, column in curve.items()}
            for curve in (*result.curves, *result.reference_curves)
        ]
        history = {} if result.history is None else vars(result.history)
        arrays = {name: value.tobytes() for name, value in history.items() if isinstance(value, np.ndarray)}
        return repr((cell, result.rows, curves, arrays)).encode()

    return of


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory, that of child processes too."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _children() -> set[int]:
    tasks = Path(f"/proc/{os.getpid()}/task")
    return {int(word) for task in tasks.iterdir() for word in (task / "children").read_text().split()}


@pytest.fixture
def no_child_left() -> Iterator[None]:
    """The test leaves no child process behind that was not there before, not even a zombie."""
    before = _children()
    yield
    assert _children() <= before
