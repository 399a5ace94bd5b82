"""Disk thrown with slip on a plane: it slides, then rolls (appendix A.3.3 with rotations)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    THETA,
    contact_step,
    last,
    numerics_of,
    series_and_final,
    single,
    whole_steps,
)
from ninedisk.harness.cases.rolling._slip_bounds import (
    NO_TURN,
    binding_history,
    bounds,
    shear_frequency,
    slip_tolerance,
    truth,
)
from ninedisk.references.analytic.slip_to_roll import UNIFORM_DISK

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: ``omega dt <= PHASE``, omega the higher of the normal and the shear frequency."""

CONTACT_BETA = 1.0
"""The plane's dashpot is critical: a landing (``start=dilated``) does not bounce for long."""

RUN = 3.0
"""Default duration in units of v0/(mu g), the time in which a disk that cannot turn stops; a rolling disk
rolls from a third of it on."""


class SlipToRoll:
    """A disk with forward velocity and no spin on a plane, under gravity."""

    id = "slip-to-roll"
    version = 1
    title = "Slip to roll"
    source = "appendix A.3.3 of Lim's thesis (rotations); classical rigid-body mechanics"
    requirement = "slides until v0/(3 mu g), then rolls at 2 v0/3; without rotation stops at v0/(mu g)"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.3, low=0.0, low_open=True, unit="-", in_id=True, help="friction coefficient"),
        Parameter(
            name="dt",
            default=0.01,
            low=0.0,
            low_open=True,
            unit="s",
            in_id=True,
            help="step; sampling of spring engines",
        ),
        Parameter(name="speed", default=1.0, low=0.0, low_open=True, unit="m/s", help="initial velocity"),
        Parameter(name="g", default=10.0, low=0.0, low_open=True, unit="m/s^2", help="gravity"),
        Parameter(name="rotating", default=True, help="false: the disk cannot turn"),
        Parameter(
            name="start",
            default="touching",
            choices=("touching", "dilated"),
            help="gap at time 0: none, or mu v0 dt, at which the associated rule (theta = 1) slides from the start",
        ),
        Parameter(
            name="kn", default=1e8, low=0.0, low_open=True, unit="N/m", help="normal stiffness of spring engines"
        ),
        Parameter(
            name="ks",
            default=None,
            optional=True,
            low=0.0,
            low_open=True,
            unit="N/m",
            help="shear stiffness of spring engines; none: kn",
        ),
        CONTACT_DT,
        Parameter(
            name="duration",
            default=None,
            optional=True,
            low=0.0,
            low_open=True,
            unit="s",
            help="length of the run; none: 3 v0/(mu g), and 4 times the fall from a dilated start",
        ),
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Three steps, Coulomb's law, a disk that cannot turn, and soft springs."""
        rows: list[Mapping[str, Value]] = [{"mu": 0.3, "dt": dt} for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": 0.3, "dt": 0.01, "rotating": rotating, "sliding": "coulomb"} for rotating in (True, False)]
        return [*rows, {"mu": 0.3, "dt": 0.01, "rotating": False}, {"mu": 0.3, "dt": 0.01, "kn": 1e6}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane; springs start with the weight's overlap and with full sliding friction."""
        mu, g, kn, rotating = params["mu"], params["g"], params["kn"], params["rotating"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        touching = params["start"] == "touching"
        lift = 0.0 if touching else mu * params["speed"] * params["dt"]
        height = RADIUS - MASS * g / kn if touching else RADIUS + lift
        if height <= 0.0:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane "
                f"by its weight; use kn > {MASS * g / RADIUS:g}"
            )
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, height]]),
                v=np.array([[params["speed"], 0.0]]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
                rotating=np.array([rotating]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(0.0, -g),
            initial_shear={PAIR: -mu * MASS * g} if touching else {},
        )
        fastest = max(math.sqrt(kn / MASS), shear_frequency(ks, MASS, inertia_ratio(params)))
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, RUN * params["speed"] / (mu * g) + 4.0 * math.sqrt(2.0 * lift / g)),
            contact_dt=contact_step(params["dt"], PHASE / fastest),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Motion, spin (positive when rolling forward) and slip; ``slip_end`` is the first sample of lasting rolling.

        Slip counts as ended within `slip_tolerance`, which allows for the swing that a shear spring of the scene's
        stiffness leaves. NaN where the slip never ends.
        """
        vx, spin = history.v[:, 0, 0], 0.0 - history.omega[:, 0]
        slip = vx - RADIUS * spin
        series = {
            "x": ("m", history.x[:, 0, 0] - setup.scene.disks.x[0, 0]),
            "vx": ("m/s", vx),
            "spin": ("rad/s", spin),
            "slip": ("m/s", slip),
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        # Written so that a NaN counts as slip.
        slips = np.flatnonzero(~(np.abs(slip) <= slip_tolerance(params, setup, inertia_ratio(params))))
        first = int(slips[-1]) + 1 if len(slips) else 0
        scalars["slip_end"] = ("s", float(history.t[first]) if first < len(history.t) else math.nan)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """History, end of slip and rolling speed; a start above the plane binds contact dynamics alone."""
        ratio = inertia_ratio(params)
        limit = bounds(params, setup, observed, engine, ratio)
        analytic = truth(params, observed.t, RADIUS, ratio)
        names = ("x", "vx", "spin", "slip", "gap")
        source = "rigid disk with Coulomb friction"
        tolerance = {name: (limit.atol[name], 0.0, limit.why[name]) for name in names}
        expected = {**analytic.curves, "gap": np.full_like(observed.t, limit.rest_gap)}
        found = series_and_final(names, expected, truth="analytic", source=source, tolerance=tolerance)
        found.append(
            Check(quantity="slip_end", norm="scalar", truth="analytic", expected=analytic.slip_end, source=source,
                  atol=limit.atol["slip_end"], why=limit.why["slip_end"]),
        )  # fmt: skip
        if params["start"] == "dilated" and engine.contact != "cd":
            # The flight down to the plane is no part of the closed form; the rolling speed does not depend on it.
            return [check for check in found if check.quantity in ("vx_final", "spin_final", "slip_final")]
        exact = binding_history(params, setup, observed, engine, RADIUS, ratio)
        if exact is None:
            return found
        source = f"{engine.scheme}: sum of the exact velocities"
        why = "velocities at the steps are the rigid disk's own, positions their sum: round-off"
        if "gap" in exact.curves:
            source = f"{engine.scheme}, associated rule: (A.6) in every step"
            why = "exact solution of this very scheme: round-off of the steps and of the solver"
        t_end = float(observed.t[-1])
        # Velocities are round-off of the larger of what the disk has and of what gravity and the plane exchange in the run.
        rough = single(engine, max(params["speed"], params["g"] * t_end), setup.numerics.n_steps)
        if rough:
            why += " in single precision"
        floor = {
            "x": 1e-12 * params["speed"] * t_end + rough * t_end,
            "vx": rough,
            "spin": rough / (ratio * RADIUS),
            "gap": 1e-12 * RADIUS,
            "slip": 1e-11 * params["speed"],
        }
        stepped = series_and_final(
            tuple(exact.curves),
            exact.curves,
            truth="exact-step",
            source=source,
            tolerance={name: (floor.get(name, 0.0), EXACT_STEP_RTOL, why) for name in exact.curves},
        )
        return [*stepped, *found]


def inertia_ratio(params: Mapping[str, Any]) -> float:
    """``I/(m R^2)``; `NO_TURN` for a disk that cannot turn."""
    return UNIFORM_DISK if params["rotating"] else NO_TURN


CASE = SlipToRoll()
