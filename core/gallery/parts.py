"""What all scenes of the gallery share: lengths, masses, laws of contact, and being at rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.disks import Disks
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

FloatArray = NDArray[np.float64]

DENSITY, GRAVITY = 1000.0, 9.81
SPREAD = (0.4, 0.6)
"""Radii are uniform in this range [m]: mean diameter 1 m, no crystal."""

STILL = 1e-9
"""A packing has settled when its kinetic energy is this fraction of the energy of a fall by one diameter."""


def contact_law(height: float, *, overlap: float = 0.005, mu: float = 0.5, beta: float = 0.2) -> ContactLaw:
    """Law whose contacts overlap by about ``overlap`` diameters under a column of the given height [m]."""
    kn = DENSITY * GRAVITY * height / overlap
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
    from ninedisk.core.dem.session import DemSession

    g = math.hypot(*scene.gravity)
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
    """Disks at rest, of the gallery's density unless their masses [kg] are given."""
    return Disks(x=x, radius=radius, mass=DENSITY * math.pi * radius**2 if mass is None else mass)


def positive(**values: float) -> None:
    """Raise `InvalidSceneError` with the name of a value that is no number > 0."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            raise InvalidSceneError(f"{name} = {value!r} is not allowed: it must be > 0")
