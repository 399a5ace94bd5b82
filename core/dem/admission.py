"""What the DEM takes on: checks of a scene, its numerics and the number of threads before anything is allocated."""

from __future__ import annotations

import numpy as np

from ninedisk.core._crew import check_threads
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import Scene
from ninedisk.core.watch import check_run


def check_admission(scene: Scene, numerics: Numerics, threads: int) -> None:
    """Refuse what the DEM cannot run.

    Raises
    ------
    InvalidSceneError
        If the scene has no disk or one that is held in a motion.
    InvalidNumericsError
        If the numerics ask for the static limit or have options for the DEM, which has none, or the number of threads is not allowed.
    """
    check_run(scene, numerics)
    moved = scene.disks.held.any(axis=1) & ~scene.disks.fixed
    if moved.any():
        raise InvalidSceneError(
            f"disk {int(np.argmax(moved))} is held in a motion, which the DEM cannot express: free it, hold it at rest (both "
            "components, not rotating), or use contact dynamics"
        )
    if numerics.regime != "dynamic":
        raise InvalidNumericsError(f"regime = {numerics.regime!r} needs contact dynamics: the DEM has inertia")
    check_threads(threads)
    read_options("dem", {}, numerics)
