"""Overlaps of pairs of grains at rest: disks given as outlines, and ellipses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Norm, Observed, Parameter, Setup, Value
from ninedisk.harness.api.claims import Cells, Claim, UndecidedError, Verdict, series
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nurbs.grains import disk_gap, grains, uniform
from ninedisk.references.analytic.contact.ellipse_contact import Ellipse, ellipse_overlap, ellipse_separation

KN, DENSITY = 1e4, 1000.0

AXES: Mapping[str, Sequence[tuple[float, float]]] = {
    "disk": ((1.0, 1.0), (0.5, 0.5), (0.15, 0.15), (2.0, 2.0)),
    "ellipse": ((1.0, 0.5), (1.5, 1.0), (0.8, 0.75), (2.0, 1.2)),
}
"""Half-axes [m] of the kinds of grains."""

SPACING = 9.0
"""Side [m] of the square that a pair has for itself: more than the two largest grains side by side."""

GRADES = {"grazing": (-11.0, -6.0), "shallow": (-6.0, -2.0), "deep": (-2.0, -1.0)}
"""Decades of the overlap over the smaller grain's smaller half-axis."""

APART = 4
"""Of the disks that graze or overlap little, each fourth pair is apart by as much."""

LAST_PLACES = 16.0
"""Of the largest coordinate: the rounding of two of them and of the operations of an intersection."""

SAME_OVERLAP = 1e-12
"""Difference of overlaps [m] that is round-off on grains of 1 m some ten metres from the origin: hundreds of last places."""


def nurbs_overlap(cells: Cells) -> Verdict:
    """Overlaps of all pairs of circles given as NURBS outlines, against equation (2.5)."""
    circles = [cell for cell in cells if cell.params.get("shape") == "disk"]
    if not circles:
        raise UndecidedError("it takes the variant with disks")
    worst = max(float(series(cell, "gap_error").max()) for cell in circles)
    return worst <= SAME_OVERLAP, f"largest difference of an overlap from Ri + Rj - |xj - xi|: {worst:.1e} m"


