"""Time limits count CPU seconds of all processes of an engine; other work on the machine changes no status, and a sleeper is stopped."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from ninedisk.harness.api.engine import EngineTimeoutError
from ninedisk.harness.run import limits
from ninedisk.harness.run.isolation import run_isolated

Crowd = Callable[[int], AbstractContextManager[None]]

BURN = "import time\nwhile time.process_time() < {}: pass\nprint('done')"

CHILD = "import subprocess, sys\nsubprocess.run([sys.executable, '-c', {!r}])"
"""The parent uses no CPU time while it waits."""

ORPHAN = (
    "import os, time\n"
    "if not os.fork():\n"
    "    if os.fork(): os._exit(0)\n"
    "    while True: pass\n"
    "os.wait()\n"
    "time.sleep(600)"
)
"""The process that burns is nobody's child."""


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


@pytest.fixture
def crowd() -> Crowd:
    """Keeps this machine busy with so many processes, each in its own session: Linux shares the processors among sessions."""

    @contextmanager
    def busy(count: int) -> Iterator[None]:
        others = [subprocess.Popen(python("while True: pass"), start_new_session=True) for _ in range(count)]
        try:
            yield
        finally:
            for other in others:
                other.kill()
                other.wait()

    return busy


def stopped(code: str, limit: float) -> tuple[str, float]:
    """What is said of a command that is stopped, and its CPU seconds."""
    with pytest.raises(EngineTimeoutError, match=f"at its time limit of {limit:g} s") as caught:
        run_isolated(python(code), time_limit=limit)
    said = str(caught.value)
    found = re.search(r"([\d.]+) s of CPU time|CPU time ([\d.]+) s", said)
    assert found is not None, said
    return said, float(found[1] or found[2])


@pytest.mark.parametrize("others", [0, 4])
def test_a_burner_is_stopped_at_its_cpu_time_and_not_before(crowd: Crowd, others: int) -> None:
    with crowd(others):
        said, used = stopped("while True: pass", 1.5)
    assert "it used 1." in said
    assert 1.5 <= used < 2.0


def test_a_busy_machine_stops_no_engine(crowd: Crowd) -> None:
    with crowd(4 * (os.cpu_count() or 1)):
        done = run_isolated(python(BURN.format(1.0)), time_limit=3.0)
    assert done.stdout == "done\n"
    assert done.cpu < 1.5
    assert done.seconds > 3.0  # else the machine was not busy, and this shows nothing


@pytest.mark.parametrize("code", [CHILD.format("while True: pass"), ORPHAN], ids=["child", "orphan"])
def test_processes_that_an_engine_starts_count(code: str) -> None:
    said, used = stopped(code, 1.5)
    assert "it used" in said
    assert 1.5 <= used < 2.0


def test_children_that_ended_count() -> None:
    """Each child takes a third of the limit; none lives at its end."""
    code = f"import subprocess, sys\nfor _ in range(20): subprocess.run([sys.executable, '-c', {BURN.format(0.5)!r}])"
    said, used = stopped(code, 1.5)
    assert "it used" in said
    assert 1.5 <= used < 2.0


@pytest.mark.parametrize(
    "code", ["time.sleep(600)", "[time.sleep(0.02) for _ in range(30000)]"], ids=["asleep", "polls"]
)
def test_a_sleeper_is_stopped(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    monkeypatch.setattr(limits, "machine_load", lambda: 1.0)
    begin = time.monotonic()
    said, used = stopped(f"import time; {code}", 1.5)
    assert "it was idle for 1." in said
    assert used < 0.5
    assert 1.5 <= time.monotonic() - begin < 30.0


def test_what_an_engine_waits_for_may_be_slowed_down_by_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "machine_load", lambda: 4.0)
    assert run_isolated(python("import time; time.sleep(2)"), time_limit=1.0).seconds > 2.0


def test_the_load_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    monkeypatch.setattr(os, "getloadavg", lambda: (12.0, 1.0, 1.0))
    assert limits.machine_load() == 3.0
    monkeypatch.setattr(os, "getloadavg", lambda: (0.1, 1.0, 1.0))
    assert limits.machine_load() == 1.0


def test_without_proc_the_wall_clock_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(limits, "_PROCESSES", tmp_path)
    with pytest.raises(
        EngineTimeoutError, match=r"time limit of 1 s .* it ran for 1\..* wall-clock time; CPU times are unknown"
    ):
        run_isolated(python("import time; time.sleep(600)"), time_limit=1.0)


def test_without_schedstat_a_process_that_could_run_is_not_idle(monkeypatch: pytest.MonkeyPatch, crowd: Crowd) -> None:
    monkeypatch.setattr(limits, "_with_busy", lambda _, seen: seen)
    monkeypatch.setattr(limits, "machine_load", lambda: 1.0)
    with crowd(4 * (os.cpu_count() or 1)):
        assert run_isolated(python(BURN.format(0.5)), time_limit=1.5).seconds > 1.0
    assert "it was idle" in stopped("import time; time.sleep(600)", 1.0)[0]
