"""Grain on an incline beside a disk: the disk rolls, the grain rests until the slope exceeds the one that tips it.

How far springs and steps may take grains from the motion of rigid ones, from their release on, is derived.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Scene, Wall
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Norm,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    Value,
)
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    THETA,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    round_off_speed,
    single,
    slack_time,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.matched import slip_of
from ninedisk.harness.cases.nurbs.grains import grains, uniform
from ninedisk.references.analytic.on_plane.rolling_grain import (
    NODES,
    WEIGHTS,
    EllipseShape,
    RoundedPolygon,
    energy_gained,
    forces_at,
    kinetic_of,
    spin_at,
    time_to,
    tipping_slope,
)
from ninedisk.references.analytic.on_plane.rolling_incline import roll_rates

if TYPE_CHECKING:
    from ninedisk.core.nurbs.mass import UniformGrain
KN, BETA = 1e7, 0.3
GRAIN, DISK, PLANE = 0, 1, 2
AHEAD = 4.0
"""Distance [m] of the disk down the incline: it is faster, and the two never meet."""

DURATION = 2.5
"""Default length of the run [s]: a grain that tips needs about one for the first face."""


APOTHEM, AXES, DENSITY, G = 0.5, (0.6, 0.4), 1.0, 9.81
"""Distance of a polygon's faces from its centre, and half-axes of the ellipse [m]; mass per area and gravity."""

CLOSE = 0.02
"""Slopes so near the one that tips a grain are not allowed: a lean of `LEAN` would tip it below."""

LEAN = 4e-3
"""Angle [rad] by which a polygon leans over its lower corner when it is released to roll: it then touches with the corner alone."""

ELLIPSE_WAY = 1.5
"""Angle [rad] of rolling on by which the ellipse has passed its highest position, and over which its energy is held to its truth."""


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
    beside_headlines = (
        ("load_*", "loads are held to the grain's own balance, at any motion"),
        ("unbalance", "loads are held to the grain's own balance, at any motion"),
    )
    source = "rigid-body statics and dynamics, by the support function (references.analytic.on_plane.rolling_grain)"
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
        Parameter.positive("dt", 0.005, unit="s", help="step; sampling of spring engines"),
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
                at_least=arrival_time(params, start),
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
        without loss; NaN once it has rolled too far (see `ninedisk.harness.cases.nurbs.rolling.Release.reach`). ``rolls`` is 1 if it
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
        scalars["way_disk"] = ("m", last(series["x_disk"][1]))
        # Written so that a NaN counts as neither.
        farthest = float(turned.max())
        scalars["rolls"] = ("1", math.nan if math.isnan(farthest) else float(farthest > start.passed))
        scalars["t_half"] = ("s", crossing_time(history.t, turned, spin, start.reach))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """Rigid grains: the disk's way, the time that a grain takes over half a face, and the turn of one that should rest.

        The time is known where the grain tips, the turn where a polygon rests; an ellipse on a flatter slope rocks for ever.
        """
        start, above = release(params), params["steepness"] > 1.0
        weight = float(setup.scene.disks.mass[GRAIN]) * G
        radius, t_end = float(setup.scene.disks.radius[DISK]), float(observed.t[-1])
        disk = roll_rates(mu=params["mu"], angle=start.angle, g=G, mass=weight / G, radius=radius)
        path = 0.5 * disk.along * t_end**2
        time = arrival_time(params, start) if above else math.nan
        rests = not above and params["grain"] == "polygon"
        return (
            Headline(name="distance of the disk", use="rolling", quantity="way_disk", expected=path,
                     source="a uniform disk rolls with 2/3 g sin", scale=path, scale_is="distance of the rigid disk"),
            Headline(name="time to roll over half a face", use="rolling", quantity="t_half", expected=time,
                     source="quadrature of the energy's equation", scale=time if above else t_end,
                     scale_is="time of the rigid grain" if above else "length of the run"),
            Headline(name="turn of the resting grain", use="rest", quantity="turned_final", expected=0.0 if rests else math.nan,
                     source="rest: the weight meets the plane within the face", scale=start.passed, scale_is="angle of a face"),
        )  # fmt: skip

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

        size = {"spin_final": math.sqrt(G / start.height)}  # of a grain that falls over

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
                scale=size.get(quantity, 1.0 if quantity in ("turned", "unbalance") else 0.0),
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
            found.append(check("t_half", "scalar", arrival_time(params, start), "quadrature of the energy's equation"))
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
    from ninedisk.core.nurbs.shapes import ellipse, regular_polygon

    if params["grain"] == "ellipse":
        return uniform(DENSITY, ellipse, *AXES)
    return uniform(DENSITY, regular_polygon, params["faces"], APOTHEM, roundness=params["roundness"])


