"""How much memory and processor time a cell's engine may take, and how much processes have taken.

Resident memory is watched, not address space limited (RLIMIT_AS): JavaScript and Java reserve far more than they ever use. It is read
from /proc; without that memory is not limited, and time is that of the wall clock.

The time limit counts CPU seconds, so that other work on the machine changes no result. A process that hangs without using the processor
is caught by its idle time: wall-clock seconds in which none of its group ran or waited for a processor, divided by the load of
the machine (`machine_load`), since what it waits for may be slowed down by other work. Idle time has the same limit.
"""

from __future__ import annotations

import os
import re
import time
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path

from ninedisk.harness.api.errors import UsageError

DEFAULT_TIME_LIMIT = 120.0
TIME_LIMIT_VARIABLE = "NINEDISK_TIME_LIMIT"
MEMORY_VARIABLE = "NINEDISK_MEMORY_LIMIT"
LEAST = 2 << 30
"""Bytes below which the default never goes: kernels that compile and histories of long runs take a good part of that."""

_UNITS = {"KB": 10**3, "MB": 10**6, "GB": 10**9, "KIB": 1 << 10, "MIB": 1 << 20, "GIB": 1 << 30}
_SIZE = re.compile(r"([0-9.]+)\s*([kmg]i?b)", re.IGNORECASE)
_PROCESSES = Path("/proc")
_TICK = 1.0 / os.sysconf("SC_CLK_TCK")
_SHORTEST, _LONGEST = 0.05, 1.0
"""Seconds between two readings of the times of processes: each reads all of /proc, some milliseconds."""


def read_size(text: str, flag: str) -> float:
    """Bytes of ``4 GB``, ``500 MB``, ``2 GiB``; infinite for ``none``.

    Raises
    ------
    UsageError
        Naming the flag.
    """
    if text.strip() == "none":
        return inf
    found = _SIZE.fullmatch(text.strip())
    with suppress(ValueError):
        if found and (size := float(found[1]) * _UNITS[found[2].upper()]) > 0.0:
            return size
    raise UsageError(f"{flag} {text!r} is not allowed: give a size above 0 with its unit, for instance '4 GB', or none")


def default_limit(jobs: int = 1) -> float:
    """Half of what this machine has, or this container may use, shared by the cells that run at once; at least `LEAST`."""
    whole = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):  # no separate one: "max", or no such file
            whole = min(whole, float(Path(path).read_text()))
    return max(float(LEAST), 0.5 * whole / min(max(1, jobs), 10**9))


def memory_limit() -> float:
    """Bytes that a cell's engine may hold: the environment variable ``NINEDISK_MEMORY_LIMIT`` if it is set, else `default_limit`.

    Raises
    ------
    UsageError
        If the variable is no size.
    """
    text = os.environ.get(MEMORY_VARIABLE)
    return read_size(text, f"{MEMORY_VARIABLE} =") if text else default_limit()


def resident(pid: int, *, children: bool = True) -> int:
    """Bytes of resident memory of a process and, where asked for, of all that it started and that still belong to it; 0 if it is gone."""
    pages = 0
    with suppress(OSError, ValueError, IndexError):
        pages = int((_PROCESSES / str(pid) / "statm").read_text().split()[1])
    size = pages * os.sysconf("SC_PAGE_SIZE")
    if children:
        with suppress(OSError):
            for task in (_PROCESSES / str(pid) / "task").iterdir():
                size += sum(resident(int(child)) for child in (task / "children").read_text().split())
    return size


def exceeds_memory(held: float, limit: float) -> str:
    """Words for an engine that was stopped for its memory."""
    return (
        f"was stopped because it held {held / 1e9:.3g} GB of memory, more than the limit of {limit / 1e9:.3g} GB "
        f"(ninedisk run --memory-limit, or {MEMORY_VARIABLE}, allow more)"
    )


def time_limit_from_environment(default: float = DEFAULT_TIME_LIMIT) -> float:
    """Time limit [s]: the environment variable ``NINEDISK_TIME_LIMIT`` if it is set, else ``default``.

    Raises
    ------
    UsageError
        If the variable is not a number above 0.
    """
    text = os.environ.get(TIME_LIMIT_VARIABLE)
    if not text:
        return default
    with suppress(ValueError):
        if (limit := float(text)) > 0.0:
            return limit
    raise UsageError(f"{TIME_LIMIT_VARIABLE}={text!r} is not a time limit: give a number of seconds > 0, or unset it")


def machine_load() -> float:
    """Processes that run or wait for each processor, mean of the last minute; at least 1, and 1 where it is unknown."""
    with suppress(OSError):
        return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
    return 1.0


@dataclass(frozen=True)
class _ProcessSample:
    """A process at one moment.

    ``own`` and ``waited`` are CPU seconds of the process and of the ended children that it waited for; ``busy`` are seconds in which its
    threads ran or waited for a processor, None where the system does not say. ``runs`` says whether it is in the state R.
    """

    start: int
    own: float
    waited: float
    busy: float | None
    runs: bool


