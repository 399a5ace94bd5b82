"""`make report`: the page is built whatever the checks say, and the exit status separates findings from breakdowns."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app

pytestmark = pytest.mark.tree


@pytest.fixture
def job(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("main_job", root / "tools" / "main_job.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("run", "third", "page", "flags", "status", "said"),
    [
        (0, "pass", 0, [], 0, "Measurements: 2 pass, 1 fail"),
        (1, "pass", 0, [], 0, "Some checks fail"),
        (3, "timeout", 0, [], 0, "Some cells ended without a result, 1 timeout: the page lists them first."),
        (3, "error", 0, [], 0, "1 error"),
        (3, "error", 0, ["--strict"], 3, "1 error"),
        (1, "pass", 0, ["--strict"], 0, "Some checks fail"),
        (3, "unsupported", 0, [], 3, "an engine can run no cell"),
        (3, "", 0, [], 3, "nothing was run or stored"),
        (2, "", 0, [], 2, "exit code 2"),
        (0, "pass", 2, [], 2, "not built"),
        (3, "error", 2, [], 2, "not built"),
    ],
)
def test_exit_status(
    job: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    run: int,
    third: str,
    page: int,
    flags: list[str],
    status: int,
    said: str,
) -> None:
    calls = []

    def ninedisk(*arguments: str) -> int:
        calls.append(arguments[0])
        if arguments[0] == "report":
            return page
        rows = [{"status": status} for status in ("pass", "fail", third)]
        if third:  # else nothing was stored
            Path(arguments[arguments.index("--json") + 1]).write_text(json.dumps(rows))
        return run

    monkeypatch.setattr(job, "ninedisk", ninedisk)
    monkeypatch.setattr(job, "changed_verdicts", lambda store: f"news of {store}")
    monkeypatch.setattr(sys, "argv", ["main_job.py", "--out", str(tmp_path / "page"), *flags])
    assert job.main() == status
    assert calls == ["run", "report"]
    out = capsys.readouterr().out
    assert said in out
    assert ("Since the run before: news of results" in out) is (run in (0, 1, 3))
    assert (str(tmp_path / "page" / "index.html") in out) is (page == 0)


def test_ctrl_c_ends_it_without_a_traceback_or_a_page(root: Path, tmp_path: Path) -> None:
    words = [
        sys.executable,
        str(root / "tools" / "main_job.py"),
        "--engine-cmd",
        f"{sys.executable} engine.py",
        "--jobs",
        "1",
    ]
    (tmp_path / "engine.py").write_text("open('begun', 'w'); import time; time.sleep(600)")
    process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
    end = time.monotonic() + 120.0
    while not (tmp_path / "begun").exists() and time.monotonic() < end:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, "interrupted: nothing was stored\n")
    assert not (tmp_path / "report").exists()


def test_a_run_without_rows_is_said_to_be_one(job: ModuleType, tmp_path: Path) -> None:
    assert not job.statuses(tmp_path / "absent.json")


def test_engines_by_their_commands_join_all_others(job: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    monkeypatch.setattr(job, "ninedisk", lambda *arguments: calls.append(arguments) or 0)
    monkeypatch.setattr(job, "changed_verdicts", lambda _: "")
    monkeypatch.setattr(sys, "argv", ["main_job.py", "--engine-cmd", "node a.mjs", "--engine-cmd", "./b c"])
    assert job.main() == 0
    assert calls[0][:4] == ("run", "--all-engines", "--profile", "both")
    assert calls[0][4:8] == ("--engine-cmd", "node a.mjs", "--engine-cmd", "./b c")


@pytest.mark.usefixtures("cells_here")
def test_news_are_what_moved_since_the_run_before(job: ModuleType, tmp_path: Path) -> None:
    def run(kind: str, *more: str) -> None:
        words = ["run", "binary-collision", "--engine", "pymunk", "--set", f"kind={kind}", "--store", str(tmp_path)]
        done = CliRunner().invoke(app, [*words, *more])
        assert done.exit_code in (0, 1), done.output

    run("plastic")
    assert "has 1 finished run" in job.changed_verdicts(str(tmp_path))
    run("plastic")
    assert job.changed_verdicts(str(tmp_path)) == f"nothing moved (ninedisk compare latest~1 latest --store {tmp_path})"
    run("plastic", "--set", "speed=2")
    assert " new" in job.changed_verdicts(str(tmp_path))
