"""What a run is asked to do and to record."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.core.validate import body_numbers, items_of, kind_of, shown


def check_run(scene: Scene, numerics: Numerics) -> None:
    """Refuse what is no scene with a disk, or no numerics.

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
    """
    kind_of("scene", scene, Scene)
    kind_of("numerics", numerics, Numerics, error=InvalidNumericsError)
    if len(scene.disks) == 0:
        raise InvalidSceneError("the scene has no disk: there is nothing to simulate")


def check_progress(progress: object) -> None:
    """Raise `InvalidNumericsError` unless ``progress`` can be called or is None."""
    if not (progress is None or callable(progress)):
        raise InvalidNumericsError(
            f"progress = {shown(progress)} is not allowed: it must be a function of two numbers, or None"
        )


def watched_pairs(scene: Scene, watch: Sequence[Pair]) -> tuple[Pair, ...]:
    """The contacts to record, as body numbers.

    Raises
    ------
    InvalidSceneError
        If one does not exist.
    """
    pairs = items_of("watch", watch, "a sequence of pairs, () for none")
    return tuple(scene.check_pair(pair) for pair in pairs)


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
    chosen: list[int] = []
    for particle in items_of("particles", particles, f"a sequence of disks' numbers 0..{n - 1}, or None for all"):
        try:
            chosen.append(*body_numbers("a particle is a whole number", (particle,)))
        except InvalidSceneError as error:
            raise InvalidSceneError(
                f"particle {shown(particle)} is no whole number: disks are numbered 0..{n - 1}"
            ) from error
        if not 0 <= chosen[-1] < n:
            raise InvalidSceneError(f"particle {particle} does not exist: disks are numbered 0..{n - 1}")
    return np.array(chosen, dtype=np.int64)


def check_room(numerics: Numerics, n_chosen: int, n_walls: int, n_pairs: int) -> None:
    """Refuse a run whose samples this machine cannot hold.

    Raises
    ------
    InvalidNumericsError
        Before anything is allocated: the system would hand out the memory and end the process once it is written to.
    """
    samples = len(numerics.sampled_steps())
    needed = 8 * samples * (6 * n_chosen + 5 * n_walls + 3 * n_pairs + 10)  # numbers of a History, each 8 bytes
    here = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > here:
        raise InvalidNumericsError(
            f"n_steps = {numerics.n_steps} with sample_every = {numerics.sample_every} is not allowed: {samples} samples of "
            f"{n_chosen} disks need {needed / 2**30:.3g} GiB, and this machine has {here / 2**30:.3g} GiB; raise sample_every, or "
            "record fewer particles"
        )