def arrival_time(params: Mapping[str, Any], start: Release) -> float:
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


class Release(NamedTuple):
    """A grain at rest on an incline.

    Attributes
    ----------
    shape : RoundedPolygon or EllipseShape
    angle : float
        Of the incline [rad].
    phi : float
        Place of the outline that touches (`ninedisk.references.analytic.on_plane.rolling_grain`) [rad].
    height : float
        Of the centroid above the plane [m].
    reach : float
        Angle of rolling on [rad] over which energy is judged: half a face, long before it lands or leaves the plane.
    passed : float
        That beyond which the grain has rolled: a whole face.
    fn, fs : float
        Contact forces over weight, ``fs`` positive up the incline.
    """

    shape: RoundedPolygon | EllipseShape
    angle: float
    phi: float
    height: float
    reach: float
    passed: float
    fn: float
    fs: float


def release(params: Mapping[str, Any]) -> Release:
    """The start of a variant: below the slope that tips it a polygon is at rest on its springs, above it leans by `LEAN`."""
    steepness = params["steepness"]
    if abs(steepness - 1.0) < CLOSE:
        raise ParameterError(
            f"steepness = {steepness:g} is not allowed: it must be at most {1.0 - CLOSE:g} (rests) or at least {1.0 + CLOSE:g} (rolls)"
        )
    if params["grain"] == "ellipse":
        oval = EllipseShape(*AXES)
        angle = math.atan(steepness * tipping_slope(oval))
        return _released(oval, angle, oval.start, ELLIPSE_WAY, ELLIPSE_WAY)
    shape = RoundedPolygon(params["faces"], APOTHEM, params["roundness"])
    angle, face = math.atan(steepness * tipping_slope(shape)), 2.0 * math.pi / params["faces"]
    if steepness > 1.0:
        return _released(shape, angle, LEAN, 0.5 * face, face)
    phi = leaning_angle(shape, angle, overlap_of(shape, angle, params["kn"]))
    height = float(shape.height(np.array(phi)))
    return Release(shape, angle, phi, height, 0.5 * face, face, math.cos(angle), math.sin(angle))


def _released(shape: RoundedPolygon | EllipseShape, angle: float, phi: float, reach: float, passed: float) -> Release:
    at = np.array(phi)
    fn, fs = forces_at(shape, at, start=phi, angle=angle, g=G)
    return Release(shape, angle, phi, float(shape.height(at)), reach, passed, float(fn), float(fs))


def overlap_of(shape: RoundedPolygon | EllipseShape, angle: float, kn: float) -> float:
    """Overlap [m] at which a spring bears the grain's weight."""
    return DENSITY * shape.area * G * math.cos(angle) / kn


