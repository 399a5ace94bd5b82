"""Impact on a contact with linear cohesion: rebound, duration, or capture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import phase_error
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.cohesion import cohesive_contact, cohesive_rebound, is_captured

RADIUS, MASS, HEAVY, SPEED = 0.5, 1.0, 3.0, 2.0
"""Of the disk that flies [m], [kg], mass of the other one [kg], speed of approach [m/s]."""

KN = 1e6
"""Stiffness [N/m]."""

PAIR = (0, 1)
PHASE = 0.001
"""Resolution of the contact, omega dt: a dashpot of ratio 0.3 is off by 0.06 % of it at entry and at exit."""

HALF_RESTITUTION = 0.2155
"""Damping ratio of restitution 1/2 where nothing attracts and the dashpot may pull: ln 2 over the root of pi^2 + ln^2 2, 0.21545."""


class Cohesion:
    """A disk hits a wall, or a heavier disk; both touch at time 0, so that the contact begins with a step."""

    id = "impact/cohesion"
    version = 2
    title = "Impact with linear cohesion"
    source = "damped linear oscillator of the stiffness kn - c: restitution exp(-pi z/s), duration pi/(s omega), z = beta/sqrt(1 - c/kn)"
    requirement = (
        "cohesion c beside kn leaves a softer and more damped contact; from beta = sqrt(1 - c/kn) on nothing rebounds"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="partner", default="wall", choices=("wall", "disk"), in_id=True, help="what the disk hits"),
        Parameter.positive("share", 0.5, high=0.95, unit="-", in_id=True, help="cohesion over kn"),
        Parameter(name="beta", default=0.0, low=0.0, high=2.0, unit="-", in_id=True, help="contact damping ratio"),
        Parameter.positive("phase", PHASE, high=0.1, unit="-", help="resolution omega dt"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Contact with cohesion",
            quantities=(
                Plotted("overlap", "overlap"),
                Plotted("fn", "normal force"),
                Plotted("rate", "rate of the overlap"),
            ),
            compare="beta",
            shows="One impact on a spring of which cohesion takes back a part, with dashpots.",
            allows="The contact lasts longer by 1/sqrt(1 - c/kn) and pulls before it ends; a strong dashpot holds what it has caught.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Without a dashpot, with the one of restitution 1/2, which cohesion makes 0.366, and with one that captures."""
        return [
            {"beta": 0.0},
            {"beta": 0.0, "share": 0.9},
            {"beta": HALF_RESTITUTION},
            {"beta": HALF_RESTITUTION, "partner": "disk"},
            {"beta": 0.8},
        ]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Along x; the springs are what the case is about."""
        law = ContactLaw(kn=KN, beta=params["beta"], cohesion=params["share"] * KN)
        wall = params["partner"] == "wall"
        n = 1 if wall else 2
        disks = Disks(
            x=np.array([[RADIUS, 0.0], [-RADIUS, 0.0]][:n]),
            v=np.array([[-SPEED, 0.0], [0.0, 0.0]][:n]),
            radius=np.full(n, RADIUS),
            mass=np.array([MASS, HEAVY][:n]),
        )
        walls = (Wall(name="wall", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),) if wall else ()
        dt = params["phase"] / math.sqrt(KN / _mass(params))
        numerics = Numerics(dt=dt, n_steps=math.ceil(_duration(params) / dt), contact_dt=dt, damping_form="lagged")
        return Setup(
            scene=Scene(disks=disks, disk_disk=law, walls=walls),
            numerics=numerics,
            watch=(PAIR,),
            labels={"contact": PAIR},
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Overlap, its rate and the force; when the overlap ends, between samples where it changes its sign."""
        apart = history.v[:, 0, 0] - (history.v[:, 1, 0] if params["partner"] == "disk" else 0.0)
        gap = history.gap[:, 0]
        series = {
            "overlap": ("m", -gap),
            "rate": ("m/s", -apart),
            "fn": ("N", history.fn[:, 0]),
        }
        scalars = {"deepest": ("m", float(np.max(-gap))), "rate_final": ("m/s", float(-apart[-1]))}
        if not is_captured(**_law(params)):
            open_ = np.flatnonzero((gap[1:] > 0.0) & (gap[:-1] <= 0.0) & (history.t[1:] > 2.0 * setup.numerics.dt))
            k = int(open_[-1]) if len(open_) else -1
            ends = (
                history.t[k] - gap[k] * (history.t[k + 1] - history.t[k]) / (gap[k + 1] - gap[k])
                if len(open_)
                else math.nan
            )
            scalars |= {"duration": ("s", float(ends)), "restitution": ("1", float(apart[-1] / SPEED))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The speed after the impact, 0 or nearly so where the disk is caught, and the overlap all the while."""
        truth = _truth(params, observed.t)
        return (
            Headline(name="speed after a cohesive impact", use="impacts", quantity="rate_final", expected=float(truth.rate[-1]),
                     source=self.source, scale=SPEED, scale_is="speed of approach"),
            Headline(name="overlap in a cohesive impact", use="impacts", quantity="overlap", expected=truth.overlap, source=self.source,
                     scale=float(np.abs(truth.overlap).max()), scale_is="largest overlap"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """The oscillator, less what a step's entry and exit are late.

        Central differences of an undamped oscillator are off by ``phase^2/8`` in velocity and by ``omega t phase^2/24`` in phase. A
        dashpot's force begins a step late, or ends so, and sees the velocity of half a step before: `phase_error` for entry and exit. An
        implicit scheme damps the swing by ``(theta - 1/2) omega h`` in a radian, omega h at most with what its first order adds.
        """
        step, share, t = setup.numerics.contact_dt or setup.numerics.dt, params["share"], observed.t
        omega, z = math.sqrt(KN * (1.0 - share) / _mass(params)), params["beta"] / math.sqrt(1.0 - share)
        part = phase_error(omega * step, z, 2.0) + omega * float(t[-1]) * (omega * step) ** 2 / 24.0
        if engine.contact != "spring":
            part += omega * float(t[-1]) * omega * step
        speed = (part + 1e-12) * SPEED
        truth = _truth(params, t)
        overlap = speed / omega
        force = KN * (1.0 - share) * overlap + 2.0 * params["beta"] * math.sqrt(_mass(params) * KN) * (
            speed + SPEED * omega * step
        )
        common: dict[str, Any] = {
            "truth": "analytic", "source": self.source,
            "why": f"omega dt = {omega * step:.2g}, damping ratio {z:.2g}: first order of a dashpot's entry and exit, else second",
        }  # fmt: skip
        # A force that begins or ends at once is not sampled within a step of that.
        edge = t < 1.5 * step
        found = [
            Check(quantity="overlap", norm="max", expected=truth.overlap, atol=overlap, scale=SPEED / omega, **common),
            Check(quantity="rate", norm="max", expected=truth.rate, atol=speed + SPEED * 2.0 * z * omega * step, scale=SPEED, **common),
        ]  # fmt: skip
        if is_captured(**_law(params)):
            return [
                *found,
                Check(quantity="fn", norm="max", expected=np.where(edge, np.nan, truth.fn), atol=force, scale=KN * SPEED / omega, **common),
            ]  # fmt: skip
        rebound = _rebound(params)
        edge |= np.abs(t - rebound.duration) < 1.5 * step
        return [
            *found,
            Check(quantity="fn", norm="max", expected=np.where(edge, np.nan, truth.fn), atol=force, scale=KN * SPEED / omega, **common),
            Check(quantity="restitution", norm="scalar", expected=rebound.restitution, atol=part, **common),
            Check(quantity="duration", norm="scalar", expected=rebound.duration, atol=rebound.duration * part + step, **common),
            Check(quantity="deepest", norm="scalar", expected=rebound.deepest, atol=overlap, **common),
        ]  # fmt: skip


def _mass(params: Mapping[str, Any]) -> float:
    return MASS if params["partner"] == "wall" else MASS * HEAVY / (MASS + HEAVY)


def _law(params: Mapping[str, Any]) -> dict[str, float]:
    return {"kn": KN, "cohesion": params["share"] * KN, "beta": params["beta"]}


def _rebound(params: Mapping[str, Any]) -> Any:
    return cohesive_rebound(**_law(params), m_eff=_mass(params), speed=SPEED)


def _truth(params: Mapping[str, Any], t: np.ndarray[Any, Any]) -> Any:
    return cohesive_contact(t, **_law(params), m_eff=_mass(params), speed=SPEED)


def _duration(params: Mapping[str, Any]) -> float:
    """End of the run [s]: a fifth after the rebound, or two periods."""
    if is_captured(**_law(params)):
        return 4.0 * math.pi / math.sqrt(KN * (1.0 - params["share"]) / _mass(params))
    return float(1.2 * _rebound(params).duration)


CASE = Cohesion()
