"""Grains of cases: disks given as outlines, uniform grains in a scene, and what overlaps are by the formula of disks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import Disks, Scene
from ninedisk.harness.api.case import FloatArray, Parameter, Setup

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve
    from ninedisk.core.nurbs.mass import UniformGrain
SHAPE = Parameter(
    name="shape",
    default="disk",
    choices=("disk", "nurbs"),
    help="the disks themselves, or NURBS outlines that are exactly their circles, each turned by its own angle",
)

TURN = 2.4
"""Angle [rad] between the outlines of one disk and the next, near the golden one: no two contacts meet the curves' seams alike."""


def as_outlines(scene: Scene) -> Scene:
    """The scene with every disk given as an outline, an exact circle of four rational arcs."""
    from ninedisk.core.nurbs.shapes import disk

    radii, number = np.unique(scene.disks.radius, return_inverse=True)
    turned: dict[str, Any] = {"outline": number, "angle": TURN * np.arange(len(scene.disks))}
    return scene.replace(disks=replace(scene.disks, **turned), outlines=tuple(disk(float(radius)) for radius in radii))


@lru_cache(maxsize=64)
def uniform(density: float, shape: Callable[..., NurbsCurve], *sizes: float, **more: float) -> UniformGrain:
    """The uniform grain [kg/m^2] of an outline, made once: variants and engines ask for the same few, which take 0.1 s each."""
    from ninedisk.core.nurbs.mass import uniform_grain

    return uniform_grain(shape(*sizes, **more), density)


def as_disks(setup: Setup) -> Setup:
    """The set-up with the circles around its grains in place of the outlines."""
    plain: dict[str, Any] = {"outline": -1, "angle": 0.0}
    return replace(setup, scene=setup.scene.replace(disks=replace(setup.scene.disks, **plain), outlines=()))


def grains(kinds: Sequence[UniformGrain], number: Sequence[int], **state: Any) -> dict[str, Any]:
    """``disks`` and ``outlines`` of a `Scene` whose grain k is of the kind ``number[k]``; ``state`` goes to `Disks`."""
    each = [kinds[k] for k in number]
    given = {name: [getattr(kind, name) for kind in each] for name in ("radius", "mass", "inertia")}
    disks = Disks(**{**given, "outline": list(number), **state})
    return {"disks": disks, "outlines": tuple(kind.outline for kind in kinds)}


def disk_gap(setup: Setup, history: History, column: int) -> FloatArray:
    """Gap [m] of a watched pair of disks by equation (2.5), and the same between a disk and a wall."""
    radius, n = setup.scene.disks.radius, len(setup.scene.disks)
    i, j = history.pairs[column]
    if j < n:
        distance = np.hypot(*(history.x[:, j] - history.x[:, i]).T)
        return np.asarray(distance - radius[i] - radius[j], dtype=np.float64)
    angle = history.wall_angle[:, j - n]
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    height = ((history.x[:, i] - history.wall_point[:, j - n]) * normal).sum(axis=1)
    return np.asarray(height - radius[i], dtype=np.float64)


def overlap_error(setup: Setup, history: History) -> float:
    """Largest difference [m] of the watched gaps from those of disks; NaN where a gap is not observed."""
    columns = range(len(history.pairs))
    return float(np.max([np.abs(history.gap[:, c] - disk_gap(setup, history, c)).max() for c in columns]))
