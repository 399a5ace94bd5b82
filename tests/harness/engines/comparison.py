"""What tests of engines with contact springs share: variants with the engines' conventions, comparison with the in-house DEM."""

from __future__ import annotations

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case

ROUND_OFF = 1e-10
"""Of the largest force: it is kn times a difference of positions near 300 m (ulp 5.7e-14 m) over overlaps of some 0.04 m,
1.5e-12 in each evaluation; some hundred cycles add up to less than a hundred of them."""


def variant(case_id: str, **params: object) -> Setup:
    """A variant whose slip is measured at the end of a step, as engines do, where the case has a word for it."""
    case = get_case(case_id)
    if any(parameter.name == "slip_at" for parameter in case.parameters):
        params = {"slip_at": "end", **params}
    return case.build(resolve(case, params).params)


def worst(one: np.ndarray, two: np.ndarray, scale: float | None = None) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / (np.abs(two).max() if scale is None else scale))


def assert_same(engine: History, core: History, tolerance: float, *, without: tuple[str, ...] = ()) -> None:
    """All observed quantities agree, each relative to the largest value of its kind in the history."""
    force = float(np.abs(core.fn).max())
    scales = {"gap": float(np.abs(core.gap).max()), "fn": force, "fs": force, "wall_force": force}
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        one, two = getattr(engine, name), getattr(core, name)
        assert one.shape == two.shape
        if name not in without and two.size and np.abs(two).max() > 0.0:
            assert worst(one, two, scales.get(name)) <= tolerance, name
    total = max(float(np.abs(core.energy[key]).max()) for key in ("kinetic", "elastic", "gravity"))
    for name in ("kinetic", "elastic", "gravity"):
        assert worst(engine.energy[name], core.energy[name], total) <= 4.0 * tolerance, name
