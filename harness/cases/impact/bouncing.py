"""Disk dropped on a plane: it bounces lower and lower, and rests after a finite time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import CONTACT_DT, CONTACT_DYNAMICS, contact_step, last, numerics_of, whole_steps
from ninedisk.harness.cases.impact._bounce_truth import Truth, binding_truth, exact_curves, rest_level
from ninedisk.harness.cases.impact._impact import beta_for
from ninedisk.references.analytic.bouncing import landing_speed, zeno_time

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE, DAMPED_PHASE = 0.05, 0.02
"""Default resolution of the contact: ``omega dt <= PHASE`` and ``beta omega dt <= DAMPED_PHASE``."""

REST = 1.25
"""Default duration in units of the time by which a rigid disk rests."""


class BouncingDisk:
    """A disk falls from rest on a plane; no friction.

    Engines with springs are held to the bounces of their own spring and dashpot under the disk's weight, contacts of finite length
    included; rigid ones to the geometric series of Newton's law. Each flight is compared at its highest point, whose height and
    time follow from two samples to round-off, and as a curve.
    """

    id = "impact/bouncing-disk"
    version = 1
    title = "Bouncing disk"
    source = "geometric series of Newton's restitution; spring and dashpot under weight: equation of motion, solved in closed form"
    requirement = "flight k reaches e^(2k) h; with e < 1 the disk rests after sqrt(2 h/g) (1 + e)/(1 - e); with e = 1 it never does"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="restitution", default=0.5, low=0.0, high=1.0, unit="-", in_id=True,
                  help="coefficient of restitution; beta and theta follow from it"),
        Parameter(name="height", default=0.45, low=0.0, low_open=True, unit="m", help="gap from which the disk is dropped"),
        Parameter(name="g", default=10.0, low=0.0, low_open=True, unit="m/s^2", help="gravity"),
        Parameter(name="dt", default=2e-3, low=0.0, low_open=True, unit="s", help="step; sampling of spring engines"),
        Parameter(name="bounces", default=3, low=1, high=12, whole=True, help="flights after the fall that are compared, at most"),
        Parameter(name="kn", default=1e6, low=0.0, low_open=True, unit="N/m",
                  help="stiffness of spring engines: 1e6 makes a contact of 6 ms"),
        CONTACT_DT,
        Parameter(name="duration", default=None, optional=True, low=0.0, low_open=True, unit="s",
                  help="length of the run; none: until it rests and a quarter more; for e > 0.9 the bounces that are compared"),
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Half the speed kept, all of it, none of it; Newton's law in contact dynamics."""
        return (
            {"restitution": 0.5},
            {"restitution": 1.0},
            {"restitution": 0.0},
            {"restitution": 0.5, "impact": "newton"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk above a horizontal plane."""
        kn, g, e = params["kn"], params["g"], params["restitution"]
        beta, omega = beta_for(e), math.sqrt(kn / MASS)
        speed = landing_speed(height=params["height"], g=g)
        if speed / omega + 2.0 * g / omega**2 >= RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane by its radius; "
                f"use kn > {4.0 * MASS * max(speed / RADIUS, math.sqrt(g / RADIUS)) ** 2:.2g}"
            )
        law = ContactLaw(kn=kn, beta=beta, restitution=e, regularised=True)
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS + params["height"]]]), radius=np.array([RADIUS]), mass=np.array([MASS])
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(0.0, -g),
        )
        dt = params["dt"]
        target = min(PHASE, DAMPED_PHASE / beta if beta > 0.0 else math.inf) / omega
        fall = speed / g
        if e <= 0.9:
            length = REST * max(zeno_time(height=params["height"], g=g, restitution=e), 2.0 * fall)
        else:
            length = fall * (1.0 + sum(2.0 * e**k for k in range(1, params["bounces"] + 1)))
            length += params["bounces"] * 2.0 * math.pi / omega
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, length, at_least=fall, event="the fall"),
            contact_dt=contact_step(dt, target),
            theta=1.0 / (1.0 + e),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Gap, velocity and energy; height and time of each flight's highest point; when the disk is at rest for good.

        The highest point lies between samples whose velocities have different signs: from the first of them the parabola of free
        flight gives both numbers.
        """
        g, mass = params["g"], float(setup.scene.disks.mass[0])
        gap, vy = history.gap[:, 0], history.v[:, 0, 1]
        series = {
            "gap": ("m", gap),
            "vy": ("m/s", vy),
            "energy": ("J", mass * (0.5 * (history.v[:, 0] ** 2).sum(axis=1) + g * gap)),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        tops = np.flatnonzero((vy[1:-1] > 0.0) & (vy[2:] <= 0.0)) + 1
        for k in range(1, params["bounces"] + 1):
            found = k <= len(tops)
            i = int(tops[k - 1]) if found else 0
            scalars[f"apex_{k}"] = ("m", float(gap[i] + vy[i] ** 2 / (2.0 * g)) if found else math.nan)
            scalars[f"apex_time_{k}"] = ("s", float(history.t[i] + vy[i] / g) if found else math.nan)
        # Written so that a NaN counts as motion.
        moving = np.flatnonzero(~(gap <= rest_level(params)))
        rests = len(moving) > 0 and moving[-1] + 1 < len(gap)
        scalars["rest_time"] = ("s", float(history.t[moving[-1] + 1]) if rests else math.nan)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps for contact dynamics; flights, highest points and rest for all whose impact law is that of the scene."""
        found: list[Check] = []
        if engine.scheme == "theta":
            found += _stepped(params, setup, observed)
            if setup.numerics.impact != "newton" and params["restitution"] != 0.0:
                return found
        return [*found, *_flights(binding_truth(params, setup, observed, engine))]


def _flights(truth: Truth) -> list[Check]:
    common: dict[str, Any] = {"truth": "analytic", "source": truth.source, "why": truth.why}
    curves = [
        Check(quantity=name, norm="max", expected=curve, atol=truth.atol[name], **common)
        for name, curve in truth.curves.items()
    ]
    numbers = [
        Check(quantity=name, norm="scalar", expected=value, atol=truth.atol[name], **common)
        for name, value in truth.scalars.items()
    ]
    return [*curves, *numbers]


def _stepped(params: Mapping[str, Any], setup: Setup, observed: Observed) -> list[Check]:
    exact, numerics = exact_curves(params, setup, observed), setup.numerics
    source = f"theta scheme, theta = {numerics.theta:g}, impact {numerics.impact}: every step"
    why = "exact solution of this very scheme: round-off, which the phase of each impact in its step makes grow"
    return [
        Check(
            quantity=name, norm="max", truth="exact-step", expected=curve, source=source, atol=exact.atol[name], why=why
        )
        for name, curve in exact.curves.items()
    ]


CASE = BouncingDisk()
