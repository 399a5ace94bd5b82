"""Engines that are Python packages with native code: each run in a process of its own, so that a crash is a status.

The process runs this very Python and drives the engine's `Session` (see `ninedisk.harness.api.engine`); scene and history go
over the wire format.

Engines with rigid contacts that are Python packages: what they support, and their settings checked before they start.
"""

from __future__ import annotations

import math
import sys
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.scene import Scene
from ninedisk.harness.api.engine import EngineRun, Support
from ninedisk.harness.engines.rigid import NOTE_PRELOAD, rigid_support, without_spring_preload
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).with_name("package_driver.py")


@cache
def package_version(distribution: str) -> tuple[str | None, str]:
    """Version of an installed distribution and "", or None and the reason; imports nothing of it."""
    try:
        return metadata.version(distribution), ""
    except metadata.PackageNotFoundError:
        return None, f"there is no Python package {distribution} in this environment"


class PackageEngine(ExternalEngine):
    """Adapter of an engine whose `Session` lives in this package; a subclass gives `id`, `info`, `session`."""

    @property
    @abstractmethod
    def session(self) -> str:
        """Where the session is, ``"module:Class"``; its module may import the engine."""

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(DRIVER), self.session]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread, and a home of its own for engines that write logs there."""
        home = str(folder)
        return {**super().environment(folder), "HOME": home, "MPLCONFIGDIR": home, "OMP_NUM_THREADS": "1"}

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the engine on the scene without the preload of regularising springs; raises as `ExternalEngine.run`."""
        return super().run(without_spring_preload(scene), numerics, watch)


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
