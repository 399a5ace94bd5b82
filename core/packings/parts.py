"""What all packings share: lengths, masses, laws of contact, and being at rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics, check_progress
from ninedisk.core.scene import Scene
from ninedisk.core.scene.bodies import Disks
from ninedisk.core.validate import at_least, kind_of, whole, within

MOST_DISKS = 10_000_000
"""Disks of a scene: more would need tens of gigabytes."""

DENSITY, GRAVITY = 1000.0, 9.81
LEAST_OVERLAP = 1e-9
"""Overlap over diameter under the weight: of stiffer contacts nothing but round-off would be left."""
SPREAD = (0.4, 0.6)
"""Radii are uniform in this range [m]: mean diameter 1 m, no crystal."""

STILL = 1e-9
"""A packing has settled when its kinetic energy is this fraction of the energy of a fall by one diameter."""


def contact_law(height: float, *, overlap: float = 0.005, mu: float = 0.5, beta: float = 0.2) -> ContactLaw:
    """Law whose contacts overlap by about ``overlap`` diameters under a column of the given height [m]."""
    kn = DENSITY * GRAVITY * checked_positive("height", height) / within("overlap", overlap, LEAST_OVERLAP, 0.1)
    return ContactLaw(kn=kn, ks=0.5 * kn, mu=mu, beta=beta, restitution=0.0)


def settle(scene: Scene, *, progress: Callable[[int, int], None] | None = None, threads: int = 1) -> Scene:
    """The scene at rest: run by the DEM under heavy global damping until it is still.

    Parameters
    ----------
    scene : Scene
        Disks under gravity.
    progress : callable, optional
        Called with (steps done, at most to do).
    threads : int
        As in `DemSession`.

    Returns
    -------
    Scene
        Same disks, where they came to rest, without velocities; their contacts keep the shear forces.

    Raises
    ------
    InvalidSceneError
        If nothing pulls the disks together, or they do not come to rest.
    """
    from ninedisk.core.dem.critical import critical_time_step, packed_time_step
    from ninedisk.core.dem.session import DemSession, check_admission

    g = math.hypot(*kind_of("scene", scene, Scene).gravity)
    check_progress(progress)
    check_admission(scene, Numerics(dt=1.0, n_steps=1), threads)
    if g == 0.0:
        raise InvalidSceneError("a scene without gravity does not settle: give it one, or walls that press")
    disks = scene.disks
    height = float(np.ptp(disks.x @ np.array(scene.gravity)) / g)
    fall = math.sqrt(2.0 * max(height, 1.0) / g)
    dt = min(0.2 * critical_time_step(scene), packed_time_step(scene))
    per = max(1, math.ceil(0.25 * fall / dt))
    target = STILL * float(disks.mass[~disks.fixed].sum()) * g * 2.0 * float(disks.radius.mean())
    rounds = 60
    damped = scene.replace(xi=4.0 / fall)
    numerics = Numerics(dt=per * dt, n_steps=rounds, contact_dt=dt, sample_every=1)
    session = DemSession(damped, numerics, threads=threads)
    for done in range(1, rounds + 1):
        session.advance(1)
        if progress is not None:
            progress(done, rounds)
        history = session.history()
        if done > 4 and history.energy["kinetic"][-1] < target:
            rest = replace(disks, x=history.x[-1], v=np.zeros_like(disks.v), omega=np.zeros_like(disks.omega))
            return scene.replace(disks=rest, initial_shear=session.shear_forces())
    raise InvalidSceneError(
        f"the scene has not come to rest after {rounds * per} steps: kinetic energy {history.energy['kinetic'][-1]:.3g} J, "
        f"still means {target:.3g} J; is a wall missing, or does one move?"
    )


def uniform_disks(x: FloatArray, radius: FloatArray, mass: FloatArray | None = None) -> Disks:
    """Disks at rest, of the common density unless their masses [kg] are given."""
    return Disks(x=x, radius=radius, mass=DENSITY * math.pi * radius**2 if mass is None else mass)


def checked_count(name: str, value: object, *, low: int = 1, high: int = MOST_DISKS) -> int:
    """The value as an int, or `InvalidSceneError`: a number of disks, copies, sides, or a seed."""
    return whole(name, value, low, high, error=InvalidSceneError)


def checked_positive(name: str, value: object) -> float:
    """The value as a float, or `InvalidSceneError`: a number > 0."""
    return at_least(name, value, 0.0, strict=True)


def random_generator(seed: object) -> np.random.Generator:
    """The generator of a scene's radii and places; `InvalidSceneError` unless the seed is a whole number >= 0."""
    return np.random.default_rng(checked_count("seed", seed, low=0, high=2**63 - 1))
