"""Pictures, as SVG: sketches of set-ups, configurations of a run, and the source's figures for print.

A sketch shows what is read from a stored scene's JSON: disks or grains, walls as hatched half-planes, arrows of what moves; a scene in
space is seen from the side and from above. A figure of
the source shows a quantity over time, and below it every engine's distance from the truth on a logarithmic axis.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.reports.drawing.charts import PALETTE, SOFT, Look

FloatArray = NDArray[np.float64]
EPS = float(np.finfo(np.float64).eps)
MOST_POINTS = 300
MOST_ERRORS = 180
"""Errors jump from sample to sample; fewer points keep the files small and the extremes are kept anyway."""
MARKS = 7
FLAT = 2e-3
"""Relative span below which a quantity counts as constant."""
MOST_TOLD = 12
"""Moving bodies of a sketch whose speeds are given."""
MOST_NUMBERED = 60
ROMAN = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii")
MOTION, GRAVITY, MARK = PALETTE[0], PALETTE[2], "#d64545"
SPIN = PALETTE[4]
SPHERE = ("#a9bdd3", "#42566b", "#14222f")
"""Fill, rim and number of a sphere, the same on light and on dark pages: it covers what is behind it."""
CHAIN = MARK
CHAIN_WIDTH = 7.0
"""Width [pt] of the largest force of a picture; the others in proportion."""
EDGE_POINTS = 129
"""Points of an outline's polygon: a circle's is off by 3e-4 of its radius, less than the line is wide."""
INK = "#24292f"
"""Colour of text and axes; `svg_of` turns it light on dark pages."""
DARK = "#d7dce2"
"""What the ink becomes where the reader prefers a dark page."""
STRAIGHT = 0.6
"""Distance from a straight line, in tenths of a point, below which a curve's point is left out: no pixel moves."""
_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_ATTRIBUTE = re.compile(r'( (?:d|x|y|width|height|points)=")([^"]*)(")')
_POLYLINE = re.compile(r'\bd="((?:M ?-?[\d.]+ -?[\d.]+(?:L ?-?[\d.]+ -?[\d.]+)+)+)"')
_PAIR = re.compile(r"(-?[\d.]+) (-?[\d.]+)")
_STYLE = re.compile(r' style="([^"]*)"')


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
class CellView:
    """A periodic cell: edges at time 0 [m], and the rate of their columns [m/s]."""

    size: FloatArray
    motion: FloatArray

    def edges(self, t: float) -> FloatArray:
        """Edges at time ``t`` [s] as columns [m]: of the same lattice of images, the ones that lean least."""
        h = np.diag(self.size) + t * self.motion
        h[0, 1] -= np.round(h[0, 1] / h[0, 0]) * h[0, 0]
        return np.asarray(h)

    def outline(self, t: float) -> FloatArray:
        """Corners at time ``t`` [s], shape (4, 2)."""
        return np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) @ self.edges(t).T

    def placed(self, x: FloatArray, radius: FloatArray, t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Centres put back into the cell, and those of images beside it with the number of their disk."""
        h = self.edges(t)
        part = x @ np.linalg.inv(h).T
        part -= np.floor(part)
        near = 2.0 * radius.max(initial=0.0) / np.diag(h)
        images, of = [], []
        for shift in [np.array([p, q]) for p in (-1, 0, 1) for q in (-1, 0, 1) if p or q]:
            moved = part + shift
            beside = np.flatnonzero(((moved > -near) & (moved < 1.0 + near)).all(axis=1))
            images.append(moved[beside])
            of.append(beside)
        return part @ h.T, np.concatenate(images) @ h.T, np.concatenate(of)


def read_cell(setup: Mapping[str, Any]) -> CellView | None:
    """The periodic cell of a stored set-up; None where it has none."""
    cell = setup["scene"].get("cell")
    if cell is None:
        return None
    size = np.array(cell["size"], dtype=np.float64)
    return CellView(size, np.array(cell["rate"], dtype=np.float64) @ np.diag(size))


@dataclass(frozen=True)
class SceneView:
    """Disks and walls of a scene, or its periodic cell; ``marks`` are the watched contacts by label.

    ``edges`` are the outlines of its grains about their centres [m], turned as at time 0; None for a disk. The only body of a scene
    with a plane is a ``block`` if it cannot turn: engines get a disk that may not rotate, which is the same contact, but it is drawn
    as what it is.
    """

    x: FloatArray
    v: FloatArray
    radius: FloatArray
    rotating: NDArray[np.bool_]
    walls: tuple[WallView, ...]
    gravity: FloatArray
    marks: tuple[tuple[str, FloatArray], ...]
    edges: tuple[FloatArray | None, ...]
    block: bool = False
    cell: CellView | None = None

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
            None if self.cell is None else tuple(np.sign(self.cell.motion).ravel()),
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
    walls = tuple(_wall_of(wall) for wall in scene.get("walls", ()))
    labels = setup.get("labels") or {f"{i}–{j}": (i, j) for i, j in setup.get("watch", ())}
    marks = []
    for label, bodies in labels.items():
        place = _contact(np.atleast_1d(np.array(bodies, dtype=np.int64)), x, radius, walls)
        if place is not None:
            marks.append((str(label), place))
    gravity = np.array(scene.get("gravity", (0.0, 0.0)), dtype=np.float64)
    edges = _edges(scene, len(x))
    block = len(x) == 1 and len(walls) == 1 and not rotating[0] and edges[0] is None
    if block:
        half = radius[0] * np.array([walls[0].tangent, walls[0].normal])
        edges = (np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]) @ half,)
    cell = read_cell(setup)
    if cell is not None:  # a watched pair may touch through an edge, where no mark can be
        marks = []
    return SceneView(x, v, radius, rotating, walls, gravity, tuple(marks), edges, block, cell)


def with_gravity_down(scene: SceneView) -> SceneView:
    """A scene turned about the origin such that gravity points down; as it is without gravity."""
    strength = float(np.hypot(*scene.gravity))
    if strength == 0.0 or scene.gravity[1] <= -strength * (1.0 - 1e-12):
        return scene
    angle = -0.5 * np.pi - float(np.arctan2(scene.gravity[1], scene.gravity[0]))

    def turn(vector: FloatArray) -> FloatArray:
        return turned(vector, angle)

    walls = tuple(
        replace(
            wall,
            point=turn(wall.point),
            normal=turn(wall.normal),
            moves=tuple(turn(velocity) for velocity in wall.moves),
            pivot=None if wall.pivot is None else turn(wall.pivot),
        )
        for wall in scene.walls
    )
    return replace(
        scene,
        x=turn(scene.x),
        v=turn(scene.v),
        walls=walls,
        gravity=np.array([0.0, -strength]),
        marks=tuple((label, turn(place)) for label, place in scene.marks),
        edges=tuple(
            # A disk's number stands upright whatever the picture's turn; only outlines have a side that points somewhere.
            None if edge is None else turn(edge)
            for edge in scene.edges
        ),
    )


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
    """A point, or a polygon, turned about the origin by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(edge @ np.array([[c, s], [-s, c]]), dtype=np.float64)


def _wall_of(wall: Mapping[str, Any]) -> WallView:
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
    bodies: NDArray[np.int64], x: FloatArray, radius: FloatArray, walls: tuple[WallView, ...] | tuple[PlaneView, ...]
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


@dataclass(frozen=True)
class PlaneView:
    """A plane wall: as `WallView`, all vectors with three components."""

    name: str
    point: FloatArray
    normal: FloatArray
    moves: tuple[FloatArray, ...]
    spin: FloatArray


@dataclass(frozen=True)
class SpaceView:
    """Spheres, boxes and planes of a scene; ``marks`` are the watched contacts by label, ``up`` the number of the axis that stands upright.

    ``half`` has half the edges of boxes, zeros of spheres; the columns of ``turn`` are the directions of the edges.
    """

    x: FloatArray
    v: FloatArray
    omega: FloatArray
    radius: FloatArray
    walls: tuple[PlaneView, ...]
    gravity: FloatArray
    marks: tuple[tuple[str, FloatArray], ...]
    half: FloatArray
    turn: FloatArray

    @property
    def up(self) -> int:
        """That of the largest component of gravity; z without."""
        return int(np.argmax(np.abs(self.gravity))) if self.gravity.any() else 2

    @property
    def signature(self) -> tuple[Any, ...]:
        """Equal for scenes that look alike, whatever their speeds and stiffnesses."""
        size = float(self.radius.max())
        planes = tuple(
            (*np.round(wall.normal, 1), *np.sign(wall.spin), *np.sign(np.array(wall.moves)).ravel())
            for wall in self.walls
        )
        shape = np.round(np.concatenate([self.x, self.radius[:, None], self.half], axis=1) / size, 1)
        turn = np.round(self.turn[self.half.any(axis=1)], 1)
        return (
            tuple(turn.ravel()),
            tuple(shape.ravel()),
            planes,
            *(tuple(np.sign(each).ravel()) for each in (self.v, self.omega, self.gravity)),
        )


def read_space(setup: Mapping[str, Any]) -> SpaceView | None:
    """View of a stored set-up in space; None where it holds none that can be drawn."""
    try:
        scene = setup["scene"]
        if scene.get("dimension") != 3:
            return None
        spheres = scene["spheres"]
        x, v, omega = (np.array(spheres[name], dtype=np.float64).reshape(-1, 3) for name in ("x", "v", "omega"))
        radius = np.array(spheres["radius"], dtype=np.float64).reshape(len(x))
        half = np.array(spheres.get("half_sizes", np.zeros_like(x)), dtype=np.float64).reshape(x.shape)
        still = np.tile([1.0, 0.0, 0.0, 0.0], (len(x), 1))
        turn = _rotations(np.array(spheres.get("quaternion", still), dtype=np.float64).reshape(still.shape))
        walls = tuple(_plane_of(wall) for wall in scene["walls"])
        labels = setup.get("labels") or {f"{i}–{j}": (i, j) for i, j in setup.get("watch", ())}
        reported = (
            (str(label), _contact(np.array(pair, dtype=np.int64), x, radius, walls)) for label, pair in labels.items()
        )
        marks = tuple((label, place) for label, place in reported if place is not None)
        gravity = np.array(scene["gravity"], dtype=np.float64).reshape(3)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        return None
    if not (len(x) and np.isfinite(x).all()):
        return None
    return SpaceView(x, v, omega, radius, walls, gravity, marks, half, turn)


def _rotations(quaternion: FloatArray) -> FloatArray:
    """Rotation matrices, shape (n, 3, 3), of unit quaternions ``(w, x, y, z)``, shape (n, 4)."""
    w, u = quaternion[:, :1, None], quaternion[:, 1:]
    crossed = np.cross(u[:, None, :], np.eye(3)).transpose(0, 2, 1)
    found: FloatArray = np.eye(3) + 2.0 * w * crossed + 2.0 * crossed @ crossed
    return found


def faces_of(x: FloatArray, half: FloatArray, turn: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Outward normal, shape (3,), and corners in their order round it, shape (4, 3), of each face of a box.

    Parameters
    ----------
    x, half : ndarray, shape (3,)
        Centre and half the edges [m].
    turn : ndarray, shape (3, 3)
        Directions of the edges as columns.
    """
    found = []
    for axis in range(3):
        one, two = ((axis + step) % 3 for step in (1, 2))
        for side in (1.0, -1.0):
            middle = x + side * half[axis] * turn[:, axis]
            a, b = half[one] * turn[:, one], half[two] * turn[:, two]
            found.append(
                (side * turn[:, axis], np.array([middle + a + b, middle - a + b, middle - a - b, middle + a - b]))
            )
    return found


def _plane_of(wall: Mapping[str, Any]) -> PlaneView:
    point, normal = (np.array(wall[name], dtype=np.float64).reshape(3) for name in ("point", "normal"))
    moves, spin = [], np.zeros(3)
    for segment in wall["motion"]:
        moved = np.array(segment["velocity"]) + np.array(segment["amplitude"]) * float(segment["frequency"])
        if moved.any():
            moves.append(moved)
        if not spin.any():
            spin = np.array(segment["angular_velocity"], dtype=np.float64)
    return PlaneView(str(wall["name"]), point, normal / np.linalg.norm(normal), tuple(moves), spin)


@dataclass(frozen=True)
class Projection:
    """A scene in space as seen from the side, upright, or from above."""

    scene: SpaceView
    above: bool

    @property
    def axes(self) -> tuple[int, int]:
        """Numbers of the axes that point to the right and up."""
        across = {0: (1, 2), 1: (0, 2), 2: (0, 1)}[self.scene.up]
        return across if self.above else (across[0], self.scene.up)

    @property
    def depth(self) -> int:
        """Number of the axis along which one looks."""
        return 3 - sum(self.axes)

    @property
    def nearer(self) -> float:
        """1 where what has the larger coordinate along `depth` is nearer, else -1; from above it is, where gravity points down."""
        if self.above:
            return 1.0 if self.scene.gravity[self.scene.up] <= 0.0 else -1.0
        return 1.0 if (self.axes[0] + 1) % 3 == self.axes[1] else -1.0

    @property
    def middle(self) -> float:
        """Where planes are cut that are not seen edge-on, along `depth` [m]."""
        return float(self.scene.x[:, self.depth].mean())

    def cuts(self) -> list[tuple[WallView, bool]]:
        """Lines of the planes, and whether they are seen edge-on; none of those that face the viewer."""
        pair, found = list(self.axes), []
        for wall in self.scene.walls:
            seen = wall.normal[pair]
            length = float(np.hypot(*seen))
            if length < 0.05:
                continue
            # Points u of the cut have (u - p) . n + (middle - p_d) n_d = 0.
            shift = (wall.point[self.depth] - self.middle) * wall.normal[self.depth] / length
            moves = tuple(velocity[pair] for velocity in wall.moves if velocity[pair].any())
            cut = WallView(wall.name, wall.point[pair] + shift * seen / length, seen / length, moves)
            found.append((cut, length > 1.0 - 1e-9))
        return found

    @property
    def title(self) -> str:
        """What is seen, and its axes."""
        right, up = ("xyz"[axis] for axis in self.axes)
        return f"{'from above' if self.above else 'from the side'}: {right} to the right, {up} {'back' if self.above else 'up'}"


@dataclass(frozen=True)
class Configuration:
    """Disks and walls of several engines at one sampled step, and the force chains of one of them.

    ``chains`` are links, shape (2, 2) [m], with their normal force [N]; ``edges`` outlines as in `SceneView`, None: disks alone.
    """

    title: str
    radius: FloatArray
    bodies: tuple[tuple[Look, FloatArray, FloatArray, tuple[WallView, ...]], ...]  # look, x (n, 2), angle (n,), walls
    chains_of: str = ""
    chains: tuple[tuple[FloatArray, float], ...] = ()
    edges: tuple[FloatArray | None, ...] | None = None
    cell: tuple[CellView, float] | None = None
    """The periodic cell, and the time [s]."""


def draw_sketch(scene: SceneView) -> str:
    """SVG of a scene's sketch, gravity pointing down."""
    from matplotlib import rc_context

    if scene.cell is not None:
        return _draw_cell(scene, scene.cell)
    scene = with_gravity_down(scene)
    with rc_context(rc_params()):
        low, high, size = _box(scene.x, scene.radius, 0.3)
        figure, axes = _empty_axes(low, high)
        for wall in scene.walls:
            _wall(axes, wall, scene.walls, low, high, hatch=True)
        for k, (centre, radius) in enumerate(zip(scene.x, scene.radius, strict=True)):
            axes.add_patch(_body(centre, radius, scene.edges[k], facecolor=SOFT, alpha=0.28, edgecolor="none"))
            axes.add_patch(_body(centre, radius, scene.edges[k], facecolor="none", edgecolor=INK, linewidth=1.0))
            if len(scene.x) <= MOST_NUMBERED:
                axes.text(*centre, str(k), ha="center", va="center", fontsize=10, fontweight="bold")
            if not scene.rotating[k] and not scene.block:
                axes.text(centre[0], centre[1] - 0.45 * radius, "no rotation", ha="center", va="center", fontsize=6.5)
            if scene.v[k].any():
                along = scene.v[k] / np.hypot(*scene.v[k])
                if np.count_nonzero(scene.v.any(axis=1)) > MOST_TOLD:  # a gas: arrows as long as speeds, and no numbers
                    way = 2.0 * radius * scene.v[k] / np.hypot(*scene.v.T).mean()
                    _arrow(axes, centre, centre + way, MOTION, "")
                    continue
                foot = centre + radius * np.array([0.0, 1.18])
                label = f"{np.hypot(*scene.v[k]):.4g} m/s"
                _arrow(axes, foot - 0.4 * size * along, foot + 0.4 * size * along, MOTION, label)
        for wall in scene.walls:
            _motion(axes, wall, scene.walls, low, high, size)
        if len(scene.walls) == 1 and scene.gravity.any():
            _slope(axes, scene.walls[0], low, high)
        if scene.gravity.any():
            strength = float(np.hypot(*scene.gravity))
            head = np.array([high[0] - 1.1 * size, high[1] - 0.1 * size]) + 0.8 * size * scene.gravity / strength
            _arrow(axes, head - 0.8 * size * scene.gravity / strength, head, GRAVITY, f"g = {strength:.4g} m/s²")
        for k, (_, place) in enumerate(scene.marks):
            _mark(axes, place, numeral(k))
        return svg_of(figure)


def draw_projection(picture: Projection) -> str:
    """SVG of a scene in space seen along an axis; planes that are not seen edge-on are cut through the scene's middle, dashed."""
    from matplotlib import rc_context
    from matplotlib.patches import Circle, Polygon

    scene, pair = picture.scene, list(picture.axes)
    x, v, omega, size = scene.x[:, pair], scene.v, scene.omega, 0.0
    few = np.count_nonzero(v.any(axis=1) | omega.any(axis=1)) <= MOST_TOLD
    with rc_context(rc_params()):
        low, high, size = _box(x, scene.radius, 0.3)
        figure, axes = _empty_axes(low, high)
        cuts = picture.cuts()
        lines = tuple(cut for cut, _ in cuts)
        for cut, edge_on in cuts:
            _wall(axes, cut, lines, low, high, hatch=edge_on, style="solid" if edge_on else (0, (5, 3)))
        for k in np.argsort(picture.nearer * scene.x[:, picture.depth], kind="stable").tolist():
            centre, radius = x[k], float(scene.radius[k])
            level = 2.0 + 1e-3 * len(axes.patches)
            if scene.half[k].any():
                for normal, corners in faces_of(scene.x[k], scene.half[k], scene.turn[k]):
                    facing = picture.nearer * float(normal[picture.depth])
                    if facing > 1e-9:
                        axes.add_patch(
                            Polygon(
                                corners[:, pair], facecolor=SPHERE[0], edgecolor=SPHERE[1], linewidth=0.9, zorder=level
                            )
                        )
                        axes.add_patch(
                            Polygon(
                                corners[:, pair],
                                facecolor="#ffffff",
                                alpha=0.35 * facing,
                                edgecolor="none",
                                zorder=level,
                            )
                        )
            else:
                axes.add_patch(
                    Circle(tuple(centre), radius, facecolor=SPHERE[0], edgecolor=SPHERE[1], linewidth=0.9, zorder=level)
                )
                shine = centre + radius * np.array([-0.28, 0.3])
                axes.add_patch(
                    Circle(tuple(shine), 0.45 * radius, facecolor="#ffffff", alpha=0.35, edgecolor="none", zorder=level)
                )
            if radius > 0.03 * float((high - low).max()):
                axes.text(*centre, str(k), ha="center", va="center", fontsize=9, color=SPHERE[2], zorder=level)
        for k, (centre, radius) in enumerate(zip(x, scene.radius, strict=True)):
            speed = float(np.hypot(*v[k, pair]))
            if speed > 1e-9 * float(np.linalg.norm(v[k])):
                along = v[k, pair] / np.linalg.norm(v[k])
                label = f"{np.linalg.norm(v[k]):.4g} m/s" if few else ""
                # Behind the sphere, where nothing is that it is about to touch; in a crowd from its middle on.
                foot = centre - (radius * along + 0.6 * size * along if few else 0.0)
                _arrow(axes, foot, foot + (0.6 * size if few else 1.6 * radius) * along, MOTION, label)
            if few and omega[k].any():
                axes.text(
                    *(centre - [0.0, 0.5 * radius]),
                    _spin(omega[k]),
                    ha="center",
                    va="center",
                    fontsize=7.5,
                    color=SPIN,
                    zorder=6,
                )
        for cut in lines:
            _motion(axes, cut, lines, low, high, size)
        turning = [f"{wall.name} turns: {_spin(wall.spin)}" for wall in scene.walls if wall.spin.any()]
        axes.text(high[0], low[1], "\n".join(turning), color=SPIN, fontsize=7.5, ha="right", va="bottom", zorder=6)
        strength = float(np.linalg.norm(scene.gravity))
        if scene.gravity[pair].any():
            way = 0.8 * size * scene.gravity[pair] / strength
            head = np.array([high[0] - 1.1 * size, high[1] - 0.1 * size]) + way
            _arrow(axes, head - way, head, GRAVITY, f"g = {strength:.4g} m/s²")
        for k, (_, place) in enumerate(scene.marks):
            _mark(axes, place[pair], numeral(k))
        corner = low + 0.03 * (high - low)
        for along, name in zip(np.eye(2), ("xyz"[axis] for axis in pair), strict=True):
            _arrow(axes, corner, corner + 0.35 * size * along, INK, "")
            axes.text(*(corner + 0.42 * size * along), name, ha="center", va="center", fontsize=8)
        return svg_of(figure)


def _spin(omega: FloatArray) -> str:
    return "(" + ", ".join(f"{each + 0.0:.3g}" for each in np.round(omega, 12)) + ") rad/s"


def _draw_cell(scene: SceneView, cell: CellView) -> str:
    """SVG of a periodic cell: its edges, disks and the images beside it, and where its corners go."""
    from matplotlib import rc_context

    with rc_context(rc_params()):
        low, high, size = _box(cell.outline(0.0), np.zeros(4), 0.22)
        figure, axes = _empty_axes(low, high)
        _cell(axes, cell, 0.0, INK)
        x, images, of = cell.placed(scene.x, scene.radius, 0.0)
        for centre, radius in zip(images, scene.radius[of], strict=True):
            axes.add_patch(_body(centre, radius, None, facecolor="none", edgecolor=INK, linewidth=0.6, alpha=0.35))
        for centre, radius in zip(x, scene.radius, strict=True):
            axes.add_patch(_body(centre, radius, None, facecolor=SOFT, alpha=0.28, edgecolor="none"))
            axes.add_patch(_body(centre, radius, None, facecolor="none", edgecolor=INK, linewidth=0.8))
        rate = cell.motion / cell.size
        length = 0.45 * size / max(float(np.abs(cell.motion).max()), np.finfo(float).tiny)
        for k, middle in ((0, np.array([1.0, 0.5])), (1, np.array([0.5, 1.0]))):
            move = length * cell.motion[:, k]
            if move.any():
                foot = cell.size * middle + (0.05 * size * np.eye(2)[k])
                label = ", ".join(
                    f"{name} {value:.3g} /s" for name, value in zip("xy", rate[:, k], strict=True) if value
                )
                _arrow(axes, foot, foot + move, MOTION, f"edge {k + 1}: {label}")
        return svg_of(figure)


def _cell(axes: Any, cell: CellView, t: float, colour: str) -> None:
    from matplotlib.patches import Polygon

    axes.add_patch(Polygon(cell.outline(t), closed=True, facecolor="none", edgecolor=colour, linewidth=1.6, zorder=3.0))


def draw_configuration(configuration: Configuration) -> str:
    """SVG of the outlines of every engine's disks and walls; spokes show the rotations."""
    from matplotlib import rc_context

    with rc_context(rc_params()):
        every = np.concatenate([x for _, x, _, _ in configuration.bodies])
        radii = np.tile(configuration.radius, len(configuration.bodies))
        if configuration.cell is not None:
            outline = configuration.cell[0].outline(configuration.cell[1])
            every, radii = outline, np.full(4, configuration.radius.max(initial=0.0))
        low, high, _ = _box(every, radii, 0.07)
        figure, axes = _empty_axes(low, high)
        axes.set_title(configuration.title)
        if configuration.cell is not None:
            _cell(axes, *configuration.cell, INK)
        most = max((force for _, force in configuration.chains), default=0.0)
        for link, force in configuration.chains:
            if force > 0.0:
                axes.plot(*link.T, color=CHAIN, alpha=0.6, linewidth=CHAIN_WIDTH * force / most, zorder=1.5)
        for look, x, angle, walls in configuration.bodies:
            style = (0, tuple(look.dash)) if look.dash else "solid"
            for wall in walls:
                _wall(axes, wall, walls, low, high, hatch=False, colour=look.colour, style=style)
            edges = configuration.edges or (None,) * len(x)
            if configuration.cell is not None:
                cell, t = configuration.cell
                x, images, of = cell.placed(x, configuration.radius, t)
                for centre, radius in zip(images, configuration.radius[of], strict=True):
                    axes.add_patch(
                        _body(centre, radius, None, facecolor="none", edgecolor=look.colour, linewidth=0.6, alpha=0.35)
                    )
            for centre, radius, turn, edge in zip(x, configuration.radius, angle, edges, strict=True):
                options = {"edgecolor": look.colour, "linestyle": style, "linewidth": 1.1}
                if edge is not None and not np.isfinite(turn):
                    continue
                placed = None if edge is None else turned(edge, turn)
                axes.add_patch(_body(centre, radius, placed, facecolor="none", **options))
                if np.isfinite(turn):
                    rim = centre + (radius * np.array([np.cos(turn), np.sin(turn)]) if placed is None else placed[0])
                    axes.plot(*zip(centre, rim, strict=True), color=look.colour, linewidth=1.1, linestyle=style)
        return svg_of(figure)


def numbers_of(picture: SceneView | Configuration | Projection) -> str:
    """What a sketch or a configuration shows as CSV: a line a body, then a line a wall; a wall has a point and its unit normal."""
    if isinstance(picture, Projection):
        return _numbers_in_space(picture.scene)
    lines = ["engine,kind,number,x [m],y [m],radius [m],angle [rad],vx [m/s],vy [m/s],normal x,normal y"]

    def add(*cells: Any) -> None:
        reported = [
            "" if cell is None or cell != cell else cell if isinstance(cell, str) else repr(float(cell))
            for cell in cells
        ]
        lines.append(
            ",".join(
                f'"{cell.replace(chr(34), chr(34) * 2)}"' if set(cell) & set(',"\n') else cell for cell in reported
            )
        )

    if isinstance(picture, SceneView):
        for k, (x, radius, v) in enumerate(zip(picture.x, picture.radius, picture.v, strict=True)):
            add("", "block" if picture.block else "body", str(k), *x, radius, None, *v, None, None)
        bodies: Sequence[tuple[str, tuple[WallView, ...]]] = [("", picture.walls)]
    else:
        for look, places, angles, _ in picture.bodies:
            for k, (x, radius, angle) in enumerate(zip(places, picture.radius, angles, strict=True)):
                add(look.label, "body", str(k), *x, radius, angle, None, None, None, None)
        bodies = [(look.label, walls) for look, _, _, walls in picture.bodies]
    for name, walls in bodies:
        for k, wall in enumerate(walls):
            add(name, "wall", wall.name or str(k), *wall.point, None, None, None, None, *wall.normal)
    return "\n".join(lines) + "\n"


def _numbers_in_space(scene: SpaceView) -> str:
    names = [
        f"{name}{axis}{unit}"
        for name, unit in (("", " [m]"), ("v", " [m/s]"), ("omega ", " [rad/s]"), ("normal ", ""))
        for axis in "xyz"
    ]
    lines = [",".join(["kind", "number", "radius [m]", *names])]
    for k, (x, v, omega, radius) in enumerate(zip(scene.x, scene.v, scene.omega, scene.radius, strict=True)):
        lines.append(
            ",".join(["sphere", str(k), *(repr(float(each)) for each in (radius, *x, *v, *omega)), "", "", ""])
        )
    for wall in scene.walls:
        name = '"' + wall.name.replace('"', '""') + '"'
        lines.append(",".join(["plane", name, "", *(repr(float(each)) for each in wall.point), *[""] * 6,
                               *(repr(float(each)) for each in wall.normal)]))  # fmt: skip
    return "\n".join(lines) + "\n"


def numeral(k: int) -> str:
    """Roman numeral of the k-th watched contact, from 0."""
    return ROMAN[k] if k < len(ROMAN) else str(k + 1)


def _body(centre: FloatArray, radius: float, edge: FloatArray | None, **style: Any) -> Any:
    """A disk, or a grain whose outline is ``edge`` about its centre."""
    from matplotlib.patches import Circle, Polygon

    return Circle(tuple(centre), radius, **style) if edge is None else Polygon(centre + edge, closed=True, **style)


def _box(x: FloatArray, radius: FloatArray, margin: float) -> tuple[FloatArray, FloatArray, float]:
    """Lower and upper corner of the picture, and the length of a typical arrow."""
    finite = np.isfinite(x).all(axis=1)
    x, radius = x[finite], radius[finite]
    if not len(x):
        x, radius = np.zeros((1, 2)), np.ones(1)
    low, high = (x - radius[:, None]).min(axis=0), (x + radius[:, None]).max(axis=0)
    extent = float((high - low).max())
    return low - margin * extent, high + margin * extent, 0.3 * extent


def _empty_axes(low: FloatArray, high: FloatArray) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    shape = (high - low)[1] / (high - low)[0]
    figure = Figure(figsize=(4.5, float(np.clip(4.5 * shape, 1.8, 5.0))), layout="constrained")
    axes = figure.subplots()
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    return figure, axes


def _ends(wall: WallView, others: tuple[WallView, ...], low: FloatArray, high: FloatArray) -> tuple[float, float]:
    """Stretch of a wall's line that is drawn: inside the picture and on the free side of the other walls."""
    reach = 0.5 * float(np.hypot(*(high - low)))
    middle = (0.5 * (low + high) - wall.point) @ wall.tangent
    first, last = float(middle - reach), float(middle + reach)
    for other in others:
        slope = float(wall.tangent @ other.normal)
        if other is wall or abs(slope) < 1e-6:
            continue
        cut = float((other.point - wall.point) @ other.normal) / slope
        first, last = (max(first, cut), last) if slope > 0.0 else (first, min(last, cut))
    return first, last


def _wall(
    axes: Any, wall: WallView, walls: tuple[WallView, ...], low: FloatArray, high: FloatArray, *,
    hatch: bool, colour: str = INK, style: Any = "solid",
) -> None:  # fmt: skip
    first, last = _ends(wall, walls, low, high)
    if not first < last:
        return
    a, b = wall.point + first * wall.tangent, wall.point + last * wall.tangent
    if hatch:
        from matplotlib.patches import Polygon

        depth = 0.045 * float((high - low).max()) * wall.normal
        band = np.array([a, b, b - depth, a - depth])
        axes.add_patch(Polygon(band, facecolor="none", edgecolor=SOFT, hatch="/////", linewidth=0.0))
    axes.plot(*zip(a, b, strict=True), color=colour, linewidth=1.4, linestyle=style)


def _motion(
    axes: Any, wall: WallView, walls: tuple[WallView, ...], low: FloatArray, high: FloatArray, size: float
) -> None:
    first, last = _ends(wall, walls, low, high)
    downwards = wall.tangent[1] < -1e-9 or (wall.tangent[1] < 1e-9 and wall.tangent[0] < 0.0)
    start, end = (last, first) if downwards else (first, last)  # from the lower or left end on
    low_pivot = wall.pivot is not None and ((wall.pivot - wall.point) @ wall.tangent - start) / (end - start) < 0.3
    for velocity in wall.moves:
        along = velocity / np.hypot(*velocity)
        inward = abs(float(along @ wall.normal)) > 0.5
        share = (0.8 if low_pivot else 0.2) if wall.spin else 0.5 if inward else 0.15
        place = wall.point + (start + share * (end - start)) * wall.tangent - 0.25 * size * wall.normal
        foot = place - (0.55 if inward else 0.3) * size * along
        label = f"{np.hypot(*velocity):.4g} m/s"
        _arrow(axes, foot, foot + 0.6 * size * along, MOTION, label, beneath=wall.normal[1] > 0.5)
    if wall.spin and wall.pivot is not None:
        from matplotlib.patches import FancyArrowPatch

        axes.plot(*wall.pivot, marker="o", markersize=5, color=MOTION)
        arm = 0.8 * size * wall.tangent * (1.0 if wall.tangent[1] >= 0.0 else -1.0)
        tip = turned(arm, float(np.copysign(0.6, wall.spin)))
        bend = f"arc3,rad={0.35 * np.sign(wall.spin):g}"
        axes.add_patch(
            FancyArrowPatch(
                tuple(wall.pivot + arm), tuple(wall.pivot + tip), connectionstyle=bend, arrowstyle="-|>",
                mutation_scale=10, color=MOTION, linewidth=1.4, clip_on=False,
            )
        )  # fmt: skip
        beside = wall.pivot + 1.15 * arm - 0.3 * size * wall.normal
        side = "right" if wall.normal[0] >= 0.0 else "left"
        axes.text(*beside, f"{abs(wall.spin):.4g} rad/s", color=MOTION, fontsize=8, ha=side, va="center", zorder=6)


def _slope(axes: Any, wall: WallView, low: FloatArray, high: FloatArray) -> None:
    """Angle of a plane that is neither level nor upright with the horizontal, at its lower end."""
    from matplotlib.patches import Arc

    uphill = wall.tangent if wall.tangent[1] > 0.0 else -wall.tangent
    angle = float(np.degrees(np.arctan2(uphill[1], abs(uphill[0]))))
    if not 0.5 < angle < 89.5:
        return
    side = 1.0 if uphill[0] > 0.0 else -1.0
    # The lowest point of the plane that is well inside the picture, moving up from the lower corner.
    room = 0.05 * (high - low)
    corner = np.array([low[0] + room[0] if side > 0.0 else high[0] - room[0], low[1] + room[1]])
    foot = wall.point + float(((corner - wall.point) / uphill).max()) * uphill
    reach = 0.45 * float(high[0] - low[0])
    axes.plot(
        [foot[0], foot[0] + side * reach], [foot[1]] * 2, color=INK, linewidth=0.8, linestyle=(0, (5, 3)), zorder=4
    )
    first, last = (0.0, angle) if side > 0.0 else (180.0 - angle, 180.0)
    axes.add_patch(
        Arc(tuple(foot), 1.6 * reach, 1.6 * reach, theta1=first, theta2=last, color=INK, linewidth=1.0, zorder=4)
    )
    half = np.radians(0.5 * angle)
    place = foot + 0.86 * reach * np.array([side * np.cos(half), np.sin(half)])
    axes.text(*place, f"{angle:.4g}°", fontsize=9, ha="left" if side > 0.0 else "right", va="center", zorder=6)


def _arrow(axes: Any, tail: FloatArray, head: FloatArray, colour: str, label: str, *, beneath: bool = False) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(head), xytext=tuple(tail), arrowprops=arrow, annotation_clip=False)
    along = head - tail
    upright = abs(along[1]) > abs(along[0])
    offset = (5, 0) if upright else (0, -5) if beneath else (0, 5)
    axes.annotate(
        label,
        xy=tuple(tail + (0.5 if upright else 0.35) * along),
        xytext=offset,
        textcoords="offset points",
        color=colour,
        fontsize=8,
        ha="left" if upright else "center",
        va="center" if upright else "top" if beneath else "bottom",
        annotation_clip=False,
    )


def _mark(axes: Any, place: FloatArray, text: str) -> None:
    box = {"boxstyle": "circle,pad=0.22", "facecolor": MARK, "edgecolor": "none"}
    axes.text(*place, text, color="#ffffff", fontsize=7, ha="center", va="center", bbox=box, zorder=5)


@dataclass(frozen=True)
class Line:
    """A curve of a panel; ``error`` is None for references and where no truth speaks."""

    look: Look
    x: FloatArray
    y: FloatArray
    error: FloatArray | None = None
    tolerance: float = float("nan")


@dataclass(frozen=True)
class HistoryPanel:
    """What one panel draws; limits are shared by the panels that are compared.

    ``floor`` is the round-off of the quantity: smaller errors are drawn on it. ``note`` says what is clipped, and which truth the
    errors are measured from.
    """

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    references: tuple[Line, ...]
    y_limits: tuple[float, float]
    error_limits: tuple[float, float] | None
    floor: float
    note: str = ""


@dataclass(frozen=True)
class StackPanel:
    """Quantities of one engine on top of each other, from below: names, numbers of their colours, values of shape (s,).

    ``base`` is where the lowest begins, ``base_name`` what is taken off there; empty: nothing.
    """

    title: str
    y_label: str
    t: FloatArray
    base: FloatArray
    base_name: str
    bands: tuple[tuple[str, int, FloatArray], ...]


def draw_stack(panel: StackPanel) -> str:
    """SVG of stacked areas, with a line along their top: flat where they add up to the same at all times."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(rc_params()):
        # Room for the names beneath, two in a row: the picture stays readable on a narrow page.
        rows = (len(panel.bands) + 2) // 2
        tall = 2.9 + 0.17 * rows
        figure = Figure(figsize=(4.3, tall))
        axes = figure.subplots()
        figure.subplots_adjust(left=0.13, right=0.98, top=1.0 - 0.3 / tall, bottom=(0.5 + 0.17 * rows) / tall)
        figure.text(0.02, 0.985, panel.title, fontsize=9.0, va="top")
        low = panel.base
        if panel.base_name:
            axes.fill_between(
                panel.t, np.minimum(0.0, low), np.maximum(0.0, low), label=panel.base_name, facecolor="none", edgecolor=SOFT,
                hatch="////", linewidth=0.4,
            )  # fmt: skip
        for name, number, values in panel.bands:
            colour = PALETTE[number % len(PALETTE)]
            axes.fill_between(panel.t, low, low + values, color=colour, alpha=0.75, linewidth=0.0, label=name)
            low = low + values
        axes.plot(panel.t, low, color=INK, linewidth=1.4, label="sum")
        axes.set_xlim(panel.t[0], panel.t[-1])
        axes.set_xlabel("time [s]", labelpad=1.0)
        axes.set_ylabel(panel.y_label)
        figure.legend(
            loc="lower left", ncols=2, fontsize=7.0, frameon=False, borderpad=0.1, handlelength=1.4, labelspacing=0.3
        )
        return svg_of(figure)


def value_limits(truths: Sequence[FloatArray], values: Sequence[FloatArray]) -> tuple[float, float]:
    """Common limits of a quantity: all curves, but at most twice the truths' own span beyond them, so that one engine
    that runs away does not flatten the others."""
    low, high = _span([*truths, *values])
    if truths and np.isfinite(_span(truths)).all():
        least, most = _span(truths)
        room = 2.0 * (most - least)
        if room > 0.0:
            low, high = max(low, least - room), min(high, most + room)
    if not np.isfinite([low, high]).all():
        return -1.0, 1.0
    # A constant is drawn as one: what happens around it (and round-off around zero) belongs to the error axis.
    size = max(abs(low), abs(high))
    if high - low < FLAT * size:
        low, high = low - 0.05 * size, high + 0.05 * size
    if size < 1e-12:
        low, high = -1e-12, 1e-12
    margin = 0.06 * (high - low)
    return low - margin, high + margin


def error_limits(errors: Sequence[FloatArray], tolerances: Sequence[float], floor: float) -> tuple[float, float] | None:
    """Common limits of the error axis, at least three decades and the tolerances; None where there is no error."""
    finite = [error[np.isfinite(error)] for error in errors]
    if not any(len(error) for error in finite):
        return None
    top = max(float(error.max()) for error in finite if len(error))
    top = max([top, *(limit for limit in tolerances if np.isfinite(limit))])
    return 0.5 * floor, max(4.0 * top, 500.0 * floor)


def round_off(scales: Sequence[float], errors: Sequence[FloatArray]) -> float:
    """Round-off of a quantity, ``eps max|expected|``.

    For a truth of zero it is the smallest error that is not zero, but no less than ``eps`` times the largest one.
    """
    scale = max((s for s in scales if np.isfinite(s)), default=0.0)
    if scale > 0.0:
        return EPS * scale
    positive = [error[np.isfinite(error) & (error > 0.0)] for error in errors]
    filled = [error for error in positive if len(error)]
    if not filled:
        return EPS
    return max(min(float(error.min()) for error in filled), EPS * max(float(error.max()) for error in filled))


def error_label(y_label: str) -> str:
    """Label of the error axis below an axis of values."""
    return f"|error| {y_label[y_label.rfind('[') :]}" if "[" in y_label else "|error|"


def draw_history(panel: HistoryPanel) -> str:
    """SVG of a panel."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(rc_params()):
        reported = textwrap.wrap(panel.note, 78)
        foot = 0.13 * len(reported)
        tall = (2.3 if panel.error_limits is None else 3.6) + foot
        figure = Figure(figsize=(4.3, tall))
        if panel.error_limits is None:
            top, bottom = figure.subplots(), None
        else:
            top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1.0))
        # Fixed margins: measuring the texts takes longer than drawing everything else.
        figure.subplots_adjust(left=0.17, right=0.78, top=1.0 - 0.45 / tall, bottom=(0.43 + foot) / tall, hspace=0.1)
        figure.text(0.02, 0.985, panel.title, fontsize=9.0, va="top")
        if reported:
            figure.text(0.02, 0.01, "\n".join(reported), fontsize=6.5, va="bottom")
        top.set_ylabel(panel.y_label)
        top.set_ylim(*panel.y_limits)
        for line in panel.references:
            _plot(top, line.look, line.x, line.y, zorder=1.0)
        for line in panel.lines:
            _plot(top, line.look, line.x, line.y, zorder=2.0)
        _name_ends(top, [(line.look, line.y) for line in (*panel.references, *panel.lines)], panel.y_limits)
        if bottom is not None and panel.error_limits is not None:
            _errors(bottom, panel, panel.error_limits)
        (top if bottom is None else bottom).set_xlabel(panel.x_label)
        return svg_of(figure)


