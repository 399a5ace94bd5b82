"""Two unequal disks that hit each other off the centre, both spinning."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    contact_softness,
    contact_step,
    numerics_of,
    phase_error,
    single,
    single_precision,
    soft_reason,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.impact.binary import ROUND_OFF, beta_for
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, restitution_of_beta
from ninedisk.references.analytic.impact.two_disks import Impact, Springs, two_disk_impact

RADIUS, MASS = np.array([0.4, 0.7]), np.array([1.0, 3.0])
VELOCITY, SPIN = np.array([0.4, -0.3]), np.array([2.0, -3.5])
"""Of the first disk [m/s], and of both [rad/s]."""

DIRECTION = (math.cos(0.65), math.sin(0.65))
"""Line of centres in the impact: along no axis."""

APPROACH, MU, FLIGHT = 1.0, 0.3, 4e-3
"""Speed along the line of centres [m/s], friction, time of flight [s]."""

PAIR = (0, 1)
PHASE, DAMPED_PHASE = 0.01, 0.05
"""Resolution of a spring contact: ``omega dt``, and ``beta omega dt``, at most."""

AFTER = 20
"""Steps after the impact."""

NAMES = ("vx_1", "vy_1", "spin_1", "vx_2", "vy_2", "spin_2")


class TwoDisks:
    """Free disks of masses 1 and 3 and radii 0.4 and 0.7, with friction; no gravity, no walls.

    ``across`` is the second disk's velocity along ``t = (-n_y, n_x)`` seen from the first. Far from 0 the contact slides all the
    while; near the spins' own slip it sticks, and springs and rigid disks have their own truths, as in ``impact/oblique``.
    """

    id = "impact/two-disks"
    version = 1
    title = "Oblique impact of two unequal disks"
    source = "balance of impulses of two bodies; Coulomb's law for impulses (Walton 1993), or linear springs (Di Maio & Di Renzo 2004)"
    requirement = "velocities and spins of both follow from each one's own mass, radius and inertia; momenta are kept"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="across", default=3.0, unit="m/s", in_id=True, help="velocity across the line of centres: 3 slides, -1.2 sticks"),
        Parameter(name="restitution", default=1.0, low=0.0, high=1.0, unit="-", in_id=True, help="of rigid engines; beta follows from it"),
        Parameter.positive("mass_2", 3.0, unit="kg", help="mass of the second disk; the first has 1 kg"),
        Parameter.positive("inertia_2", 0.5, unit="-", help="moment of inertia of the second disk over m R^2: 1/2 of a disk, 1 of a ring"),
        Parameter.positive("dt", 2e-4, high=1e-3, unit="s", help="step; sampling of spring engines"),
        Parameter(name="kn", default=1e8, low=1e6, unit="N/m", help="stiffness of spring engines; ks is 2/3 of it"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Sliding and sticking, elastic and not; a ring; heavy on light."""
        return (
            {"across": 3.0, "restitution": 1.0},
            {"across": 3.0, "restitution": 0.5},
            {"across": -1.2, "restitution": 0.5},
            {"across": 3.0, "restitution": 0.5, "inertia_2": 1.0},
            *({"across": 3.0, "restitution": 0.5, "mass_2": mass} for mass in (100.0, 1e4)),
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disks `FLIGHT` before they touch."""
        mass, velocity, kn = _mass(params), _approach_velocities(params), params["kn"]
        normal = np.array(DIRECTION)
        place = RADIUS.sum() * normal - FLIGHT * (velocity[1, :2] - velocity[0, :2])
        beta = beta_for(params["restitution"])
        law = ContactLaw(
            kn=kn, ks=kn * 2.0 / 3.0, mu=MU, beta=beta, restitution=params["restitution"], regularised=True
        )
        disks = Disks(
            x=np.array([[0.0, 0.0], place]),
            v=velocity[:, :2],
            omega=velocity[:, 2],
            radius=RADIUS,
            mass=mass,
            inertia=_inertia(params),
        )
        omega, dt = math.sqrt(kn / _effective(params)), params["dt"]
        target = min(PHASE / math.sqrt(3.0), DAMPED_PHASE / beta if beta > 0.0 else math.inf) / omega
        lasts = contact_duration(kn=kn, m_eff=_effective(params), beta=beta)
        numerics = numerics_of(
            params, n_steps=math.ceil((FLIGHT + lasts) / dt) + AFTER, contact_dt=contact_step(dt, target)
        )
        return Setup(
            scene=Scene(disks=disks, disk_disk=law), numerics=numerics, watch=(PAIR,), labels={"contact": PAIR}
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Velocities, spins and places at the end; momenta and their moment about the origin, over the run; relative speed after."""
        mass, inertia = _mass(params), _inertia(params)
        spin, x, v = history.omega, history.x, history.v
        moment = (mass * (x[:, :, 0] * v[:, :, 1] - x[:, :, 1] * v[:, :, 0]) + inertia * spin).sum(axis=1)
        momentum = (mass[:, None] * v).sum(axis=1)
        state = np.concatenate([v, spin[:, :, None]], axis=2).reshape(len(x), -1)
        series = {name: ("rad/s" if "spin" in name else "m/s", state[:, k]) for k, name in enumerate(NAMES)}
        series |= {
            "momentum_x": ("kg m/s", momentum[:, 0]),
            "momentum_y": ("kg m/s", momentum[:, 1]),
            "moment_of_momentum": ("kg m^2/s", moment),
        }
        scalars = {f"{name}_final": (series[name][0], float(series[name][1][-1])) for name in NAMES}
        for k, one in enumerate(("1", "2")):
            scalars |= {f"{axis}_{one}_final": ("m", float(x[-1, k, c])) for c, axis in enumerate(("x", "y"))}
        scalars["restitution_effective"] = ("1", float((v[-1, 1] - v[-1, 0]) @ np.array(DIRECTION)) / APPROACH)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Restitution, and the spin of the light disk where rigid disks and the scene's springs agree on it."""
        rigid, sprung = (_exact_rebound(params, setup, springs=springs).velocity[0, 2] for springs in (False, True))
        size = APPROACH / float(RADIUS[0])
        return (
            Headline(name="restitution", use="impacts", quantity="restitution_effective", expected=params["restitution"],
                     source="Newton's restitution", scale=1.0, scale_is="speed of approach"),
            Headline(name="spin after the impact", use="impacts", quantity="spin_1_final",
                     expected=rigid if abs(rigid - sprung) < 0.01 * size else math.nan, source=self.source, scale=size,
                     scale_is="speed of approach over the radius"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,  # noqa: ARG002
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Momenta for all; velocities and spins by the kind of the contact."""
        mass, first, steps = _mass(params), _approach_velocities(params), setup.numerics.n_steps
        momentum = mass @ first[:, :2]
        fastest = float(np.abs(first[:, :2]).max())
        size = float(mass.max()) * fastest
        rough = 1e-12 * size + 2.0 * single(engine, size, steps)
        place = setup.scene.disks.x
        moment = float(
            (mass * (place[:, 0] * first[:, 1] - place[:, 1] * first[:, 0]) + _inertia(params) * first[:, 2]).sum()
        )
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "source": "conservation"}
        why = "equal and opposite impulses: round-off" + single_precision(engine)
        found = [
            Check(quantity=f"momentum_{axis}", expected=float(momentum[k]), atol=rough, scale=size, why=why, **common)
            for k, axis in enumerate("xy")
        ]  # fmt: skip
        if engine.scheme == "central-difference":
            arm = fastest * (setup.numerics.contact_dt or setup.numerics.dt)
            why = "impulses act at one place; lever arms within the overlap: the largest overlap over the radius"
        else:
            arm = 2.0 * float(np.hypot(*(first[1, :2] - first[0, :2]))) * setup.numerics.dt
            why = "impulses act at the places of a step's begin or end: the displacement of two steps" + soft_reason(
                engine
            )
        impact = _exact_rebound(params, setup, springs=engine.contact == "spring")
        if engine.contact == "spring":
            arm += _overlap(params)
        impulse = abs(impact.normal) + abs(impact.shear)
        found.append(
            Check(quantity="moment_of_momentum", expected=moment, atol=rough + arm * impulse * (1.0 + contact_softness(engine)),
                  scale=size * float(RADIUS.sum()), why=why, **common)
        )  # fmt: skip

        def after(setup: Setup, engine: EngineInfo) -> list[Check]:
            return _impact_checks(params, setup, engine, self.source)

        return [*found, *checks_with_allowance(LIFTS, setup, engine, after)]


def _mass(params: Mapping[str, Any]) -> FloatArray:
    return np.array([MASS[0], params["mass_2"]])


def _inertia(params: Mapping[str, Any]) -> FloatArray:
    return np.asarray(np.array([0.5, params["inertia_2"]]) * _mass(params) * RADIUS**2)


def _effective(params: Mapping[str, Any]) -> float:
    return 1.0 / float((1.0 / _mass(params)).sum())


def _contact_mobility(params: Mapping[str, Any]) -> float:
    """What an impulse along the contact changes its slip by, over what one towards it changes the approach by."""
    return 1.0 + _effective(params) * float((RADIUS**2 / _inertia(params)).sum())


def _approach_velocities(params: Mapping[str, Any]) -> FloatArray:
    """Velocities and spins, shape (2, 3)."""
    nx, ny = DIRECTION
    second = VELOCITY - APPROACH * np.array([nx, ny]) + params["across"] * np.array([-ny, nx])
    return np.column_stack([np.array([VELOCITY, second]), SPIN])


def _overlap(params: Mapping[str, Any]) -> float:
    return APPROACH * math.sqrt(_effective(params) / params["kn"])


def _exact_rebound(params: Mapping[str, Any], setup: Setup, *, springs: bool) -> Impact:
    law = setup.scene.disk_disk
    return two_disk_impact(
        direction=DIRECTION, velocity=_approach_velocities(params), radius=RADIUS, mass=_mass(params), inertia=_inertia(params), mu=MU,
        restitution=params["restitution"], springs=Springs(law.kn, law.ks, law.beta) if springs else None,
    )  # fmt: skip


def _errors(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, impact: Impact) -> tuple[float, float, str]:
    """What the impulses towards and along the contact may be off by [N s], for a fixed direction, and why.

    As derived in ``impact/oblique`` for one disk on a plane.
    """
    m, law = _effective(params), setup.scene.disk_disk
    if engine.contact != "spring":
        s = contact_softness(engine)
        largest = float(np.abs(_approach_velocities(params)[:, :2]).max())
        floor = float(_mass(params).max()) * (
            ROUND_OFF * largest + 2.0 * single(engine, largest, setup.numerics.n_steps)
        )
        normal, along = impact.normal * s + floor, (abs(impact.shear) + MU * impact.normal) * s + floor
        why = "impulses of one step: round-off" + single_precision(engine) + soft_reason(engine)
        if follows_associated_rule(engine, setup.numerics):
            # A sliding contact opens by mu times its slip: that much more impulse, and friction with it.
            opened = m * MU * abs(_slip(params))
            normal, along = normal + opened, along + MU * opened
            why += "; the associated rule opens a sliding contact by mu times its slip"
        return normal, along, why
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    phase = math.sqrt(law.kn / m) * contact_dt
    swing = math.sqrt(_contact_mobility(params) * law.ks / m) * contact_dt
    slip = abs(_slip(params))
    normal = m * APPROACH * (restitution_of_beta(law.beta) * phase_error(phase, law.beta) + ROUND_OFF)
    slides = slip * law.ks > MU * APPROACH * law.kn and law.beta == 0.0
    along = MU * normal + m * ((0.0 if slides else swing) + swing**2) * slip / _contact_mobility(params)
    along += 2.0 * _overlap(params) / float(RADIUS.min()) * abs(impact.shear)
    why = f"phase of the impact in the contact step: omega dt = {phase:.3g}, beta = {law.beta:.4g}, Omega dt = {swing:.3g}"
    return normal, along, why


def _slip(params: Mapping[str, Any]) -> float:
    """Velocity of the first disk's surface along t, seen from the second's [m/s]."""
    return float(RADIUS @ SPIN) - float(params["across"])


def _impact_checks(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, source: str) -> list[Check]:
    impact = _exact_rebound(params, setup, springs=engine.contact == "spring")
    law, numerics, mass, inertia = setup.scene.disk_disk, setup.numerics, _mass(params), _inertia(params)
    normal, along, why = _errors(params, setup, engine, impact)
    first = _approach_velocities(params)
    lasts = contact_duration(kn=law.kn, m_eff=_effective(params), beta=law.beta) if engine.contact == "spring" else 0.0
    late = (2.0 * numerics.dt if engine.contact != "spring" else numerics.contact_dt or numerics.dt) + lasts
    speed = float(np.hypot(*(first[1, :2] - first[0, :2])))
    turn = speed * late / float(RADIUS.sum())
    # The line of centres turns: so do the impulses, and the approach and the slip that they are of.
    m, e = _effective(params), params["restitution"]
    normal += m * (1.0 + e) * speed * turn
    along += max(MU * m * (1.0 + e), m / _contact_mobility(params)) * speed * turn
    off = normal + along + turn * (abs(impact.normal) + abs(impact.shear))
    why = f"the line of centres turns by {turn:.2g} rad in what an impact may be late or early; {why}"
    atol = np.column_stack([off / mass, off / mass, RADIUS * along / inertia])
    scale = np.column_stack([impact.normal / mass, impact.normal / mass, RADIUS * abs(impact.normal) / inertia])
    common: dict[str, Any] = {"norm": "scalar", "truth": "analytic", "source": source}
    found = [
        Check(quantity=f"{name}_final", expected=float(impact.velocity.flat[k]), atol=float(atol.flat[k]), scale=float(scale.flat[k]),
              why=why, **common)
        for k, name in enumerate(NAMES)
    ]  # fmt: skip
    flown = numerics.n_steps * numerics.dt - FLIGHT
    for k in range(2):
        place = setup.scene.disks.x[k] + FLIGHT * first[k, :2] + flown * impact.velocity[k, :2]
        change = float(np.hypot(*(impact.velocity[k, :2] - first[k, :2])))
        path = float(atol[k, 0]) * flown + change * late + np.abs(first[k, :2]).max() * 2.0 * ROUND_OFF
        path += single(engine, float(np.abs(place).max()), numerics.n_steps)
        found += [
            Check(quantity=f"{axis}_{k + 1}_final", expected=float(place[c]), atol=path + contact_softness(engine) * change * flown,
                  scale=float(RADIUS[k]), why="flight before and after, the impact within two steps; " + why, **common)
            for c, axis in enumerate(("x", "y"))
        ]  # fmt: skip
    parting = float((impact.velocity[1, :2] - impact.velocity[0, :2]) @ np.array(DIRECTION))
    found.append(
        Check(quantity="restitution_effective", expected=parting / APPROACH,
              atol=float((atol[0, 0] + atol[1, 0]) / APPROACH), scale=1.0, why=why, **common)
    )  # fmt: skip
    return found


CASE = TwoDisks()
