"""Commands that crash, hang, flood or leave children behind end as one clear error, and nothing outlives them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from ninedisk.harness.api.engine import EngineError, EngineTimeoutError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.run import isolation
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.run.limits import TIME_LIMIT_VARIABLE, time_limit_from_environment


def python(code: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", code, *arguments]


def test_stdin_comes_back_on_stdout() -> None:
    text = "caf\u00e9 " * 50_000  # far more than a pipe holds
    done = run_isolated(python("import sys; sys.stdout.write(sys.stdin.read())"), stdin=text, keep=1 << 20)
    assert done.stdout == text
    assert (done.status, done.signal) == (0, None)


def test_command_that_ignores_its_stdin() -> None:
    assert run_isolated(python("print('done')"), stdin="x" * 1_000_000).stdout == "done\n"


def test_exit_status_carries_the_last_lines() -> None:
    code = "import sys; [print('line', k, file=sys.stderr) for k in range(100)]; sys.exit(3)"
    with pytest.raises(EngineError, match=r"ended with status 3 .*\n(line \d+\n)+line 99$"):
        run_isolated(python(code))


def test_signal_is_named() -> None:
    with pytest.raises(EngineError, match="ended by SIGSEGV") as caught:
        run_isolated(python("import os, signal; print('here', flush=True); os.kill(os.getpid(), signal.SIGSEGV)"))
    assert "here" in str(caught.value)


def test_time_limit_stops_the_whole_group(tmp_path: Path, dies: Callable[[int], bool]) -> None:
    code = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "open(sys.argv[1], 'w').write(str(child.pid)); print('started', flush=True); time.sleep(600)"
    )
    begin = time.monotonic()
    with pytest.raises(EngineTimeoutError, match=r"time limit of 4 s") as caught:
        run_isolated(python(code, str(tmp_path / "pid")), time_limit=4.0)
    assert time.monotonic() - begin < 60.0  # the child sleeps ten times as long
    assert "started" in str(caught.value)
    assert dies(int((tmp_path / "pid").read_text()))


def test_child_that_outlives_its_parent_is_killed(tmp_path: Path, dies: Callable[[int], bool]) -> None:
    code = (
        "import subprocess, sys\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "open(sys.argv[1], 'w').write(str(child.pid)); print('parent done')"
    )
    done = run_isolated(python(code, str(tmp_path / "pid")), time_limit=60.0)  # the child sleeps longer
    assert done.stdout == "parent done\n"
    assert dies(int((tmp_path / "pid").read_text()))


def test_child_in_another_session_cannot_hold_the_call() -> None:
    code = (
        "import subprocess, sys\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'], start_new_session=True)\n"
        "print(child.pid, flush=True)"
    )
    done = run_isolated(python(code), time_limit=60.0)  # the child sleeps longer
    os.kill(int(done.stdout), signal.SIGKILL)


def test_flood_neither_blocks_nor_fills_memory() -> None:
    code = (
        "import sys\n"
        "for k in range(20000): sys.stderr.write('e' * 999 + '\\n'); sys.stdout.write('o' * 999 + '\\n')\n"
        "print('end')"
    )
    done = run_isolated(python(code), keep=5000)
    assert len(done.stdout) == 5000
    assert len(done.stderr) == 5000
    assert done.stdout.endswith("end\n")


def test_undecodable_output_is_shown() -> None:
    with pytest.raises(EngineError, match="bad \ufffd byte"):
        run_isolated(python("import os, sys; os.write(2, b'bad \\xff byte'); sys.exit(1)"))


def test_unknown_command() -> None:
    with pytest.raises(EngineError, match=r"no-such-engine cannot be started: No such file"):
        run_isolated(["no-such-engine", "-x"])


def test_interrupt_kills_the_command(
    tmp_path: Path, hears_signals: Callable[[], None], dies: Callable[[int], bool]
) -> None:
    """Ctrl-C in the middle of a run: the exception passes on, the engine is gone."""
    code = (
        "import sys\n"
        "from ninedisk.harness.run.isolation import run_isolated\n"
        "run_isolated([sys.executable, '-c', \"import os, sys, time; open(sys.argv[1], 'w').write(str(os.getpid())); "
        'time.sleep(600)", sys.argv[1]])'
    )
    pid_file = tmp_path / "pid"
    parent = subprocess.Popen(python(code, str(pid_file)), stderr=subprocess.DEVNULL, preexec_fn=hears_signals)
    end = time.monotonic() + 60.0
    while not (pid_file.exists() and pid_file.read_text()) and time.monotonic() < end:
        time.sleep(0.02)
    parent.send_signal(signal.SIGINT)
    assert parent.wait(timeout=60.0) != 0
    assert dies(int(pid_file.read_text()))


@pytest.mark.usefixtures("no_child_left")
def test_no_zombie_and_no_thread_left() -> None:
    threads = threading.active_count()
    run_isolated(python("pass"))
    assert threading.active_count() == threads


def test_time_limit_from_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(TIME_LIMIT_VARIABLE, raising=False)
    assert time_limit_from_environment() == 120.0
    monkeypatch.setenv(TIME_LIMIT_VARIABLE, "0.5")
    assert time_limit_from_environment() == 0.5
    with pytest.raises(EngineTimeoutError, match=TIME_LIMIT_VARIABLE):
        run_isolated(python("import time; time.sleep(60)"))


@pytest.mark.parametrize("text", ["soon", "-1", "0", "nan"])
def test_bad_time_limit(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(TIME_LIMIT_VARIABLE, text)
    with pytest.raises(UsageError, match="give a number of seconds > 0"):
        time_limit_from_environment()


DRIVER = """
import json, os, sys, time
loaded = os.getpid()
def preload():
    global loaded
    import colorsys
    colorsys.by = loaded
