"""The unit cell of a regular packing that yields: a disk wedges two others apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    GRAVITY,
    THETA,
    contact_softness,
    contact_step,
    numerics_of,
    single,
    single_precision,
    soft_reason,
)
from ninedisk.references.analytic.assembly.wedge import Wedge, wedge

RADIUS, MASS = 0.5, 1.0
PHASE = 0.1
"""Default resolution of a contact: ``sqrt(kn/m) dt <= PHASE``."""

LABELS = {
    "side_left": (0, 2),
    "side_right": (1, 2),
    "wall_left": (0, 4),
    "wall_right": (1, 5),
    "floor_left": (0, 3),
    "floor_right": (1, 3),
}


class HexagonalCell:
    """Three disks that cannot turn; rough between each other, smooth on a floor and between two walls that part or close in."""

    id = "strength/hexagonal"
    version = 1
    title = "Strength of a regular packing's cell"
    source = "P. W. Rowe, The stress-dilatancy relation ..., Proc. R. Soc. A 269 (1962) 500-527"
    requirement = (
        "lateral over vertical force is tan(angle - phi) where walls part, tan(angle + phi) where they close in"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="speed", default=0.01, low=-0.1, high=0.1, unit="m/s", in_id=True, help="velocity of either wall, outwards"),
        Parameter(name="mu", default=0.3, low=0.0, high=2.0, unit="-", help="friction between the disks"),
        Parameter(name="angle_deg", default=35.0, low=30.0, low_open=True, high=89.0, unit="deg", help="lines of centres to the vertical"),
        Parameter.positive("dt", 1e-3, unit="s", help="step; sampling of spring engines"),
        Parameter(name="steps", default=1000, low=20, whole=True, help="steps of the run"),
        GRAVITY,
        Parameter(name="kn", default=1e6, low=1e4, unit="N/m", help="normal and shear stiffness of spring engines"),
        CONTACT_DT,
        THETA,
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Walls that part and close in, with both sliding rules of contact dynamics."""
        return [
            {"speed": speed, "sliding": sliding} for speed in (0.01, -0.01) for sliding in ("associated", "coulomb")
        ]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The cell in motion, touching without forces: rigid contacts find theirs at once, springs settle on critical dashpots."""
        kn, mu, speed, tilt = params["kn"], params["mu"], params["speed"], math.radians(params["angle_deg"])
        first = _truth(params, np.zeros(1))
        _truth(params, np.array([params["dt"] * params["steps"]]))
        reach, height = 2.0 * RADIUS * math.sin(tilt), 2.0 * RADIUS * math.cos(tilt)
        if not float(first.side[0]) < 0.01 * RADIUS * kn:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: overlaps would exceed a hundredth of the radius; use a larger one"
            )
        rough = ContactLaw(kn=kn, ks=kn, mu=mu, beta=1.0, restitution=0.0, regularised=True)
        smooth = ContactLaw(kn=kn, beta=1.0, restitution=0.0, regularised=True)
        edge = reach + RADIUS
        places = {
            "floor": ((0.0, 0.0), (0.0, 1.0), 0.0),
            "left": ((-edge, 0.0), (1.0, 0.0), -speed),
            "right": ((edge, 0.0), (-1.0, 0.0), speed),
        }
        walls = tuple(
            Wall(
                name=name, point=point, normal=normal, law=smooth, motion=(WallSegment(velocity=(v, 0.0)),) if v else ()
            )
            for name, (point, normal, v) in places.items()
        )
        scene = Scene(
            disks=Disks(
                x=np.array([[-reach, RADIUS], [reach, RADIUS], [0.0, RADIUS + height]]),
                v=np.array([[-speed, 0.0], [speed, 0.0], [0.0, float(first.vy[0])]]),
                radius=RADIUS,  # type: ignore[arg-type]
                mass=MASS,  # type: ignore[arg-type]
                rotating=False,  # type: ignore[arg-type]
            ),
            disk_disk=rough,
            walls=walls,
            gravity=(0.0, -params["g"]),
        )
        numerics = numerics_of(
            params,
            n_steps=params["steps"],
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(kn / MASS)),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=tuple(LABELS.values()), labels=LABELS)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Forces of the contacts, ``fn_<kind>`` the mean of left and right; means of them over the second half of the run.

        ``mobilised`` is the mean of ``|fs|`` over that of fn between the disks; ``ratio`` the lateral over half the vertical force.
        """
        series, scalars = {}, {}
        half = params["steps"] // 2
        for kind in ("side", "wall", "floor"):
            columns = [history.contact(LABELS[f"{kind}_{end}"]) for end in ("left", "right")]
            force = history.fn[:, columns].mean(axis=1)
            series[f"fn_{kind}"] = ("N", force)
            scalars[f"fn_{kind}_mean"] = ("N", float(force[half + 1 :].mean()))
        columns = [history.contact(LABELS[name]) for name in ("side_left", "side_right")]
        shear = float(np.abs(history.fs[half + 1 :, columns]).mean())
        with np.errstate(divide="ignore", invalid="ignore"):
            scalars["mobilised"] = ("1", float(np.float64(shear) / scalars["fn_side_mean"][1]))
        series["y"] = ("m", history.x[:, 2, 1] - setup.scene.disks.x[2, 1])
        series["skew"] = ("m", history.x[:, 2, 0] - 0.5 * (history.x[:, 0, 0] + history.x[:, 1, 0]))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Rigid disks that slide on each other: force on the walls, friction between the disks, height of the upper one."""
        truth, late = _truth(params, observed.t), slice(params["steps"] // 2 + 1, None)
        source = "Rowe's cell with the upper disk's inertia"
        return (
            Headline(name="force on the walls", use="moving-walls", quantity="fn_wall_mean", expected=float(truth.wall[late].mean()),
                     source=source, scale=MASS * params["g"], scale_is="weight of a disk"),
            Headline(name="mobilised friction", use="sliding", quantity="mobilised", expected=params["mu"],
                     source="Coulomb: contacts that slide", scale=1.0, scale_is="normal force"),
            Headline(name="height of the upper disk", use="moving-walls", quantity="y", expected=truth.y - truth.y[0], source=source,
                     scale=RADIUS, scale_is="radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Means for all; every step where contacts stay closed (springs, and contact dynamics, whose steps end on the constraint)."""
        truth = _truth(params, observed.t)
        bounds = _bounds(params, setup, engine, truth)
        source = "Rowe's cell with the upper disk's inertia"
        rise = truth.y - truth.y[0]
        found = [
            Check(quantity="y", norm="max", truth="analytic", expected=rise, source="disks in touch", atol=bounds.length, why=bounds.why),
            Check(quantity="mobilised", norm="scalar", truth="analytic", expected=params["mu"], source="Coulomb: contacts that slide",
                  atol=bounds.mobilised, why=bounds.why),
        ]  # fmt: skip
        late = slice(params["steps"] // 2 + 1, None)
        for kind in ("side", "wall", "floor"):
            curve: FloatArray = getattr(truth, kind)
            found.append(
                Check(quantity=f"fn_{kind}_mean", norm="scalar", truth="analytic", expected=float(curve[late].mean()), source=source,
                      atol=bounds.mean, why=bounds.why)
            )  # fmt: skip
            if bounds.stepwise:
                settled = np.where(observed.t >= 0.25 * observed.t[-1], curve, np.nan)
                found.append(
                    Check(quantity=f"fn_{kind}", norm="max", truth="analytic", expected=settled, source=source, atol=bounds.force,
                          why=bounds.why)
                )  # fmt: skip
        return found


def _truth(params: Mapping[str, Any], t: FloatArray) -> Wedge:
    try:
        return wedge(
            t, mu=params["mu"], g=params["g"], mass=MASS, chord=2.0 * RADIUS,
            half_width=2.0 * RADIUS * math.sin(math.radians(params["angle_deg"])), speed=params["speed"],
        )  # fmt: skip
    except ValueError as error:
        raise ParameterError(str(error)) from error


class _Bounds(NamedTuple):
    """Tolerances: of a step's force and of means [N], of the upper disk's way [m], of the mobilised friction; whether forces of a
    step count; the reason."""

    force: float
    mean: float
    length: float
    mobilised: float
    stepwise: bool
    why: str


def _bounds(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, truth: Wedge) -> _Bounds:
    """Derived from the rate at which the geometry changes.

    With ``A`` the largest angle of a force to the vertical, forces change by ``weight/(2 cos(A)^2)`` per radian at most. Springs
    shorten the chord, and so turn it, by ``overlap/(chord cos(angle))``; walls give way as much. Rigid engines take a step's
    geometry from one of its ends: off by the rotation of a step. A step along the tangent leaves the curved path by ``(slip dt)^2/(2
    chord)``, and the contact opens: contact dynamics closes it in the same step with a force of ``m slip^2/chord``, which is the
    inertia of the path; engines that let a body fall from an open contact lose its weight for a step and get it back in the next,
    so that only means count, which momentum keeps up to the fall of a step at either end.
    """
    scene, dt, steps = setup.scene, setup.numerics.dt, setup.numerics.n_steps
    kn, weight = params["kn"], MASS * params["g"]
    steep = float(truth.angle.max()) + (math.atan(params["mu"]) if params["speed"] < 0.0 else 0.0)
    sensitive = 0.5 * weight / math.cos(steep) ** 2
    cosine = float(np.cos(truth.angle).min())
    turning = abs(params["speed"]) / (2.0 * RADIUS * cosine)  # of the lines of centres [rad/s]
    yields = float(truth.side.max() + truth.wall.max()) / kn / cosine
    why = f"lines of centres turn at {turning:.2g} rad/s"
    if engine.contact == "spring":
        coordinates = 16.0 * float(np.spacing(float(np.abs(scene.disks.x).max())))
        # Overlaps follow the forces at sensitive turning/kn, against dashpots of 2 sqrt(m kn).
        force = sensitive * (yields / (2.0 * RADIUS) + 2.0 * math.sqrt(MASS / kn) * turning) + kn * coordinates * 8.0
        sunk = 2.0 * yields + float(truth.floor.max()) / kn
        return _Bounds(force, force, sunk, 1e-9, True, f"{why}; overlaps of {yields:.2g} m, dashpots that follow")
    slip = abs(params["speed"]) / cosine
    rough = contact_softness(engine) * sensitive + single(engine, weight, 1)
    step = sensitive * turning * dt + rough + 1e-9 * weight
    path = slip**2 * dt * dt * steps / (2.0 * RADIUS) + 2.0 * slip * dt + single(engine, 2.0 * RADIUS, steps)
    skewed = turning * dt * (1.0 + params["mu"] ** 2) + 1e-6
    why += "; a step's geometry is that of one of its ends" + soft_reason(engine)
    why += single_precision(engine)
    if engine.contact == "cd":
        associated = setup.numerics.sliding == "associated"
        lift = params["mu"] * slip * dt if associated else 0.0
        step += sensitive * lift / (2.0 * RADIUS) * 4.0
        return _Bounds(
            step, step, path + 4.0 * lift, skewed, True, why + ("; the associated rule's gap" if associated else "")
        )
    fall = 2.0 * weight * math.tan(steep) / (0.5 * steps) + 2.0 * weight / (0.5 * steps)
    return _Bounds(
        step,
        step + fall,
        path + 2.0 * params["g"] * dt**2,
        skewed + 2.0 * rough / weight,
        False,
        f"{why}; a step's fall at either end",
    )


CASE = HexagonalCell()
