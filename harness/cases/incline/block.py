"""Block on an incline, sliding or sticking (appendix A.3.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    THETA,
    contact_step,
    follows_associated_rule,
    last,
    numerics_of,
    series_and_final,
    whole_steps,
)
from ninedisk.harness.cases.incline._incline_bounds import NAMES, Bounds, chatters, first_order_bounds, spring_bounds
from ninedisk.harness.cases.incline._incline_steps import exact_step_checks
from ninedisk.references.analytic.incline import critical_mu, incline

RADIUS = 0.5
PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: ``omega dt <= PHASE``; nothing but the start without preload depends on it."""

CONTACT_BETA = 1.0
"""The plane's dashpot is critical: without preload the block settles on the plane instead of bouncing for ever."""


class InclineBlock:
    """A disk that cannot turn, touching a plane under tilted gravity: x runs down the incline, y is its normal."""

    id = "incline-block"
    version = 1
    title = "Block on an incline"
    source = "appendix A.3.4 of Lim's thesis, (A.7), figures A.17-A.26"
    requirement = "mu = 0.36 slides with a = g (sin - mu cos), mu = 0.4 stays; fn = m g cos; dilation shrinks with dt"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.36, low=0.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter(
            name="dt",
            default=0.01,
            low=0.0,
            low_open=True,
            unit="s",
            in_id=True,
            help="step; sampling of spring engines",
        ),
        Parameter(
            name="angle_deg", default=20.0, low=0.0, low_open=True, high=89.0, unit="deg", help="slope of the incline"
        ),
        Parameter(name="duration", default=1.0, low=0.0, low_open=True, unit="s", help="length of the run"),
        Parameter(
            name="preload",
            default=True,
            help="spring engines start with the overlap and the shear force of equilibrium; "
            "rigid ones start touching anyway",
        ),
        Parameter(name="g", default=10.0, low=0.0, low_open=True, unit="m/s^2", help="gravity"),
        Parameter(name="mass", default=7.854, low=0.0, low_open=True, unit="kg", help="mass of the block"),
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
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The source's two coefficients and three steps; springs without preload, stiff and soft."""
        rows: list[Mapping[str, Value]] = [{"mu": mu, "dt": dt} for mu in (0.36, 0.4) for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": mu, "dt": 0.01, "preload": False} for mu in (0.36, 0.4)]
        rows += [{"mu": 0.36, "dt": dt, "sliding": "coulomb"} for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": 0.4, "dt": 0.01, "sliding": "coulomb"}]
        return [*rows, {"mu": 0.4, "dt": 0.01, "preload": False, "kn": 1e6}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane, gravity tilted."""
        angle = math.radians(params["angle_deg"])
        kn, mu, mass, g = params["kn"], params["mu"], params["mass"], params["g"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        normal, shear = mass * g * math.cos(angle), mass * g * math.sin(angle)
        overlap = normal / kn if params["preload"] else 0.0
        # The disk is body i and the plane's normal is +y, hence t = +x: friction up the incline is fs < 0.
        start = {PAIR: -min(mu * normal, shear)} if params["preload"] and mu > 0.0 else {}
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS - overlap]]),
                radius=np.array([RADIUS]),
                mass=np.array([mass]),
                rotating=np.array([False]),
            ),
            disk_disk=law,
            walls=(Wall(name="incline", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(g * math.sin(angle), -g * math.cos(angle)),
            initial_shear=start,
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(max(kn, ks) / mass)),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Displacement, velocity, gap and contact forces; ``fs`` is positive up the incline.

        ``fn_mean`` and ``fs_mean`` are means over the second half of the run, and ``mu_crit`` the friction that would hold the
        block, from what the engine reports there: ``(fs + m dvx/dt)/fn``. ``dilation`` is the final rise of the gap over
        ``mu v dt``: 1 under the associated rule, 0 under Coulomb's. ``dilation_peak`` is the largest gap of that half over ``mu v
        dt``, v the velocity at the begin of the step. ``creep_rate`` is the mean velocity over that half, observed only where the
        block should stick.
        """
        x = history.x[:, 0, 0] - setup.scene.disks.x[0, 0]
        fn, fs = history.fn[:, 0], -history.fs[:, 0]
        series = {
            "x": ("m", x),
            "vx": ("m/s", history.v[:, 0, 0]),
            "gap": ("m", history.gap[:, 0]),
            "fn": ("N", fn),
            "fs": ("N", fs),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        half = _half(history.t)
        elapsed = history.t[-1] - history.t[half]
        vx = series["vx"][1]
        inertial = params["mass"] * (vx[-1] - vx[half]) / elapsed
        scalars |= {
            "fn_mean": ("N", float(fn[half + 1 :].mean())),
            "fs_mean": ("N", float(fs[half + 1 :].mean())),
        }
        with np.errstate(divide="ignore", invalid="ignore"):  # an engine that loses the contact reports fn = 0
            held = np.float64(scalars["fs_mean"][1] + inertial) / scalars["fn_mean"][1]
        scalars["mu_crit"] = ("1", float(held))
        if not sticks(params):
            lift = series["gap"][1][-1] - series["gap"][1][0]
            with np.errstate(divide="ignore", invalid="ignore"):
                scalars["dilation"] = (
                    "1",
                    float(lift / (params["mu"] * vx[-1] * params["dt"])) if params["mu"] else 0.0,
                )
                lifts = series["gap"][1][half + 1 :] / (params["mu"] * vx[half:-1] * params["dt"])
            scalars["dilation_peak"] = ("1", float(lifts.max()) if params["mu"] else 0.0)
        else:
            scalars["creep_rate"] = ("m/s", float((x[-1] - x[half]) / elapsed))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of the engine's scheme where there are any, and the continuous solution for all."""
        exact = exact_step_checks(params, setup, observed, engine)
        spring = engine.contact == "spring"
        bounds = spring_bounds(params, setup, observed) if spring else first_order_bounds(params, setup, engine)
        return [*exact, *_analytic(params, observed, bounds), *_dilation(params, setup, observed, engine, bounds)]


def sticks(params: Mapping[str, Any]) -> bool:
    """Whether the block should stay where it is."""
    return bool(params["mu"] >= critical_mu(angle=math.radians(params["angle_deg"])))


def _dilation(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, bounds: Bounds
) -> list[Check]:
    """1 for the associated rule at theta = 1, where every sliding step ends with ``gap = mu v dt``; 0 for Coulomb's law.

    The final gap of a block that chatters is that of its last flight; its largest lift counts. A step from touch lifts it by
    ``mu v dt/(1 + mu^2)``, as (A.4) has it, and the velocity ``mu v`` carries it on by ``(mu v)^2/(2 g cos)`` at most.
    """
    mu = params["mu"]
    if sticks(params) or mu == 0.0:
        return []
    numerics = setup.numerics
    associated = follows_associated_rule(engine, numerics)
    if associated and numerics.theta != 1.0:
        return []
    angle = math.radians(params["angle_deg"])
    speed = float(incline(observed.t, mu=params["mu"], angle=angle, g=params["g"], mass=params["mass"]).vx[-1])
    length = mu * speed * numerics.dt
    if chatters(engine):
        flight = mu * speed / (2.0 * params["g"] * math.cos(angle) * numerics.dt)
        return [
            Check(quantity="dilation_peak", norm="scalar", truth="analytic", expected=1.0,
                  source="associated rule: a sliding step lifts by mu v dt", atol=mu**2 / (1.0 + mu**2) + flight,
                  why=f"a step from touch lifts by 1/(1 + mu^2) of that; flight after it: {flight:.3g}"),
        ]  # fmt: skip
    start = RADIUS - float(setup.scene.disks.x[0, 1])
    # Springs rest at the overlap of the weight, whatever they start with; an associated step is exact to the solver's residual.
    error = 1e-12 if associated else bounds.atol["gap"] + abs(bounds.rest_gap + start)
    return [
        Check(quantity="dilation", norm="scalar", truth="exact-step" if associated else "analytic",
              expected=1.0 if associated else 0.0, source="(A.2): gap = mu v dt" if associated else "Coulomb's law: no dilation",
              atol=2.0 * error / length + EXACT_STEP_RTOL, why=bounds.why["gap"]),
    ]  # fmt: skip


def _half(t: FloatArray) -> int:
    """Sample from which the second half of the run counts; never the last one."""
    return min(int(np.searchsorted(t, 0.5 * t[-1])), len(t) - 2)


def _analytic(params: Mapping[str, Any], observed: Observed, bounds: Bounds) -> list[Check]:
    angle = math.radians(params["angle_deg"])
    truth = incline(observed.t, mu=params["mu"], angle=angle, g=params["g"], mass=params["mass"])
    expected = {
        "x": truth.x,
        "vx": truth.vx,
        "gap": np.full_like(truth.x, bounds.rest_gap),
        "fn": np.where(bounds.forces_from, truth.fn, np.nan),
        "fs": np.where(bounds.forces_from, truth.fs, np.nan),
    }
    if bounds.settled_only:
        expected["gap"] = np.where(bounds.forces_from, expected["gap"], np.nan)
    tolerance = {name: (bounds.atol[name], 0.0, bounds.why[name]) for name in NAMES}
    source = "(A.7), equilibrium on the incline"
    names = tuple(name for name in NAMES if not (bounds.chatter and name in ("fn", "fs")))
    found = series_and_final(names, expected, truth="analytic", source=source, tolerance=tolerance)
    if bounds.chatter:
        found += [
            Check(quantity=f"{name}_mean", norm="scalar", truth="analytic", expected=float(getattr(truth, name)[-1]),
                  source=source, atol=bounds.atol[name] + bounds.chatter, why=f"mean over half the run; {bounds.why[name]}")
            for name in ("fn", "fs")
        ]  # fmt: skip
    elapsed = float(observed.t[-1] - observed.t[_half(observed.t)])
    weight = params["mass"] * params["g"] * math.cos(angle)
    found.append(
        Check(quantity="mu_crit", norm="scalar", truth="analytic", expected=critical_mu(angle=angle),
              source="tan(angle)", atol=(bounds.force + 2.0 * params["mass"] * bounds.gain / elapsed) / weight,
              why=bounds.why["fs"]),
    )  # fmt: skip
    if sticks(params):
        found.append(
            Check(quantity="creep_rate", norm="scalar", truth="analytic", expected=0.0,
                  source="Coulomb: a stuck block rests", atol=bounds.creep / elapsed, why=bounds.why["creep"]),
        )  # fmt: skip
    return found


CASE = InclineBlock()
