"""Outlines of grains: what a scene asks of them, and their JSON form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.scene.bodies import Disks
from ninedisk.core.validate import items_of

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve

CENTRED = 1e-9
"""Distance of the centroid from the frame's origin, over the largest distance of the outline, that counts as rounding: moving a curve
leaves 1e-16 of the distance by which it was moved."""

ENCLOSED = 1e-12
"""What an outline may stick out of its enclosing circle, over the radius: rounding of the curve's points."""


def check_outlines(outlines: Sequence[NurbsCurve], disks: Disks) -> tuple[NurbsCurve, ...]:
    """Return the outlines as a tuple, or `InvalidSceneError`: each centred, each inside the circles of the grains that have it."""
    given = items_of("outlines", outlines, "a sequence of NurbsCurve, () for none")
    most = int(disks.outline.max()) if len(disks) else -1
    if most >= len(given):
        i = int(np.argmax(disks.outline))
        known = f"outlines 0 .. {len(given) - 1}" if given else "no outlines"
        raise InvalidSceneError(
            f"disks.outline[{i}] = {most} is not allowed: the scene has {known}, and -1 stands for a disk"
        )
    if not given:
        return given
    # The curves' modules load Numba, which a scene of disks need not wait for.
    from ninedisk.core.nurbs.curve import NurbsCurve
    from ninedisk.core.nurbs.mass import area_moments, farthest

    for k, curve in enumerate(given):
        if not isinstance(curve, NurbsCurve):
            raise InvalidSceneError(f"outlines[{k}] is no NurbsCurve but {type(curve).__name__}")
        reach, centroid = farthest(curve), area_moments(curve).centroid
        if not float(np.hypot(*centroid)) <= CENTRED * reach:
            raise InvalidSceneError(
                f"outlines[{k}] has its centroid at ({centroid[0]:g}, {centroid[1]:g}) m; it must be the origin of the body's frame: "
                "shift it by ninedisk.core.nurbs.mass.centred"
            )
        mine = np.flatnonzero(disks.outline == k)
        small = mine[disks.radius[mine] < reach * (1.0 - ENCLOSED)]
        if len(small):
            i = int(small[0])
            raise InvalidSceneError(
                f"disks.radius[{i}] = {disks.radius[i]:.17g} is not allowed: outline {k} reaches {reach:.17g} m from its centroid, and the "
                "radius of a grain is that of a circle around it (ninedisk.core.nurbs.mass.uniform_grain gives the smallest)"
            )
    return given


def plain_outline(curve: NurbsCurve) -> dict[str, Any]:
    """Return an outline as JSON data."""
    return {
        "degree": curve.degree,
        "knots": curve.knots.tolist(),
        "points": curve.points.tolist(),
        "weights": curve.weights.tolist(),
    }


def outlines_from(data: Sequence[Mapping[str, Any]]) -> tuple[NurbsCurve, ...]:
    """Outlines from `plain_outline` data, the same to the last bit."""
    if not data:
        return ()
    from ninedisk.core.nurbs.curve import NurbsCurve

    return tuple(NurbsCurve(**curve) for curve in data)