def _errors(axes: Any, panel: HistoryPanel, limits: tuple[float, float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set_yscale("log")
    axes.set_ylim(*limits)
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: log_label(value)))
    axes.set_ylabel(error_label(panel.y_label))
    axes.axhline(panel.floor, color=INK, linewidth=0.6, alpha=0.6, dashes=(1, 2))
    axes.text(0.01, panel.floor, "round-off", transform=axes.get_yaxis_transform(), fontsize=7, va="bottom")
    for line in panel.lines:
        if line.error is not None and np.isfinite(line.error).any():
            _plot(axes, line.look, line.x, np.maximum(line.error, panel.floor), zorder=2.0, most=MOST_ERRORS)
    shown = [(line.look, np.maximum(line.error, panel.floor)) for line in panel.lines if line.error is not None]
    _name_ends(axes, [(look, np.log10(error)) for look, error in shown], (np.log10(limits[0]), np.log10(limits[1])))
    limits_shown = sorted(
        {line.tolerance for line in panel.lines if np.isfinite(line.tolerance) and line.tolerance > 0}
    )
    if len(limits_shown) == 1:
        axes.axhline(limits_shown[0], color=INK, linewidth=0.8, alpha=0.8, dashes=(5, 2))
        axes.text(
            0.99,
            limits_shown[0],
            "tolerance",
            transform=axes.get_yaxis_transform(),
            fontsize=7,
            ha="right",
            va="bottom",
        )
    elif limits_shown:
        for line in panel.lines:
            if np.isfinite(line.tolerance) and line.tolerance > 0:
                mark = [line.tolerance, line.tolerance]
                axes.plot(
                    [0.94, 1.0], mark, transform=axes.get_yaxis_transform(), color=line.look.colour, linewidth=2.0
                )


