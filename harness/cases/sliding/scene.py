"""What the two tests of the sliding rule share: a particle on a plane, its gap and its path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Observed, Setup

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
KN = 1e6
"""Stiffness [N/m] with which spring engines represent the rigid contact."""


def particle_on_plane(params: Mapping[str, Any], *, gap: float, velocity: float, held: bool, gravity: float) -> Scene:
    """A disk that cannot turn, ``gap`` above a plane, with a tangential velocity that is given or, if held, prescribed."""
    law = ContactLaw(kn=KN, ks=KN, mu=params["mu"], restitution=0.0, regularised=True)
    return Scene(
        disks=Disks(
            x=np.array([[0.0, RADIUS + gap]]),
            v=np.array([[velocity, 0.0]]),
            radius=np.array([RADIUS]),
            mass=np.array([MASS]),
            rotating=np.array([False]),
            held=np.array([[held, False]]),
        ),
        disk_disk=law,
        walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        gravity=(0.0, -gravity),
    )


def observe_particle(setup: Setup, history: History) -> Observed:
    """Way, gap and contact forces; rises ``du_y_1``, ``du_y_2`` of the first two steps; ``fs`` is positive against the motion."""
    x = history.x[:, 0, 0] - setup.scene.disks.x[0, 0]
    gap = history.gap[:, 0]
    series = {
        "x": ("m", x),
        "gap": ("m", gap),
        "fn": ("N", history.fn[:, 0]),
        "fs": ("N", -history.fs[:, 0]),
    }
    rise = np.diff(history.x[:, 0, 1])
    scalars = {f"du_y_{k + 1}": ("m", float(rise[k]) if k < len(rise) else math.nan) for k in (0, 1)}
    scalars["x_final"] = ("m", float(x[-1]))
    scalars["gap_final"] = ("m", float(gap[-1]))
    return Observed(step=history.step, t=history.t, series=series, scalars=scalars)
