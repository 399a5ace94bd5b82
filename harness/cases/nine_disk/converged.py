"""Checks against the converged tables: the fine-step limit, with the error that the scheme's own step explains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import Check, FloatArray, Observed
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.matched import slip_of

if TYPE_CHECKING:
    from ninedisk.references.converged_tables import ConvergedCurve

MARGIN = 2.0
"""Factor on the measured step error: it comes from one pair of steps, and friction makes the order wander around 2."""


class FirstOrder(NamedTuple):
    """Error of a scheme of first order: of forces [N] and of places [m], and why.

    No force is off by more than ``lag`` of its largest value: half a step at the oscillation's rate, ``omega dt/2``.
    """

    force: float
    length: float
    lag: float
    why: str


class Limit:
    """The fine-step limit of a variant at the sampled steps, for headlines."""

    def __init__(self, table: ConvergedCurve, observed: Observed) -> None:
        self._table, self._observed = table, observed
        names = ", ".join(f"{name}: {size:.1g}" for name, size in table.uncertainty.items())
        self.source = f"fine-step limit of the in-house DEM, uncertain by (N) {names}"

    @classmethod
    def of(cls, case: str, params: Mapping[str, Any], observed: Observed) -> Limit | None:
        """None where no limit was computed for the variant."""
        from ninedisk.references.converged_tables import load_converged

        table = load_converged(case, params)
        return None if table is None else cls(table, observed)

    def series(self, name: str) -> FloatArray:
        """Values at the sampled steps, NaN where the table has none, shape (s,)."""
        return at_steps(self._table, name, self._observed)

    def number(self, name: str) -> float:
        """A single number of the table; NaN where it has none."""
        return self._table.scalars[name].value if name in self._table.scalars else math.nan


def at_steps(table: ConvergedCurve, name: str, observed: Observed) -> FloatArray:
    """Values of a table at the sampled steps, NaN where it has none, shape (s,)."""
    rows = {int(step): row for row, step in enumerate(table.step)}
    pick = np.array([rows.get(int(step), -1) for step in observed.step])
    return np.where(pick >= 0, table.quantities[name][pick], np.nan)


def converged_checks(
    case: str,
    params: Mapping[str, Any],
    observed: Observed,
    engine: EngineInfo,
    *,
    series: Sequence[str],
    scalars: Sequence[str],
    first_order: FirstOrder,
    other_arm: str = "",
    other_arm_rtol: float = 0.0,
    scales: Mapping[str, float] | None = None,
) -> list[Check]:
    """Checks of histories and numbers against the converged table of the variant, if there is one.

    Parameters
    ----------
    case, params
        Variant.
    observed : Observed
        For the sampled steps.
    engine : EngineInfo
        Central-difference engines are granted the step error that refinement measured with slip where they have it, others
        ``first_order``.
    series, scalars : sequence of str
        Quantities to check, where the table has them.
    first_order : FirstOrder
        Tolerance of schemes of another order.
    other_arm, other_arm_rtol : str, float
        Where the engine has another lever arm than the scene asks for: what that is, and the difference it explains.
    scales : mapping from str to float, optional
        What relative tolerances of these numbers refer to, where their own size depends on the origin of the coordinates.
    """
    from ninedisk.references.converged_tables import load_converged

    table = load_converged(case, params)
    if table is None:
        return []
    found = []
    for name in (*series, *scalars):
        number = name in scalars
        if name not in (table.scalars if number else table.quantities):
            continue
        if number:
            entry = table.scalars[name]
            expected: Any = entry.value
            uncertainty, scale = entry.uncertainty, (scales or {}).get(name, abs(entry.value))
        else:
            expected = at_steps(table, name, observed)
            uncertainty, scale = table.uncertainty[name], float(np.abs(table.quantities[name]).max())
        if other_arm:
            atol, why = other_arm_rtol * scale + uncertainty, other_arm
        elif engine.scheme == "central-difference":
            scheme = f"{params['damping_form']}_{slip_of(params['slip_at'], engine)}"
            measured = table.scalars[f"step_error_{scheme}_{name}"].value / params["substeps"]
            atol = MARGIN * measured + uncertainty
            why = (
                f"error of the tabulated step by refinement of the in-house DEM ({measured:.2g}), times {MARGIN:g}, plus the "
                f"uncertainty of the limit"
            )
        else:
            atol = (
                first_order.length if name.startswith(("x_", "y_")) else min(first_order.force, first_order.lag * scale)
            )
            atol += uncertainty
            why = first_order.why
        found.append(
            Check(
                quantity=name,
                norm="scalar" if number else "max",
                truth="converged",
                expected=expected,
                uncertainty=uncertainty,
                source=table.method,
                atol=atol,
                why=why,
            )
        )
    return found


def consensus_checks(
    observed: Observed, expected: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]], *, rtol: float, why: str
) -> list[Check]:
    """Cross-checks of another engine of the same scheme against the in-house DEM on the same scene."""
    return [
        Check(
            quantity=name,
            norm="max",
            truth="consensus",
            expected=values,
            source="in-house DEM, same scene, same conventions, same steps",
            rtol=rtol,
            why=why,
        )
        for name, values in expected.items()
        if name in observed.series
    ]
