"""Suite ``spheres``: particle-steps per second of the in-house DEM of spheres beside LAMMPS and YADE.

Spheres of Hertz-Mindlin's law lie settled in a box, in some problems with a layer of large ones on top; everything else is as in the suite
``dem`` (`ninedisk.harness.bench.dem`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import pi
from typing import ClassVar

import numpy as np

from ninedisk.core.dem.space.session import SORT_FROM, SphereSession, contact_step
from ninedisk.core.law import LeverArm, SlipAt, SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.packings.spheres import DENSITY, MATERIAL, settled_spheres
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.harness.bench import dem
from ninedisk.harness.bench.dem import DemProblem, Peer
from ninedisk.harness.bench.measure import Sample

SIZES, LARGE = (1_000, 10_000), (100_000,)
SHORT, UNDAMPED, SHORT_UP_TO = "-short", "-undamped", 10_000
"""Ends of the names of short problems, which YADE has, too, and spheres up to which there are any."""
DAMPED = 0.03
"""Bound of the check where there are dashpots (measured: 0.011 for LAMMPS, 0.013 for YADE after 1,000 steps of 1,000 spheres)."""
WORK, WORK_SHORT = 10_000_000, 5_000_000
"""Particle-steps of a problem."""
MOST_STEPS, MOST_STEPS_SHORT, FEWEST_STEPS = 5_000, 1_000, 60
MIXED, RATIOS = "mixed", (5, 10, 20)
"""Problems of two sizes, and radii of the large spheres over the mean of the small ones."""
STEP = 0.1
"""Contact step over the critical one of a fall through the packing."""
SKIN = 0.1
"""Skin over the mean radius for peers, which keep one (LAMMPS is as fast with half of it); ours adapts its own."""


class SphereProblem(DemProblem):
    """A problem of spheres: contacts begin without shear force, and the packing that has lost it moves.

    Without dashpots LAMMPS takes the same steps, to round-off. With them all engines differ where one pulls at the end of a contact: LAMMPS
    then caps friction by the size of the pull, YADE lets no dashpot pull. So the timed problems have dashpots, and one without them shows
    that it is the same problem.
    """

    suite: ClassVar[str] = "spheres"
    error_of: ClassVar[str] = "positions, and so overlaps, root mean square over that of the displacements,"

    def bound(self, peer: Peer) -> tuple[float, str]:
        """Largest `error` of an engine, with its reason."""
        if self.scene.sphere_sphere.beta > 0.0:
            return DAMPED, "friction and dashpots differ in contacts whose dashpots pull"
        return peer.bound, peer.why

    def error(self, sample: Sample, ours: Sample) -> float:
        """Difference of the last positions from the in-house run."""
        x, own = sample.facts["x"], ours.facts["x"]
        moved = float(np.linalg.norm(own - self.scene.spheres.x))
        apart = float(np.linalg.norm(x - own))
        return apart / moved if np.isfinite(apart) and moved > 0.0 else float("inf")

    @property
    def sort_from(self) -> int:
        """Spheres from which a run shares its work among threads."""
        return SORT_FROM

    @property
    def peers(self) -> Sequence[Peer]:
        """External engines that have spheres."""
        return PEERS

    def session(self, numerics: Numerics, threads: int = 1) -> SphereSession:
        """The in-house DEM at time 0."""
        return SphereSession(self.scene, numerics, particles=[0], threads=threads)

    def law(self, law: SphereLaw) -> dict[str, float]:
        """What an external engine is given of a law."""
        return {"young": MATERIAL.E, "poisson": MATERIAL.nu, "mu": law.mu, "beta": law.beta}

    def with_conventions(self, disks: LeverArm, walls: LeverArm, slip_at: SlipAt) -> SphereProblem:
        """The same with the lever arms of one engine, and slip measured where in the step it has it."""

        def turned(law: SphereLaw, arm: LeverArm) -> SphereLaw:
            return replace(law, lever_arm=arm, slip_at=slip_at)

        scene = self.scene
        planes = tuple(replace(wall, law=turned(wall.law, walls)) for wall in scene.walls)
        return replace(self, scene=scene.replace(sphere_sphere=turned(scene.sphere_sphere, disks), walls=planes))


def problem_makers(
    sizes: list[int], wanted: Callable[[str], bool], notify: Callable[[int, int], None] | None = None
) -> dict[str, Callable[[], list[DemProblem]]]:
    """A maker of the wanted problems of each size, by the first one's name: one size at a time is held in memory."""
    found: dict[str, Callable[[], list[DemProblem]]] = {}
    for n in dict.fromkeys(sizes):
        kinds = ("", SHORT, UNDAMPED) if n <= SHORT_UP_TO else ("",)
        names = [f"settled-{n}{kind}" for kind in kinds]
        names += [f"{MIXED}-{ratio}-{n}" for ratio in RATIOS if n >= ratio**3]
        if chosen := [name for name in names if wanted(name)]:
            found[chosen[0]] = partial(_problem_of_size, n, chosen, notify)
    return found