class TimeLimit:
    """Watches the time of a command that leads a session.

    It counts every process of the session and their children in other sessions; one that was seen stays counted wherever it goes.

    Parameters
    ----------
    pid : int
        The leader.
    limit : float
        Seconds of CPU time, and of idle time.

    Attributes
    ----------
    cpu : float
        CPU seconds used, of ended processes as well.
    idle : float
        Idle seconds, divided by the load.
    """

    def __init__(self, pid: int, limit: float) -> None:
        self._pid, self._limit = pid, limit
        self._began = self._looked = time.monotonic()
        self._next = self._began + min(_LONGEST, max(_SHORTEST, limit / (os.cpu_count() or 1)))
        self._blind = not (_PROCESSES / "self" / "stat").exists()
        self._seen: dict[int, _ProcessSample] = {}
        self._own: dict[tuple[int, int], float] = {}
        self.cpu = self.idle = 0.0

    @property
    def due(self) -> float:
        """When to call `reached` again (`time.monotonic`)."""
        return self._began + self._limit if self._blind else self._next

    def reached(self) -> str:
        """Which limit is reached, with its numbers; ``""`` as long as none is."""
        now = time.monotonic()
        if now < self.due:
            return ""
        wall = f"{now - self._began:.3g} s of wall-clock time"
        if self._blind:
            return f"it ran for {wall}; CPU times are unknown, since there is no /proc"
        self._look(now)
        if self.cpu >= self._limit:
            return f"it used {self.cpu:.3g} s of CPU time, in {wall}"
        if self.idle >= self._limit:
            return f"it was idle for {self.idle:.3g} s (neither running nor waiting for a processor), of {wall}; CPU time {self.cpu:.3g} s"
        # What it can use at most until then: nothing is reached earlier.
        left = min((self._limit - self.cpu) / (os.cpu_count() or 1), self._limit - self.idle)
        self._next = now + min(_LONGEST, max(_SHORTEST, left))
        return ""

    def _look(self, now: float) -> None:
        found = _members(self._pid, self._seen)
        before = sum(self._own.values())
        self._own |= {(pid, each.start): each.own for pid, each in found.items()}
        used = sum(self._own.values())
        # Both are too low, never too high: the first misses children that ended between two looks, the second those that nobody waited for.
        self.cpu = max(self.cpu, used, sum(each.own + each.waited for each in found.values()))
        passed = min(now - self._looked, 2.0 * _LONGEST)  # more only if this process could not look
        busy = 0.0
        for pid, each in found.items():
            last = self._seen.get(pid)
            if each.busy is None:
                busy += passed if each.runs else 0.0
            else:
                known = last.busy or 0.0 if last is not None and last.start == each.start else 0.0
                busy += max(0.0, each.busy - known)  # ended threads take their time with them
        self.idle += max(0.0, passed - max(busy, used - before)) / machine_load()
        self._looked, self._seen = now, found


def _members(leader: int, known: dict[int, _ProcessSample]) -> dict[int, _ProcessSample]:
    """The processes that belong to a session: its own, those seen before, and their children; by number."""
    table: dict[int, tuple[int, _ProcessSample]] = {}
    members = set()
    for entry in os.listdir(_PROCESSES):
        if not entry.isdigit():
            continue
        pid = int(entry)
        with suppress(OSError, ValueError, IndexError):  # it has ended
            # After the name, which may hold spaces and brackets: state, parent, group, session; proc(5).
            words = _read(entry, "stat").rpartition(b")")[2].split()
            own, waited = (int(words[k]) + int(words[k + 1]) for k in (11, 13))
            seen = _ProcessSample(int(words[19]), own * _TICK, waited * _TICK, None, words[0] == b"R")
            table[pid] = int(words[1]), seen
            if int(words[3]) == leader or (pid in known and known[pid].start == seen.start):
                members.add(pid)
    grown = True
    while grown:
        more = {pid for pid, (parent, _) in table.items() if parent in members and pid not in members}
        members |= more
        grown = bool(more)
    return {pid: _with_busy(pid, table[pid][1]) for pid in members}


def _read(*names: str) -> bytes:
    """A file of /proc; paths and text layers of Python would take most of the time."""
    handle = os.open("/".join((str(_PROCESSES), *names)), os.O_RDONLY)
    try:
        return os.read(handle, 4096)
    finally:
        os.close(handle)


def _with_busy(pid: int, seen: _ProcessSample) -> _ProcessSample:
    """The same with its ``busy`` time, of all its threads."""
    busy = 0
    try:
        for task in os.listdir(_PROCESSES / str(pid) / "task"):
            words = _read(str(pid), "task", task, "schedstat").split()
            busy += int(words[0]) + int(words[1])  # ran, waited [ns]
    except (OSError, ValueError, IndexError):
        return seen
    return _ProcessSample(seen.start, seen.own, seen.waited, 1e-9 * busy, seen.runs)
