"""A disk that hits another one whose motion is prescribed: one that stays where it is, or one that moves whatever it meets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    around_contact,
    contact_softness,
    contact_step,
    numerics_of,
    phase_error,
    single,
    single_precision,
    soft_reason,
)
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.references.analytic.impact.prescribed_partner import Struck, rebound_from_held_disk
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration

RADIUS, MASS = 0.5, 1.0
PLACE, SPEED, RESTITUTION = (-0.95, 0.5), 1.0, 0.5
"""Where the free disk starts [m], seen from the held one: it hits at 30 degrees. Speed of approach [m/s], restitution."""

PAIR = (0, 1)
PHASE = 0.05
"""Resolution of a spring contact, omega dt."""

AFTER = 0.04
"""Time after the impact [s]."""


class HeldDisk:
    """``partner=fixed``: a flying disk hits one that stays; ``partner=held``: one that is driven hits a disk at rest.

    Seen from the disk whose motion is prescribed both are the same impact, off the centre and smooth.
    """

    id = "impact/held-disk"
    version = 2
    title = "Impact on a disk whose motion is prescribed"
    beside_headlines = (
        ("partner_*", "an engine may place the impact up to a step early or late: places after it have no one truth"),
    )
    source = "Newton's restitution along the line of centres, for a partner that takes any momentum"
    requirement = "the free disk loses 1 + e of its approach along the line of centres; the other one keeps its motion"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="partner", default="fixed", choices=("fixed", "held"), in_id=True, help="fixed, or held at a velocity"),
        Parameter.positive("dt", 1e-4, high=1e-2, unit="s", help="step; sampling of spring engines"),
        Parameter(name="kn", default=1e8, low=1e6, unit="N/m", help="stiffness of spring engines"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both partners."""
        return [{"partner": "fixed"}, {"partner": "held"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The free disk is the first."""
        kn, dt, frame = params["kn"], params["dt"], _frame(params)
        beta = beta_for(RESTITUTION)
        law = ContactLaw(kn=kn, beta=beta, restitution=RESTITUTION, regularised=True)
        disks = Disks(
            x=np.array([PLACE, (0.0, 0.0)]),
            v=np.array([(SPEED - frame, 0.0), (-frame, 0.0)]),
            radius=np.full(2, RADIUS),
            mass=np.full(2, MASS),
            rotating=np.array([True, False]),
            held=np.array([[False, False], [True, True]]),
        )
        numerics = numerics_of(
            params,
            n_steps=math.ceil((_struck_partner().time + AFTER) / dt),
            contact_dt=contact_step(dt, PHASE / (math.sqrt(kn / MASS) * max(1.0, beta))),
        )
        return Setup(
            scene=Scene(disks=disks, disk_disk=law), numerics=numerics, watch=(PAIR,), labels={"contact": PAIR}
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Velocity of the free disk, and the displacement of both."""
        path = history.x - setup.scene.disks.x
        series = {
            "vx": ("m/s", history.v[:, 0, 0]),
            "vy": ("m/s", history.v[:, 0, 1]),
            "x": ("m", path[:, 0, 0]),
            "y": ("m", path[:, 0, 1]),
            "partner_x": ("m", path[:, 1, 0]),
            "partner_y": ("m", path[:, 1, 1]),
            "partner_vx": ("m/s", history.v[:, 1, 0]),
        }
        scalars = {f"{name}_final": ("m/s", float(series[name][1][-1])) for name in ("vx", "vy")}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the impact turns the disk aside."""
        return (
            Headline(name="transverse velocity after hitting a held disk", use="impacts", quantity="vy_final",
                     expected=_struck_partner().velocity[1], source=self.source, scale=SPEED, scale_is="speed of approach"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """An impact somewhere in a step: the line of centres is that of some time within two steps."""
        struck, numerics, law, t = _struck_partner(), setup.numerics, setup.scene.disk_disk, observed.t
        lasts = contact_duration(kn=law.kn, m_eff=MASS, beta=law.beta)
        turn = SPEED * (2.0 * numerics.dt + lasts * (engine.contact == "spring")) / RADIUS
        error, why = impact_error(engine, setup, law, MASS, struck.approach, RESTITUTION)
        # The impulse turns with the line of centres, and the approach that it is of does.
        off = error + 2.0 * (1.0 + RESTITUTION) * SPEED * turn
        why = f"the line of centres turns by {turn:.2g} rad in what an impact may be late or early; {why}"
        frame = np.array([_frame(params), 0.0])
        first, then = np.array([SPEED, 0.0]) - frame, np.array(struck.velocity) - frame
        event = around_contact(t, struck.time, lasts, numerics.dt)
        found: list[Check] = []
        common: dict[str, Any] = {"truth": "analytic", "source": self.source, "why": why}
        for k, name in enumerate(("x", "y")):
            v = np.where(event, np.nan, np.where(t < struck.time, first[k], then[k]))
            path = first[k] * np.minimum(t, struck.time) + then[k] * np.maximum(t - struck.time, 0.0)
            found += [
                Check(quantity=f"v{name}", norm="max", expected=v, atol=off, **common),
                Check(quantity=f"v{name}_final", norm="scalar", expected=float(then[k]), atol=off, **common),
                Check(quantity=name, norm="max", expected=path, atol=2.0 * SPEED * numerics.dt + off * (AFTER + numerics.dt), **common),
            ]  # fmt: skip
        rough = 1e-12 + single(engine, 1.0, numerics.n_steps)
        prescribed: dict[str, Any] = {
            "norm": "max", "truth": "analytic", "source": "prescribed motion", "atol": rough, "scale": SPEED,
            "why": "round-off" + single_precision(engine),
        }  # fmt: skip
        return [
            *found,
            Check(quantity="partner_x", expected=-frame[0] * t, **prescribed),
            Check(quantity="partner_y", expected=0.0, **prescribed),
            Check(quantity="partner_vx", expected=float(-frame[0]), **prescribed),
        ]


def impact_error(
    engine: EngineInfo, setup: Setup, law: ContactLaw, mass: float, approach: float, restitution: float
) -> tuple[float, str]:
    """Error of the velocity [m/s] after an impact on a body of any mass, beside what its direction is off by; and why."""
    if engine.contact == "spring":
        phase = math.sqrt(law.kn / mass) * (setup.numerics.contact_dt or setup.numerics.dt)
        error = (restitution * phase_error(phase, law.beta) + 1e-12) * approach
        return error, f"phase of the impact in the contact step: omega dt = {phase:.3g}, beta = {law.beta:.3g}"
    error = (1.0 + restitution) * approach * contact_softness(engine) + 2.0 * single(
        engine, approach, setup.numerics.n_steps
    )
    return error + 1e-12 * approach, "impulse of one step" + soft_reason(engine) + single_precision(engine)


def _frame(params: Mapping[str, Any]) -> float:
    """Velocity [m/s] along x of the observer who sees the held disk at rest hit at `SPEED`, less that of the scene."""
    return SPEED if params["partner"] == "held" else 0.0


def _struck_partner() -> Struck:
    return rebound_from_held_disk(place=PLACE, speed=SPEED, reach=2.0 * RADIUS, restitution=RESTITUTION)


CASE = HeldDisk()
