"""Head-on collision of two equal disks, elastic or plastic (appendix A.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    contact_step,
    last,
    numerics_of,
    single,
    whole_steps,
)
from ninedisk.harness.cases.impact._impact import impact_checks, knobs
from ninedisk.references.analytic.spring_dashpot import contact_duration

RADIUS = 1.0
PAIR = (0, 1)

PHASE, DAMPED_PHASE = 0.02, 0.05
"""Default resolution of the contact: ``omega dt <= PHASE`` and ``beta omega dt <= DAMPED_PHASE``."""


class BinaryCollision:
    """Disk 1 hits disk 2, which rests; no gravity, no friction.

    ``energy`` is kinetic only: while the disks touch, a spring engine holds the rest in the spring. Histories are
    therefore compared before and after the contact, and not within the step in which a rigid engine may place it.
    """

    id = "binary-collision"
    version = 1
    title = "Binary collision of two disks"
    source = "appendix A.2 of Lim's thesis, figures A.6-A.13"
    requirement = (
        "momentum always conserved; energy after an elastic impact; velocities (0, 1) elastic, (1/2, 1/2) plastic"
    )
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
        Parameter(name="dt", default=0.01, low=0.0, low_open=True, unit="s", help="step; sampling of spring engines"),
        Parameter(name="speed", default=1.0, low=0.0, low_open=True, unit="m/s", help="initial velocity of disk 1"),
        Parameter(name="mass", default=math.pi, low=0.0, low_open=True, unit="kg", help="mass of each disk"),
        Parameter(
            name="kn",
            default=1e6,
            low=0.0,
            low_open=True,
            unit="N/m",
            help="stiffness of spring engines; 1e6 makes a contact of 4 ms",
        ),
        CONTACT_DT,
        Parameter(
            name="duration",
            default=None,
            optional=True,
            low=0.0,
            low_open=True,
            unit="s",
            help="length of the run; none: twice the time of flight and at least 50 steps after the contact",
        ),
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The source's two, a restitution between, a soft spring, an impact within a step, and Newton's law."""
        return (
            {"kind": "elastic"},
            {"kind": "plastic"},
            {"kind": "elastic", "restitution": 0.5},
            {"kind": "elastic", "kn": 1e4},
            {"kind": "elastic", "gap": 0.5025},
            {"kind": "elastic", "restitution": 0.5, "impact": "newton"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Two disks on the x axis."""
        told, m_eff = knobs(params), params["mass"] / 2.0
        law = ContactLaw(kn=params["kn"], beta=told.beta, restitution=told.restitution, regularised=True)
        disks = Disks(
            x=np.array([[0.0, 0.0], [2.0 * RADIUS + params["gap"], 0.0]]),
            v=np.array([[params["speed"], 0.0], [0.0, 0.0]]),
            radius=np.full(2, RADIUS),
            mass=np.full(2, params["mass"]),
        )
        flight, dt = params["gap"] / params["speed"], params["dt"]
        contact = contact_duration(kn=params["kn"], m_eff=m_eff, beta=told.beta)
        end = flight + contact + 2.0 * dt
        omega = math.sqrt(params["kn"] / m_eff)
        target = min(PHASE, DAMPED_PHASE / told.beta if told.beta > 0.0 else math.inf) / omega
        numerics = numerics_of(
            params,
            n_steps=whole_steps(
                params,
                max(2.0 * flight, end + 48.0 * dt),
                at_least=end + dt,
                event="the collision, spread over its steps,",
            ),
            contact_dt=contact_step(dt, target),
            theta=told.theta,
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
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

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
                  atol=1e-13 * params["speed"] + of_speed)
            for i in (1, 2)
        ]  # fmt: skip
        return [
            *impact_checks(params, setup, observed, engine),
            Check(quantity="momentum_x", norm="max", truth="analytic", expected=momentum, source="conservation",
                  why=conserved, rtol=1e-13, atol=of_momentum),
            Check(quantity="momentum_x_final", norm="scalar", truth="analytic", expected=momentum,
                  source="conservation", why=conserved, rtol=1e-13, atol=of_momentum),
            Check(quantity="momentum_drift", norm="scalar", truth="analytic", expected=0.0, source="conservation",
                  why=conserved, atol=1e-13 * momentum + of_momentum),
            *still,
        ]  # fmt: skip


CASE = BinaryCollision()
