"""Kernels of the area that two outlines have in common, contact by contact, by Green's theorem on its arcs.

The area between an arc and its chord is the integral of ``(r x dr)/2`` along the arc with r measured from the chord's end: the chord
itself contributes nothing, and no area of the outline's own size is subtracted.
"""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, tangent_at
from ninedisk.core.nurbs.lens_kernels import piece_from

NODES = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
"""Positive half of the 8 Gauss nodes on a piece, which turns by 0.6 rad at most: they leave round-off (`test_area`)."""

GAUSS_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)


@inline_kernel
def segment_area(table: ShapeTable, shape: int, start: float, end: float) -> float:
    """Area [m^2] between the arc that runs forward between two places (span + u + 1/2) and its chord."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    ring = table.first_span[shape + 1] - table.first_span[shape]
    start, end = start if start < ring else start - ring, end if end < ring else end - ring
    i0, i1 = int(start), int(end)
    u0, u1 = start - i0 - 0.5, end - i1 - 0.5
    first, last = table.first_piece[shape], table.first_piece[shape + 1] - 1
    fx, fy, _, _ = tangent_at(table, shape, i0, u0, still)
    k, low, whole_turn, area = piece_from(table, shape, i0, u0), u0, end < start, 0.0
    for _ in range(last - first + 2):
        span, high = table.piece_span[k], table.piece_range[k, 1]
        ends_here = span == i1 and u1 <= high and not whole_turn
        if ends_here:
            high = u1
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        for m in range(8):
            node = NODES[m // 2] if m % 2 == 0 else -NODES[m // 2]
            x, y, dx, dy = tangent_at(table, shape, span, middle + half * node, still)
            area += 0.5 * half * GAUSS_WEIGHTS[m // 2] * ((x - fx) * dy - (y - fy) * dx)
        if ends_here:
            break
        k += 1
        if k > last:
            k, whole_turn = first, False
        low = table.piece_range[k, 0]
    return area