def _name_ends(axes: Any, ends: Sequence[tuple[Look, FloatArray]], limits: tuple[float, float]) -> None:
    """Write the names of curves beside their last values."""
    low, high = limits
    places = []
    for look, values in ends:
        held = values[np.isfinite(values)]
        if len(held):
            places.append((float(np.clip((held[-1] - low) / (high - low), 0.0, 1.0)), look))
    for height, words, colour in end_labels(places, 0.025, 0.075):
        axes.text(1.015, height, words, transform=axes.transAxes, fontsize=6.5, color=colour, va="center")


def end_labels(places: Sequence[tuple[float, Look]], near: float, apart: float) -> list[tuple[float, str, str]]:
    """Labels beside the ends of curves: height, words and colour.

    Parameters
    ----------
    places : sequence of (float, Look)
        Height of each end in parts of the axis; looks without a mark are truths.
    near : float
        Ends that are no farther apart than this share a label.
    apart : float
        Labels keep this distance; where there is no room for all, neighbours are joined.
    """
    groups: list[list[tuple[float, Look]]] = []
    for place in sorted(places, key=lambda each: each[0]):
        if groups and place[0] - groups[-1][-1][0] <= near:
            groups[-1].append(place)
        else:
            groups.append([place])
    while len(groups) > max(1, int(1.0 / apart)):
        gaps = [two[0][0] - one[-1][0] for one, two in pairwise(groups)]
        k = gaps.index(min(gaps))
        groups[k : k + 2] = [groups[k] + groups[k + 1]]
    heights: list[float] = []
    for group in groups:
        middle = sum(height for height, _ in group) / len(group)
        heights.append(max(middle, heights[-1] + apart) if heights else middle)
    highest = 1.0
    for k in range(len(heights) - 1, -1, -1):
        heights[k] = highest = min(heights[k], highest)
        highest -= apart
    found = []
    for height, group in zip(heights, groups, strict=True):
        names = list(dict.fromkeys(look.label for _, look in group if look.marker))
        truth = len(names) < len({look.label for _, look in group})
        both = ", ".join(names)
        one = both if len(names) < 2 or len(both) <= LABEL else f"{len(names)} engines"
        words = ("truth" if not names else f"truth + {len(names)}") if truth else one
        colour = next(look.colour for _, look in group if look.marker) if len(names) == 1 and not truth else INK
        found.append((height, words, colour))
    return found


