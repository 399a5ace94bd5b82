"""Kernel that keeps the features of a pair: each once, and those within reach."""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.state import FULL, FeatureRows

DEEPEST = 0.05
"""Overlap over the smaller radius up to which a contact is followed; it leaves the far sides of both bodies alone."""

SAME = 1e-6
"""Distance over the smaller radius up to which two features are one; the gaps of such neighbours differ by the square of it."""

CONVERGED = 1e-9
"""Step of Newton's method in ``u`` after which the next one is below rounding."""

AT_END = 1e-9
"""Range of ``u`` beyond a piece that still counts as the piece: rounding must not lose what lies on the border of two."""


@inline_kernel
def added(
    out: FeatureRows,
    row: int,
    n: int,
    size: float,
    reach: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    nx: float,
    ny: float,
    gap: float,
    place_a: float,
    place_b: float,
) -> int:
    """Number of features of a pair after one more, unless it is out of range or known; those of the pair begin at ``row``.

    Points are in the frame in which the pair is computed. `FULL` where there is no room.
    """
    if not -DEEPEST * size < gap < reach:
        return n
    same = SAME * size
    k = row + n
    for other in range(row, row + n):
        if (
            abs(out.first[other, 0] - ax) + abs(out.first[other, 1] - ay) <= same
            and abs(out.second[other, 0] - bx) + abs(out.second[other, 1] - by) <= same
        ):
            if gap >= out.gap[other]:
                return n
            k, n = other, n - 1
            break
    if k >= out.gap.shape[0]:
        return FULL
    out.first[k, 0], out.first[k, 1], out.second[k, 0], out.second[k, 1] = ax, ay, bx, by
    out.normal[k, 0], out.normal[k, 1], out.gap[k] = nx, ny, gap
    out.place[k, 0], out.place[k, 1] = place_a, place_b
    return n + 1
