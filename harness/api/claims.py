"""What the source claims of a case, and what the rules that decide it have in common.

A rule takes the finished cells of one engine on the claim's case and returns whether they confirm it, with the
evidence; it raises `UndecidedError` where they cannot tell.
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
    """The cells at hand cannot decide the claim; the message says why."""


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
    """

    id: str
    place: str
    text: str
    decided_by: str
    rule: Callable[[Cells], Verdict]
    derivation: tuple[str, ...] = ()


def claims_of(case: Case) -> tuple[Claim, ...]:
    """The claims that a case declares; none where it has no such attribute."""
    return tuple(getattr(case, "claims", ()))


def series(cell: CaseResult, quantity: str) -> NDArray[np.float64]:
    """A series of a cell, finite after its first sample; raises `UndecidedError` where it is not."""
    assert cell.observed is not None
    if quantity not in cell.observed.series:
        raise UndecidedError(f"the case does not observe {quantity}")
    values = np.asarray(cell.observed.series[quantity][1])
    if not np.isfinite(values[1:]).all():
        raise UndecidedError(f"the engine does not observe {quantity}")
    return values


def scalar(cell: CaseResult, quantity: str) -> float:
    """A finite number of a cell; raises `UndecidedError` where it is none."""
    assert cell.observed is not None
    if quantity not in cell.observed.scalars:
        raise UndecidedError(f"the case does not observe {quantity}")
    value = cell.observed.scalars[quantity][1]
    if not math.isfinite(value):
        raise UndecidedError(f"the engine does not observe {quantity}")
    return value


def by_value(cells: Cells, varied: str) -> list[dict[Any, CaseResult]]:
    """Cells that differ in one parameter only, by its value."""
    groups: dict[str, dict[Any, CaseResult]] = {}
    for cell in cells:
        params = cell.params
        if varied not in params:
            raise UndecidedError(f"the case has no parameter {varied!r}")
        rest = {name: value for name, value in params.items() if name != varied}
        groups.setdefault(repr(sorted(rest.items())), {})[params[varied]] = cell
    return list(groups.values())


def published(cells: Cells, quantities: Sequence[str], **wanted: Any) -> Verdict:
    """Whether the published values of some quantities are met in every variant that has them.

    A failed check contradicts. A known gap does not: there another truth says that this engine on this variant solves
    something else than the source did (a spring that is not quite plastic, a gap that is no whole number of steps).
    """
    found: dict[str, list[Row]] = {"fail": [], "known-gap": [], "pass": []}
    for cell in cells:
        if any(cell.params.get(name) != value for name, value in wanted.items()):
            continue
        for row in cell.rows:
            if row["truth"] == "published" and row["quantity"] in quantities and row["status"] != "no-truth":
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
    """Cells that are not told to slide by Coulomb's law: the source's statements on dilation are about its own rule."""
    return [cell for cell in cells if cell.params.get("sliding", "associated") == "associated"]
