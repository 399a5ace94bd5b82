"""The in-house engine: DEM and contact dynamics of disks and NURBS grains in the plane, DEM of spheres in space, between moving walls."""

from __future__ import annotations

from ninedisk.core.errors import (
    BehindWallError,
    CoreError,
    InterruptedRunError,
    InvalidNumericsError,
    InvalidSceneError,
    NoEquilibriumError,
    NonFiniteStateError,
    SolverNotConvergedError,
    TooFastError,
    UnstableTimeStepError,
    UnwritableFileError,
)
from ninedisk.core.history import History
from ninedisk.core.law import Elastic, SphereLaw, damping_ratio, moduli
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import (
    BodyForce,
    Cell,
    ContactLaw,
    Disks,
    PlaneSegment,
    PlaneWall,
    Rolling,
    Scene,
    Spheres,
    SphereScene,
    Wall,
    WallSegment,
)
from ninedisk.core.simulate import simulate

__all__ = [
    "BehindWallError",
    "BodyForce",
    "Cell",
    "ContactLaw",
    "CoreError",
    "Disks",
    "Elastic",
    "History",
    "InterruptedRunError",
    "InvalidNumericsError",
    "InvalidSceneError",
    "NoEquilibriumError",
    "NonFiniteStateError",
    "Numerics",
    "PlaneSegment",
    "PlaneWall",
    "Rolling",
    "Scene",
    "SolverNotConvergedError",
    "SphereLaw",
    "SphereScene",
    "Spheres",
    "TooFastError",
    "UnstableTimeStepError",
    "UnwritableFileError",
    "Wall",
    "WallSegment",
    "damping_ratio",
    "moduli",
    "simulate",
]
