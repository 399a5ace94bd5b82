"""Oblique impact of a sphere on a plane over Thornton's normalised angle: rigid, linear springs, Hertz-Mindlin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import Elastic, SphereLaw, damping_ratio, moduli
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, TruthKind, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import CONTACT_DT, contact_softness, contact_step, phase_error, soft_reason
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.impact.sphere_impact import ROUND_OFF, observed_of, rebound_checks, rebound_within, setup_of
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.hertz import contact_moduli
from ninedisk.references.analytic.impact.oblique_impact import Rebound, rigid_rebound, spring_rebound
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration
from ninedisk.references.hertz_mindlin import Contact, SpheresAfterImpact, rebound

RADIUS, MASS, MU, SPEED = 1.0, 4.0 / 3.0 * math.pi, 0.3, 1.0
INERTIA_RATIO = 0.4
"""``I/(m R^2)`` of a sphere."""

KN, SHEAR_RATIO = 1e8, 2.0 / 3.0
SOFT = (1e10, 0.3)
"""Stiffness [N/m], its shear part, and (E [Pa], nu) of the two laws: contacts of about half a millisecond."""

GAP, AFTER, PHASE = 2.3e-3, 3, 0.01
PLACES = (0.5, 1.5, 2.5, 4.0, 6.0, 9.0)
"""Normalised angles; a rigid sphere slides through the impact from 7 on, and before that stops its slip."""


class Thornton:
    """A sphere that does not spin meets a plane; no gravity.

    Over ``2 tan(angle)/(mu (1 + e))`` all restitutions and coefficients of friction fall on one curve for each kind of contact:
    5/7 of the speed is left where a rigid sphere rolls off, and ``1 - 2/x`` where it slides all the while.
    """

    id = "spheres/thornton"
    version = 1
    title = "Tangential restitution over the normalised angle"
    source = "Thornton, Cummins & Cleary (2011), Powder Technology 210, 189; Thornton (2009), J. Appl. Mech. 76, 014501"
    requirement = "velocity and spin after the impact are those of rigid impulses, linear springs or Hertz-Mindlin"
    figures: tuple[Figure, ...] = (
        Figure(
            kind="places",
            title="Tangential restitution and spin",
            quantities=(
                Plotted("tangential_restitution", "vt after over before [-]", at="incidence"),
                Plotted("rebound_spin", "R spin/(mu (1 + e) vn) [-]", at="incidence"),
            ),
            where={"restitution": (1.0,)},
            compare="law",
            at_label="2 tan(angle)/(mu (1 + e))",
            shows="Speed along the plane and spin after the impact, of every engine.",
            allows="From 7 on a sphere slides through the impact, whatever its contact is like, and all lie on 1 - 2/x and on 5/2; below, "
            "rigid spheres keep 5/7, linear springs give back some of what they have stored by ks/kn, and Hertz-Mindlin by Poisson's "
            "ratio.",
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="law", default="linear", choices=("linear", "hertz"), in_id=True, help="linear: rigid engines run it as well"),
        Parameter(name="incidence", default=4.0, low=0.01, high=100.0, unit="-", in_id=True, help="2 tan(angle)/(mu (1 + e))"),
        Parameter(name="restitution", default=1.0, low=0.1, high=1.0, unit="-", help="coefficient of restitution"),
        Parameter.positive("dt", 1e-3, high=1e-2, unit="s", help="step; sampling of spring engines"),
        CONTACT_DT,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both laws from sticking to sliding; one with a dashpot."""
        found: list[dict[str, Value]] = [{"law": law, "incidence": x} for law in ("linear", "hertz") for x in PLACES]
        return [*found, {"law": "linear", "incidence": 9.0, "restitution": 0.5}]

    def contact(self, params: Mapping[str, Any]) -> Contact:
        """The sphere before it meets the plane, with Hertz' law by the references' formulas."""
        e_star, g_star = contact_moduli(SOFT)
        e = params["restitution"]
        vt = 0.5 * params["incidence"] * MU * (1.0 + e) * SPEED
        return Contact(
            radius=RADIUS, mass=MASS, radius_2=math.inf, mass_2=math.inf, first=(SPEED, vt, 0.0), second=(0.0, 0.0, 0.0),
            e_star=e_star, g_star=g_star, mu=MU, beta=-math.log(e) / math.hypot(math.pi, math.log(e)), unloading="force",
        )  # fmt: skip

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One sphere above a plane."""
        contact, e, dt = self.contact(params), params["restitution"], params["dt"]
        beta = damping_ratio(e)
        if params["law"] == "hertz":
            e_star, g_star = moduli(Elastic(E=SOFT[0], nu=SOFT[1]), None)
            law = SphereLaw(e_star=e_star, g_star=g_star, mu=MU, beta=beta, restitution=e)
            lasts, target = contact.elastic.duration / e, contact.elastic.duration * PHASE / math.pi
        else:
            law = SphereLaw(kn=KN, ks=SHEAR_RATIO * KN, mu=MU, beta=beta, restitution=e, regularised=True)
            lasts = contact_duration(kn=KN, m_eff=MASS, beta=beta)
            target = PHASE * math.sqrt(MASS / KN)
        return setup_of(
            contact, law, dt=dt, gap=GAP, n_steps=math.ceil((GAP / SPEED + lasts) / dt) + AFTER,
            contact_dt=contact_step(dt, target) if params["contact_dt"] is None else params["contact_dt"],
        )  # fmt: skip

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Velocities and spin, and what the figure shows."""
        contact = self.contact(params)
        seen = observed_of(contact, history)
        scalars = dict(seen.scalars)
        for name in ("overlap_max", "force_max", "duration"):
            del scalars[name]
        slide = MU * (1.0 + params["restitution"]) * SPEED
        scalars["incidence"] = ("1", 2.0 * float(seen.series["vt"][1][0]) / slide)
        scalars["tangential_restitution"] = ("1", scalars["vt_final"][1] / contact.first[1])
        scalars["rebound_spin"] = ("1", abs(RADIUS * scalars["spin_final"][1]) / slide)
        return Observed(step=seen.step, t=seen.t, series=seen.series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Restitution; the speed along the plane and the spin where all contacts agree on them, or where there is but one law."""
        contact, first = self.contact(params), math.hypot(SPEED, self.contact(params).first[1])
        if params["law"] == "hertz":
            along, source = rebound(contact).first[1], "Hertz-Mindlin law integrated to 1e-12"
        else:
            along, source = _rigid(contact, params, dilates=False).vx, "Coulomb's law for the impulses"
            springs = _springs(contact, setup.scene.walls[0].law.beta).vx
            along = along if abs(along - springs) <= 0.01 * first else math.nan
        return (
            Headline(name="restitution", use="impacts", quantity="restitution_effective", expected=params["restitution"],
                     source="Newton's restitution", scale=1.0, scale_is="speed of approach"),
            Headline(name="speed along the plane", use="impacts", quantity="vt_final", expected=along, source=source, scale=first,
                     scale_is="initial speed"),
            Headline(name="spin after the impact", use="impacts", quantity="spin_final",
                     expected=(along - contact.first[1]) / (INERTIA_RATIO * RADIUS), source=f"{source}; its impulse has the arm R",
                     scale=first / RADIUS, scale_is="initial speed over the radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo  # noqa: ARG002
    ) -> Sequence[Check]:  # fmt: skip
        """The rebound that the engine's kind of contact has."""
        contact = self.contact(params)
        if params["law"] == "hertz":
            return rebound_checks(contact, setup, engine)
        if engine.contact == "spring":
            return _spring_checks(contact, setup, engine)

        def rigid(setup: Any, engine: EngineInfo) -> list[Check]:
            return _rigid_checks(contact, params, setup, engine)

        def lifting(setup: Any, engine: EngineInfo) -> list[Check]:
            return checks_with_allowance(LIFTS, setup, engine, rigid)

        return checks_with_allowance(Difference.ARM_LESS_OVERLAP, setup, engine, lifting)


def _rigid(contact: Contact, params: Mapping[str, Any], *, dilates: bool) -> Rebound:
    return rigid_rebound(velocity=(contact.first[1], -SPEED), spin=0.0, radius=RADIUS, inertia_ratio=INERTIA_RATIO, mu=MU,
                         restitution=params["restitution"], dilates=dilates)  # fmt: skip


def _springs(contact: Contact, beta: float) -> Rebound:
    return spring_rebound(velocity=(contact.first[1], -SPEED), spin=0.0, radius=RADIUS, inertia_ratio=INERTIA_RATIO, mu=MU, mass=MASS,
                          kn=KN, ks=SHEAR_RATIO * KN, beta=beta)  # fmt: skip


def _rebound_checks(
    contact: Contact, found: Rebound, vt: float, vn: float, engine: EngineInfo, setup: SphereSetup, source: str, why: str
) -> list[Check]:  # fmt: skip
    """Checks of a rebound whose velocities may be off by ``vt`` along the plane and ``vn`` across it."""
    kind: TruthKind = "analytic"
    # Spin about n x t, n into the plane, turns the other way than one that rolls forward.
    truth = SpheresAfterImpact((-found.vy, found.vx, -found.spin), (0.0, 0.0, 0.0))
    bound: FloatArray = np.array([0.5 * vn, vt, vt / (INERTIA_RATIO * RADIUS)])
    return rebound_within(contact, truth, bound, engine, setup, truth_kind=kind, source=source, why=why)


def _spring_checks(contact: Contact, setup: SphereSetup, engine: EngineInfo) -> list[Check]:
    """As of `ninedisk.harness.cases.impact.oblique`: the shear spring's first step is a whole one, and
    where in the overlap of a contact that is meant to be rigid friction acts is open."""
    law = setup.scene.walls[0].law
    e = math.exp(-math.pi * law.beta / math.sqrt(1.0 - law.beta**2))
    dt = setup.numerics.contact_dt or setup.numerics.dt
    # A dashpot that pulls at the end of the contact changes the velocity across the plane alone: friction has no grip then.
    found = _springs(contact, law.beta)._replace(vy=e * SPEED)
    phase, ease = math.sqrt(KN / MASS) * dt, 1.0 + 1.0 / INERTIA_RATIO
    swing = math.sqrt(ease * SHEAR_RATIO) * phase
    normal = (e * phase_error(phase, law.beta) + ROUND_OFF) * SPEED
    slip = contact.first[1]
    slides = slip * SHEAR_RATIO > MU * SPEED and law.beta == 0.0
    overlap, lost = SPEED * math.sqrt(MASS / KN) / RADIUS, abs(found.vx - slip)
    along = MU * normal + ((0.0 if slides else swing) + swing**2) * slip / ease + 2.0 * overlap * lost
    why = f"omega dt = {phase:.3g}; {'slides' if slides else 'sticks'} at first, Omega dt = {swing:.3g}; overlap/R = {overlap:.2g}"
    return _rebound_checks(
        contact, found, along, normal, engine, setup, "linear springs with Coulomb's cap, phase by phase", why
    )


def _rigid_checks(contact: Contact, params: Mapping[str, Any], setup: SphereSetup, engine: EngineInfo) -> list[Check]:
    """Impulses of one step; a soft contact misses a part of each, and friction takes part of what the normal impulse misses."""
    dilates = follows_associated_rule(engine, setup.numerics)
    found = _rigid(contact, params, dilates=dilates)
    normal, along = found.vy + SPEED, abs(found.vx - contact.first[1])
    soft = contact_softness(engine)
    vt, vn = (along + MU * normal) * soft, normal * soft
    if Difference.IMPACT_AS_SPRINGS in engine.differences:
        vn += MU * soft * contact.first[1]
    if Difference.ARM_LESS_OVERLAP in engine.differences:
        # The impulse that ends a slip goes with 1/(1/m + a^2/I), which an arm a shorter by a share d changes by 2 d/(1 + I/(m R^2)).
        vt += along * 2.0 / (1.0 + INERTIA_RATIO) * SPEED * setup.numerics.dt / RADIUS
    rule = "the associated sliding rule" if dilates else "Coulomb's law"
    why = f"impulses of one step at velocity level{soft_reason(engine)}"
    return _rebound_checks(
        contact, found, vt, vn, engine, setup, f"Newton's restitution and {rule} for the impulses", why
    )


CASE = Thornton()
