"""Every option of the laws, moving planes, held and spinning spheres, two materials: step by step against plain NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from twin import Twin, law_of

from ninedisk.core import Numerics
from ninedisk.core.law import Rolling
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.core.simulate import simulate

R, DT, STEPS = 5e-3, 1e-5, 200


def box(**law: Any) -> SphereScene:
    """A dozen spheres, somewhat pressed together, in a box whose floor turns, one side swings and one pushes for a while."""
    rng = np.random.default_rng(3)
    cell = np.stack(np.meshgrid(range(3), range(2), range(2), indexing="ij"), axis=-1).reshape(-1, 3)
    radius = R * rng.uniform(0.9, 1.1, 12)
    x = 1.94 * R * (cell + 0.5) + 0.05 * R * rng.uniform(-1.0, 1.0, (12, 3))
    held = np.zeros((12, 3), dtype=bool)
    held[2], held[5, 1] = True, True
    v, omega = 0.3 * rng.standard_normal((12, 3)), 60.0 * rng.standard_normal((12, 3))
    v[2], omega[2] = 0.0, 0.0
    rotating = np.ones(12, dtype=bool)
    rotating[[2, 7]] = False
    one, other = law_of(**law), law_of(**{**law, "mu": 0.1, "beta": 0.3})
    size = 1.94 * R * np.array([3, 2, 2])
    floor = PlaneSegment(angular_velocity=(4.0, -3.0, 25.0), pivot=(0.01, 0.005, 0.0))
    swing = PlaneSegment(amplitude=(2e-4, 0.0, 1e-4), frequency=4e3, phase=0.4)
    push = (PlaneSegment(duration=1.05e-3, velocity=(0.0, -0.3, 0.1)),)
    walls = tuple(
        PlaneWall(name=name, point=point, normal=normal, law=one, motion=motion, material=material)
        for name, point, normal, motion, material in [
            ("floor", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (floor,), ""),
            ("top", tuple(size), (0.0, 0.0, -1.0), (), "b"),
            ("left", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (swing,), ""),
            ("right", tuple(size), (-1.0, 0.0, 0.0), (), ""),
            ("front", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (), ""),
            ("back", tuple(size), (0.0, -1.0, 0.0), push, ""),
        ]
    )
    spheres = Spheres(
        x=x,
        radius=radius,
        mass=2500.0 * 4.0 / 3.0 * np.pi * radius**3,
        v=v,
        omega=omega,
        held=held,
        rotating=rotating,
        material=["a", "b"] * 6,
    )
    return SphereScene(
        spheres=spheres, sphere_sphere=one, walls=walls, gravity=(1.0, 2.0, -9.81), laws={("a", "b"): other}
    )


SPRING = {"rolling": Rolling(model="elastic-plastic", mu=0.2, kr=0.02, beta=0.2)}
TWIST = {"twisting": Rolling(model="elastic-plastic", mu=0.1, kr=0.01, beta=0.3)}
JKR = {"surface": "jkr", "surface_energy": 2.0}
CONSTANT = {"rolling": Rolling(model="constant", mu=0.05), "twisting": Rolling(model="constant", mu=0.02)}


@pytest.mark.sampled(6)
@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "form"),
    [
        ({"slip_at": "middle", "unloading": "force", **SPRING, **TWIST}, "central"),
        ({"slip_at": "end", "unloading": "rescale", "lever_arm": "torque-overlap", **CONSTANT}, "lagged"),
        ({"slip_at": "middle", "unloading": "none", "lever_arm": "overlap", "surface_energy": 2.0}, "central"),
        ({"slip_at": "end", "kn": 2e4, "ks": 1e4, **SPRING}, "lagged"),
        ({"unloading": "rescale", "friction_pull": 2.0, **JKR, **SPRING, **TWIST}, "central"),
        ({"slip_at": "end", "unloading": "force", "lever_arm": "overlap", **JKR}, "lagged"),
    ],
    ids=[
        "middle-force-springs",
        "end-rescale-constant",
        "middle-none-overlap-dmt",
        "end-linear",
        "jkr-rescale",
        "jkr-end",
    ],
)
def test_some_hundred_steps_are_those_of_the_twin(law: dict[str, Any], form: Any) -> None:
    scene = box(**law)
    numerics = Numerics(dt=DT, n_steps=STEPS, contact_dt=DT, sample_every=50, damping_form=form)
    watch = [(i, j) for i in range(12) for j in range(i + 1, 18)]
    history = simulate(scene, numerics, watch)
    twin, closed, slid = Twin(scene, numerics), 0, 0
    stretched = 0
    for k, step in enumerate(history.step):
        while twin.steps < step:
            twin.step()
            closed += len(twin.touches)
            stretched += sum(each.overlap < 0.0 for each in twin.touches.values())
        v, omega = twin.now()
        fn, fs = np.zeros(len(watch)), np.zeros((len(watch), 3))
        for c, pair in enumerate(watch):
            if pair in twin.touches:
                fn[c], fs[c] = twin.touches[pair].fn, twin.touches[pair].fs
                slid += np.linalg.norm(fs[c]) > 0.09 * fn[c]
        for mine, exact in [
            (history.x, twin.x),
            (history.v, v),
            (history.omega, omega),
            (history.angle, twin.angle),
            (history.fn, fn),
            (history.fs, fs),
            (history.wall_force, twin.load),
        ]:
            # Round-off of 2e-16, which each of a few collisions in turn magnifies about tenfold.
            np.testing.assert_allclose(mine[k], exact, rtol=0.0, atol=1e-12 * max(np.abs(exact).max(), 1e-12))
    assert closed > 5 * STEPS
    assert slid > 20
    assert (stretched > 50) == ("surface" in law)