def _problem_of_size(n: int, names: list[str], notify: Callable[[int, int], None] | None) -> list[DemProblem]:
    scene = packing(n, notify)
    dt = STEP * contact_step(scene, Numerics(dt=1.0, n_steps=1))[1]
    found: list[DemProblem] = []
    for name in names:
        short = name.endswith((SHORT, UNDAMPED))
        most, work = (MOST_STEPS_SHORT, WORK_SHORT) if short else (MOST_STEPS, WORK)
        steps = min(most, max(FEWEST_STEPS, work // n))
        skin = SKIN * float(scene.spheres.radius.mean())
        chosen = without_dashpots(scene) if name.endswith(UNDAMPED) else scene
        classes: tuple[float, ...] = ()
        if name.startswith(MIXED):
            ratio = int(name.split("-")[1])
            chosen, classes = with_large_ones(scene, ratio), (float(scene.spheres.radius.max()),)
        problem = SphereProblem(name=name, scene=chosen, contact_dt=dt, steps=steps, skin=skin, short=short)
        found.append(replace(problem, classes=classes))
    return found


def with_large_ones(scene: SphereScene, ratio: float) -> SphereScene:
    """The settled packing with one layer of large spheres, each lowered onto it until it touches the first small one.

    Their radius is ``ratio`` times the mean one, their material that of the others; a square of as many as are inside the box.
    """
    small = scene.spheres
    large = ratio * float(small.radius.mean())
    side = max(wall.point[0] for wall in scene.walls)
    across = int(side / (2.0 * large))
    if across == 0:
        raise ValueError(
            f"ratio = {ratio:g} is not allowed: a sphere of {2.0 * large:g} m does not go into a box of {side:g} m"
        )
    middles = (np.arange(across) + 0.5) * side / across
    x = []
    for place in np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2):
        apart2 = np.sum((small.x[:, :2] - place) ** 2, axis=1)
        reach2 = (small.radius + large) ** 2
        below = apart2 < reach2
        x.append(
            (
                *place,
                float(
                    np.max(small.x[below, 2] + np.sqrt(reach2 - apart2, where=below, out=np.zeros(len(below)))[below])
                ),
            )
        )
    radius = np.append(small.radius, np.full(len(x), large))
    mass = np.append(small.mass, np.full(len(x), DENSITY * 4.0 / 3.0 * pi * large**3))
    return scene.replace(spheres=Spheres(x=np.vstack([small.x, x]), radius=radius, mass=mass))


def without_dashpots(scene: SphereScene) -> SphereScene:
    """The scene without dashpots."""
    walls = tuple(replace(wall, law=replace(wall.law, beta=0.0)) for wall in scene.walls)
    return scene.replace(sphere_sphere=replace(scene.sphere_sphere, beta=0.0), walls=walls)


def packing(n: int, notify: Callable[[int, int], None] | None = None) -> SphereScene:
    """A settled packing of ``n`` spheres, from the user's cache folder if it has been made before."""
    return dem.cached_scene(f"spheres-{n}", partial(settled_spheres, n, progress=notify), SphereScene)


LAMMPS = replace(
    dem.LAMMPS,
    settings={
        **dem.LAMMPS.settings,
        "pair_style": "granular: hertz/material, mindlin/force, coeff_restitution with e(beta)",
        "skin / mean radius": f"{SKIN:g}",
        "neighbor": "bin; of two sizes multi, with an interval for each",
    },
)
YADE = replace(
    dem.YADE,
    bound=0.02,
    why="contacts with walls that form on the way take half the sphere's radius for the reduced one",
    settings={
        "contact_law": "Law2_ScGeom_MindlinPhys_Mindlin, Ip2_FrictMat_FrictMat_MindlinPhys",
        "collider": "InsertionSortCollider, Verlet distance half the skin",
        "skin / mean radius": f"{SKIN:g}",
        "steps": "a loop over O.step; contacts are found before the clock starts",
    },
)
PEERS = (LAMMPS, YADE)
