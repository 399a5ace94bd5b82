"""How much memory a cell's engine may take, and how much a process has.

Resident memory is watched, not address space limited (RLIMIT_AS): JavaScript and Java reserve far more than they ever use. It is read
from /proc; without that nothing is limited.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from math import inf
from pathlib import Path

from ninedisk.harness.api.errors import UsageError

VARIABLE = "NINEDISK_MEMORY_LIMIT"
LEAST = 2 << 30
"""Bytes below which the default never goes: kernels that compile and histories of long runs take a good part of that."""

_UNITS = {"KB": 10**3, "MB": 10**6, "GB": 10**9, "KIB": 1 << 10, "MIB": 1 << 20, "GIB": 1 << 30}
_SIZE = re.compile(r"([0-9.]+)\s*([kmg]i?b)", re.IGNORECASE)
_PROCESSES = Path("/proc")


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
        with suppress(OSError, ValueError):  # none of its own: "max", or no such file
            whole = min(whole, float(Path(path).read_text()))
    return max(float(LEAST), 0.5 * whole / min(max(1, jobs), 10**9))


def memory_limit() -> float:
    """Bytes that a cell's engine may hold: the environment variable ``NINEDISK_MEMORY_LIMIT`` if it is set, else `default_limit`.

    Raises
    ------
    UsageError
        If the variable is no size.
    """
    text = os.environ.get(VARIABLE)
    return read_size(text, f"{VARIABLE} =") if text else default_limit()


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


def too_much(held: float, limit: float) -> str:
    """What is told of an engine that was stopped."""
    return (
        f"was stopped because it held {held / 1e9:.3g} GB of memory, more than the limit of {limit / 1e9:.3g} GB "
        f"(ninedisk run --memory-limit, or {VARIABLE}, allow more)"
    )
