"""The in-house engine, in two dimensions: DEM and contact dynamics of disks and NURBS grains between half-planes that move."""

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
    UnstableTimeStepError,
    UnwritableFileError,
)
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, Cell, ContactLaw, Disks, Rolling, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate

__all__ = [
    "BehindWallError",
    "BodyForce",
    "Cell",
    "ContactLaw",
    "CoreError",
    "Disks",
    "History",
    "InterruptedRunError",
    "InvalidNumericsError",
    "InvalidSceneError",
    "NoEquilibriumError",
    "NonFiniteStateError",
    "Numerics",
    "Rolling",
    "Scene",
    "SolverNotConvergedError",
    "UnstableTimeStepError",
    "UnwritableFileError",
    "Wall",
    "WallSegment",
    "simulate",
]
