"""Engines with rigid contacts that are Python packages: what they support, and their settings checked before they start."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.scene import Scene
from ninedisk.harness.api.engine import EngineRun, Support
from ninedisk.harness.engines.package import PackageEngine
from ninedisk.harness.engines.rigid import NOTE_PRELOAD, rigid_support

_SMALL = 1e-8
"""Factor of a disk whose pairs with disks have the coefficient 0 while walls have another: 1e-16 is left between disks."""


class RigidPackageEngine(PackageEngine):
    """Adapter of such an engine; a subclass gives `id`, `info`, `session` and `options`."""

    options: Mapping[str, Option] = {}
    preload_note = NOTE_PRELOAD

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """Rigid contacts only: a scene whose stiffness matters is refused."""
        return rigid_support(
            scene,
            numerics,
            self.info().capabilities,
            refused=self.refusals(scene, numerics),
            approximations=self.approximations(scene, numerics),
            preload_note=self.preload_note,
        )

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
