"""Disk that hits a plane at an angle: normal restitution and Coulomb friction in one impact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    contact_step,
    last,
    numerics_of,
    series_and_final,
    whole_steps,
)
from ninedisk.harness.cases.impact._impact import beta_for
from ninedisk.harness.cases.impact._oblique_truth import NAMES, before, binding_truth, curves_of, exact_curves
from ninedisk.references.analytic.slip_to_roll import UNIFORM_DISK
from ninedisk.references.analytic.spring_dashpot import contact_duration

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE = 0.01
"""Default resolution of the contact: ``omega dt <= PHASE``; the shear spring's stretch at touch is first order in it."""

DAMPED_PHASE = 0.05
"""Of a dashpot: ``beta omega dt <= DAMPED_PHASE``."""

AFTER = 4
"""Steps ``dt`` after the contact in a run of default length."""


class ObliqueImpact:
    """A disk in free flight meets a plane; no gravity.

    Which regime a variant is in decides what it tests. Rigid engines stop the slip, or let the disk slide through the impact. With
    springs there is a third: the shear spring gives back what it has stored, and the disk leaves with its slip reversed. A stiff
    spring does not make that go away, since the outcome depends on ks/kn alone: in the regime that sticks, springs and rigid engines
    have different truths. Where a disk slides all the while, and e = 1, they have the same.
    """

    id = "impact/oblique"
    version = 1
    title = "Oblique impact on a plane"
    source = (
        "Coulomb's law for impulses (Walton 1993); linear springs: Di Maio & Di Renzo, Chem. Eng. Sci. 59 (2004) 3461"
    )
    requirement = (
        "a disk that slides through the impact loses mu (1 + e) vn along the plane, one that sticks a third of its slip; springs: "
        "their own exact rebound, phase by phase"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="vt", default=3.0, unit="m/s", in_id=True, help="velocity along the plane; slides through if vt > 3 mu (1 + e) vn"
        ),
        Parameter(name="vn", default=1.0, low=0.0, low_open=True, unit="m/s", help="velocity towards the plane"),
        Parameter(name="spin", default=0.0, unit="rad/s", help="initial spin, positive when rolling forward"),
        Parameter(name="mu", default=0.3, low=0.0, unit="-", help="friction coefficient"),
        Parameter(
            name="restitution", default=1.0, low=0.0, high=1.0, unit="-", in_id=True,
            help="of rigid engines; beta and theta follow from it",
        ),
        Parameter(
            name="gap", default=2e-3, low=0.0, unit="m", help="gap at time 0; theta's own impact law depends on gap/(vn dt)"
        ),
        Parameter(name="dt", default=1e-3, low=0.0, low_open=True, unit="s", help="step; sampling of spring engines"),
        Parameter(name="rotating", default=True, help="false: the disk cannot turn"),
        Parameter(
            name="kn", default=1e8, low=0.0, low_open=True, unit="N/m", help="stiffness of spring engines: a contact of 0.56 ms"
        ),
        Parameter(
            name="ks", default=None, optional=True, low=0.0, low_open=True, unit="N/m",
            help="shear stiffness of spring engines; none: 2/3 kn",
        ),
        CONTACT_DT,
        Parameter(
            name="duration", default=None, optional=True, low=0.0, low_open=True, unit="s",
            help="length of the run; none: the flight, the contact and some steps",
        ),
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Sliding and sticking elastic, sticking dissipative, sliding plastic, no rotation; Newton's law with Coulomb's."""
        return (
            {"vt": 3.0, "restitution": 1.0},
            {"vt": 0.3, "restitution": 1.0},
            {"vt": 0.5, "restitution": 0.5},
            {"vt": 3.0, "restitution": 0.0},
            {"vt": 0.3, "restitution": 1.0, "rotating": False},
            {"vt": 3.0, "restitution": 0.5, "impact": "newton", "sliding": "coulomb"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk above a horizontal plane."""
        kn, beta = params["kn"], beta_for(params["restitution"])
        ks = kn * 2.0 / 3.0 if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=params["mu"], beta=beta, restitution=params["restitution"], regularised=True)
        omega = math.sqrt(kn / MASS)
        if params["vn"] / omega >= RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane by its radius; "
                f"use kn > {MASS * (params['vn'] / RADIUS) ** 2:g}"
            )
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS + params["gap"]]]),
                v=np.array([[params["vt"], -params["vn"]]]),
                omega=np.array([-params["spin"]]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
                rotating=np.array([params["rotating"]]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        )
        dt = params["dt"]
        swing = math.sqrt((1.0 + 1.0 / UNIFORM_DISK) * ks / kn) * omega
        target = min(PHASE / max(omega, swing), DAMPED_PHASE / (beta * omega) if beta > 0.0 else math.inf)
        flight = params["gap"] / params["vn"]
        end = flight + contact_duration(kn=kn, m_eff=MASS, beta=beta) + 2.0 * dt
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, end + AFTER * dt, at_least=end, event="the impact, spread over its steps,"),
            contact_dt=contact_step(dt, target),
            theta=1.0 / (1.0 + params["restitution"]),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Velocities, spin and slip (positive forward), kinetic energy; the ratio of the impulses along and normal to the plane."""
        disks = setup.scene.disks
        vx, vy, spin = history.v[:, 0, 0], history.v[:, 0, 1], 0.0 - history.omega[:, 0]
        series = {
            "x": ("m", history.x[:, 0, 0] - disks.x[0, 0]),
            "gap": ("m", history.gap[:, 0]),
            "vx": ("m/s", vx),
            "vy": ("m/s", vy),
            "spin": ("rad/s", spin),
            "slip": ("m/s", vx - RADIUS * spin),
            "energy": ("J", 0.5 * MASS * (vx**2 + vy**2) + 0.5 * float(disks.inertia[0]) * spin**2),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        scalars["restitution_effective"] = ("1", last(vy) / params["vn"])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.divide(params["vt"] - last(vx), last(vy) + params["vn"])
        scalars["impulse_ratio"] = ("1", float(ratio))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps for contact dynamics, and the rebound for all whose restitution is normal alone: not theta's impact law."""
        found: list[Check] = []
        if engine.scheme == "theta":
            found += _stepped(params, setup, observed)
            if setup.numerics.impact != "newton":
                return found
        return [*found, *_rebound(params, setup, observed, engine)]


