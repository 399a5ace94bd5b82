"""Disks given as outlines, and what overlaps are by the formula of disks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import Scene
from ninedisk.harness.case import Parameter, Setup

SHAPE = Parameter(
    name="shape",
    default="disk",
    choices=("disk", "nurbs"),
    help="the disks themselves, or NURBS outlines that are exactly their circles, each turned by an angle of its own",
)

TURN = 2.4
"""Angle [rad] between the outlines of one disk and the next, near the golden one: no two contacts meet the curves' seams alike."""


def as_outlines(scene: Scene) -> Scene:
    """The scene with every disk given as an outline, an exact circle of four rational arcs."""
    from ninedisk.core.geometry.nurbs_shapes import disk

    radii, number = np.unique(scene.disks.radius, return_inverse=True)
    angle = TURN * np.arange(len(scene.disks))
    return scene.replace(
        disks=replace(scene.disks, outline=number, angle=angle), outlines=tuple(disk(float(radius)) for radius in radii)
    )


def as_disks(setup: Setup) -> Setup:
    """The set-up with the circles around its grains in place of the outlines."""
    disks = replace(setup.scene.disks, outline=-1, angle=0.0)
    return replace(setup, scene=setup.scene.replace(disks=disks, outlines=()))


def overlap_error(setup: Setup, history: History) -> float:
    """Largest difference [m] of the watched gaps from those of disks: equation (2.5), and the same for walls; NaN if not observed."""
    radius, n, worst = setup.scene.disks.radius, len(setup.scene.disks), 0.0
    for column, (i, j) in enumerate(history.pairs):
        if j < n:
            gap = np.hypot(*(history.x[:, j] - history.x[:, i]).T) - radius[i] - radius[j]
        else:
            angle = history.wall_angle[:, j - n]
            normal = np.column_stack([np.cos(angle), np.sin(angle)])
            gap = ((history.x[:, i] - history.wall_point[:, j - n]) * normal).sum(axis=1) - radius[i]
        worst = float(np.maximum(worst, np.abs(history.gap[:, column] - gap).max()))
    return worst
