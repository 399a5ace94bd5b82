"""Grain on an incline beside a disk: the disk rolls, the grain rests until the slope exceeds the one that tips it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Norm, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    THETA,
    contact_step,
    last,
    numerics_of,
    whole_steps,
)
from ninedisk.harness.cases.nurbs._rolling_grain import APOTHEM, AXES, DENSITY, G, Release, grain_bounds, release
from ninedisk.harness.cases.nurbs.grains import grains
from ninedisk.references.analytic.rolling_grain import energy_gained, kinetic_of, time_to
from ninedisk.references.analytic.rolling_incline import roll_rates

if TYPE_CHECKING:
    from ninedisk.core.nurbs.nurbs_grain import UniformGrain
KN, BETA = 1e7, 0.3
GRAIN, DISK, PLANE = 0, 1, 2
AHEAD = 4.0
"""Distance [m] of the disk down the incline: it is faster, and the two never meet."""

DURATION = 2.5
"""Default length of the run [s]: a grain that tips needs about one for the first face."""


class RollingGrain:
    """A grain is released at rest on an incline, a disk of the same area ahead of it; gravity is tilted, x runs down.

    Below the slope that tips it the polygon stands on its face; above, it leans over its lower corner by a little, rolls over, and keeps
    energy until it lands. The ellipse is released where its centroid is farthest behind the place that touches: below, it rocks back
    and forth for ever; above, it rolls off. The disk rolls on any slope. A polygon on springs starts in equilibrium:
    the chord's force has no potential, and rocking on a face gains energy from it, the more the flatter the face.
    """

    id = "nurbs/rolling"
    version = 1
    title = "Angular grains on an incline"
    source = "rigid-body statics and dynamics, by the support function (references.analytic.rolling_grain)"
    requirement = (
        "a regular polygon of m faces rests up to tan(angle) = (1 - roundness) tan(pi/m) and rolls beyond, an ellipse at "
        "(a^2 - b^2)/(2 a b); a disk rolls at once with 2/3 g sin"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="grain", default="polygon", choices=("polygon", "ellipse"), in_id=True, help="regular, or 1.2 by 0.8 m"),
        Parameter(name="faces", default=6, low=4, high=12, whole=True, unit="-", in_id=True, help="of the polygon"),
        Parameter(name="roundness", default=0.1, low=0.0, high=0.9, unit="-", in_id=True,
                  help="radius of its corners over the distance of its faces: 0 is sharp, 1 would be a disk"),
        Parameter(name="steepness", default=0.95, low=0.3, high=1.3, unit="-", in_id=True,
                  help="tangent of the slope over that which tips the grain; 0.98 to 1.02 is not allowed"),
        Parameter(name="mu", default=1.5, low=0.5, unit="-", help="friction: more than rolling asks for"),
        Parameter(name="kn", default=KN, low=1e4, unit="N/m", help="normal and shear stiffness of spring engines"),
        Parameter(name="dt", default=0.005, low=0.0, low_open=True, unit="s", help="step; sampling of spring engines"),
        Parameter(name="duration", default=DURATION, low=0.1, unit="s", help="length of the run"),
        CONTACT_DT,
        THETA,
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Five parts in a hundred on either side of the slope that tips it: rounded hexagon, sharp square, rounder octagon, ellipse."""
        kinds: tuple[Mapping[str, Value], ...] = (
            {"grain": "polygon", "faces": 6, "roundness": 0.1},
            {"grain": "polygon", "faces": 4, "roundness": 0.0},
            {"grain": "polygon", "faces": 8, "roundness": 0.5},
            {"grain": "ellipse"},
        )
        return [{**kind, "steepness": steepness} for kind in kinds for steepness in (0.95, 1.05)]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Both bodies in touch with the plane, with the overlap that their weight makes and the shear force of their motion."""
        start = release(params)
        grain, kn, mu = kind_of(params), params["kn"], params["mu"]
        law = ContactLaw(kn=kn, ks=kn, mu=mu, beta=BETA, restitution=0.0, lever_arm="overlap", regularised=True)
        radius = math.sqrt(grain.mass / (math.pi * DENSITY))
        weight = grain.mass * G
        rolling = roll_rates(mu=mu, angle=start.angle, g=G, mass=grain.mass, radius=radius)
        given = grains(
            [grain],
            [0, -1],
            x=[(0.0, start.height - start.fn * weight / kn), (AHEAD, radius - rolling.fn / kn)],
            radius=[grain.radius, radius],
            mass=grain.mass,
            inertia=[grain.inertia, 0.5 * grain.mass * radius**2],
            angle=[-start.phi, 0.0],
        )
        scene = Scene(
            **given,
            disk_disk=law,
            walls=(Wall(name="incline", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(G * math.sin(start.angle), -G * math.cos(start.angle)),
            initial_shear={(GRAIN, PLANE): -start.fs * weight, (DISK, PLANE): -rolling.fs},
        )
        lever = 2.0 / grain.mass + grain.radius**2 / grain.inertia
        numerics = numerics_of(
            params,
            n_steps=whole_steps(
                params,
                DURATION,
                at_least=half_way(params, start),
                event="rolling over half a face (the ellipse: over its longer axis)",
            ),
            contact_dt=contact_step(params["dt"], 0.1 / math.sqrt(kn * lever)),
            theta=params["theta"],
        )
        watch = ((GRAIN, PLANE), (DISK, PLANE))
        return Setup(scene=scene, numerics=numerics, watch=watch, labels={"grain": watch[0], "disk": watch[1]})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Angle by which the grain has rolled on (``turned``, positive down the incline), its energy, and what rest looks like.

        ``unbalance`` is the kinetic energy less what gravity has done along the way that rolling takes, over ``m g``: 0 while it rolls
        without loss; NaN once it has rolled too far (see `ninedisk.harness.cases.nurbs._rolling_grain.Release.reach`). ``rolls`` is 1 if it
        has passed the next face (the ellipse: half a turn), else 0.
        """
        start = release(params)
        turned, spin = 0.0 - history.angle[:, GRAIN], 0.0 - history.omega[:, GRAIN]
        unbalance = np.full_like(turned, np.nan)
        # Whatever comes after the first landing is not rolling any more.
        rolling = np.maximum.accumulate(np.nan_to_num(turned, nan=np.inf)) <= start.reach
        phi = start.phi + turned[rolling]
        gained = energy_gained(start.shape, phi, start=start.phi, angle=start.angle, g=G)
        unbalance[rolling] = (kinetic_of(start.shape, phi, spin[rolling]) - gained) / G
        series = {
            "turned": ("rad", turned),
            "spin": ("rad/s", spin),
            "x": ("m", history.x[:, GRAIN, 0] - setup.scene.disks.x[GRAIN, 0]),
            "x_disk": ("m", history.x[:, DISK, 0] - setup.scene.disks.x[DISK, 0]),
            "unbalance": ("m", unbalance),
            "fn": ("N", history.fn[:, 0]),
            "fs": ("N", 0.0 - history.fs[:, 0]),
            "load_x": ("N", history.wall_force[:, 0, 0]),
            "load_y": ("N", history.wall_force[:, 0, 1]),
        }
        scalars = {f"{name}_final": (series[name][0], last(series[name][1])) for name in ("turned", "spin", "fn", "fs")}
        # Written so that a NaN counts as neither.
        farthest = float(turned.max())
        scalars["rolls"] = ("1", math.nan if math.isnan(farthest) else float(farthest > start.passed))
        scalars["t_half"] = ("s", crossing_time(history.t, turned, spin, start.reach))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Rest below, rolling above by the energy it keeps and the time it takes, and the disk beside it."""
        start, above = release(params), params["steepness"] > 1.0
        atol, why = grain_bounds(params, setup, observed, engine, start)
        weight = float(setup.scene.disks.mass[GRAIN]) * G
        disk = roll_rates(
            mu=params["mu"], angle=start.angle, g=G, mass=weight / G, radius=float(setup.scene.disks.radius[DISK])
        )

        def check(quantity: str, norm: Norm, expected: float | FloatArray, source: str, of: str = "") -> Check:
            name = of or quantity
            return Check(
                quantity=quantity,
                norm=norm,
                truth="analytic",
                expected=expected,
                source=source,
                atol=atol[name],
                why=why[name],
            )

        rolls = "tan(angle) against the largest p'/p of the support function"
        found = [
            Check(
                quantity="rolls",
                norm="scalar",
                truth="analytic",
                expected=float(above),
                source=rolls,
                why="it does, or it does not",
            ),
            check("x_disk", "max", 0.5 * disk.along * observed.t**2, "a uniform disk rolls with 2/3 g sin"),
        ]
        if above or params["grain"] == "ellipse":
            zero = 0.0 * observed.series["unbalance"][1]
            found.append(check("unbalance", "max", zero, "energy of rolling without slip"))
        if above:
            found.append(check("t_half", "scalar", half_way(params, start), "quadrature of the energy's equation"))
        elif params["grain"] == "polygon":
            found += [
                check("turned", "max", np.zeros_like(observed.t), "rest: the weight meets the plane within the face"),
                check("spin_final", "scalar", 0.0, "rest", "spin"),
                check("fn_final", "scalar", weight * math.cos(start.angle), "balance of forces", "force"),
                check("fs_final", "scalar", weight * math.sin(start.angle), "balance of forces", "force"),
            ]
            if engine.contact == "spring":
                sideways = np.full_like(observed.t, weight * math.sin(start.angle) + disk.fs)
                down = np.full_like(observed.t, -weight * math.cos(start.angle) - disk.fn)
                source = "the plane bears both bodies"
                found += [
                    check("load_x", "max", sideways, source, "load"),
                    check("load_y", "max", down, source, "load"),
                ]
        return found


def kind_of(params: Mapping[str, Any]) -> UniformGrain:
    """The grain."""
    from ninedisk.core.nurbs.nurbs_grain import uniform_grain
    from ninedisk.core.nurbs.nurbs_polygons import regular_polygon
    from ninedisk.core.nurbs.shapes import ellipse

    if params["grain"] == "ellipse":
        return uniform_grain(ellipse(*AXES), DENSITY)
    return uniform_grain(regular_polygon(params["faces"], APOTHEM, roundness=params["roundness"]), DENSITY)


def half_way(params: Mapping[str, Any], start: Release) -> float:
    """When a grain that rolls has done so by `Release.reach` [s]; 0 below the slope that tips it."""
    if params["steepness"] < 1.0:
        return 0.0
    return time_to(start.shape, start.phi + start.reach, start=start.phi, angle=start.angle, g=G)


def crossing_time(t: FloatArray, turned: FloatArray, spin: FloatArray, angle: float) -> float:
    """When ``turned`` first passes ``angle`` [s], by the cubic through two samples and their spins; NaN if it never does."""
    beyond = np.flatnonzero(turned > angle)
    if not len(beyond) or beyond[0] == 0:
        return math.nan
    k = int(beyond[0])
    length, low, high = float(t[k] - t[k - 1]), 0.0, 1.0
    ends = turned[k - 1], turned[k], length * spin[k - 1], length * spin[k]
    for _ in range(60):
        u = 0.5 * (low + high)
        value = (1 + 2 * u) * (1 - u) ** 2 * ends[0] + u**2 * (3 - 2 * u) * ends[1]
        value += u * (1 - u) ** 2 * ends[2] - u**2 * (1 - u) * ends[3]
        low, high = (low, u) if value > angle else (u, high)
    return float(t[k - 1]) + low * length


CASE = RollingGrain()
