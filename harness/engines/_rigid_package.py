"""Engines with rigid contacts that are Python packages: what they support, and their settings checked before they start."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.capabilities import Capability
from ninedisk.harness.engine import EngineRun, Support, SupportLevel
from ninedisk.harness.engines._options import Option, read_options
from ninedisk.harness.engines._package_engine import PackageEngine
from ninedisk.harness.engines._plane_geometry import wall_reach
from ninedisk.harness.engines._rigid import has_spring_preload, rigid_needs
from ninedisk.harness.engines._spring import laws_in_use

_SMALL = 1e-8
"""Factor of a disk whose pairs with disks have the coefficient 0 while walls have another: 1e-16 is left between disks."""

TOUCH_ULPS = 16.0
"""A gap is a sum of a few coordinates, each rounded to half a unit in the last place."""


class RigidPackageEngine(PackageEngine):
    """Adapter of such an engine; a subclass gives `id`, `info`, `session` and `options`."""

    options: Mapping[str, Option] = {}
    preload_note = "rigid contacts: the preload of the regularising springs is left out, disks start touching"

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """Rigid contacts only: a scene whose stiffness matters is refused."""
        need = set(rigid_needs(scene, numerics))
        if any(law.restitution for law in laws_in_use(scene)):
            need.add(Capability.RESTITUTION)
        missing = need - self.info().capabilities
        if missing:
            return Support(SupportLevel.NO, missing=tuple(sorted(missing)))
        refused = self.refusals(scene, numerics)
        if refused:
            return Support(SupportLevel.NO, notes=tuple(refused))
        notes = []
        if has_spring_preload(scene):
            notes.append(self.preload_note)
        if any(law.restitution is None for law in laws_in_use(scene)):
            notes.append("the scene prescribes no restitution: 0 is used")
        own = list(self.approximations(scene, numerics))
        level = SupportLevel.APPROXIMATE if own else SupportLevel.EQUIVALENT if notes else SupportLevel.EXACT
        return Support(level, notes=(*notes, *own))

    def refusals(self, scene: Scene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """Reasons why this very scene cannot be expressed although no capability is missing."""
        return ()

    def approximations(self, scene: Scene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """In what this engine only comes near to the scene."""
        return ()

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene; raises `InvalidNumericsError` on an impossible setting, else as `PackageEngine.run`."""
        read_options(self.id, self.options, numerics)
        return super().run(scene, numerics, watch)


def prescribed_spins(scene: Scene, engine: str) -> list[str]:
    """Reasons against disks that cannot turn and yet spin, for engines that block rotation by leaving it out."""
    spinning = np.flatnonzero(~scene.disks.rotating & (scene.disks.omega != 0.0))
    return [f"disk {i} spins at a prescribed rate: {engine}'s blocked bodies have no rotation at all" for i in spinning]


def touch_length(scene: Scene, numerics: Numerics, engine: str) -> float:
    """Length [m] of a few units of round-off of the scene's coordinates: bodies that are no further apart touch.

    Raises
    ------
    EngineError
        If the bodies' way over the run is no finite length.
    """
    return TOUCH_ULPS * float(np.spacing(wall_reach(scene, numerics, engine)))


def product_factors(between_disks: float | None, with_walls: Sequence[float]) -> tuple[float, list[float]]:
    """Factors of a disk and of each wall for engines that give a pair the product of its bodies' coefficients.

    Parameters
    ----------
    between_disks : float or None
        Coefficient of two disks; None: there is one disk only.
    with_walls : sequence of float
        Coefficient of a disk with each wall.
    """
    disk = 1.0 if between_disks is None else math.sqrt(between_disks)
    if disk == 0.0 and any(with_walls):
        disk = _SMALL
    return disk, [wall / disk if wall else 0.0 for wall in with_walls]
