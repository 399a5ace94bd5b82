"""Row of disks between two walls, pushed by one of them: a linear chain."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    TruthKind,
    Value,
)
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk.compression import step_error
from ninedisk.harness.cases.nine_disk.scene import DAMPING_FORM, NINE_DISK_CD, cd_settings
from ninedisk.references.analytic.assembly.pushed_row import chain_forces, chain_modes, mode_forces, static_force
from ninedisk.references.exact_steps.pushed_row import chain_central, chain_theta

RADIUS, MASS = 0.5, 1.0
LOAD_STEPS = 100
"""Steps during which the wall moves: a wave runs up and down a row of five within 100."""

RESIDUAL = 1e-9
"""Of the largest force: residual of an implicit solver, 1e-10, over some hundred steps that the row's swing remembers."""


RESIDUE = "round-off of the coordinates, added up over the steps; residual of an implicit solver"


class PushedRow:
    """Touching disks in a row, prestressed by the walls and by gravity along the row; the first wall moves in, then rests."""

    id = "row/pushed"
    version = 1
    title = "Row of disks, pushed"
    source = "linear chain between fixed ends, Goldstein, Classical Mechanics, chapter 6"
    requirement = "contact forces follow the modes of a linear chain and settle at prestress + k m g + kn w/(n + 1)"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="n", default=5, low=1, high=50, whole=True, help="number of disks"),
        Parameter(name="xi", default=0.0, low=0.0, unit="1/s", in_id=True, help="global damping"),
        Parameter(name="g", default=0.0, low=0.0, unit="m/s^2", in_id=True, help="gravity along the row, away from the pushing wall"),
        Parameter.positive("dt", 1e-4, unit="s", help="step of every engine"),
        Parameter(
            name="steps", default=None, optional=True, low=1, whole=True,
            help="steps of the run; none: 400, and 1500 with damping, for the forces to settle",
        ),
        Parameter(name="kn", default=1e6, low=1e3, unit="N/m", help="normal stiffness of every contact"),
        Parameter.positive("prestress", 100.0, unit="N", help="force of the pushing wall at time 0"),
        Parameter(name="speed", default=0.01, low=-10.0, high=10.0, unit="m/s", help="speed of the pushing wall"),
        Parameter(name="substeps", default=1, low=1, whole=True, help="contact steps in one step"),
        DAMPING_FORM,
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """A wave up and down the row without damping; with damping and gravity until all is at rest; the static limit."""
        damped: Mapping[str, Value] = {"xi": 300.0, "g": 10.0}
        return [{"xi": 0.0, "g": 0.0}, damped, {**damped, "theta": 1.0}, {**damped, "regime": "quasi-static"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The row along x with the overlaps of its equilibrium."""
        n, kn, dt = params["n"], params["kn"], params["dt"]
        overlap = _resting_forces(params) / kn
        if overlap.max() >= RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the prestress makes overlaps of a radius; use a larger one"
            )
        x = np.zeros((n, 2))
        x[:, 0] = RADIUS * (2.0 * np.arange(n) + 1.0) - np.cumsum(overlap[:-1])
        law = ContactLaw(kn=kn)
        push = WallSegment(duration=LOAD_STEPS * dt, velocity=(params["speed"], 0.0))
        end = x[-1, 0] + RADIUS - overlap[-1]
        scene = Scene(
            disks=Disks(x=x, radius=RADIUS, mass=MASS),  # type: ignore[arg-type]
            disk_disk=law,
            walls=(
                Wall(name="push", point=(0.0, 0.0), normal=(1.0, 0.0), law=law, motion=(push,)),
                Wall(name="stop", point=(end, 0.0), normal=(-1.0, 0.0), law=law),
            ),
            gravity=(params["g"], 0.0),
            xi=params["xi"],
        )
        labels = {"push": (0, n)} | {f"link_{k}": (k - 1, k) for k in range(1, n)} | {"stop": (n - 1, n + 1)}
        numerics = Numerics(
            dt=dt,
            n_steps=params["steps"] or (1500 if params["xi"] > 0.0 else 400),
            contact_dt=dt / params["substeps"],
            damping_form=params["damping_form"],
            **cd_settings(params),
        )
        truth = self._continuous(params, np.arange(numerics.n_steps + 1) * dt)
        if truth.min() <= 0.0:
            raise ParameterError(
                f"prestress = {params['prestress']:g} N is not allowed: a contact would open under a wall of {params['speed']:g} m/s; "
                f"use more than {params['prestress'] - truth.min():g} N"
            )
        return Setup(scene=scene, numerics=numerics, watch=tuple(labels.values()), labels=labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Force of every contact, and its last value where damping lets it settle; the largest motion across the row."""
        series, scalars = {}, {}
        for name, pair in setup.labels.items():
            force = history.fn[:, history.contact(pair)]
            series[f"fn_{name}"] = ("N", force)
            scalars[f"fn_{name}_settled"] = ("N", float(force[-1]) if params["xi"] > 0.0 else math.nan)
        scalars["across"] = ("m", float(np.abs(history.x[:, :, 1]).max()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The chain's motion, continuous in time, of elastic contacts; that of equilibria where the static limit is asked for."""
        wall_path = params["speed"] * params["dt"] * LOAD_STEPS
        settled = float(_resting_forces(params)[-1] + static_force(n=params["n"], kn=params["kn"], path=wall_path))
        if params["regime"] == "quasi-static":
            pushed = np.minimum(observed.step, LOAD_STEPS) / LOAD_STEPS
            stop = _resting_forces(params)[-1] + (settled - _resting_forces(params)[-1]) * pushed
        else:
            stop = self._continuous(params, observed.t)[:, -1]
        common: dict[str, Any] = {"scale": settled, "scale_is": "settled force at the stop"}
        return (
            Headline(name="force at the stop", use="moving-walls", quantity="fn_stop", expected=stop,
                     source="modes of the chain, continuous in time", **common),
            Headline(name="settled force", use="rest", quantity="fn_stop_settled", source="prestress + n m g + kn w/(n + 1)",
                     expected=settled if params["xi"] > 0.0 else math.nan, **common),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of central differences and of the theta scheme, the continuous chain for all dynamic runs, statics at the end."""
        rough = _round_off(params, setup, engine)
        across = Check(quantity="across", norm="scalar", truth="analytic", expected=0.0, source="symmetry", atol=1e-15, scale=RADIUS,
                       why="all centres lie on the x axis: no force has a y component")  # fmt: skip
        displacement = params["speed"] * params["dt"] * np.minimum(observed.step, LOAD_STEPS)
        static = (
            _resting_forces(params) + static_force(n=params["n"], kn=params["kn"], path=1.0) * displacement[:, None]
        )
        if engine.contact == "cd" and params["regime"] == "quasi-static":
            return [
                across,
                *_histories(setup, static, "analytic", "equilibrium: prestress + k m g + kn w/(n + 1)", rough, RESIDUE),
            ]
        found = [across]
        exact, source = _exact_steps(params, setup, engine)
        if exact is not None:
            found += _histories(setup, exact[observed.step], "exact-step", source, rough, RESIDUE)
        error, why = _scheme_error(params, setup, engine, float(observed.t[-1]))
        continuous = self._continuous(params, observed.t)
        found += _histories(setup, continuous, "analytic", "modes of the chain, continuous in time", rough + error, why)
        return found + (_settled_forces(params, setup, static[-1], rough) if params["xi"] > 0.0 else [])

    def _continuous(self, params: Mapping[str, Any], t: FloatArray) -> FloatArray:
        change = chain_forces(
            t, n=params["n"], kn=params["kn"], mass=MASS, xi=params["xi"], v_wall=params["speed"],
            t_wall=LOAD_STEPS * params["dt"],
        )  # fmt: skip
        return _resting_forces(params) + change


def _histories(setup: Setup, forces: FloatArray, truth: TruthKind, source: str, atol: float, why: str) -> list[Check]:
    """A check of each contact's force, the columns of ``forces`` at the samples."""
    return [
        Check(quantity=f"fn_{name}", norm="max", truth=truth, expected=forces[:, k], source=source, atol=atol, why=why)
        for k, name in enumerate(setup.labels)
    ]


def _settled_forces(params: Mapping[str, Any], setup: Setup, static: FloatArray, rough: float) -> list[Check]:
    """The last forces: statics, and what damping has left of every mode's swing."""
    slowest = float(chain_modes(n=params["n"], kn=params["kn"], mass=MASS).omega[0])
    half = 0.5 * params["xi"]
    decay = half - math.sqrt(max(half**2 - slowest**2, 0.0))
    left = float(_swing_amplitudes(params).sum()) * math.exp(
        -decay * (setup.numerics.n_steps - LOAD_STEPS) * params["dt"]
    )
    return [
        Check(quantity=f"fn_{name}_settled", norm="scalar", truth="analytic", expected=float(force),
              source="prestress + k m g + kn w/(n + 1)", atol=rough + 2.0 * left,
              why=f"{RESIDUE}; twice what damping has left of the modes' swing by then, {left:.1g} N")
        for name, force in zip(setup.labels, static, strict=True)
    ]  # fmt: skip


def _resting_forces(params: Mapping[str, Any]) -> FloatArray:
    """Forces at time 0 [N], shape (n + 1,): each disk hands its weight on to the next contact."""
    return np.asarray(params["prestress"] + MASS * params["g"] * np.arange(params["n"] + 1), dtype=np.float64)


def _swing_amplitudes(params: Mapping[str, Any]) -> FloatArray:
    return mode_forces(n=params["n"], kn=params["kn"], mass=MASS, v_wall=params["speed"])


def _exact_steps(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> tuple[FloatArray | None, str]:
    k = params["substeps"]
    chain = {
        "n": params["n"], "kn": params["kn"], "mass": MASS, "xi": params["xi"], "dt": params["dt"] / k, "n_load": LOAD_STEPS * k,
        "v_wall": params["speed"], "n_steps": setup.numerics.n_steps * k,
    }  # fmt: skip
    if engine.scheme == "central-difference":
        change = chain_central(**chain, form=params["damping_form"])
        return _resting_forces(params) + change[::k], "modes of the chain under central differences"
    if engine.scheme == "theta" and params["regime"] == "dynamic":
        change = chain_theta(
            **{**chain, "dt": params["dt"], "n_load": LOAD_STEPS, "n_steps": setup.numerics.n_steps},
            theta=params["theta"],
        )
        return _resting_forces(
            params
        ) + change, f"modes of the chain under the theta scheme, theta = {params['theta']:g}"
    return None, ""


def _round_off(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> float:
    """Rounding of each step's coordinates, all in phase with a mode at worst, times kn; a solver's residual."""
    length = 2.0 * RADIUS * params["n"]
    steps = setup.numerics.n_steps * params["substeps"]
    force = params["kn"] * float(np.spacing(length)) * (8.0 + 0.5 * steps)
    return float(force + (RESIDUAL * _resting_forces(params).max() if engine.contact == "cd" else 0.0))


def _scheme_error(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, t_end: float) -> tuple[float, str]:
    """Error of the scheme, mode by mode, and its reason."""
    omegas = chain_modes(n=params["n"], kn=params["kn"], mass=MASS).omega.astype(np.float64)
    remembered = min(t_end, 2.0 / params["xi"]) if params["xi"] > 0.0 else t_end
    total, reason = 0.0, ""
    for omega, swing in zip(omegas.tolist(), _swing_amplitudes(params).tolist(), strict=True):
        of_mode = step_error(params, setup, engine, omega)
        total += swing * float(of_mode.after(np.array(omega * remembered)))
        reason = of_mode.why  # of the fastest mode at last
    return total, f"{reason} for the fastest mode; drift of each mode's oscillation and its amplitude"


CASE = PushedRow()
