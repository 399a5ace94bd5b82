"""Engines that are Python packages with native code: each runs in its own process, so that a crash is a status.

The process runs this very Python and drives the engine's `Session` (see `ninedisk.harness.api.engine`); scene and history go
over the wire format. Most have rigid contacts: what those support is here, too.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support
from ninedisk.harness.api.support import NOTE_PRELOAD, rigid_support, without_spring_preload
from ninedisk.harness.engines.process import ProcessEngine, package_version

_SMALL = 1e-8
"""Factor of a disk whose pairs with disks have the coefficient 0 while walls have another: 1e-16 is left between disks."""


class PackageEngine(ProcessEngine):
    """Adapter of an engine whose `Session` lives in this package; a subclass gives `id`, `facts`, `session` and `distribution`."""

    driver = Path(__file__).with_name("package_driver.py")
    session: str
    """Where the session is, ``"module:Class"``; its module may import the engine."""
    distribution: str
    """The Python package."""
    keeps_overlaps = False
    """Whether the engine gets the preload of regularising springs, too."""

    def installed(self) -> tuple[str | None, str]:
        """Version of the Python package."""
        return package_version(self.distribution)

    def command(self) -> Sequence[str]:
        """This Python with the driver and the session's place."""
        return [*super().command(), self.session]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """Its own home, for engines that write logs there; the kernels of the core stay where this process has them."""
        home, cache = str(folder), os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        return {**super().environment(folder), "HOME": home, "MPLCONFIGDIR": home, "XDG_CACHE_HOME": cache}

    def run(self, scene: Any, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene; raises `InvalidNumericsError` on an impossible setting, else as `ExternalEngine.run`."""
        read_options(self.id, self.facts.options, numerics)
        return super().run(scene if self.keeps_overlaps else without_spring_preload(scene), numerics, watch)


class RigidPackageEngine(PackageEngine):
    """Adapter of such an engine with rigid contacts."""

    preload_note = NOTE_PRELOAD
    capabilities_3d: frozenset[Capability] = frozenset()
    """Capabilities in 3D, where walls and bodies may do what they cannot in 2D, or the reverse."""

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """Rigid contacts only: a scene whose stiffness matters is refused."""
        return rigid_support(
            scene,
            numerics,
            self.capabilities_3d if isinstance(scene, SphereScene) else self.facts.capabilities,
            refused=self.refusals(scene, numerics),
            approximations=self.approximations(scene, numerics),
            preload_note=self.preload_note,
        )

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """Reasons why this very scene cannot be expressed although no capability is missing."""
        return ()

    def approximations(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """In what this engine only comes near to the scene."""
        return ()


def package_facts(distribution: str, **facts: Any) -> EngineInfo:
    """`EngineInfo` of an engine that is this Python package, where its keywords do not say otherwise."""
    how = f"separate process (Python package {distribution})"
    return EngineInfo(how_it_runs=how, install=f"pip install {distribution}", **facts)


def prescribed_spins(scene: Scene | SphereScene, engine: str) -> list[str]:
    """Reasons against bodies that cannot turn and yet spin, for engines that block rotation by leaving it out."""
    bodies = scene.bodies
    spinning = np.flatnonzero(~bodies.rotating & bodies.omega.reshape(len(bodies), -1).any(axis=1))
    return [
        f"{scene.noun} {i} spins at a prescribed rate: {engine}'s blocked bodies have no rotation at all"
        for i in spinning
    ]


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
