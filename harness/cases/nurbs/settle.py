"""A waisted grain comes to rest on a plane: two contacts with one wall, weight, balance of moments."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import contact_step, round_off_speed, single, single_precision
from ninedisk.harness.cases.nurbs.grains import grains, uniform

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve
WAIST, CONTROL = 0.3, 20
"""Outline ``r = 1 + WAIST cos(2 angle)`` [m], fitted with so many control points: dented above and below."""

DENSITY, G = 1.0, 9.81
KN, MU, BETA = 2e4, 0.6, 0.3
FALL, TILT = 0.02, 0.05
"""Height [m] above the plane at the start, and angle [rad] of the grain to it."""

DT, END, SETTLED, LANDED = 0.01, 4.0, 3.0, 1.0
"""Sampling interval, end, when the grain must have settled, and when it must have stopped jumping from foot to foot [s]."""

STEEPEST = 0.25
"""Angle [rad] of the slope, at most: on a steeper one the grain jumps from foot to foot for longer than `LANDED`."""

PHASE = 0.1
"""Contact step times the contacts' highest frequency: two springs in parallel."""

PAIR = (0, 1)


SYMMETRY = 1e-9
"""Asymmetry [m] that the least-squares fit leaves in the outline: its parameters are found to round-off times the condition."""


