"""Engine against engine: how far their histories of the same variants lie apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ninedisk.reports.curves import Curve, Series, differences


@dataclass(frozen=True)
class Difference:
    """Largest relative difference of two engines over all shared histories, and the history where it occurs."""

    size: float
    variant: str
    quantity: str


def difference_matrix(series: Series, case: str) -> tuple[list[str], dict[tuple[str, str], Difference]]:
    """Engines with histories of a case, the one that differs most first, and every pair that shares a history.

    A difference is ``max |a - b|`` over the common steps of one history, over the largest ``|truth|`` of the quantity in
    the whole case (of the values themselves where no truth speaks): in a variant where nothing should move, round-off
    is then no difference. Both orders of a pair are keys.
    """
    scale = _scales(series, case)
    held: dict[tuple[str, str], dict[str, Curve]] = {}
    for (name, variant, engine, quantity), curve in series.items():
        if name == case:
            held.setdefault((variant, quantity), {})[engine] = curve
    worst: dict[tuple[str, str], Difference] = {}
    for (variant, quantity), engines in held.items():
        for one, two in combinations(sorted(engines), 2):
            apart = differences(engines[one], engines[two], scale[quantity])
            known = worst.get((one, two))
            if not math.isnan(apart) and (known is None or apart > known.size):
                worst[one, two] = worst[two, one] = Difference(apart, variant, quantity)
    middle: dict[str, float] = {}
    for engine in sorted({engine for engines in held.values() for engine in engines}):
        sizes = sorted(found.size for (one, _), found in worst.items() if one == engine)
        if sizes:
            middle[engine] = sizes[len(sizes) // 2]
    return sorted(middle, key=lambda engine: -middle[engine]), worst


def _scales(series: Series, case: str) -> dict[str, float]:
    """Largest finite ``|truth|`` of each quantity of a case; of the values where there is none, or it is zero."""
    truth: dict[str, float] = {}
    value: dict[str, float] = {}
    for (name, _, _, quantity), curve in series.items():
        if name == case:
            truth[quantity] = max(truth.get(quantity, 0.0), curve.scale)
            finite = np.abs(curve.value[np.isfinite(curve.value)])
            value[quantity] = max(value.get(quantity, 0.0), float(finite.max(initial=0.0)))
    return {quantity: truth[quantity] or value[quantity] for quantity in truth}
