"""Engine against engine: how far their histories of the same variant lie apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

from ninedisk.reports.curves import Curve, Series, differences


@dataclass(frozen=True)
class PairDifference:
    """Two engines: by quantity the largest relative difference over all variants, and the variant where it occurs."""

    one: str
    two: str
    worst: dict[str, tuple[float, str]]
    each: tuple[tuple[str, str, float], ...]  # variant, quantity, difference: largest first


def engine_differences(series: Series, case: str) -> tuple[list[str], list[PairDifference]]:
    """Quantities, and every pair of engines that share a history, the farthest apart first.

    A difference is ``max |a - b| / max |value|`` over the common steps of one history.
    """
    held: dict[tuple[str, str], dict[str, Curve]] = {}
    for (name, variant, engine, quantity), curve in series.items():
        if name == case:
            held.setdefault((variant, quantity), {})[engine] = curve
    found: dict[tuple[str, str], list[tuple[str, str, float]]] = {}
    for (variant, quantity), engines in held.items():
        for one, two in combinations(sorted(engines), 2):
            apart = differences(engines[one], engines[two])
            if not math.isnan(apart):
                found.setdefault((one, two), []).append((variant, quantity, apart))
    pairs = []
    for (one, two), rows in found.items():
        worst: dict[str, tuple[float, str]] = {}
        for variant, quantity, apart in rows:
            if apart > worst.get(quantity, (-1.0, ""))[0]:
                worst[quantity] = (apart, variant)
        pairs.append(PairDifference(one, two, worst, tuple(sorted(rows, key=lambda row: -row[2]))))
    pairs.sort(key=lambda pair: -pair.each[0][2])
    return list(dict.fromkeys(quantity for _, quantity in held)), pairs
