"""Run a command that may crash, hang, flood its output, take all memory or leave children behind.

The command runs in its own session and process group. Whatever happens (normal end, time limit, Ctrl-C), the whole
group is killed before the leader is reaped, so that nothing outlives the call; pipes are read all the time and only
their last bytes are kept, so that no amount of output can block either side. Should this process end before the call does, its
guard ends the command.

Where `warm_starts` is on, a driver that asks for it runs in a copy of a process of the same command which has loaded its engine, its
`ForkServer`: what a start takes, YADE's for instance most of a second, is paid once. Copies are held as commands are.
"""

from __future__ import annotations

import json
import math
import os
import select
import selectors
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

from ninedisk.harness.api.engine import EngineError, EngineTimeoutError
from ninedisk.harness.api.text import one_line
from ninedisk.harness.run.limits import (
    TIME_LIMIT_VARIABLE,
    TimeLimit,
    exceeds_memory,
    memory_limit,
    resident,
    time_limit_from_environment,
)
from ninedisk.harness.run.process_guard import guarded_environment

KEEP_BYTES = 1 << 16
LAST_LINES = 12
LINE_LENGTH = 150
_CHUNK = 1 << 16
_running: set[int] = set()
_fork_servers: dict[tuple[str, ...], ForkServer] | None = None
NURSERY = Path(__file__).parents[1] / "engines" / "drivers" / "fork_server.py"
_LOOK = (
    0.05  # between two looks at the memory of a command: what it can take in that time is a small part of a machine [s]
)
_GRACE = 1.0  # a process that left the group may hold a pipe open: wait no longer than this for its end [s]


@dataclass(frozen=True)
class Finished:
    """How a command ended; ``stdout`` and ``stderr`` hold the last `KEEP_BYTES` bytes of each.

    ``status`` is the exit status, or None where the signal named ``signal`` ended the command. ``seconds`` are those on the wall, ``cpu``
    those of the processor, of the command and the children that it waited for.
    """

    status: int | None
    signal: str | None
    stdout: str
    stderr: str
    seconds: float
    cpu: float

    def last_lines(self, count: int = LAST_LINES) -> str:
        """Last non-empty lines of standard error, or of standard output where standard error is empty; long ones are cut."""
        lines = [line for line in (self.stderr.strip() or self.stdout.strip()).splitlines() if line.strip()]
        return "\n".join(
            one_line(line if len(line) <= LINE_LENGTH else line[:LINE_LENGTH] + " ...") for line in lines[-count:]
        )


class _Process(Protocol):
    """What is held of a process."""

    pid: int
    stdin: IO[bytes] | None
    stdout: IO[bytes] | None
    stderr: IO[bytes] | None


@dataclass
class _ForkedRun:
    """A run that a `ForkServer` has begun."""

    pid: int
    stdin: IO[bytes] | None
    stdout: IO[bytes] | None
    stderr: IO[bytes] | None


class ForkServerError(Exception):
    """A fork server that does not start runs: the command has to be started by itself, and shows what is wrong."""


class ForkServer:
    """A process of a command that has loaded what its driver imports, and starts runs as copies of itself (``drivers/fork_server.py``).

    Copies see the driver as it is when they begin, and their own folder and environment; of earlier runs they see nothing. It ends with
    the process that it serves.
    """

    def __init__(self, command: Sequence[str], driver: str, cwd: Path | str | None, env: Mapping[str, str]) -> None:
        self._link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        k = list(command).index(driver)
        try:
            self._process = subprocess.Popen(
                [*command[:k], str(NURSERY), str(theirs.fileno()), *command[k:]],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=cwd,
                env=guarded_environment(env),
                start_new_session=True,
                pass_fds=(theirs.fileno(),),
            )
        except OSError as error:
            self._link.close()
            raise ForkServerError(str(error)) from error
        finally:
            theirs.close()

    def start(self, cwd: Path | str | None, env: Mapping[str, str] | None, time_limit: float) -> _ForkedRun:
        """Begin a run; raises `ForkServerError` where this process does not answer."""
        pairs = [os.pipe() for _ in range(3)]
        theirs = [pairs[0][0], pairs[1][1], pairs[2][1]]
        ours = [pairs[0][1], pairs[1][0], pairs[2][0]]
        message = json.dumps({"cwd": os.path.abspath(cwd or "."), "env": guarded_environment(env)}).encode()
        try:
            self._link.settimeout(time_limit)
            socket.send_fds(self._link, [message], theirs)
            pid = int(self._link.recv(64))
        except BaseException as error:
            for descriptor in ours:
                os.close(descriptor)
            self.end()
            if isinstance(error, OSError | ValueError):
                raise ForkServerError(str(error)) from error
            raise
        finally:
            for descriptor in theirs:
                os.close(descriptor)
        streams = [os.fdopen(n, mode, 0) for n, mode in zip(ours, ("wb", "rb", "rb"), strict=True)]
        return _ForkedRun(pid, *streams)

    def reap(self) -> tuple[int, float]:
        """How the run in hand ended, whose group has been killed: its exit code, below 0 for a signal, and its CPU seconds."""
        try:
            self._link.send(b"?")
            code, cpu = json.loads(self._link.recv(256))
        except (OSError, ValueError):  # it was killed itself, and with it the knowledge of the run's end
            self.end()
            return -signal.SIGKILL, 0.0
        return int(code), float(cpu)

    def end(self) -> None:
        """End it, with a run that it may have in hand."""
        self._link.close()
        if self._process.poll() is None:
            _kill_group(self._process.pid)
            self._process.wait()


