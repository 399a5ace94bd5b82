"""Head-on collision of two disks, elastic or plastic (appendix A.2), and what binds an engine on it.

That is the restitution by the kind of its contacts, or the exact steps of its scheme.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, TruthKind, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    around_contact,
    contact_softness,
    contact_step,
    drift_in_flight,
    flight_checks,
    last,
    numerics_of,
    phase_error,
    series_and_final,
    single,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.impact.figures import BINARY_CLAIMS, BINARY_FIGURES
from ninedisk.references.analytic.impact.collision import collision_history
from ninedisk.references.analytic.impact.spring_dashpot import (
    beta_of_restitution,
    contact_duration,
    restitution_of_beta,
)
from ninedisk.references.exact_steps.impact import collision_step_theta

RADIUS = 1.0
PAIR = (0, 1)

PHASE, DAMPED_PHASE = 0.02, 0.05
"""Default resolution of the contact: ``omega dt <= PHASE`` and ``beta omega dt <= DAMPED_PHASE``."""


PLASTIC_BETA = 10.0
"""Largest dashpot that the case chooses: e = 0.00244, a 400th of the elastic one. The step falls with 1/beta, and e = 0
needs an infinite dashpot."""

KINDS = {"elastic": 1.0, "plastic": 0.0}

ROUND_OFF = 1e-12
"""Of the speed: a collision is one impulse, a handful of roundings; free flight changes no velocity."""

NAMES = ("vx_1", "vx_2", "energy")


class BinaryCollision:
    """Disk 1 hits disk 2, which rests; no gravity, no friction.

    ``energy`` is kinetic only: while the disks touch, a spring engine holds the rest in the spring. Histories are
    therefore compared before and after the contact, and not within the step in which a rigid engine may place it.
    """

    id = "binary-collision"
    version = 1
    title = "Binary collision of two disks"
    beside_headlines = tuple(
        (name, "steps of the theta scheme that are not Newton's impact are held to themselves")
        for name in ("vx_*", "energy")
    )
    source = "appendix A.2 of Lim's thesis, figures A.6-A.13"
    requirement = (
        "momentum always conserved; energy after an elastic impact; velocities (0, 1) elastic, (1/2, 1/2) plastic"
    )
    figures = BINARY_FIGURES
    claims = BINARY_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="kind",
            default="elastic",
            choices=("elastic", "plastic"),
            in_id=True,
            help="restitution 1 or 0; restitution, beta and theta override it",
        ),
        Parameter(
            name="restitution",
            default=None,
            optional=True,
            low=0.0,
            high=1.0,
            unit="-",
            help="coefficient of restitution of rigid engines; beta and theta follow from it",
        ),
        Parameter(
            name="beta",
            default=None,
            optional=True,
            low=0.0,
            unit="-",
            help="contact damping ratio of spring engines; none: from the restitution, at most 10",
        ),
        Parameter(
            name="theta",
            default=None,
            optional=True,
            low=0.5,
            high=1.0,
            unit="-",
            help="parameter of the theta scheme; none: 1/(1 + e)",
        ),
        Parameter(name="gap", default=0.5, low=0.0, unit="m", help="gap at time 0; 0.5 m is 50 steps of flight"),
        Parameter.positive("dt", 0.01, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("speed", 1.0, unit="m/s", help="initial velocity of disk 1"),
        Parameter.positive("mass", math.pi, unit="kg", help="mass of each disk"),
        Parameter.positive("mass_2", None, unit="kg", help="mass of disk 2; none: that of disk 1"),
        Parameter.positive("radius", RADIUS, unit="m", help="radius of each disk"),
        Parameter.positive("radius_2", None, unit="m", help="radius of disk 2; none: that of disk 1"),
        Parameter.positive("kn", 1e6, unit="N/m", help="stiffness of spring engines; 1e6 makes a contact of 4 ms"),
        CONTACT_DT,
        Parameter.positive(
            "duration",
            None,
            unit="s",
            help="length of the run; none: twice the time of flight and at least 50 steps after the contact",
        ),
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The source's two, a restitution between, a soft spring, an impact within a step, and Newton's law; unequal, and fast, disks."""
        unequal: dict[str, Value] = {"kind": "elastic", "radius": 0.4, "radius_2": 0.7}
        return (
            {"kind": "elastic"},
            {"kind": "plastic"},
            {"kind": "elastic", "restitution": 0.5},
            {"kind": "elastic", "kn": 1e4},
            {"kind": "elastic", "gap": 0.5025},
            {"kind": "elastic", "restitution": 0.5, "impact": "newton"},
            {**unequal, "mass": 1.0, "mass_2": 3.0},
            {**unequal, "mass": 1.0, "mass_2": 3.0, "restitution": 0.5},
            {**unequal, "mass": 1e4, "mass_2": 1.0, "restitution": 0.5},
            {**unequal, "mass": 3e3, "mass_2": 5e3, "restitution": 0.5},
            {**unequal, "mass": 1.0, "mass_2": 3.0, "speed": 5.0, "kn": 100.0},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Two disks on the x axis."""
        given, m_eff, (one, two) = impact_settings(params), effective_mass(params), radii(params)
        law = ContactLaw(kn=params["kn"], beta=given.beta, restitution=given.restitution, regularised=True)
        disks = Disks(
            x=np.array([[0.0, 0.0], [one + two + params["gap"], 0.0]]),
            v=np.array([[params["speed"], 0.0], [0.0, 0.0]]),
            radius=np.array([one, two]),
            mass=np.array(masses(params)),
        )
        flight, dt = params["gap"] / params["speed"], params["dt"]
        contact = contact_duration(kn=params["kn"], m_eff=m_eff, beta=given.beta)
        end = flight + contact + 2.0 * dt
        omega = math.sqrt(params["kn"] / m_eff)
        target = min(PHASE, DAMPED_PHASE / given.beta if given.beta > 0.0 else math.inf) / omega
        numerics = numerics_of(
            params,
            n_steps=whole_steps(
                params,
                max(2.0 * flight, end + 48.0 * dt),
                at_least=end + dt,
                event="the collision, spread over its steps,",
            ),
            contact_dt=contact_step(dt, target),
            theta=given.theta,
        )
        return Setup(
            scene=Scene(disks=disks, disk_disk=law), numerics=numerics, watch=(PAIR,), labels={"contact": PAIR}
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Velocities, kinetic energy and momentum."""
        disks, v = setup.scene.disks, history.v
        # A spin that an engine does not report is no energy here: nothing turns the disks.
        energy = 0.5 * (disks.mass * (v**2).sum(axis=2)).sum(axis=1)
        momentum = (disks.mass * v[:, :, 0]).sum(axis=1)
        series = {
            "energy": ("J", energy),
            "momentum_x": ("kg m/s", momentum),
            "vx_1": ("m/s", v[:, 0, 0]),
            "vx_2": ("m/s", v[:, 1, 0]),
            "vy_1": ("m/s", v[:, 0, 1]),
            "vy_2": ("m/s", v[:, 1, 1]),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        scalars["restitution_effective"] = ("1", (v[-1, 1, 0] - v[-1, 0, 0]) / params["speed"])
        drift = np.abs(momentum - params["mass"] * params["speed"])
        scalars["momentum_drift"] = ("kg m/s", float(drift.max()))  # NaN where a velocity is
        scalars["drift_in_flight"] = ("m/s", drift_in_flight(setup, history))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Newton's restitution for all: the rigid disks' problem, whose spring engines have a dashpot of at most `PLASTIC_BETA`."""
        momentum = params["mass"] * params["speed"]
        return (
            Headline(name="restitution", use="impacts", quantity="restitution_effective", expected=impact_settings(params).restitution,
                     source="Newton's restitution", scale=1.0, scale_is="speed of approach"),
            Headline(name="momentum lost", use="impacts", quantity="momentum_drift", expected=0.0,
                     source="conservation of momentum", scale=momentum, scale_is="momentum of the hitting disk"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Conservation for all; velocities and energy of the restitution that binds the engine."""
        momentum = params["mass"] * params["speed"]
        of_momentum, of_speed = single(engine, momentum, 1), single(engine, params["speed"], 1)
        conserved = "two equal and opposite impulses: round-off of a few operations"
        if of_momentum:
            conserved += " in single precision"
        on_axis = "both centres lie on the x axis: no force has a y component"
        still: list[Check] = [
            Check(quantity=f"vy_{i}", norm="max", truth="analytic", expected=0.0, source="symmetry", why=on_axis,
                  atol=1e-13 * params["speed"] + of_speed, scale=params["speed"])
            for i in (1, 2)
        ]  # fmt: skip
        return [
            *impact_checks(params, setup, observed, engine),
            Check(quantity="momentum_x", norm="max", truth="analytic", expected=momentum, source="conservation",
                  why=conserved, rtol=1e-13, atol=of_momentum),
            Check(quantity="momentum_x_final", norm="scalar", truth="analytic", expected=momentum,
                  source="conservation", why=conserved, rtol=1e-13, atol=of_momentum),
            Check(quantity="momentum_drift", norm="scalar", truth="analytic", expected=0.0, source="conservation",
                  why=conserved, atol=1e-13 * momentum + of_momentum, scale=momentum),
            *still,
            *flight_checks(setup, engine),
        ]  # fmt: skip


class ImpactSettings(NamedTuple):
    """What each kind of engine is given for the impact."""

    restitution: float
    beta: float
    theta: float


class Impact(NamedTuple):
    """Restitution that binds an engine, its tolerance, and why."""

    restitution: float
    tolerance: float
    source: str
    why: str


def impact_settings(params: Mapping[str, Any]) -> ImpactSettings:
    """Restitution, damping ratio and theta of a variant.

    The first of ``restitution``, ``beta``, ``theta`` that is set gives the target restitution, else ``kind`` does; the
    two others follow from it unless they are set as well.
    """
    given, beta, theta = params["restitution"], params["beta"], params["theta"]
    if given is not None:
        target = given
    elif beta is not None:
        target = restitution_of_beta(beta)
    elif theta is not None:
        target = (1.0 - theta) / theta
    else:
        target = KINDS[params["kind"]]
    if beta is None:
        beta = beta_for(target)
    return ImpactSettings(restitution=target, beta=beta, theta=1.0 / (1.0 + target) if theta is None else theta)


def masses(params: Mapping[str, Any]) -> tuple[float, float]:
    """Mass of each disk [kg]."""
    return params["mass"], params["mass"] if params["mass_2"] is None else params["mass_2"]


def radii(params: Mapping[str, Any]) -> tuple[float, float]:
    """Radius of each disk [m]."""
    return params["radius"], params["radius"] if params["radius_2"] is None else params["radius_2"]


def effective_mass(params: Mapping[str, Any]) -> float:
    """Mass of the relative motion [kg]."""
    one, two = masses(params)
    return one * two / (one + two)


def beta_for(restitution: float) -> float:
    """Damping ratio that a case gives to springs for a coefficient of restitution: at most `PLASTIC_BETA`."""
    return min(beta_of_restitution(restitution), PLASTIC_BETA) if restitution > 0.0 else PLASTIC_BETA


def impact_checks(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Checks of velocities, kinetic energy and restitution that bind an engine."""
    if engine.scheme == "theta" and setup.numerics.impact == "theta":
        return _exact_steps(params, setup, observed)
    return _analytic(
        params, observed, setup.numerics.dt, binding_impact(params, setup, engine), single(engine, params["speed"], 1)
    )


def binding_impact(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> Impact:
    """Restitution that an engine must reach, by the kind of its contacts.

    That of springs is off by `phase_error`.
    """
    given = impact_settings(params)
    if engine.contact == "spring":
        e = restitution_of_beta(given.beta)
        phase = math.sqrt(params["kn"] / effective_mass(params)) * (setup.numerics.contact_dt or setup.numerics.dt)
        bound = e * phase_error(phase, given.beta)
        why = f"phase of the impact in the contact step: omega dt = {phase:.3g}, beta = {given.beta:.4g}"
        return Impact(e, bound + ROUND_OFF, f"spring and dashpot without tension, e(beta) = {e:.6g}", why)
    # An impulse is 1 + e times what a plastic one is; a soft contact misses a part of it.
    missed = (1.0 + given.restitution) * contact_softness(engine)
    # The relative velocity after the impact is the difference of two, each rounded.
    rounding = 2.0 * single(engine, params["speed"], 1) / params["speed"]
    why = "impact law at velocity level: round-off" + (" of single precision" if rounding else "") + soft_reason(engine)
    return Impact(given.restitution, ROUND_OFF + missed + rounding, "Newton's restitution, momentum conserved", why)


def _analytic(params: Mapping[str, Any], observed: Observed, dt: float, impact: Impact, rounding: float) -> list[Check]:
    (one, two), speed, e = masses(params), params["speed"], impact.restitution
    m_eff = effective_mass(params)
    curves = collision_history(
        observed.t, gap=params["gap"], speed=speed, mass_1=one, mass_2=two, restitution=e
    )._asdict()
    contact = contact_duration(kn=params["kn"], m_eff=m_eff, beta=impact_settings(params).beta)
    event = around_contact(observed.t, params["gap"] / speed, contact, dt)
    expected = {name: np.where(event, np.nan, curves[name]) for name in NAMES}
    # The impulse is m v (1 + e), m the effective mass, and the energy of the relative motion m (v e)^2/2.
    # Each velocity is rounded by itself, whatever its part in the impulse.
    rounding += speed * ROUND_OFF
    of_energy = m_eff * speed**2 * impact.tolerance * (e + impact.tolerance / 2.0) + (one + two) * speed * rounding
    tolerance = {
        "vx_1": (speed * impact.tolerance * m_eff / one + rounding, 0.0, impact.why),
        "vx_2": (speed * impact.tolerance * m_eff / two + rounding, 0.0, impact.why),
        "energy": (of_energy, 0.0, impact.why),
    }
    return [
        *series_and_final(
            NAMES, expected, truth="analytic", source=impact.source, tolerance=tolerance, sizes=_sizes(params)
        ),
        _restitution(e, "analytic", impact.source, impact.tolerance, impact.why),
    ]


def _exact_steps(params: Mapping[str, Any], setup: Setup, observed: Observed) -> list[Check]:
    (one, two), numerics = masses(params), setup.numerics
    steps = collision_step_theta(
        gap=params["gap"],
        speed=params["speed"],
        dt=numerics.dt,
        theta=numerics.theta,
        n_steps=numerics.n_steps,
        mass_1=one,
        mass_2=two,
    )._asdict()
    expected = {name: steps[name][observed.step] for name in NAMES}
    why = "exact solution of the theta scheme; the phase gap/(v dt) is rounded once a step"
    source = f"theta scheme, theta = {numerics.theta:g}, e_eff(gap, theta)"
    tolerance = dict.fromkeys(NAMES, (0.0, EXACT_STEP_RTOL, why))
    e = float((expected["vx_2"][-1] - expected["vx_1"][-1]) / params["speed"])
    return [
        *series_and_final(
            NAMES, expected, truth="exact-step", source=source, tolerance=tolerance, sizes=_sizes(params)
        ),
        _restitution(e, "exact-step", source, EXACT_STEP_RTOL, why),
    ]


def _sizes(params: Mapping[str, Any]) -> dict[str, float]:
    return dict.fromkeys(("vx_1", "vx_2"), float(params["speed"]))


def _restitution(e: float, truth: TruthKind, source: str, atol: float, why: str) -> Check:
    return Check(
        quantity="restitution_effective",
        norm="scalar",
        truth=truth,
        expected=e,
        source=source,
        atol=atol,
        why=why,
        scale=1.0,
    )


CASE = BinaryCollision()