if __name__ == "__main__":
    import colorsys
    asked = json.load(sys.stdin)
    print(json.dumps({"by": getattr(colorsys, "by", None), "pid": os.getpid(), "seen": getattr(colorsys, "seen", None), "cwd": os.getcwd(),
                      "env": os.environ.get("PLACE"), "argv": sys.argv, "group": os.getpgid(0)}), flush=True)
    colorsys.seen = True
    exec(asked.get("then", ""))
"""


def test_a_driver_runs_in_copies_of_what_has_loaded_its_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dies: Callable[[int], bool]
) -> None:
    fork_servers: dict[tuple[str, ...], isolation.ForkServer] = {}
    monkeypatch.setattr(isolation, "_fork_servers", fork_servers)
    driver = tmp_path / "driver.py"
    driver.write_text(DRIVER)

    def run(place: str, then: str = "", **limits: float) -> dict[str, object]:
        folder = tmp_path / place
        folder.mkdir()
        done = run_isolated(
            [sys.executable, str(driver), "word"],
            stdin=json.dumps({"then": then}),
            cwd=folder,
            env={**os.environ, "PLACE": str(folder)},
            driver=driver,
            **limits,
        )
        found: dict[str, object] = json.loads(done.stdout)
        assert (found["cwd"], found["env"], found["argv"]) == (str(folder), str(folder), [str(driver), "word"])
        assert found["group"] == found["pid"]
        assert found["seen"] is None  # nothing that a run before has left
        return found

    try:
        first = run("first")
        (fork_server,) = fork_servers.values()
        assert first["by"] != first["pid"]
        assert run("second", "time.sleep(0.01)")["by"] == first["by"]
        with pytest.raises(EngineError, match=r"ended with status 3 .*its last output:\nword of it$"):
            run("third", "print('word of it', file=sys.stderr); sys.exit(3)")
        with pytest.raises(EngineError, match="ended by SIGSEGV"):
            run("fourth", "import signal; os.kill(os.getpid(), signal.SIGSEGV)")
        marker = tmp_path / "child"
        with pytest.raises(EngineTimeoutError, match=r"time limit of 3 s"):
            run("fifth", f"open({str(marker)!r}, 'w').write(str(os.getpid())); time.sleep(60)", time_limit=3.0)
        assert dies(int(marker.read_text()))
        # The driver is read anew by each run.
        driver.write_text(DRIVER.replace("os.getcwd()", "os.getcwd() + '/new'"))
        with pytest.raises(AssertionError, match="/new"):
            run("sixth")
        driver.write_text(DRIVER)
        assert run("seventh")["by"] == first["by"]
        assert list(fork_servers.values()) == [fork_server]
        # One that has died is replaced by a plain start, then by another.
        os.kill(int(str(first["by"])), signal.SIGKILL)
        assert run("eighth")["by"] is None
        assert run("ninth")["by"] not in (None, first["by"])
    finally:
        for each in fork_servers.values():
            each.end()
