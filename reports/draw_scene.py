"""Sketch of a set-up, and configurations of a run: disks, walls as hatched half-planes, arrows of what moves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.reports.scene_view import SceneView, WallView, turned
from ninedisk.reports.style import INK, PALETTE, SOFT, Look, rc_params
from ninedisk.reports.svg import write_svg

FloatArray = NDArray[np.float64]
MOST_NUMBERED = 60
ROMAN = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii")
MOTION, GRAVITY, MARK = PALETTE[0], PALETTE[2], PALETTE[6]
CHAIN = PALETTE[6]
CHAIN_WIDTH = 7.0
"""Width [pt] of the largest force of a picture; the others in proportion."""


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


def draw_sketch(scene: SceneView, path: Path) -> None:
    """Write the sketch of a scene as SVG."""
    from matplotlib import rc_context

    with rc_context(rc_params()):
        low, high, size = _box(scene.x, scene.radius, 0.3)
        figure, axes = _blank(low, high)
        for wall in scene.walls:
            _wall(axes, wall, scene.walls, low, high, hatch=True)
        for k, (centre, radius) in enumerate(zip(scene.x, scene.radius, strict=True)):
            axes.add_patch(_body(centre, radius, scene.edges[k], facecolor=SOFT, alpha=0.28, edgecolor="none"))
            axes.add_patch(_body(centre, radius, scene.edges[k], facecolor="none", edgecolor=INK, linewidth=1.0))
            if len(scene.x) <= MOST_NUMBERED:
                axes.text(*centre, str(k), ha="center", va="center", fontsize=10, fontweight="bold")
            if not scene.rotating[k]:
                axes.text(centre[0], centre[1] - 0.45 * radius, "no rotation", ha="center", va="center", fontsize=6.5)
            if scene.v[k].any():
                along = scene.v[k] / np.hypot(*scene.v[k])
                foot = centre + radius * np.array([0.0, 1.18])
                label = f"{np.hypot(*scene.v[k]):.4g} m/s"
                _arrow(axes, foot - 0.4 * size * along, foot + 0.4 * size * along, MOTION, label)
        for wall in scene.walls:
            _motion(axes, wall, scene.walls, low, high, size)
        if scene.gravity.any():
            strength = float(np.hypot(*scene.gravity))
            head = np.array([high[0] - 1.1 * size, high[1] - 0.1 * size]) + 0.8 * size * scene.gravity / strength
            _arrow(axes, head - 0.8 * size * scene.gravity / strength, head, GRAVITY, f"g = {strength:.4g} m/s²")
        for k, (_, place) in enumerate(scene.marks):
            _mark(axes, place, numeral(k))
        write_svg(figure, path)


def draw_configuration(configuration: Configuration, path: Path) -> None:
    """Write the outlines of every engine's disks and walls as SVG; spokes show the rotations."""
    from matplotlib import rc_context

    with rc_context(rc_params()):
        every = np.concatenate([x for _, x, _, _ in configuration.bodies])
        radii = np.tile(configuration.radius, len(configuration.bodies))
        low, high, _ = _box(every, radii, 0.07)
        figure, axes = _blank(low, high)
        axes.set_title(configuration.title)
        most = max((force for _, force in configuration.chains), default=0.0)
        for link, force in configuration.chains:
            if force > 0.0:
                axes.plot(*link.T, color=CHAIN, alpha=0.6, linewidth=CHAIN_WIDTH * force / most, zorder=1.5)
        for look, x, angle, walls in configuration.bodies:
            style = (0, tuple(look.dash)) if look.dash else "solid"
            for wall in walls:
                _wall(axes, wall, walls, low, high, hatch=False, colour=look.colour, style=style)
            edges = configuration.edges or (None,) * len(x)
            for centre, radius, turn, edge in zip(x, configuration.radius, angle, edges, strict=True):
                options = {"edgecolor": look.colour, "linestyle": style, "linewidth": 1.1}
                if edge is not None and not np.isfinite(turn):
                    continue
                placed = None if edge is None else turned(edge, turn)
                axes.add_patch(_body(centre, radius, placed, facecolor="none", **options))
                if np.isfinite(turn):
                    rim = centre + (radius * np.array([np.cos(turn), np.sin(turn)]) if placed is None else placed[0])
                    axes.plot(*zip(centre, rim, strict=True), color=look.colour, linewidth=1.1, linestyle=style)
        write_svg(figure, path)


def _body(centre: FloatArray, radius: float, edge: FloatArray | None, **style: Any) -> Any:
    """A disk, or a grain whose outline is ``edge`` about its centre."""
    from matplotlib.patches import Circle, Polygon

    return Circle(tuple(centre), radius, **style) if edge is None else Polygon(centre + edge, closed=True, **style)


def numeral(k: int) -> str:
    """Roman numeral of the k-th watched contact, from 0."""
    return ROMAN[k] if k < len(ROMAN) else str(k + 1)


def _box(x: FloatArray, radius: FloatArray, margin: float) -> tuple[FloatArray, FloatArray, float]:
    """Lower and upper corner of the picture, and the length of a typical arrow."""
    finite = np.isfinite(x).all(axis=1)
    x, radius = x[finite], radius[finite]
    if not len(x):
        x, radius = np.zeros((1, 2)), np.ones(1)
    low, high = (x - radius[:, None]).min(axis=0), (x + radius[:, None]).max(axis=0)
    extent = float((high - low).max())
    return low - margin * extent, high + margin * extent, 0.3 * extent


def _blank(low: FloatArray, high: FloatArray) -> tuple[Any, Any]:
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
        turn = np.copysign(0.6, wall.spin)
        c, s = np.cos(turn), np.sin(turn)
        tip = np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
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
