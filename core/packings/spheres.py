"""Spheres poured into a box and settled."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt

import numpy as np

from ninedisk.core.law import Elastic, SphereLaw, damping_ratio, moduli
from ninedisk.core.numerics import Numerics
from ninedisk.core.packings.parts import GRAVITY
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.core.validate import whole

RADIUS, SPREAD, DENSITY = 5e-3, 0.1, 2500.0
"""Mean radius [m], largest deviation from it over it, [kg/m^3]."""
MATERIAL, MU, RESTITUTION = Elastic(E=1e7, nu=0.3), 0.5, 0.3
FALLS = 1.8
"""Time to settle over that of a fall through the packing."""
STEP = 0.15
"""Contact step over the critical one."""
STRIDES = 100


def sphere_law() -> SphereLaw:
    """Hertz-Mindlin of two spheres of `MATERIAL`."""
    e_star, g_star = moduli(MATERIAL, MATERIAL)
    return SphereLaw(e_star=e_star, g_star=g_star, mu=MU, beta=damping_ratio(RESTITUTION))


def poured_spheres(n: int) -> SphereScene:
    """``n`` spheres on a loose lattice, jittered and thrown about, in a box without lid that they will fill to about its width."""
    law = sphere_law()
    rng = np.random.default_rng(1)
    across = max(2, round(whole("n", n, 1, 10_000_000) ** (1.0 / 3.0)))
    side = 2.0 * RADIUS * across
    columns = max(1, int(side / (2.25 * RADIUS)))
    pitch = side / columns
    layers = -(-n // columns**2)
    lattice = np.stack(np.meshgrid(range(layers), range(columns), range(columns), indexing="ij"), axis=-1)
    x = (lattice.reshape(-1, 3)[:n, ::-1] + 0.5) * pitch + 0.02 * RADIUS * rng.uniform(-1.0, 1.0, (n, 3))
    radius = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, n)
    mass = DENSITY * 4.0 / 3.0 * pi * radius**3
    sides = (("left", 0, 1.0), ("right", 0, -1.0), ("front", 1, 1.0), ("back", 1, -1.0), ("bottom", 2, 1.0))
    walls = []
    for name, axis, sign in sides:
        far = side if sign < 0.0 else 0.0
        along, across, up = (sign if axis == each else 0.0 for each in range(3))
        walls.append(PlaneWall(name=name, point=(far, far, 0.0), normal=(along, across, up), law=law))
    spheres = Spheres(x=x, v=rng.normal(0.0, 0.2, (n, 3)), radius=radius, mass=mass)
    return SphereScene(spheres=spheres, sphere_sphere=law, walls=tuple(walls), gravity=(0.0, 0.0, -GRAVITY))


def settled_spheres(n: int, *, progress: Callable[[int, int], None] | None = None) -> SphereScene:
    """`poured_spheres` after `FALLS` times the time of a fall through them, at rest.

    Parameters
    ----------
    n : int
        Spheres, >= 1.
    progress : callable, optional
        Called with (steps done, all steps).
    """
    from ninedisk.core.dem.space.session import SphereSession, contact_step

    scene = poured_spheres(n)
    height = float(scene.spheres.x[:, 2].max()) + RADIUS
    time = FALLS * sqrt(2.0 * height / GRAVITY)
    one = Numerics(dt=time / STRIDES, n_steps=STRIDES, sample_every=STRIDES, damping_form="lagged")
    dt = STEP * contact_step(scene, one)[1]
    steps = int(np.ceil(time / STRIDES / dt))
    session = SphereSession(scene, one.replace(contact_dt=time / STRIDES / steps))
    history = session.run(progress)
    spheres = scene.spheres
    return scene.replace(spheres=Spheres(x=history.x[-1], radius=spheres.radius, mass=spheres.mass))
