"""How grains are released on an incline, and how far springs and steps may take them from the rigid grain's motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import FloatArray, Observed, ParameterError, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import round_off_speed, single, slack_time, soft_reason, softness
from ninedisk.harness.run.matched import slip_of
from ninedisk.references.analytic.rolling_grain import (
    NODES,
    WEIGHTS,
    EllipseShape,
    RoundedPolygon,
    energy_gained,
    forces_at,
    spin_at,
    tipping_slope,
)

APOTHEM, AXES, DENSITY, G = 0.5, (0.6, 0.4), 1.0, 9.81
"""Distance of a polygon's faces from its centre, and half-axes of the ellipse [m]; mass per area and gravity."""

CLOSE = 0.02
"""Slopes so near the one that tips a grain are not allowed: a lean of `LEAN` would tip it below."""

LEAN = 4e-3
"""Angle [rad] by which a polygon leans over its lower corner when it is released to roll: it then touches with the corner alone."""

ELLIPSE_WAY = 1.5
"""Angle [rad] of rolling on by which the ellipse has passed its highest position, and over which its energy is held to its truth."""


class Release(NamedTuple):
    """A grain at rest on an incline.

    Attributes
    ----------
    shape : RoundedPolygon or EllipseShape
    angle : float
        Of the incline [rad].
    phi : float
        Place of the outline that touches (`ninedisk.references.analytic.rolling_grain`) [rad].
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
    """The start of a variant: below the slope that tips it a polygon stands at rest on its springs, above it leans by `LEAN`."""
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
    phi = standing(shape, angle, overlap_of(shape, angle, params["kn"]))
    height = float(shape.height(np.array(phi)))
    return Release(shape, angle, phi, height, 0.5 * face, face, math.cos(angle), math.sin(angle))


def _released(shape: RoundedPolygon | EllipseShape, angle: float, phi: float, reach: float, passed: float) -> Release:
    at = np.array(phi)
    fn, fs = forces_at(shape, at, start=phi, angle=angle, g=G)
    return Release(shape, angle, phi, float(shape.height(at)), reach, passed, float(fn), float(fs))


def overlap_of(shape: RoundedPolygon | EllipseShape, angle: float, kn: float) -> float:
    """Overlap [m] at which a spring bears the grain's weight."""
    return DENSITY * shape.area * G * math.cos(angle) / kn


def standing(shape: RoundedPolygon, angle: float, overlap: float) -> float:
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
    ways = start.reach * (0.5 * (1.0 + NODES)) ** 2
    with np.errstate(invalid="ignore"):
        gained = energy_gained(start.shape, start.phi + ways, start=start.phi, angle=start.angle, g=G) / G
        spin = spin_at(start.shape, start.phi + ways, start=start.phi, angle=start.angle, g=G)
    phi = start.phi + ways
    p, q = start.shape.height(phi), start.shape.ahead(phi)
    behind = 0.5 * contact_dt if slip_of(setup.scene.disk_disk.slip_at, engine) == "end" else 0.0
    late = behind * float(np.nanmax(np.abs(p * q * spin**3), initial=0.0)) / G
    missing = d * _arm_work(start, ways, d)
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


def _arm_work(start: Release, ways: FloatArray, d: float) -> FloatArray:
    """What the arm of the chord's middle takes from the work of the weight, over weight and overlap, after rolling on by ``ways``."""
    if isinstance(start.shape, RoundedPolygon):
        rho = start.shape.roundness * start.shape.apothem
        all_round = math.sqrt(2.0 * d / rho) if rho > 0.0 else math.inf
        return np.asarray(0.5 * np.log1p(np.minimum(ways, all_round) / LEAN))
    at = np.concatenate([start.phi + ways, [start.phi]])
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
    rough = (G * slack_time(engine, dt, t_end) + single(engine, G * t_end, setup.numerics.n_steps)) * t_end
    first = "first order in dt" + soft_reason(engine)
    return GrainBounds(
        atol={
            "unbalance": 2.0 * dt * speed + 2.0 * d + rough,
            "t_half": 4.0 * dt + rough,
            "turned": 2.0 * lean + rough / start.height,
            "spin": (1e-9 * speed + rough / t_end) / start.height,
            "force": (softness(engine) + 1e-6) * weight + single(engine, weight, 1),
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
