"""What this machine can do at best, measured by small kernels: the roofs under which a rate is seen (roofline model).

Source: Williams, Waterman & Patterson, Communications of the ACM 52 (4) (2009) 65-76. All on one thread, float64, compiled like the
kernels of the core; the best of many short runs counts, as a roof is what cannot be surpassed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_kernel

FloatArray = NDArray[np.float64]

SECONDS, SECONDS_MEMORY = 0.04, 0.2
"""For one probe, and for the one of the main memory, which neighbours on the machine disturb most."""
SHORTEST = 1e-3
"""Of one run of a probe [s]: far above the clock's resolution and the cost of a call."""
LEVEL_2, LAST_LEVEL = 1 << 20, 32 << 20
"""Bytes of the second and of the last cache where the system does not tell."""
SMALLEST, LARGEST = 64 << 20, 512 << 20
"""Limits of the arrays of the probe of the main memory, which is given four times the last cache [bytes]."""
CHAIN, CHAINS = 16, 8
"""Multiply-adds on one element of `multiply_add`; independent ones in `multiply_add_single`: two units, four cycles each."""


@dataclass(frozen=True)
class Roofs:
    """Rates of one core.

    Attributes
    ----------
    bandwidth : float
        Of a triad whose arrays are as large as the working set in question [B/s].
    bandwidth_cached, bandwidth_memory : float
        Of one whose arrays lie within the second-level cache, and far beyond all caches [B/s].
    flop_rate, flop_rate_single : float
        Fused multiply-adds, two operations each, on vectors as wide as the compiler makes them, and one by one [1/s].
    root_rate : float
        A root and a division by it, on vectors [1/s].
    """

    bandwidth: float
    bandwidth_cached: float
    bandwidth_memory: float
    flop_rate: float
    flop_rate_single: float
    root_rate: float


@fused_kernel
def triad(a: FloatArray, b: FloatArray, factor: float, rounds: int) -> None:
    """``a += factor b``: reads two arrays and writes one, which it has read, so that no line is loaded in order to be overwritten."""
    for _ in range(rounds):
        for i in range(a.shape[0]):
            a[i] = a[i] + factor * b[i]


@fused_kernel
def multiply_add(a: FloatArray, factor: float, term: float, rounds: int) -> None:
    """`CHAIN` multiply-adds on each element."""
    for _ in range(rounds):
        for i in range(a.shape[0]):
            x = a[i]
            for _ in range(CHAIN):
                x = x * factor + term
            a[i] = x


@fused_kernel
def multiply_add_single(a: FloatArray, factor: float, term: float, rounds: int) -> None:
    """`CHAINS` independent multiply-adds, again and again, each on one number."""
    p, q, r, s, t, u, v, w = a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]
    for _ in range(rounds):
        p = p * factor + term
        q = q * factor + term
        r = r * factor + term
        s = s * factor + term
        t = t * factor + term
        u = u * factor + term
        v = v * factor + term
        w = w * factor + term
    a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7] = p, q, r, s, t, u, v, w


@fused_kernel
def roots(a: FloatArray, term: float, rounds: int) -> None:
    """``a = term + 1/sqrt(a)``, again and again: each round needs the one before, and the numbers stay away from 0."""
    for _ in range(rounds):
        for i in range(a.shape[0]):
            a[i] = term + 1.0 / sqrt(a[i])


def measure(working_set: float) -> Roofs:
    """Roofs for a working set [bytes], on the core that this process is on."""
    return Roofs(bandwidth_of(working_set), *_general())


def bandwidth_of(size: float, seconds: float = SECONDS) -> float:
    """Bytes per second of a triad whose two arrays have ``size`` bytes together."""
    n = max(64, int(size) // 16)
    a, b = np.zeros(n), np.ones(n)
    return best(partial(triad, a, b, 1e-9), 24.0 * n, seconds)


@lru_cache(maxsize=1)
def _general() -> tuple[float, float, float, float, float]:
    """All but the first of `Roofs`, once for a run of the benchmark."""
    second, last = cache_sizes()
    small = np.ones(512)
    beyond = min(max(4 * last, SMALLEST), LARGEST)
    return (
        bandwidth_of(0.5 * second),
        bandwidth_of(beyond, SECONDS_MEMORY),
        best(partial(multiply_add, small, 0.5, 1.0), 2.0 * CHAIN * len(small)),
        best(partial(multiply_add_single, small, 0.5, 1.0), 2.0 * CHAINS),
        best(partial(roots, small, 1.0), float(len(small))),
    )


def best(run: Callable[[int], object], work: float, seconds: float = SECONDS) -> float:
    """Largest rate at which ``run(rounds)``, which does ``rounds`` times ``work``, did it in repeats of `SHORTEST` or more."""
    run(1)  # compiled or loaded, arrays touched
    rounds, spent = 1, 0.0
    while (taken := _time(run, rounds)) < SHORTEST:
        rounds *= 2
    rate = work * rounds / taken
    while spent < seconds:
        taken = _time(run, rounds)
        spent += taken
        rate = max(rate, work * rounds / taken)
    return rate


def _time(run: Callable[[int], object], rounds: int) -> float:
    begin = time.perf_counter()
    run(rounds)
    return time.perf_counter() - begin


def cache_sizes(folder: Path = Path("/sys/devices/system/cpu/cpu0/cache")) -> tuple[int, int]:
    """Bytes of the second-level and of the last cache, as the system tells them."""
    found: dict[int, int] = {}
    for each in sorted(folder.glob("index*")):
        try:
            level, size = int((each / "level").read_text()), (each / "size").read_text().strip()
            found[level] = int(size.rstrip("KMG")) * {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}.get(size[-1], 1)
        except (OSError, ValueError, IndexError):
            continue
    second = found.get(2, LEVEL_2)
    return second, max([second, *found.values()]) if len(found) > 1 else max(second, LAST_LEVEL)
