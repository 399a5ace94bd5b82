"""Make the converged references of the nine-disk cases: the in-house DEM, its step halved until the limit is known.

Run after a change of the physics only, look at the differences, and say in the commit why they moved:

    python tools/make_converged.py
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from rich.progress import track

from ninedisk.core.simulate import simulate
from ninedisk.harness.api.case import Case, Observed
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import CASE as COMPRESSION
from ninedisk.harness.cases.nine_disk.distortion import CASE as DISTORTION
from ninedisk.references.converged_tables import ConvergedCurve, ConvergedScalar
from ninedisk.references.converged_writer import write_converged

FINE = 128
"""Contact steps a cycle of the finest run; the one of half as many gives the uncertainty."""

EVERY = 5
"""Thinning of the stored histories (cycles)."""

METHOD = (
    f"in-house DEM with {FINE} contact steps a cycle; uncertainty: largest difference from {FINE // 2} contact steps a cycle "
    "(contacts that begin or cease to slide limit the order to one in the end, so the last difference bounds what is left)"
)

CONTACT_DYNAMICS = ("theta", "regime", "sliding", "solver")
IGNORED = {
    "nine-disk/compression": ("substeps", "cycles", "lever_arm", "damping_form", "slip_at", "shape", *CONTACT_DYNAMICS),
    "nine-disk/distortion": ("substeps", "damping_form", "slip_at", "shape", *CONTACT_DYNAMICS),
}


def run(case: Case, params: Mapping[str, Any], **changes: Any) -> Observed:
    """Observed quantities of one run of the in-house DEM."""
    changed = {**params, **changes}
    setup = case.build(changed)
    return case.observe(changed, setup, simulate(setup.scene, setup.numerics, setup.watch))


def difference(a: Observed, b: Observed) -> dict[str, float]:
    """Largest difference of every quantity of two runs; infinite where only one of them has a number."""
    found = {name: float(np.abs(a.series[name][1] - b.series[name][1]).max()) for name in a.series}
    for name in a.scalars:
        one, two = a.scalars[name][1], b.scalars[name][1]
        found[name] = 0.0 if one == two else abs(one - two)
    return found


def converge(case: Case, params: Mapping[str, Any]) -> ConvergedCurve:
    """Converged curve of one variant."""
    fine, finer = run(case, params, substeps=FINE // 2), run(case, params, substeps=FINE)
    left = difference(fine, finer)
    scalars = {
        name: ConvergedScalar(value=value, unit=unit, uncertainty=left[name])
        for name, (unit, value) in finer.scalars.items()
        if math.isfinite(value) and math.isfinite(left[name])
    }
    for form, slip_at in product(("central", "lagged"), ("middle", "end")):
        error = difference(run(case, params, damping_form=form, slip_at=slip_at), finer)
        units = {**finer.series, **finer.scalars}
        for name in (*finer.series, *scalars.copy()):
            if name in error:
                key = f"step_error_{form}_{slip_at}_{name}"
                scalars[key] = ConvergedScalar(value=error[name], unit=units[name][0], uncertainty=0.0)
    keep = np.flatnonzero(finer.step % EVERY == 0)
    return ConvergedCurve(
        case=case.id,
        params={key: value for key, value in params.items() if key not in IGNORED[case.id]},
        method=METHOD,
        step=finer.step[keep],
        t=finer.t[keep],
        quantities={name: values[keep] for name, (_, values) in finer.series.items()},
        units={name: unit for name, (unit, _) in finer.series.items()},
        uncertainty={name: left[name] for name in finer.series},
        scalars=scalars,
    )


def main() -> None:
    """Write every table."""
    work = [
        (case, resolve(case, overrides))
        for case in (COMPRESSION, DISTORTION)
        for overrides in case.matrix()
        if overrides.get("shape", "disk") == "disk"
        and overrides.get("regime", "dynamic") == "dynamic"
        and (case is DISTORTION or overrides.get("wall_mu") == "mu")
    ]
    for number, (case, variant) in enumerate(track(work, "refining"), start=1):
        file = f"{case.id.split('/')[1]}-{number:02d}.csv"
        write_converged(converge(case, variant.params), file=file, ignored=IGNORED[case.id])


if __name__ == "__main__":
    main()