class Settle:
    """A grain falls from 20 mm, rocks on its two feet and stays.

    On a plane at right angles to gravity the grain's mirror symmetry fixes the end: both feet bear half of the weight, and the grain
    stands level. On a slope below friction it leans on the lower foot; its moments must balance all the same, or it would turn.
    """

    id = "nurbs/settle"
    version = 1
    title = "Waisted grain at rest on a plane"
    source = "statics: equilibrium of forces and moments"
    requirement = "a non-convex grain comes to rest on two contacts, bears its weight, and stays where it is"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="slope", default=0.0, low=0.0, high=STEEPEST, unit="rad", in_id=True, help="angle of the plane to the horizontal"
        ),
        Parameter(name="substeps", default=1, low=1, whole=True, help="contact steps in place of one"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Level, and on a slope at half of what friction holds."""
        return ({"slope": 0.0}, {"slope": 0.25})

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One grain above a plane, axes along it."""
        grain = uniform(DENSITY, waisted_outline)
        height = FALL - lowest(grain.outline, TILT)[1]
        law = ContactLaw(kn=KN, ks=0.5 * KN, mu=MU, beta=BETA, lever_arm="overlap", regularised=True, restitution=0.0)
        plane = Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
        gravity = (G * math.sin(params["slope"]), -G * math.cos(params["slope"]))
        given = grains([grain], [0], x=[(0.0, height)], angle=TILT)
        scene = Scene(**given, disk_disk=law, walls=(plane,), gravity=gravity)
        step = contact_step(DT, PHASE * math.sqrt(grain.mass / (2.0 * KN))) / params["substeps"]
        numerics = Numerics(dt=DT, n_steps=round(END / DT), contact_dt=step)
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contacts": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Height, angle, forces and kinetic energy; how far the grain moves once it has settled."""
        disks = setup.scene.disks
        x, y, angle = history.x[:, 0, 0], history.x[:, 0, 1], disks.angle[0] + history.angle[:, 0]
        kinetic = (
            0.5 * disks.mass[0] * (history.v[:, 0] ** 2).sum(axis=1) + 0.5 * disks.inertia[0] * history.omega[:, 0] ** 2
        )
        series = {
            "y": ("m", y),
            "angle": ("rad", angle),
            "fn": ("N", history.fn[:, 0]),
            "fs": ("N", history.fs[:, 0]),
            "kinetic": ("J", kinetic),
        }
        still = history.t >= SETTLED - 0.5 * DT
        moved = [np.ptp(values[still]) for values in (x, y, disks.radius[0] * angle)]
        scalars = {f"{name}_final": (unit, float(values[-1])) for name, (unit, values) in series.items()}
        scalars["way_settled"] = ("m", float(np.max(moved)))
        scalars["kinetic_settled"] = ("J", float(kinetic[still].max()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Statics: the plane bears the weight, and the grain stays where it is, on a level plane with both feet on it."""
        weight, slope = float(setup.scene.disks.mass[0]) * G, params["slope"]
        return (
            Headline(name="force at rest", use="rest", quantity="fn_final", expected=weight * math.cos(slope),
                     source="balance of forces", scale=weight, scale_is="weight"),
            Headline(name="creep at rest", use="rest", quantity="way_settled", expected=0.0, source="rest: no creep, no rolling",
                     scale=float(setup.scene.disks.radius[0]), scale_is="radius of the grain"),
            Headline(name="height at rest", use="rest", quantity="y_final", source="lowest points on the plane",
                     expected=-lowest(setup.scene.outlines[0], 0.0)[1] if slope == 0.0 else math.nan,
                     scale=float(setup.scene.disks.radius[0]), scale_is="radius of the grain"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,  # noqa: ARG002
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Weight on both feet, rest, and on a level plane the height and angle that symmetry gives."""
        disks, slope = setup.scene.disks, params["slope"]
        weight, mass = float(disks.mass[0]) * G, float(disks.mass[0])
        length = float(disks.radius[0])
        speed = round_off_speed(length, float(setup.numerics.contact_dt or DT))
        rough, foot = single(engine, length, setup.numerics.n_steps), abs(lowest(setup.scene.outlines[0], 0.0)[0])
        if (
            rough and engine.contact != "spring" and engine.scheme != "theta"
        ):  # rounding decides in which step a foot lands: a step's fall may stay
            rough += G * setup.numerics.dt**2
        frequency, decay = slowest_modes(setup)

        def remaining_motion(time: float) -> tuple[float, float, str]:
            """Energy [J] and displacement [m] that are left at a time, and the reason."""
            energy = fall_energy(setup) * math.exp(-2.0 * decay * (time - LANDED))
            top = math.sqrt(2.0 * energy / mass) + speed
            why = f"damping leaves {energy:.1e} J by {time:g} s; coordinates are rounded to {speed:.1e} m a second"
            why += single_precision(engine)
            return 0.5 * mass * top**2, top / frequency, why

        energy, path, why = remaining_motion(SETTLED)
        _, swing, why_end = remaining_motion(END)
        rest: dict[str, Any] = {"norm": "scalar", "truth": "analytic", "expected": 0.0, "why": why}
        common: dict[str, Any] = {"norm": "scalar", "truth": "analytic", "why": why_end}
        force = 2.0 * KN * swing
        found = [
            Check(quantity="fn_final", expected=weight * math.cos(slope), source="balance of forces: weight", atol=force, **common),
            Check(quantity="fs_final", expected=-weight * math.sin(slope), source="balance of forces: weight along the slope",
                  atol=force, scale=weight, **common),
            Check(quantity="kinetic_settled", source="rest", atol=energy, scale=fall_energy(setup), **rest),
            Check(quantity="way_settled", source="rest: no creep, no rolling", atol=path + rough, scale=length, **rest),
        ]  # fmt: skip
        if slope == 0.0:
            sag = 0.5 * weight / KN if engine.contact == "spring" else 0.0
            level = -lowest(setup.scene.outlines[0], 0.0)[1] - sag
            found += [
                Check(quantity="angle_final", expected=0.0, source="balance of moments: both feet bear alike",
                      atol=SYMMETRY + swing / length + 2.0 * rough / foot, scale=1.0, **common),
                Check(quantity="y_final", expected=level, source="lowest points, less (m g/2)/kn each on springs",
                      atol=SYMMETRY + swing + rough, **common),
            ]  # fmt: skip
        return found


def waisted_outline() -> NurbsCurve:
    """The grain's outline."""
    from ninedisk.core.nurbs.shapes import fitted

    angle = 2.0 * np.pi * np.arange(400) / 400
    radius = 1.0 + WAIST * np.cos(2.0 * angle)
    return fitted(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), CONTROL).curve


def lowest(outline: NurbsCurve, turn: float) -> tuple[float, float]:
    """Lowest point (x, y) [m] of an outline that is turned by ``turn`` [rad]: sampled ever closer about the lowest sample."""
    degree = outline.degree
    low, high = float(outline.knots[degree]), float(outline.knots[-degree - 1])
    c, s = math.cos(turn), math.sin(turn)
    found = (0.0, math.inf)
    for _ in range(5):
        at = np.linspace(low, high, 2001)
        points = outline.evaluate(at) @ np.array([[c, s], [-s, c]])
        k = int(np.argmin(points[:, 1]))
        found = min(found, (float(points[k, 0]), float(points[k, 1])), key=lambda point: point[1])
        low, high = float(at[max(k - 1, 0)]), float(at[min(k + 1, 2000)])
    return found


def fall_energy(setup: Setup) -> float:
    """Energy [J] above that of the grain at rest: the fall, and the displacement of either foot to the plane."""
    disks = setup.scene.disks
    return float(disks.mass[0]) * G * (FALL + TILT * float(disks.radius[0]))


def slowest_modes(setup: Setup) -> tuple[float, float]:
    """Lowest frequency [rad/s] and slowest decay [1/s] of the grain that stands on both feet, moved a little.

    With feet at ``(+-f, -h)`` a motion (x, y, angle) opens a foot by ``y +- f angle`` and shifts it by ``x + h angle``; the springs kn
    and ks and the dashpot ``2 beta sqrt(m kn)`` act on these. The shift of the feet by rolling is left out: it weighs as m g times
    a radius of curvature beside ``2 kn f^2``, less than a hundredth. Only rocking lets the dashpots see the sway.
    """
    disks, law = setup.scene.disks, setup.scene.disk_disk
    mass, inertia = float(disks.mass[0]), float(disks.inertia[0])
    x, y = lowest(setup.scene.outlines[0], 0.0)
    stiffness, damping = np.zeros((3, 3)), np.zeros((3, 3))
    for foot in (-abs(x), abs(x)):
        normal, shear = np.array([0.0, 1.0, foot]), np.array([1.0, 0.0, -y])
        stiffness += law.kn * np.outer(normal, normal) + law.ks * np.outer(shear, shear)
        damping += 2.0 * law.beta * math.sqrt(mass * law.kn) * np.outer(normal, normal)
    inverse = np.diag([1.0 / mass, 1.0 / mass, 1.0 / inertia])
    rates = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ stiffness, -inverse @ damping]]))
    return math.sqrt(float(np.linalg.eigvals(inverse @ stiffness).real.min())), float(-rates.real.max())


CASE = Settle()
