"""What the source claims of a case, and what the rules that decide it have in common.

A rule takes the finished cells of one engine on the claim's case and returns whether they confirm it, with the
evidence; it raises `UndecidedError` where they cannot decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ninedisk.harness.api.case import Case
    from ninedisk.harness.results.schema import Row
    from ninedisk.harness.results.tables import CaseResult

Verdict = tuple[bool, str]
Cells = Sequence["CaseResult"]

NO_DILATION = 1e-9
"""Gap [m] up to which a sliding block of size 1 m has not dilated: round-off of the positions."""


class UndecidedError(Exception):
    """The cells at hand cannot decide the claim; the message says why.

    Examples
    --------
    >>> by_value([], "mu")
    []
    >>> published([], ["fn"])
    Traceback (most recent call last):
    ninedisk.harness.api.claims.UndecidedError: no variant of this run has the published values
    """


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a case's source, to be confirmed or contradicted by every engine.

    Parameters
    ----------
    id, place, text : str
        Name, place in the source and the source's own words.
    decided_by : str
        What is measured and compared, in words.
    rule : callable
        The same as code: from the cells of one engine to whether they confirm the claim, and the evidence.
    derivation : tuple of str
        Paragraphs: why measurements differ from the claim, where they are known to.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> claim = Claim(
    ...     id="energy-falls", place="p. 12", text="energy never grows", decided_by="largest change of the energy",
    ...     rule=lambda cells: (all(cell.gain <= 0.0 for cell in cells), f"{len(cells)} cell"),
    ... )
    >>> claim.rule([SimpleNamespace(gain=-0.5)])
    (True, '1 cell')
    """

    id: str
    place: str
    text: str
    decided_by: str
    rule: Callable[[Cells], Verdict]
    derivation: tuple[str, ...] = ()


def claims_of(case: Case) -> tuple[Claim, ...]:
    """Return the claims that a case declares; none if it has no such attribute.

    Parameters
    ----------
    case : Case

    Returns
    -------
    tuple of Claim

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_case
    >>> [claim.id for claim in claims_of(get_case("sliding/quasistatic"))]
    ['quasistatic-dilates-once']
    """
    return tuple(getattr(case, "claims", ()))


def series(cell: CaseResult, quantity: str) -> NDArray[np.float64]:
    """Return a series of a cell, finite after its first sample.

    Parameters
    ----------
    cell : CaseResult
    quantity : str
        Name in `Observed.series`.

    Returns
    -------
    ndarray, shape (s,)
        In the unit of the quantity.

    Raises
    ------
    UndecidedError
        If the case or the engine does not observe it.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from ninedisk.harness.api.case import Observed
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> fallen = Observed(step=np.arange(3), t=t, series={"y": ("m", -5.0 * t**2)}, scalars={"speed": ("m/s", 20.0)})
    >>> cell = SimpleNamespace(observed=fallen)
    >>> series(cell, "y").tolist()
    [-0.0, -5.0, -20.0]
    """
    assert cell.observed is not None
    if quantity not in cell.observed.series:
        raise UndecidedError(f"the case does not observe {quantity}")
    values = np.asarray(cell.observed.series[quantity][1])
    if not np.isfinite(values[1:]).all():
        raise UndecidedError(f"the engine does not observe {quantity}")
    return values


def scalar(cell: CaseResult, quantity: str) -> float:
    """Return a finite number of a cell.

    Parameters
    ----------
    cell : CaseResult
    quantity : str
        Name in `Observed.scalars`.

    Returns
    -------
    float
        In the unit of the quantity.

    Raises
    ------
    UndecidedError
        If the case or the engine does not observe it.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from ninedisk.harness.api.case import Observed
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> fallen = Observed(step=np.arange(3), t=t, series={"y": ("m", -5.0 * t**2)}, scalars={"speed": ("m/s", 20.0)})
    >>> cell = SimpleNamespace(observed=fallen)
    >>> scalar(cell, "speed")
    20.0
    """
    assert cell.observed is not None
    if quantity not in cell.observed.scalars:
        raise UndecidedError(f"the case does not observe {quantity}")
    value = cell.observed.scalars[quantity][1]
    if not math.isfinite(value):
        raise UndecidedError(f"the engine does not observe {quantity}")
    return value