def warm_starts() -> None:
    """Have this process keep a `ForkServer` for each driver from now on: workers do, which run cells of all engines."""
    global _fork_servers
    if _fork_servers is None and hasattr(os, "pidfd_open") and hasattr(os, "fork"):
        _fork_servers = {}


def _started_run(
    command: Sequence[str],
    driver: Path | str | None,
    cwd: Path | str | None,
    env: Mapping[str, str] | None,
    limit: float,
) -> tuple[_Process, Callable[[], tuple[int, float]]]:
    """A run that has begun, and what reaps it."""
    if _fork_servers is not None and driver is not None and str(driver) in command:
        given = dict(os.environ if env is None else env)
        # What names the run's own folder is not the fork server's.
        key = (*command, *sorted(f"{name}={text}" for name, text in given.items() if str(cwd) not in text))
        with suppress(ForkServerError):
            fork_server = _fork_servers.pop(key, None) or ForkServer(command, str(driver), cwd, given)
            copy = fork_server.start(cwd, given, limit)
            nurseries = _fork_servers

            def reap() -> tuple[int, float]:
                ended = fork_server.reap()
                nurseries[key] = fork_server
                return ended

            return copy, reap
    try:
        process = subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=cwd,
            env=guarded_environment(env),
            start_new_session=True,
            bufsize=0,
        )
    except OSError as error:
        raise EngineError(
            f"{Path(command[0]).name} cannot be started: {error.strerror or error} ({' '.join(command)})"
        ) from error

    def wait() -> tuple[int, float]:
        _, ended, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
        return process.returncode, used.ru_utime + used.ru_stime

    return process, wait


def run_isolated(
    command: Sequence[str],
    *,
    stdin: str = "",
    time_limit: float | None = None,
    cwd: Path | str | None = None,
    env: Mapping[str, str] | None = None,
    keep: int = KEEP_BYTES,
    driver: Path | str | None = None,
) -> Finished:
    """Run ``command`` with ``stdin`` as its standard input and wait for its end.

    Parameters
    ----------
    command : sequence of str
        Program and arguments; no shell.
    stdin : str
        Text for the standard input (UTF-8); a command that does not read it is no error.
    time_limit : float or None
        Seconds of CPU time, of all processes together, and of idle time (`ninedisk.harness.run.limits.TimeLimit`) after which the whole
        group is killed; None: `ninedisk.harness.run.limits.time_limit_from_environment`.
    cwd, env
        Working directory and environment; None: those of this process.
    keep : int
        Bytes of each output stream that are kept, the last ones.
    driver : Path or str, optional
        The part of the command that is a Python script which may run in a copy of a process (see `ForkServer`).

    Raises
    ------
    EngineTimeoutError
        At the time limit.
    EngineError
        If the command cannot be started, holds more memory than `ninedisk.harness.run.limits.memory_limit`, ends by a signal or
        ends with a status other than 0; the message carries its
        last output lines.
    """
    limit = time_limit_from_environment() if time_limit is None else time_limit
    memory = memory_limit()
    program = Path(command[0]).name
    begin = time.monotonic()
    process, reap = _started_run(command, driver, cwd, env, limit)
    _running.add(process.pid)
    tails = {"stdout": bytearray(), "stderr": bytearray()}
    try:
        stopped = _exchange(process, stdin.encode(), tails, keep, (TimeLimit(process.pid, limit), memory))
    finally:
        _running.discard(process.pid)
        _kill_group(process.pid)
        returned, cpu = reap()
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None:
                stream.close()
    texts = {name: bytes(tail).decode(errors="replace") for name, tail in tails.items()}
    name = signal_name(-returned) if returned < 0 else None
    finished = Finished(
        None if name else returned, name, texts["stdout"], texts["stderr"], time.monotonic() - begin, cpu
    )
    said = finished.last_lines()
    tail = f"; its last output:\n{said}" if said else "; it printed nothing"
    if isinstance(stopped, int):
        raise EngineError(f"{program} {exceeds_memory(stopped, memory)}{tail}")
    if stopped:
        raise EngineTimeoutError(
            f"{program} was stopped at its time limit of {limit:g} s (set {TIME_LIMIT_VARIABLE} to allow more): {stopped}{tail}"
        )
    if name:
        raise EngineError(f"{program} was ended by {name} after {finished.seconds:.2f} s{tail}")
    if returned:
        raise EngineError(f"{program} ended with status {returned} after {finished.seconds:.2f} s{tail}")
    return finished


