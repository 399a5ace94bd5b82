"""What compression and distortion share: the nine disks, the four walls, the parameters of their contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, LeverArm, Scene, Wall, WallSegment, WallVelocityAt
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Parameter
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import CONTACT_DYNAMICS, REGIME, THETA

RADIUS, DENSITY, SIDE = 50.0, 1000.0, 300.0
"""Radius [m], density [kg/m^2] per unit thickness, side of the box [m] (appendix A.1)."""

MASS = DENSITY * math.pi * RADIUS**2

LEFT, RIGHT, BOTTOM, TOP = 9, 10, 11, 12
"""Body numbers of the walls; disks are numbered 0..8 row by row from the lower left."""

CENTRE = 4


ARMS: dict[str, tuple[LeverArm, LeverArm, WallVelocityAt]] = {
    "radius": ("radius", "radius", "surface"),
    "overlap": ("overlap", "overlap", "mid-overlap"),
    "overlap-disks": ("overlap", "radius", "surface"),
    "torque-overlap-disks": ("torque-overlap", "radius", "surface"),
}
"""Conventions of the shear torque: lever arm of disk-disk contacts, of disk-wall contacts, and the point at which a wall's
velocity enters the slip. "radius" is Cundall & Strack's, "overlap" that of contacts whose point lies in the middle of the
overlap, "overlap-disks" takes that point between disks and the wall's surface at walls; "torque-overlap-disks" does so for the torque
alone, slip between disks having the arm R (LAMMPS ``granular``)."""

LEVER_ARM = Parameter(
    name="lever_arm",
    default="radius",
    choices=tuple(ARMS),
    help="arm of the shear torque: R everywhere, R - overlap/2 everywhere, between disks only, or between disks for the torque only",
)

DAMPING_FORM = Parameter(
    name="damping_form",
    default="central",
    choices=("central", "lagged"),
    help="velocity that global damping sees: at t_n to second order, or v_{n-1/2}",
)

SLIP_AT = Parameter(
    name="slip_at",
    default="middle",
    choices=("middle", "end"),
    help="where in a step its slip is measured: in the middle, or with the normal of its end as Cundall & Strack do",
)

NINE_DISK_CD = (
    replace(
        THETA,
        default=0.5,
        help="parameter of the theta scheme; elastic contacts are dissipative at every theta, 1/2 the least",
    ),
    REGIME,
    *(parameter for parameter in CONTACT_DYNAMICS if parameter.name != "impact"),
)
"""Settings of contact dynamics, whose contacts are elastic here: no impact law."""


@dataclass(frozen=True)
class LoadCase:
    """One row of Table A.1.

    Attributes
    ----------
    kn : float
        Contact stiffness [N/m].
    dt : float
        Step [s].
    load_cycles : int
        Cycles during which the walls move.
    v_wall : float
        Speed of each wall [m/s].
    """

    kn: float
    dt: float
    load_cycles: int
    v_wall: float


LOAD_CASES = {
    "a1": LoadCase(1.35e9, 0.01525, 40, 0.12),
    "a2": LoadCase(1.35e9, 0.01525, 120, 0.04),
    "b1": LoadCase(1.5e8, 0.04576, 40, 0.36),
    "b2": LoadCase(1.5e8, 0.04576, 120, 0.12),
}


def cd_settings(params: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of `Numerics` that `NINE_DISK_CD` sets."""
    return {name: params[name] for name in ("theta", "regime", "sliding", "solver")}


def friction(params: Mapping[str, Any]) -> tuple[float, float]:
    """Friction coefficients (disk-disk, disk-wall); ``wall_mu = "mu"`` represents the disks' own."""
    mu = math.tan(math.radians(params["phi_deg"]))
    return mu, mu if params["wall_mu"] == "mu" else float(params["wall_mu"])


def contact_laws(params: Mapping[str, Any], kn: float) -> tuple[ContactLaw, ContactLaw]:
    """Laws of disk-disk and disk-wall contacts."""
    mu, wall_mu = friction(params)
    ks = kn * params["ks_over_kn"]
    disk_arm, wall_arm, velocity_at = ARMS[params["lever_arm"]]
    slip_at = params["slip_at"]
    disk = ContactLaw(kn=kn, ks=ks, mu=mu, lever_arm=disk_arm, slip_at=slip_at)
    wall = ContactLaw(kn=kn, ks=ks, mu=wall_mu, lever_arm=wall_arm, wall_velocity_at=velocity_at, slip_at=slip_at)
    return disk, wall


def nine_disks(
    disk_law: ContactLaw, wall_law: ContactLaw, motions: Mapping[str, tuple[WallSegment, ...]], xi: float
) -> Scene:
    """Nine touching disks, simple cubic, in a box whose walls move as given (keys left, right, bottom, top)."""
    places = {
        "left": ((0.0, 0.0), (1.0, 0.0)),
        "right": ((SIDE, 0.0), (-1.0, 0.0)),
        "bottom": ((0.0, 0.0), (0.0, 1.0)),
        "top": ((0.0, SIDE), (0.0, -1.0)),
    }
    centres = [[RADIUS * (1 + 2 * column), RADIUS * (1 + 2 * row)] for row in range(3) for column in range(3)]
    walls = tuple(
        Wall(name=name, point=point, normal=normal, law=wall_law, motion=motions[name])
        for name, (point, normal) in places.items()
    )
    return Scene(disks=Disks(x=centres, radius=RADIUS, mass=MASS), disk_disk=disk_law, walls=walls, xi=xi)  # type: ignore[arg-type]


def shear_growth(history: History, engine: EngineInfo, law: ContactLaw) -> float:
    """Relative growth of shear forces in an engine that turns them to first order: half the sum of the squared rotations.

    Rotations are those of the contacts between disks, which have the given law, from sample to sample; the worst contact
    counts.
    """
    if engine.turns_shear == "exactly" or LEVER_ARMS[law.lever_arm] in engine.turns_exactly_with:
        return 0.0
    worst = 0.0
    for i in range(9):
        for j in (i + 1, i + 3):
            if j < 9 and (j != i + 1 or j % 3):
                d = history.x[:, j] - history.x[:, i]
                worst = max(worst, 0.5 * float((np.diff(np.arctan2(d[:, 1], d[:, 0])) ** 2).sum()))
    return worst