def _rebound(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    beta = setup.scene.walls[0].law.beta
    truth = binding_truth(params, setup, engine, beta)
    event = _event(params, setup, observed)
    first, after = curves_of(before(params), setup), curves_of(truth.rebound, setup)
    middle = params["gap"] / params["vn"]
    expected = {
        name: np.where(event, np.nan, np.where(observed.t < middle, first[name], after[name])) for name in NAMES
    }
    tolerance = {name: (truth.atol[name], 0.0, truth.why) for name in NAMES}
    found = series_and_final(NAMES, expected, truth="analytic", source=truth.source, tolerance=tolerance)
    gained, lost = after["vy"] + params["vn"], params["vt"] - after["vx"]
    ratio = lost / gained
    atol = (truth.atol["vx"] + abs(ratio) * truth.atol["vy"]) / (gained - truth.atol["vy"])
    found += [
        Check(quantity="restitution_effective", norm="scalar", truth="analytic", expected=after["vy"] / params["vn"],
              source=truth.source, atol=truth.atol["vy"] / params["vn"], why=truth.why),
        Check(quantity="impulse_ratio", norm="scalar", truth="analytic", expected=ratio,
              source=truth.source, atol=atol, why=truth.why),
    ]  # fmt: skip
    return found


def _stepped(params: Mapping[str, Any], setup: Setup, observed: Observed) -> list[Check]:
    curves = exact_curves(params, setup, observed)
    numerics = setup.numerics
    source = (
        f"theta scheme, theta = {numerics.theta:g}, impact {numerics.impact}, sliding {numerics.sliding}: every step"
    )
    why = "exact solution of this very scheme: round-off of the steps and of the solver"
    largest = abs(params["vt"]) + params["vn"] + RADIUS * abs(params["spin"])
    floor = {"gap": 1e-12 * RADIUS, "spin": 1e-10 * largest / RADIUS}
    tolerance = {name: (floor.get(name, 1e-11 * largest), EXACT_STEP_RTOL, why) for name in curves}
    return series_and_final(tuple(curves), curves, truth="exact-step", source=source, tolerance=tolerance)


def _event(params: Mapping[str, Any], setup: Setup, observed: Observed) -> NDArray[np.bool_]:
    """Samples in the contact, or as near to it as a step may place the impact, shape (s,)."""
    begin, dt = params["gap"] / params["vn"], setup.numerics.dt
    length = contact_duration(kn=params["kn"], m_eff=MASS, beta=setup.scene.walls[0].law.beta)
    return np.asarray((observed.t > begin - 1.5 * dt) & (observed.t < begin + length + 1.5 * dt))


CASE = ObliqueImpact()
