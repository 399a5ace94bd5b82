"""The roofline estimate of a benchmark page: what the DEM's step does, under the roofs that the same run measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.reports.draw_points import Dots, PointChart
from ninedisk.reports.style import engine_looks
from ninedisk.reports.text import as_float

Row = Mapping[str, Any]

NEEDED = (
    "flops", "traffic", "working_set", "low_s", "bandwidth", "bandwidth_cached", "bandwidth_memory", "flop_rate",
    "flop_rate_single", "root_rate",
)  # fmt: skip
BINDS = 0.7
"""Of a roof: from there on it is said to bind, as it leaves less than a third of the time to everything else."""
GIGA = 1e9


@dataclass(frozen=True)
class Estimate:
    """One problem under its roofs; rates are those of its fastest repeat, as roofs are what probes reach at best.

    Attributes
    ----------
    problem : str
    flops, traffic : float
        Operations on floats and bytes of a particle-step.
    rate : float
        Particle-steps per second.
    of_bandwidth, of_vectors, of_single : float
        Parts of the bandwidth for this working set, and of the rates of multiply-adds on vectors and one by one.
    of_roots : float
        Part of the time that one root and one division for each listed pair, those with walls among them, take alone.
    row : mapping
        Where all this comes from.
    """

    problem: str
    flops: float
    traffic: float
    rate: float
    of_bandwidth: float
    of_vectors: float
    of_single: float
    of_roots: float
    row: Row

    @property
    def intensity(self) -> float:
        """Operations per byte."""
        return self.flops / self.traffic

    @property
    def bound(self) -> str:
        """What binds, in words: of arithmetic the roof of vectors, in which the kernels take what their loops allow."""
        if self.of_bandwidth >= BINDS:
            return "bandwidth"
        return "arithmetic" if self.of_vectors >= BINDS else "neither"


def estimates(rows: Sequence[Row]) -> list[Estimate]:
    """Estimates of the rows that carry one, smallest problem first."""
    able = [row for row in rows if all(as_float(row.get(name)) > 0.0 for name in NEEDED)]
    return [_estimate(row) for row in sorted(able, key=lambda row: int(row["disks"]))]


def _estimate(row: Row) -> Estimate:
    rate = row["disks"] * row["steps"] / row["low_s"]
    return Estimate(
        problem=row["problem"],
        flops=row["flops"],
        traffic=row["traffic"],
        rate=rate,
        of_bandwidth=rate * row["traffic"] / row["bandwidth"],
        of_vectors=rate * row["flops"] / row["flop_rate"],
        of_single=rate * row["flops"] / row["flop_rate_single"],
        of_roots=rate * row["listed_pairs"] / row["disks"] / row["root_rate"],
        row=row,
    )


def roofline_chart(found: Sequence[Estimate]) -> PointChart | None:
    """Rate of operations over operations per byte: roofs as lines, problems as dots, the roof of each one's working set above it."""
    if not found:
        return None
    looks = engine_looks({each.problem: each.problem for each in found})
    dots = [
        Dots(each.problem, looks[each.problem], (each.intensity,), (each.rate * each.flops / GIGA,), joined=False)
        for each in found
    ]
    # Roofs differ little between the problems of one run: the highest of each is what the machine can do.
    top, single, cached, memory = (
        max(each.row[name] for each in found) / GIGA
        for name in ("flop_rate", "flop_rate_single", "bandwidth_cached", "bandwidth_memory")
    )
    middle = [each.intensity for each in found]
    left = min(min(middle), single / cached) / 4.0
    right = 4.0 * max(*middle, top / memory)
    low = min(*(dot.y[0] for dot in dots), left * memory) / 2.0
    roofs = [
        (f"L2 cache {cached:.3g} GB/s", (left, top / cached), (left * cached, top)),
        (f"memory {memory:.3g} GB/s", (left, top / memory), (left * memory, top)),
        (f"multiply-adds, vectors: {top:.3g} Gflop/s", (top / cached, right), (top, top)),
        (f"one by one: {single:.3g} Gflop/s", (single / cached, right), (single, single)),
    ]
    own = [
        ("", (each.intensity,) * 2, (dot.y[0], min(top, each.intensity * each.row["bandwidth"] / GIGA)))
        for each, dot in zip(found, dots, strict=True)
    ]
    return PointChart(
        "roofline: the DEM's step, one thread",
        "operations per byte",
        "Gflop/s",
        tuple(dots),
        guides=(*roofs, *own),
        limits=((left, right), (low, 2.0 * top)),
        labels_along=True,
        decades=True,
    )
