"""Which disks a run records."""

from __future__ import annotations

from collections.abc import Sequence
from operator import index

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.scene import Scene


def chosen_particles(scene: Scene, particles: Sequence[int] | None) -> NDArray[np.int64]:
    """Disk numbers, shape (k,); None means all.

    Raises
    ------
    InvalidSceneError
        If a disk does not exist.
    """
    n = len(scene.disks)
    if particles is None:
        return np.arange(n, dtype=np.int64)
    chosen = []
    for particle in particles:
        try:
            chosen.append(index(particle))
        except TypeError as error:
            raise InvalidSceneError(
                f"particle {particle!r} is no whole number: disks are numbered 0..{n - 1}"
            ) from error
        if not 0 <= chosen[-1] < n:
            raise InvalidSceneError(f"particle {particle} does not exist: disks are numbered 0..{n - 1}")
    return np.array(chosen, dtype=np.int64)
