"""Slip of the step's end ("ratchet"): what it does to a small disk on large ones, and what Coulomb's law does there alone.

Vyas, Ottino, Lueptow & Umbanhowar (Comput. Phys. Commun. 310 (2025) 109524) find small spheres that stick to large ones. Materials here
are those of LAMMPS' example of it (examples/granular/in.sync_verlet).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Disks, Numerics, Scene, Wall, WallSegment, simulate

R, DENSITY, KN, STIFFNESS, G = 5e-3, 2500.0, 1e4, 8235.0, 9.81
BETA = -math.log(0.5) / math.hypot(math.pi, math.log(0.5))


def law(mu, slip_at):
    return ContactLaw(kn=KN, ks=STIFFNESS, mu=mu, beta=BETA, slip_at=slip_at)


def grain(ratio):
    """Radius and mass (that of a sphere) of the small disk, and a step of a seventh of the stable one's size."""
    r = R / ratio
    m = DENSITY * 4.0 / 3.0 * math.pi * r**3
    return r, m, 0.2 * math.sqrt(m / KN)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 20.0])
def test_rolling_in_the_plane_adds_no_slip(ratio):
    """The end adds ``-(dt/2) r' phi' dt`` to a step's slip, and a rolling disk's distance r changes by its overlap alone.

    While it rolls off, the overlap falls from ``m g/kn`` to nothing: the slip that is added is below ``(dt/2) phi' m g/kn``, and its
    force below ``dt phi' ks/(2 mu kn)`` of the friction at full weight, twice that on half of it. In space a sphere that rolls in the
    groove between two others slides ``(dt/2) (v^2/rho) cos(alpha)`` per unit of time across the way that it rolls, away from the
    groove: (dt/2) times the acceleration of its turning, whatever r' is. In LAMMPS' example that has become sixty times the slip that
    friction bears after 48 degrees, and holds the sphere in the groove.
    """
    (r, m, dt), mu, start = grain(ratio), 0.5, math.radians(1.0)
    distance = R + r - m * G * math.cos(start) / KN
    disks = Disks(
        x=[(0.0, 0.0), (distance * math.sin(start), distance * math.cos(start))], radius=[R, r], mass=m,
        rotating=[False, True], held=[[True, True], [False, False]],
    )  # fmt: skip
    speed, found = math.sqrt(4.0 * G / (3.0 * (R + r))), {}
    for slip_at in ("middle", "end"):
        scene = Scene(disks=disks, disk_disk=law(mu, slip_at), gravity=(0.0, -G))
        count = math.ceil(9.0 / speed / (100.0 * dt))
        numerics = Numerics(dt=100.0 * dt, n_steps=count, contact_dt=dt, damping_form="lagged")
        found[slip_at] = simulate(scene, numerics, watch=[(0, 1)])
    middle, end = found["middle"], found["end"]
    held = middle.fn[:, 0] > 0.05 * m * G
    assert 0.3 * len(held) < held.sum() < len(held)
    added = np.abs(end.fs - middle.fs)[held, 0] / (mu * middle.fn[held, 0])
    assert added.max() < dt * speed * STIFFNESS / (mu * KN)
    assert added.max() < 1e-5
    # Both let go of it, at the same place.
    last = int(np.flatnonzero(held)[-1])
    assert middle.gap[-1, 0] > r
    np.testing.assert_allclose(end.x[last, 1], middle.x[last, 1], atol=1e-6 * r)


@pytest.mark.parametrize(("ratio", "sticks"), [(7.0, False), (10.0, True), (20.0, True)])
@pytest.mark.parametrize("slip_at", ["middle", "end"])
def test_a_disk_pressed_between_two_sticks_by_coulomb_s_law(ratio, sticks, slip_at):
    """Between two disks that touch, the normals rise by alpha, ``tan(alpha) = sqrt(2 q + 1)/q`` with the ratio q of the radii.

    Pressed in until it slides, it can stay against its own weight turned round if ``tan(alpha) <= mu``: from q = 8.5 on for mu = 1/2,
    1 + sqrt(2) for mu = 1. That is statics: it does so with slip measured in either place. In LAMMPS' example the same angle decides
    whether what the end adds can hold a sphere: from q = 12 on for mu = 1/2, 5 for mu = 1, not at 9 and 3, and never with the middle.
    """
    mu = 0.5
    assert (math.sqrt(2.0 * ratio + 1.0) / ratio <= mu) is sticks
    (r, m, dt), press = grain(ratio), 300.0
    height = math.sqrt((R + r) ** 2 - R**2)
    sunk, period = press * m * G / KN, 400.0 * dt
    motion = (
        WallSegment(duration=50.0 * period, amplitude=(0.0, 0.5 * sunk), frequency=2.0 * math.pi / period, phase=0.5 * math.pi),
        WallSegment(duration=50.0 * period, velocity=(0.0, r / (50.0 * period))),
    )  # fmt: skip
    lid = Wall(name="lid", point=(0.0, height + r), normal=(0.0, -1.0), law=ContactLaw(kn=KN), motion=motion)
    place = {
        "radius": [R, R, r],
        "mass": m,
        "rotating": [False, False, True],
        "held": [[True] * 2, [True] * 2, [False] * 2],
    }
    rough, watch = law(mu, slip_at), [(0, 2), (1, 2)]
    numerics = Numerics(dt=period, n_steps=150, contact_dt=dt, damping_form="lagged")
    pressed = simulate(
        Scene(disks=Disks(x=[(-R, 0.0), (R, 0.0), (0.0, height)], **place), disk_disk=rough, walls=(lid,), gravity=(0.0, -G)),
        numerics, watch=watch,
    )  # fmt: skip
    assert pressed.fn[-1].min() > 0.3 * m * G
    turned = simulate(
        Scene(
            disks=Disks(x=pressed.x[-1], v=pressed.v[-1], omega=pressed.omega[-1], **place), disk_disk=rough, gravity=(0.0, G),
            initial_shear={pair: float(pressed.fs[-1, k]) for k, pair in enumerate(watch)},
        ),
        numerics.replace(n_steps=300), watch=watch,
    )  # fmt: skip
    if sticks:
        assert turned.fn[-1].min() > 5.0 * m * G
        np.testing.assert_allclose(turned.fs[-1, 0] / turned.fn[-1, 0], math.sqrt(2.0 * ratio + 1.0) / ratio, rtol=0.1)
    else:
        assert turned.gap[-1].min() > 0.0
