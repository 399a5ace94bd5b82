"""The source's claims of grains given as outlines: what is shown, what is claimed, and what decides a claim."""

from __future__ import annotations

from ninedisk.harness.api.claims import Cells, Claim, UndecidedError, Verdict, series

SAME_OVERLAP = 1e-12
"""Difference of overlaps [m] that is round-off on grains of 1 m some ten metres from the origin: hundreds of last places."""


def nurbs_overlap(cells: Cells) -> Verdict:
    """Overlaps of all pairs of circles given as NURBS outlines, against equation (2.5)."""
    circles = [cell for cell in cells if cell.params.get("shape") == "disk"]
    if not circles:
        raise UndecidedError("it takes the variant with disks")
    worst = max(float(series(cell, "gap_error").max()) for cell in circles)
    return worst <= SAME_OVERLAP, f"largest difference of an overlap from Ri + Rj - |xj - xi|: {worst:.1e} m"


OVERLAP_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="nurbs-overlap",
        place="A.1",
        text=(
            "A simple NURBS intersection-based contact approach is utilized so that the particle overlap "
            "is identical with that calculated using equation (2.5)."
        ),
        decided_by=(
            "Overlap of two disks given as NURBS curves against Ri + Rj - |xj - xi|: confirmed if they "
            "agree to round-off."
        ),
        rule=nurbs_overlap,
    ),
)
