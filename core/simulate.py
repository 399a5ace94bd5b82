"""Public entry of the core: a scene and its numerics in, a history out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics, check_run
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.core.threads import check_threads
from ninedisk.core.validate import one_of

if TYPE_CHECKING:
    from ninedisk.core.history import History, Pair


def simulate(
    scene: Scene | SphereScene,
    numerics: Numerics,
    watch: Sequence[Pair] = (),
    *,
    method: Literal["dem", "cd"] = "dem",
    particles: Sequence[int] | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> History:
    """Run a scene on the in-house DEM, or by contact dynamics.

    Parameters
    ----------
    scene : Scene or SphereScene
        Disks in the plane, or spheres and boxes in space, walls, contact laws, gravity.
    numerics : Numerics
        Steps and sampling.
    watch : sequence of pairs
        Contacts to record, as body numbers (disks first, then walls; `Scene.wall_index` finds a wall's).
    method : {"dem", "cd"}
        Discrete element method (contact springs, explicit) or contact dynamics (implicit; rigid or elastic, in space rigid).
    particles : sequence of int or None
        Disks whose motion is recorded; None: all.
    threads : int
        Threads of the DEM, or of Gauss-Seidel in contact dynamics (there 1 leaves it to the option ``cd.threads``), 1..64; the
        result does not depend on them.
    progress : callable, optional
        Called with (steps done, steps in all) a few times a second.

    Returns
    -------
    History

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
        If the input is impossible; the message names the value and the way out.
    UnstableTimeStepError
        If the contact step exceeds the critical one.
    NonFiniteStateError
        If the state stops being finite on the way.
    BehindWallError
        If the centre of a disk gets behind a wall on the way.
    SolverNotConvergedError, NoEquilibriumError
        Contact dynamics: if a step is not solved to its tolerance, or a static one has no solution.

    Examples
    --------
    A disk in free fall for 1 s, ``g t^2/2`` = 5 m:

    >>> disk = Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=disk, disk_disk=ContactLaw(kn=1e6), gravity=(0.0, -10.0))
    >>> history = simulate(scene, Numerics(dt=0.1, n_steps=10))
    >>> round(float(history.x[-1, 0, 1]), 9)
    -5.0
    """
    one_of("method", method, ("dem", "cd"), error=InvalidNumericsError)
    if isinstance(scene, SphereScene):
        if method == "cd":
            from ninedisk.core.cd.space.session import SpaceSession

            check_threads(threads)
            return SpaceSession(scene, numerics, watch, particles).run(progress)
        from ninedisk.core.dem.space.session import SphereSession

        return SphereSession(scene, numerics, watch, particles, threads=threads).run(progress)
    check_run(scene, numerics)
    if method == "dem":
        from ninedisk.core.dem.session import DemSession

        return DemSession(scene, numerics, watch, particles, threads=threads).run(progress)
    from ninedisk.core.cd.session import CdSession

    if check_threads(threads) != 1:
        numerics = numerics.replace(options={**numerics.options, "cd.threads": threads})
    return CdSession(scene, numerics, watch, particles).run(progress)