LABEL = 16
"""Letters that fit beside a chart."""


def log_label(value: float) -> str:
    """Label of a power of ten on a log axis: ``1e-9``."""
    return f"1e{round(float(np.log10(value)))}" if value > 0.0 else ""


def _plot(axes: Any, look: Look, x: FloatArray, y: FloatArray, zorder: float, most: int = MOST_POINTS) -> None:
    x, y = joined(x, y)
    keep = thinned_indices(x, y, most)
    x, y = x[keep], y[keep]
    options: dict[str, Any] = {"color": look.colour, "linewidth": look.width, "zorder": zorder}
    if look.dash:
        options["dashes"] = [length / look.width * 0.8 for length in look.dash]
    if not look.marker:
        options["alpha"] = 0.55
    elif len(x):
        places = sorted({int((k + look.phase) / MARKS * len(x)) for k in range(MARKS)})
        options |= {"marker": look.marker, "markersize": 4.0, "markevery": places, "markeredgewidth": 0.0}
    axes.plot(x, y, **options)


def joined(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points to connect: a curve that speaks at scattered samples only loses its gaps, any other keeps them."""
    held = np.isfinite(y)
    neighbour = np.append(held[1:], False) | np.append(False, held[:-1])
    alone = held & ~neighbour
    return (x[held], y[held]) if 2 * alone.sum() > held.sum() else (x, y)


def thinned_indices(x: FloatArray, y: FloatArray, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Indices of at most ``most`` points that keep the ends and the extremes of every stretch."""
    if len(x) <= most:
        return np.arange(len(x))
    keep = {0, len(x) - 1}
    for part in np.array_split(np.arange(len(x)), most // 2 - 1):
        finite = part[np.isfinite(y[part])]
        keep |= (
            {int(finite[np.argmin(y[finite])]), int(finite[np.argmax(y[finite])])} if len(finite) else {int(part[0])}
        )
    return np.array(sorted(keep))


def _span(curves: Sequence[FloatArray]) -> tuple[float, float]:
    finite = [curve[np.isfinite(curve)] for curve in curves]
    filled = [curve for curve in finite if len(curve)]
    if not filled:
        return float("nan"), float("nan")
    return min(float(curve.min()) for curve in filled), max(float(curve.max()) for curve in filled)


def rc_params() -> Any:
    """Settings of matplotlib: transparent, text as text, no mathematics in labels, and the same bytes every time."""
    return {
        "font.family": "DejaVu Sans",
        "font.size": 8.5,
        "axes.titlesize": 9.0,
        "axes.titley": 1.0,
        "axes.titlelocation": "left",
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.titlecolor": INK,
        "axes.facecolor": "none",
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.formatter.use_mathtext": False,
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-3, 4),
        "axes.unicode_minus": True,
        "grid.color": SOFT,
        "grid.alpha": 0.25,
        "grid.linewidth": 0.6,
        "xtick.color": INK,
        "ytick.color": INK,
        "text.color": INK,
        "text.parse_math": False,
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "svg.fonttype": "none",
        "svg.hashsalt": "ninedisk",
        "path.simplify": True,
        "path.simplify_threshold": 0.15,
    }


def svg_of(figure: Any) -> str:
    """A matplotlib figure as SVG: small, the same every time, readable on light and dark pages.

    Coordinates are rounded to 0.1 pt, a tenth of a line's width, and points of a curve that lie on the line through
    their neighbours to that precision are left out; styles that matplotlib repeats at every tick and marker become
    classes. Together that makes the file a fifth as large.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = _ATTRIBUTE.sub(lambda m: m[1] + _NUMBER.sub(_short, m[2]) + m[3], text)
    text = re.sub(r"'DejaVu Sans'(, sans-serif)?", "system-ui, sans-serif", text)
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    text = re.sub(r"\n\s*", "\n", text)
    text = re.sub(r" ?\n([LMCQz\"])", r"\1", text)
    text = _POLYLINE.sub(lambda m: f'd="{"".join(map(_shortened, re.split("(?=M)", m[1])))}"', text)
    text = re.sub(r">\n+<", "><", text)
    text = _short_ids(text)
    return _with_classes(text)


def _with_classes(text: str) -> str:
    """Replace style attributes by classes; those that use the ink get a second rule for dark pages."""
    names: dict[str, str] = {}
    text = _STYLE.sub(lambda m: f' class="{names.setdefault(m[1], f"s{len(names)}")}"', text)
    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    dark = "".join(
        f".{name}{{{inked}}}"
        for style, name in names.items()
        if (inked := "".join(f"{what}:{DARK};" for what in ("fill", "stroke") if f"{what}: {INK}" in style))
    )
    head = text.index(">") + 1
    sheet = f"<style>{rules}@media screen and (prefers-color-scheme: dark){{{dark}}}</style>"
    return text[:head] + sheet + text[head:]


def _short(match: re.Match[str]) -> str:
    return f"{float(match[0]):.1f}".rstrip("0").rstrip(".") or "0"


def _short_ids(text: str) -> str:
    """Replace matplotlib's ids, which every marker repeats, by short ones."""
    names = {name: f"i{k}" for k, name in enumerate(dict.fromkeys(re.findall(r' id="([^"]+)"', text)))}
    return re.sub(r'(id="|href="#|url\(#)([^")]+)', lambda m: m[1] + names.get(m[2], m[2]), text)


def _shortened(line: str) -> str:
    """A polyline with absolute coordinates as one with relative ones, without the points that lie on their neighbours' line."""
    points = [(round(10 * float(x)), round(10 * float(y))) for x, y in _PAIR.findall(line)]
    if not points:
        return ""
    kept = _corners(points)
    (x, y), steps = kept[0], []
    for u, v in kept[1:]:
        steps.append(f"{_tenths(u - x)} {_tenths(v - y)}".replace(" -", "-"))
        x, y = u, v
    return f"M{_tenths(kept[0][0])} {_tenths(kept[0][1])}" + (f"l{' '.join(steps)}".replace(" -", "-") if steps else "")


def _corners(points: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Ramer-Douglas-Peucker with the tolerance `STRAIGHT`: no left-out point is farther from the line that stays."""
    keep = {0, len(points) - 1}
    stack = [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        (ax, ay), (bx, by) = points[a], points[b]
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        worst, far = STRAIGHT * STRAIGHT, -1
        for k in range(a + 1, b):
            px, py = points[k][0] - ax, points[k][1] - ay
            along = min(1.0, max(0.0, (px * dx + py * dy) / length)) if length else 0.0
            apart = (px - along * dx) ** 2 + (py - along * dy) ** 2
            if apart > worst:
                worst, far = apart, k
        if far > 0:
            keep.add(far)
            stack += [(a, far), (far, b)]
    return [points[k] for k in sorted(keep)]


def _tenths(value: int) -> str:
    return f"{value / 10:g}"
