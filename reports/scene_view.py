"""What a sketch needs of a stored scene, read from its JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EDGE_POINTS = 129
"""Points of an outline's polygon: a circle's is off by 3e-4 of its radius, less than the line is wide."""


@dataclass(frozen=True)
class WallView:
    """A half-plane: a point, the unit normal into the free side, the velocities by direction, the first spin."""

    name: str
    point: FloatArray
    normal: FloatArray
    moves: tuple[FloatArray, ...] = ()
    spin: float = 0.0
    pivot: FloatArray | None = None

    @property
    def tangent(self) -> FloatArray:
        """Unit vector along the surface."""
        return np.array([-self.normal[1], self.normal[0]])


@dataclass(frozen=True)
class SceneView:
    """Disks and walls of a scene; ``marks`` are the watched contacts by label.

    ``edges`` are the outlines of its grains about their centres [m], turned as at time 0; None for a disk.
    """

    x: FloatArray
    v: FloatArray
    radius: FloatArray
    rotating: NDArray[np.bool_]
    walls: tuple[WallView, ...]
    gravity: FloatArray
    marks: tuple[tuple[str, FloatArray], ...]
    edges: tuple[FloatArray | None, ...]

    @property
    def signature(self) -> tuple[Any, ...]:
        """Equal for scenes that look alike, whatever their speeds and stiffnesses."""
        size = float(self.radius.max()) if len(self.radius) else 1.0
        motion = tuple(
            (
                tuple(tuple(np.sign(np.round(velocity, 12))) for velocity in wall.moves),
                np.sign(wall.spin),
                None if wall.pivot is None else tuple(np.round(wall.pivot / size, 1)),
            )
            for wall in self.walls
        )
        moving = tuple(map(tuple, np.sign(self.v)))
        extents = [
            np.full(2, 2.0 * radius) if edge is None else np.ptp(edge, axis=0)
            for radius, edge in zip(self.radius, self.edges, strict=True)
        ]
        look = tuple(tuple(np.round(extent / size, 1)) for extent in extents)
        return (
            len(self.x),
            look,
            tuple(np.round(self.x / size, 1).ravel()),
            motion,
            moving,
            tuple(np.sign(self.gravity)),
        )


def read_scene(setup: Mapping[str, Any]) -> SceneView | None:
    """View of a stored set-up; None where it holds no scene that can be drawn."""
    try:
        return _read(setup)
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def _read(setup: Mapping[str, Any]) -> SceneView | None:
    scene = setup["scene"]
    disks = scene["disks"]
    x = np.array(disks["x"], dtype=np.float64).reshape(-1, 2)
    radius = np.broadcast_to(np.array(disks["radius"], dtype=np.float64), (len(x),))
    v = np.array(disks.get("v") or np.zeros((len(x), 2)), dtype=np.float64).reshape(-1, 2)
    rotating = np.broadcast_to(np.array(disks.get("rotating", True), dtype=np.bool_), (len(x),))
    if not len(x) or not (np.isfinite(x).all() and np.isfinite(radius).all()):
        return None
    walls = tuple(_wall(wall) for wall in scene.get("walls", ()))
    labels = setup.get("labels") or {f"{i}–{j}": (i, j) for i, j in setup.get("watch", ())}
    marks = []
    for label, bodies in labels.items():
        place = _contact(np.atleast_1d(np.array(bodies, dtype=np.int64)), x, radius, walls)
        if place is not None:
            marks.append((str(label), place))
    gravity = np.array(scene.get("gravity", (0.0, 0.0)), dtype=np.float64)
    return SceneView(x, v, radius, rotating, walls, gravity, tuple(marks), _edges(scene, len(x)))


def _edges(scene: Mapping[str, Any], n: int) -> tuple[FloatArray | None, ...]:
    """Outlines of n bodies as closed polygons about their centres, turned by their angles at time 0."""
    numbers = scene["disks"].get("outline", [-1] * n)
    if not scene.get("outlines") or max(numbers, default=-1) < 0:
        return (None,) * n
    curves = [_polygon(curve) for curve in scene["outlines"]]
    angles = scene["disks"].get("angle", [0.0] * n)
    return tuple(
        None if number < 0 else turned(curves[number], float(angle))
        for number, angle in zip(numbers, angles, strict=True)
    )


def _polygon(curve: Mapping[str, Any]) -> FloatArray:
    """Points of a stored NURBS curve: a spline in homogeneous coordinates, over its weights."""
    from scipy.interpolate import BSpline

    degree, knots = int(curve["degree"]), np.array(curve["knots"], dtype=np.float64)
    weights = np.array(curve["weights"], dtype=np.float64)[:, None]
    points = np.array(curve["points"], dtype=np.float64)
    at = np.linspace(knots[degree], knots[-degree - 1], EDGE_POINTS)
    lifted = BSpline(knots, np.hstack([weights * points, weights]), degree)(at)
    return np.asarray(lifted[:, :2] / lifted[:, 2:], dtype=np.float64)


def turned(edge: FloatArray, angle: float) -> FloatArray:
    """A polygon turned about the origin by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(edge @ np.array([[c, s], [-s, c]]), dtype=np.float64)


def _wall(wall: Mapping[str, Any]) -> WallView:
    point = np.array(wall["point"], dtype=np.float64)
    normal = np.array(wall["normal"], dtype=np.float64)
    spin, pivot = 0.0, None
    moves: list[FloatArray] = []
    for segment in wall.get("motion", ()):
        moved = np.array(segment.get("velocity", (0.0, 0.0)), dtype=np.float64)
        if segment.get("tan_rate"):
            moved = moved + np.array(segment["tan_lever"]) * float(segment["tan_rate"])
        moved = moved + np.array(segment.get("amplitude", (0.0, 0.0))) * float(segment.get("frequency", 0.0))
        if moved.any() and not any(abs(moved @ known) > 0.9 * np.hypot(*moved) * np.hypot(*known) for known in moves):
            moves.append(moved)
        if not spin and segment.get("angular_velocity"):
            spin = float(segment["angular_velocity"])
            pivot = np.array(segment["pivot"] if segment.get("pivot") else point, dtype=np.float64)
    return WallView(str(wall["name"]), point, normal / np.hypot(*normal), tuple(moves), spin, pivot)


def _contact(
    bodies: NDArray[np.int64], x: FloatArray, radius: FloatArray, walls: tuple[WallView, ...]
) -> FloatArray | None:
    """Contact point of a pair of bodies; a body's own centre for a single number."""
    n = len(x)
    i, j = int(bodies[0]), int(bodies[-1])
    if not 0 <= i < n or not 0 <= j < n + len(walls):
        return None
    if i == j:
        return np.array(x[i])
    if j < n:
        gap_middle = radius[i] / (radius[i] + radius[j])
        return np.array(x[i] + gap_middle * (x[j] - x[i]))
    wall = walls[j - n]
    return np.array(x[i] - ((x[i] - wall.point) @ wall.normal) * wall.normal)