def leaning_angle(shape: RoundedPolygon, angle: float, overlap: float) -> float:
    """Angle [rad] by which a polygon leans forward when it rests on springs: its chord's middle is then below its centroid.

    The chord reaches from where the lower corner leaves the plane to where the face, tilted by the angle, leaves it. The shear force
    acts ``overlap/2`` below the plane.

    Raises
    ------
    ParameterError
        If the springs are so soft that it would tip over on them.
    """
    rho, c, half = shape.roundness * shape.apothem, shape.corner, math.pi / shape.faces
    if 0.0 < rho < overlap:
        raise ParameterError(
            f"roundness = {shape.roundness:g} is not allowed: the corner's radius, {rho:.1e} m, would be less than "
            f"the {overlap:.1e} m by which the grain sinks into the plane; use 0 (sharp), at least "
            f"{overlap / shape.apothem:.1e}, or a larger kn"
        )

    def ahead_of_weight(lean: float) -> float:
        """Distance [m] of the chord's middle ahead of where the weight meets the plane."""
        corner, tall = c * math.sin(half - lean), c * math.cos(half - lean) + rho - overlap
        behind = (rho - (rho - overlap) * math.cos(lean)) / math.sin(lean)
        front = math.sqrt(overlap * (2.0 * rho - overlap)) if rho > 0.0 else overlap / math.tan(2.0 * half - lean)
        return corner + 0.5 * (front - behind) - math.tan(angle) * (tall + 0.5 * overlap)

    low, high = overlap / (4.0 * shape.apothem), half
    if ahead_of_weight(low) >= 0.0:
        raise ParameterError("the springs' overlap is not small beside the grain: use a larger kn")
    tilts = np.geomspace(low, high, 400)
    standing_at = next((k for k in range(1, 400) if ahead_of_weight(float(tilts[k])) >= 0.0), None)
    if standing_at is None:
        raise ParameterError(
            f"the grain would sink {overlap:.1e} m into the plane and tip over: use a larger kn or a smaller steepness"
        )
    low, high = float(tilts[standing_at - 1]), float(tilts[standing_at])
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if ahead_of_weight(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


class GrainBounds(NamedTuple):
    """Absolute tolerances by quantity, and their reasons."""

    atol: Mapping[str, float]
    why: Mapping[str, str]


def grain_bounds(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, start: Release
) -> GrainBounds:
    """Tolerances of the rigid grain's truths for this engine."""
    if engine.contact == "spring":
        return _springs(params, setup, observed, engine, start)
    return _rigid(params, setup, observed, engine, start)


def _springs(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, start: Release
) -> GrainBounds:
    """Everything is off by parts of the overlap d over the grain's size; standing, by nothing but rounding.

    The chord's middle is not where rigid outlines touch. Leaning by w, a polygon's chord begins at its corner and is up to d/w
    long: the weight's arm lacks d/(2 w), its work ``d/2 ln(w/LEAN)``, until at ``w = sqrt(2 d/rho)`` a corner of radius rho has all of the
    chord and its middle under its centre. On an ellipse the middle is off by ``d/3 dR/ds`` along the
    arc s, R the radius of curvature, which makes ``d/3 ln(R/R_0)``. The springs themselves hold d/2 and ``d tan^2/2``, the
    height is off by d, and heights that are off by d change the kinetic energy by ``2 d/size``. Slip with the arms in the middle of each
    contact step errs by its second order, which is granted nothing; with those at its end, where p changes, centroid and spin differ by
    ``contact_dt/2 p' omega^2``, which is v times that of kinetic energy.
    """
    disks, kn = setup.scene.disks, params["kn"]
    contact_dt = float(setup.numerics.contact_dt or setup.numerics.dt)
    t_end, radius, weight = float(observed.t[-1]), float(disks.radius[1]), float(disks.mass[0]) * G
    d = overlap_of(start.shape, start.angle, kn)
    paths = start.reach * (0.5 * (1.0 + NODES)) ** 2
    with np.errstate(invalid="ignore"):
        gained = energy_gained(start.shape, start.phi + paths, start=start.phi, angle=start.angle, g=G) / G
        spin = spin_at(start.shape, start.phi + paths, start=start.phi, angle=start.angle, g=G)
    phi = start.phi + paths
    p, q = start.shape.height(phi), start.shape.ahead(phi)
    behind = 0.5 * contact_dt if slip_of(setup.scene.disk_disk.slip_at, engine) == "end" else 0.0
    late = behind * float(np.nanmax(np.abs(p * q * spin**3), initial=0.0)) / G
    missing = d * _arm_work(start, paths, d)
    top = float(np.nanmax(gained, initial=0.0))
    held = 1.5 + 0.5 * math.tan(start.angle) ** 2 + 2.0 * top / start.height
    # The time's integrand over u, way = reach u^2, times half of the energy's relative error.
    share = (missing / gained + 2.0 * d / start.height) / spin
    time = float(0.5 * (0.5 * share * 2.0 * start.reach * 0.5 * (1.0 + NODES)) @ WEIGHTS)
    lean, rounding = start.phi - start.shape.start, float(np.spacing(start.height))
    steps = math.sqrt(t_end / contact_dt)
    still = "no motion but that of rounding:"
    return GrainBounds(
        atol={
            "unbalance": float(missing.max()) + held * d + late,
            "t_half": 2.0 * time,
            "turned": 8.0 * rounding / d * steps * lean,
            "spin": round_off_speed(start.height, contact_dt) / start.height,
            "force": 32.0 * kn * rounding,
            "load": 64.0 * kn * rounding + 2.0 * d / radius * weight,
            "x_disk": d * (1.0 + _fall(start, t_end) / radius),
        },
        why={
            "unbalance": f"overlap {d:.1e} m: arm of the chord's middle, springs, depth; contact step: {late:.1e} m by slip at its end",
            "t_half": "twice what that energy makes of the time",
            "turned": f"{still} of heights over the overlap, the square root of {steps**2:.0f} steps",
            "spin": f"{still} of a height, a step",
            "force": f"{still} kn times some last places of a height",
            "load": "as the forces; the disk's friction by its arm within the overlap, which it finds with a swing",
            "x_disk": f"overlap {d:.1e} m: arm of friction, start",
        },
    )


def _arm_work(start: Release, paths: FloatArray, d: float) -> FloatArray:
    """What the arm of the chord's middle takes from the work of the weight, over weight and overlap, after rolling on by ``paths``."""
    if isinstance(start.shape, RoundedPolygon):
        rho = start.shape.roundness * start.shape.apothem
        all_round = math.sqrt(2.0 * d / rho) if rho > 0.0 else math.inf
        return np.asarray(0.5 * np.log1p(np.minimum(paths, all_round) / LEAN))
    at = np.concatenate([start.phi + paths, [start.phi]])
    radius = start.shape.height(at) + start.shape.bend(at)
    return np.asarray(np.abs(np.log(radius[:-1] / radius[-1])) / 3.0)


def _fall(start: Release, t_end: float) -> float:
    """Way [m] down the incline of a body without friction."""
    return 0.5 * G * math.sin(start.angle) * t_end**2


def _rigid(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, start: Release
) -> GrainBounds:
    """First order in the step: in half a step a body moves by its speed, and gravity works by as much.

    The start has the overlap of the springs, which rigid contacts push out or keep, and the tilt of a polygon that stands on springs.
    """
    disks, dt = setup.scene.disks, setup.numerics.dt
    t_end, weight = float(observed.t[-1]), float(disks.mass[0]) * G
    d = overlap_of(start.shape, start.angle, params["kn"])
    lean = start.phi - start.shape.start
    top = np.nan_to_num(
        energy_gained(start.shape, start.phi + start.reach * NODES**2, start=start.phi, angle=start.angle, g=G)
    ).max()
    speed = math.sqrt(2.0 * max(float(top), G * d))
    rough = (G * slack_time(engine, dt) + single(engine, G * t_end, setup.numerics.n_steps)) * t_end
    first = "first order in dt" + soft_reason(engine)
    return GrainBounds(
        atol={
            "unbalance": 2.0 * dt * speed + 2.0 * d + rough,
            "t_half": 4.0 * dt + rough,
            "turned": 2.0 * lean + rough / start.height,
            "spin": (1e-9 * speed + rough / t_end) / start.height,
            "force": (contact_softness(engine) + 1e-6) * weight + single(engine, weight, 1),
            "x_disk": dt * G * math.sin(start.angle) * t_end + d + rough,
        },
        why={
            "unbalance": f"{first}: the speed in two steps",
            "t_half": f"{first}: four steps",
            "turned": "tilt of a grain on springs, with which the run starts" + soft_reason(engine),
            "spin": "rest" + soft_reason(engine),
            "force": "balance in every step, to the solver's tolerance" + soft_reason(engine),
            "x_disk": f"{first}: a t dt",
        },
    )


CASE = RollingGrain()
