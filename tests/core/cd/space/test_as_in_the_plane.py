"""A scene in space that is confined to the plane z = 0 has the contact dynamics of the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ninedisk.core import (
    BodyForce,
    ContactLaw,
    Disks,
    Numerics,
    PlaneSegment,
    PlaneWall,
    Scene,
    Spheres,
    SphereScene,
    Wall,
    WallSegment,
    simulate,
)

SEGMENTS: tuple[dict[str, Any], ...] = (
    {"duration": 0.05, "velocity": (0.2, 0.3)},
    {"angular_velocity": 0.5, "amplitude": (0.05, 0.1), "frequency": 3.0, "pivot": (1.0, 0.2)},
)


def flat(rows: Any) -> Any:
    """Vectors in the plane as vectors in space."""
    return np.column_stack([rows, np.zeros(len(rows))])


def solid(segment: dict[str, Any]) -> PlaneSegment:
    lifted = {
        name: (*value, 0.0) if name in ("velocity", "amplitude", "pivot") else value for name, value in segment.items()
    }
    return PlaneSegment(**{**lifted, "angular_velocity": (0.0, 0.0, segment.get("angular_velocity", 0.0))})


def twins(e: float | None) -> tuple[Scene, SphereScene]:
    """Seven disks thrown together over a floor that moves and turns, one partly held, one that does not turn, one pushed."""
    rng, n = np.random.default_rng(3), 7
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.4, regularised=True, restitution=e)
    x = np.array([[0.5 + 1.05 * i, 0.55 + 1.1 * k] for i in range(3) for k in range(3)])[:n] + rng.uniform(
        -0.02, 0.02, (n, 2)
    )
    radius, mass = rng.uniform(0.4, 0.5, n), rng.uniform(1.0, 2.0, n)
    v, omega = rng.normal(0.0, 1.0, (n, 2)), rng.normal(0.0, 2.0, n)
    held, rotating = np.zeros((n, 2), dtype=bool), np.arange(n) != 4
    held[3, 0] = True
    same: dict[str, Any] = {"radius": radius, "mass": mass, "inertia": 0.5 * mass * radius**2, "rotating": rotating}
    walls = (
        Wall(name="floor", point=(0, 0), normal=(0, 1), law=law, motion=[WallSegment(**each) for each in SEGMENTS]),  # type: ignore[arg-type]
        Wall(name="left", point=(0, 0), normal=(1, 0.1), law=law),
        Wall(name="right", point=(3.3, 0), normal=(-1, 0), law=law),
    )
    plane = Scene(
        disks=Disks(x=x, v=v, omega=omega, held=held, **same),
        disk_disk=law,
        walls=walls,
        gravity=(1.0, -10.0),
        xi=0.2,
        forces=(BodyForce(disk=2, force=(3.0, 1.0), torque=0.4, begin=0.05, end=0.12),),
    )
    held_3 = np.column_stack([held, np.arange(n) > 4])
    solids = tuple(
        PlaneWall(
            name=w.name,
            point=(*w.point, 0.0),
            normal=(*w.normal, 0.0),
            law=law,
            motion=tuple(map(solid, SEGMENTS)) if w.motion else (),
        )
        for w in walls
    )
    space = SphereScene(
        spheres=Spheres(x=flat(x), v=flat(v), omega=np.outer(omega, [0.0, 0.0, 1.0]), held=held_3, **same),
        sphere_sphere=law,
        walls=solids,
        gravity=(1.0, -10.0, 0.0),
        xi=0.2,
        forces=(BodyForce(disk=2, force=(3.0, 1.0, 0.0), torque=(0.0, 0.0, 0.4), begin=0.05, end=0.12),),
    )
    return plane, space


@pytest.mark.parametrize(
    ("theta", "impact", "sliding", "e"),
    [
        (1.0, "theta", "associated", None),
        (1.0, "theta", "coulomb", None),
        (0.6, "theta", "coulomb", None),
        (0.6, "theta", "associated", None),
        (1.0, "newton", "associated", 0.3),
        (0.5, "newton", "coulomb", 0.3),
        (1.0, "newton", "coulomb", 0.0),
    ],
)
def test_a_scene_at_z_0_moves_as_in_the_plane(theta: float, impact: Any, sliding: Any, e: float | None) -> None:
    numerics = Numerics(
        dt=0.005, n_steps=40, theta=theta, impact=impact, sliding=sliding, options={"cd.tolerance": 1e-11}
    )
    watch = [(0, 1), (0, 7), (3, 7), (1, 8), (4, 5)]
    one, two = (simulate(scene, numerics, watch, method="cd") for scene in twins(e))
    assert np.nanmax(one.fn) > 100.0
    assert np.abs(two.x[..., :2] - one.x).max() < 1e-9
    assert np.abs(two.v[..., :2] - one.v).max() < 1e-7
    assert np.abs(two.omega[..., 2] - one.omega).max() < 1e-7
    assert np.abs(two.angle[..., 2] - one.angle).max() < 1e-9
    assert np.abs(two.gap - one.gap).max() < 1e-9
    assert np.nanmax(np.abs(two.fn - one.fn)) < 1e-7 * np.nanmax(one.fn)
    assert np.nanmax(np.abs(two.wall_force[..., :2] - one.wall_force)) < 1e-7 * np.nanmax(one.fn)
    for name in ("kinetic", "gravity", "wall_work", "impact_gain"):
        assert np.abs(two.energy[name] - one.energy[name]).max() < 1e-6
    assert np.abs(two.x[..., 2]).max() < 1e-13