def end_commands() -> None:
    """Kill the groups of all commands that threads of this process wait for; each wait then ends with an `EngineError`."""
    for pid in list(_running):
        _kill_group(pid)


def _exchange(
    process: _Process, data: bytes, tails: dict[str, bytearray], keep: int, limits: tuple[TimeLimit, float]
) -> str | int:
    """Feed and drain the pipes until the leader has ended: ``""``; or why it is out of time, or the bytes held where these are too many.

    ``limits`` are the time and the memory [bytes]. The leader is not reaped.
    """
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    (clock, memory), ended, looked = limits, False, time.monotonic()
    end = math.inf
    with selectors.DefaultSelector() as selector, _end_of(process.pid) as over:
        for stream, name in ((process.stdout, "stdout"), (process.stderr, "stderr")):
            os.set_blocking(stream.fileno(), False)
            selector.register(stream, selectors.EVENT_READ, name)
        os.set_blocking(process.stdin.fileno(), False)
        selector.register(process.stdin, selectors.EVENT_WRITE, "stdin")
        if over is not None:
            selector.register(over, selectors.EVENT_READ, "end")
        pending = memoryview(data)
        pause = 0.002
        while True:
            if not ended and (_has_ended(process.pid) if over is None else _readable(over)):
                ended, end = True, time.monotonic() + _GRACE
                _kill_group(process.pid)
            if not _any_output(selector) and ended:
                return ""
            now = time.monotonic()
            if now >= end:
                return ""
            if not ended and (why := clock.reached()):
                return why
            if not ended and now >= looked + _LOOK:
                looked = now
                if (held := resident(process.pid)) > memory:
                    return held
            pause = min(2.0 * pause, 0.05)
            for key, _ in _ready(selector, min(end - now, pause)):
                if key.data == "end":
                    selector.unregister(key.fileobj)
                elif key.data == "stdin":
                    pending = _feed(selector, process.stdin, pending)
                elif chunk := os.read(key.fd, _CHUNK):
                    tail = tails[key.data]
                    tail += chunk
                    del tail[: max(0, len(tail) - keep)]
                else:
                    selector.unregister(key.fileobj)


def _ready(selector: selectors.BaseSelector, timeout: float) -> list[tuple[selectors.SelectorKey, int]]:
    if selector.get_map():
        return selector.select(timeout)
    time.sleep(timeout)
    return []


def _any_output(selector: selectors.BaseSelector) -> bool:
    return any(key.data in ("stdout", "stderr") for key in selector.get_map().values())


def _feed(selector: selectors.BaseSelector, pipe: IO[bytes], pending: memoryview) -> memoryview:
    """Write what the pipe takes; close it at the end of the data or when nobody reads it."""
    try:
        written = os.write(pipe.fileno(), pending[:_CHUNK]) if pending else 0
    except BrokenPipeError:
        written = len(pending)
    if written < len(pending):
        return pending[written:]
    selector.unregister(pipe)
    pipe.close()
    return memoryview(b"")


@contextmanager
def _end_of(pid: int) -> Iterator[int | None]:
    """A descriptor that can be read once the process has ended; None where this system has none."""
    over = None
    if hasattr(os, "pidfd_open"):
        with suppress(OSError):  # an older Linux
            over = os.pidfd_open(pid)
    try:
        yield over
    finally:
        if over is not None:
            os.close(over)


def _readable(descriptor: int) -> bool:
    return bool(select.select([descriptor], [], [], 0.0)[0])


def _has_ended(pid: int) -> bool:
    """Whether the child has ended; it stays a zombie, so that its number keeps naming its own group."""
    return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def _kill_group(pid: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def signal_name(number: int) -> str:
    """Name of a signal, ``SIGSEGV``; its number where it has none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
