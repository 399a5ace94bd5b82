"""Scenes in space that several tests use."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core import ContactLaw, Numerics, PlaneWall, Spheres, SphereScene

G = 9.81
FLOOR = {"name": "floor", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0)}


def rigid(mu: float = 0.0, e: float | None = None) -> ContactLaw:
    """A rigid contact."""
    return ContactLaw(kn=1e6, ks=1e6, mu=mu, restitution=e, regularised=True)


def on_floor(law: ContactLaw, gravity: Any = (0.0, 0.0, -G), **spheres: Any) -> SphereScene:
    """Bodies above the plane z = 0."""
    floor = PlaneWall(**FLOOR, law=law)  # type: ignore[arg-type]
    return SphereScene(spheres=Spheres(**spheres), sphere_sphere=law, walls=(floor,), gravity=gravity)


def slope(angle: float, direction: float) -> tuple[float, float, float]:
    """Gravity on the plane z = 0 of a slope that falls along a direction [rad]."""
    along = G * np.sin(angle)
    return float(along * np.cos(direction)), float(along * np.sin(direction)), float(-G * np.cos(angle))


def steps(dt: float, count: int, **options: Any) -> Numerics:
    """Numerics under Coulomb's law."""
    return Numerics(dt=dt, n_steps=count, **{"sliding": "coulomb", **options})


def turn_about(axis: Any, angle: float) -> NDArray[np.float64]:
    """Unit quaternion of a rotation by an angle [rad]."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * unit])


def matrix(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix of a unit quaternion: ``(w^2 - v.v) 1 + 2 v v' + 2 w [v x]``."""
    w, v = q[0], q[1:]
    across = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray((w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * across)