class Overlap:
    """Pairs at rest, placed at random: unequal sizes, any direction, overlaps from grazing to a third of the smaller grain.

    The source says that the overlap of its NURBS contact is that of equation (2.5). Disks include pairs that are just apart.
    """

    id = "nurbs/overlap"
    version = 1
    title = "Overlaps of outlines"
    source = "appendix A.1: 'the particle overlap is identical with that calculated using equation (2.5)'"
    requirement = "gap and force of every pair equal the closed form of disks, and of ellipses, to round-off"
    claims = (
        Claim(
            id="nurbs-overlap",
            place="A.1",
            text=(
                "A simple NURBS intersection-based contact approach is utilized so that the particle overlap "
                "is identical with that calculated using equation (2.5)."
            ),
            decided_by=(
                "Overlap of two disks given as NURBS curves against Ri + Rj - |xj - xi|: confirmed if they "
                "agree to round-off."
            ),
            rule=nurbs_overlap,
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="shape", default="disk", choices=("disk", "ellipse"), in_id=True, help="outlines that are circles, or ellipses"
        ),
        Parameter(name="pairs", default=48, low=3, high=400, whole=True, help="number of pairs"),
        Parameter(name="seed", default=1, low=0, whole=True, help="of their sizes, places and angles"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both shapes."""
        return ({"shape": "disk"}, {"shape": "ellipse"})

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Pairs in the squares of a grid about the origin."""
        from ninedisk.core.nurbs.shapes import disk, ellipse

        axes, rng, count = AXES[params["shape"]], np.random.default_rng(params["seed"]), params["pairs"]
        kinds = [uniform(DENSITY, disk, a) if a == b else uniform(DENSITY, ellipse, a, b) for a, b in axes]
        number = rng.integers(0, len(kinds), 2 * count).tolist()
        angle = rng.uniform(-math.pi, math.pi, 2 * count)
        side, x = math.ceil(math.sqrt(count)), np.empty((2 * count, 2))
        for k in range(count):
            one, two = axes[number[2 * k]], axes[number[2 * k + 1]]
            low, high = list(GRADES.values())[k % len(GRADES)]
            depth = min(*one, *two) * 10.0 ** rng.uniform(low, high)
            if params["shape"] == "disk" and grade_of(k) != "deep" and k // len(GRADES) % APART == 0:
                depth = -depth
            direction = rng.uniform(-math.pi, math.pi)
            n = np.array([math.cos(direction), math.sin(direction)])
            x[2 * k] = SPACING * (np.array(divmod(k, side)) - 0.5 * (side - 1))
            x[2 * k + 1] = x[2 * k] + _extreme(one, angle[2 * k], n) - _extreme(two, angle[2 * k + 1], -n) - depth * n
        scene = Scene(**grains(kinds, number, x=x, angle=angle), disk_disk=ContactLaw(kn=KN))
        pairs = tuple((2 * k, 2 * k + 1) for k in range(count))
        return Setup(scene=scene, numerics=Numerics(dt=1e-9, n_steps=1), watch=pairs, labels={"a pair": pairs[0]})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Largest error of a gap and of a force over the pairs, at each sample, and of the gap for each grade of overlap."""
        truth = expected_gaps(params, setup, history)
        off = np.abs(history.gap - truth)
        force = np.abs(history.fn - KN * np.maximum(-truth, 0.0))
        series = {"gap_error": ("m", off.max(axis=1)), "fn_error": ("N", force.max(axis=1))}
        scalars = {
            f"gap_error_{grade}": ("m", float(off[:, [k for k in range(off.shape[1]) if grade_of(k) == grade]].max()))
            for grade in GRADES
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Overlap of the outlines by their closed form, which depends on nothing but geometry."""
        return (
            Headline(name="overlap of two outlines", use="impacts", quantity="gap_error", expected=0.0,
                     source="closed form of disks and of ellipses", scale=min(min(axes) for axes in AXES[params["shape"]]),
                     scale_is="smallest half-axis"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,  # noqa: ARG002
    ) -> Sequence[Check]:
        """Nothing but rounding is allowed; a circle's deep chord is as well conditioned as a shallow one."""
        atol = round_off(setup)
        circles = params["shape"] == "disk"
        source = (
            "equation (2.5): Ri + Rj - |xj - xi|"
            if circles
            else "implicit equations and support functions of two ellipses"
        )
        why = f"{LAST_PLACES:g} last places of the largest coordinate"
        common: dict[str, Any] = {"truth": "analytic", "expected": 0.0, "source": source}
        size = float(setup.scene.disks.radius.min())
        names: list[tuple[str, Norm]] = [("gap_error", "max"), *((name, "scalar") for name in observed.scalars)]
        found = [Check(quantity=name, norm=norm, atol=atol, why=why, scale=size, **common) for name, norm in names]
        return [
            *found,
            Check(quantity="fn_error", norm="max", atol=KN * atol, why=f"kn times {why}", scale=KN * size, **common),
        ]


def round_off(setup: Setup) -> float:
    """What rounding leaves of a gap [m]."""
    reach = float(np.abs(setup.scene.disks.x).max() + setup.scene.disks.radius.max())
    return LAST_PLACES * float(np.spacing(reach))


def grade_of(pair: int) -> str:
    """Grade of a pair's overlap."""
    return list(GRADES)[pair % len(GRADES)]


def expected_gaps(params: Mapping[str, Any], setup: Setup, history: History) -> FloatArray:
    """True gaps [m] of the pairs where the engine's grains are, shape of ``history.gap``; of ellipses that are apart any from 0 on, and
    NaN where they overlap in another way than in two points.
    """
    if params["shape"] == "disk":
        return np.column_stack([disk_gap(setup, history, column) for column in range(len(history.pairs))])
    disks, axes = setup.scene.disks, AXES["ellipse"]
    found = np.full(history.gap.shape, math.nan)
    for row, column in np.ndindex(found.shape):
        if np.isfinite(history.x[row]).all():
            pair = history.pairs[column]
            one, two = (_ellipse(axes[disks.outline[k]], history.x[row, k], disks.angle[k]) for k in pair)
            try:
                found[row, column] = -_overlap(one, two)
            except ValueError:  # an engine's grains may be apart where they ought to graze: any distance is right then
                if ellipse_separation(one, two) >= 0.0:
                    found[row, column] = max(float(history.gap[row, column]), 0.0)
    return found


_overlap = lru_cache(maxsize=4096)(ellipse_overlap)
"""Grains at rest are in the same place at every sample and on every engine."""


def _ellipse(axes: tuple[float, float], x: FloatArray, angle: float) -> Ellipse:
    return Ellipse(axes[0], axes[1], (float(x[0]), float(x[1])), float(angle))


def _extreme(axes: tuple[float, float], angle: float, n: FloatArray) -> FloatArray:
    """Point of an ellipse about the origin that is farthest along n."""
    (a, b), c, s = axes, math.cos(angle), math.sin(angle)
    p, q = a * (c * n[0] + s * n[1]), b * (c * n[1] - s * n[0])
    size = math.hypot(p, q)
    p, q = a * p / size, b * q / size
    return np.array([c * p - s * q, s * p + c * q])


CASE = Overlap()