def by_value(cells: Cells, varied: str) -> list[dict[Any, CaseResult]]:
    """Group cells that differ in one parameter only, by its value.

    Parameters
    ----------
    cells : sequence of CaseResult
    varied : str
        Name of the parameter.

    Returns
    -------
    list of dict from value to CaseResult

    Raises
    ------
    UndecidedError
        If the case has no such parameter.

    Examples
    --------
    Two steps with each of two friction coefficients:

    >>> from types import SimpleNamespace
    >>> cells = [SimpleNamespace(params={"mu": mu, "dt": dt}) for mu in (0.2, 0.4) for dt in (0.1, 0.01)]
    >>> [sorted(group) for group in by_value(cells, "dt")]
    [[0.01, 0.1], [0.01, 0.1]]
    """
    groups: dict[str, dict[Any, CaseResult]] = {}
    for cell in cells:
        params = cell.params
        if varied not in params:
            raise UndecidedError(f"the case has no parameter {varied!r}")
        rest = {name: value for name, value in params.items() if name != varied}
        groups.setdefault(repr(sorted(rest.items())), {})[params[varied]] = cell
    return list(groups.values())


def published(cells: Cells, quantities: Sequence[str], **wanted: Any) -> Verdict:
    """Decide whether the published values of some quantities are met in every variant that has them.

    A failed check contradicts. A known gap does not: another truth says there that this engine on this variant solves
    another problem than the source did (a spring that is not quite plastic, a gap that is no whole number of steps).

    Parameters
    ----------
    cells : sequence of CaseResult
    quantities : sequence of str
    **wanted
        Values of parameters; other variants are left out.

    Returns
    -------
    tuple of bool and str
        Whether the values are met, and the evidence.

    Raises
    ------
    UndecidedError
        If no variant has published values, or a known gap decides.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> row = {"truth": "published", "quantity": "fn", "status": "pass", "variant": "mu=0.4"}
    >>> cell = SimpleNamespace(params={"mu": 0.4}, rows=[{**row, "value": 9.5, "expected": 10.0, "abs_error": 0.5}])
    >>> published([cell], ["fn"], mu=0.4)
    (True, 'holds in 1 of 1 variants; largest error 5.0e-01 in mu=0.4: fn = 9.5 against 10')
    """
    found: dict[str, list[Row]] = {"fail": [], "known-gap": [], "pass": []}
    for cell in cells:
        if any(cell.params.get(name) != value for name, value in wanted.items()):
            continue
        for row in cell.rows:
            if (
                row["truth"] == "published"
                and row["quantity"] in quantities
                and row["status"] not in ("no-truth", "not-observed")
            ):
                status = str(row["status"])
                found[
                    "pass" if status == "gap-closed" else "known-gap" if status == "known-difference" else status
                ].append(row)
    every = [row for rows in found.values() for row in rows]
    if not every:
        raise UndecidedError("no variant of this run has the published values")
    variants = {row["variant"] for row in every}
    missed = {row["variant"] for row in found["fail"] + found["known-gap"]}
    worst = max(found["fail"] or found["known-gap"] or found["pass"], key=lambda row: row["abs_error"])
    text = (
        f"holds in {len(variants - missed)} of {len(variants)} variants; largest error {worst['abs_error']:.1e} in "
        f"{worst['variant']}: {worst['quantity']} = {worst['value']:.9g} against {worst['expected']:.9g}"
    )
    if found["known-gap"] and not found["fail"]:
        raise UndecidedError(f"{text}; {worst['reason']}")
    return not found["fail"], text


def associated(cells: Cells) -> list[CaseResult]:
    """Return the cells that do not slide by Coulomb's law: what the source states of dilation is about its own rule.

    Parameters
    ----------
    cells : sequence of CaseResult

    Returns
    -------
    list of CaseResult

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> cells = [SimpleNamespace(params={"sliding": rule}) for rule in ("associated", "coulomb")]
    >>> [cell.params["sliding"] for cell in associated(cells)]
    ['associated']
    """
    return [cell for cell in cells if cell.params.get("sliding", "associated") == "associated"]
