"""What cases share: parameters, steps and numerics of a run, bounds of round-off and of soft contacts, checks of flight and series."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import (
    Check,
    Norm,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    TruthKind,
)
from ninedisk.harness.api.engine import SOFTEST, EngineInfo

FloatArray = NDArray[np.float64]

PRELOAD = Parameter(
    name="preload",
    default=True,
    only_for="spring",
    help="false: springs start with the overlap of the weight, but without the shear force of the motion",
)
"""Of cases whose springs start in the motion; without it they run on engines that cannot set a shear force."""

CONTACT_DYNAMICS = (
    Parameter(
        name="impact",
        default="theta",
        only_for="cd",
        choices=("theta", "newton"),
        help="impact law of contact dynamics: the theta scheme's own, or Newton's at velocity level",
    ),
    Parameter(
        name="sliding",
        default="associated",
        only_for="cd",
        choices=("associated", "coulomb"),
        help="sliding rule of contact dynamics",
    ),
    Parameter(
        name="solver",
        default="auto",
        choices=("auto", "interior-point", "gauss-seidel"),
        only_for="cd",
        help="contact solver of contact dynamics; auto chooses by size and outcome",
    ),
)

THETA = Parameter(
    name="theta", default=1.0, low=0.5, high=1.0, unit="-", only_for="cd", help="parameter of the theta scheme"
)

REGIME = Parameter(
    name="regime",
    default="dynamic",
    choices=("dynamic", "quasi-static"),
    only_for="cd",
    help="with inertia, or the static limit of contact dynamics: a series of equilibria",
)

STIFFNESS = Parameter.positive("kn", 1e8, unit="N/m", help="normal stiffness of spring engines")
SHEAR_STIFFNESS = Parameter.positive("ks", None, unit="N/m", help="shear stiffness of spring engines; none: kn")
STEP = Parameter.positive("dt", 0.01, unit="s", in_id=True, help="step; sampling of spring engines")
FRICTION = Parameter.positive("mu", 0.3, unit="-", in_id=True, help="friction coefficient")
GRAVITY = Parameter.positive("g", 10.0, unit="m/s^2", help="gravity")

CONTACT_DT = Parameter.positive(
    "contact_dt",
    None,
    unit="s",
    help="own step of engines with contact springs; it must divide dt; none: what the contact's resolution asks for",
)

EXACT_STEP_RTOL = 1e-10
"""Of an exact time-discrete solution: the round-off of some hundred steps, 1e-14, and of a solver's residual."""

OPTIONAL = ("energy", "load", "stress", "wall")
"""Beginnings of the names of quantities that an engine need not report."""


def contact_step(dt: float, target: float) -> float:
    """Largest ``dt/k``, k whole, that does not exceed ``target`` [s]."""
    return dt / max(1, math.ceil(dt / target * (1.0 - 1e-12)))


def numerics_of(params: Mapping[str, Any], *, n_steps: int, contact_dt: float, theta: float = 1.0) -> Numerics:
    """Numerics of one variant; a ``contact_dt`` that the user set replaces the proposed one.

    Cases that leave no choice among the laws of contact dynamics have Newton's impacts and Coulomb's sliding.
    """
    own = params.get("contact_dt")
    return Numerics(
        dt=params["dt"],
        n_steps=n_steps,
        contact_dt=contact_dt if own is None else own,
        theta=theta,
        impact=params.get("impact", "newton"),
        sliding=params.get("sliding", "coulomb"),
        solver=params.get("solver", "auto"),
    )


def whole_steps(params: Mapping[str, Any], default: float, *, at_least: float = 0.0, event: str = "") -> int:
    """Number of steps ``dt`` of the run, >= 1: ``params["duration"]``, or ``default`` [s] where it is None.

    Raises
    ------
    ParameterError
        If the duration is shorter than a step, or than ``at_least`` [s], the end of the named event.
    """
    given = params["duration"]
    duration = default if given is None else float(given)
    steps = math.ceil(duration / float(params["dt"]) * (1.0 - 1e-12))
    if steps * params["dt"] < at_least:
        raise ParameterError(
            f"duration = {duration:g} s is not allowed: {event} is over at {at_least:g} s only; "
            "use a longer one, or none"
        )
    if given is not None and duration < params["dt"] * (1.0 - 1e-12):
        raise ParameterError(
            f"duration = {duration:g} s is not allowed: it must be at least one step, dt = {params['dt']:g} s"
        )
    return max(steps, 1)


def round_off_speed(length: float, contact_dt: float) -> float:
    """Velocity [m/s] that the rounding of a coordinate of size ``length`` [m] represents.

    A coordinate that is kept to one unit in the last place moves by that unit or not at all; a force balance through a
    contact spring therefore leaves velocities of the order of one unit per step. Factor 8: sums of a few such
    roundings.
    """
    return 8.0 * float(np.spacing(length)) / contact_dt


def summed_round_off(largest: float, additions: float) -> float:
    """Worst rounding error of a sum of ``additions`` terms whose value never exceeds ``largest``: half a unit each."""
    return 0.5 * additions * float(np.spacing(abs(largest)))


def single(engine: EngineInfo, largest: float, steps: float) -> float:
    """Rounding error of an engine that computes in single precision; 0 for all others.

    A quantity that is kept to one unit in the last place of single precision is off by half a unit after each of ``steps``
    updates, all of one sign at worst. A result of one step, too, is made of several roundings: eight count at least.

    Parameters
    ----------
    engine : EngineInfo
    largest : float
        Natural scale of the quantity, in its unit: the speed, momentum, length or weight that its computation handles, not the
        expected value, which may be zero.
    steps : float
        Steps in which it is updated.
    """
    if engine.precision != "float32":
        return 0.0
    return 0.5 * max(steps, 8.0) * float(np.spacing(np.float32(abs(largest))))


SAME_STEPS = 3e-4
"""Exact steps are the same where a start that rounding moves changes them by no more than this part of their largest value."""


def same_steps(curve: FloatArray, near: Sequence[FloatArray]) -> FloatArray:
    """Exact steps, NaN where those from starts that are off by rounding are others: an impact in the step before, or a phase that grows."""
    apart = np.max(np.abs(np.stack(near) - curve), axis=0)
    return np.where(apart <= SAME_STEPS * np.abs(curve).max(), curve, np.nan)


def contact_softness(engine: EngineInfo) -> float:
    """Fraction of the approach velocity that a contact of this engine does not remove per step; 0 for all except soft contacts."""
    if engine.contact != "soft":
        return 0.0
    return SOFTEST if engine.softness is None else engine.softness


HEIGHTS = ("gap", "lift", "y", "apex", "bounce", "dilation")
"""Beginnings of the names of gaps and of heights above what bears a body."""


def with_slop(checks: Sequence[Check], observed: Observed, engine: EngineInfo) -> list[Check]:
    """The checks with the overlap that the engine's contacts leave uncorrected added to gaps and heights; unchanged without any."""
    if not engine.slop:
        return list(checks)
    units = {name: unit for name, (unit, _) in (*observed.series.items(), *observed.scalars.items())}
    return [
        replace(check, atol=check.atol + engine.slop, why=f"{check.why}; contacts leave overlaps of {engine.slop:g} m")
        if units[check.quantity] == "m" and check.quantity.split("_")[0] in HEIGHTS
        else check
        for check in checks
    ]


def slack_time(engine: EngineInfo, dt: float) -> float:
    """Time [s] for which a load may act as if there were no contact: a body that should rest has that much of its free motion.

    A soft contact does not remove a fixed fraction s of the approach velocity per step: ``v' = s (v + g dt)``, which settles at
    ``s g dt/(1 - s)``, however long the load acts.
    """
    s = contact_softness(engine)
    return s / (1.0 - s) * dt


def drift_in_flight(setup: Setup, history: History) -> float:
    """Largest change of a velocity [m/s] at samples before any two bodies can have met, without gravity and with walls at rest."""
    return float(np.abs(history.v[history.t <= _free_until(setup)] - setup.scene.disks.v).max(initial=0.0))


def flight_checks(setup: Setup, engine: EngineInfo) -> list[Check]:
    """Nothing acts on bodies in flight, whatever their contacts are like; none where they meet in the first steps."""
    scene, numerics = setup.scene, setup.numerics
    if _free_until(setup) < numerics.dt:
        return []
    largest = float(np.abs(scene.disks.v).max())
    why = "no force acts before bodies meet: round-off" + single_precision(engine)
    return [
        Check(quantity="drift_in_flight", norm="scalar", truth="analytic", expected=0.0, source="Newton's first law",
              atol=1e-12 * largest + single(engine, largest, numerics.n_steps), scale=largest, why=why)
    ]  # fmt: skip


def _free_until(setup: Setup) -> float:
    """Time [s] before which no two bodies can have met, less the step by which an engine may place an impact too early."""
    disks = setup.scene.disks
    speed = np.hypot(*disks.v.T)
    one, two = np.triu_indices(len(disks), 1)
    path = [np.hypot(*(disks.x[one] - disks.x[two]).T) - disks.radius[one] - disks.radius[two]]
    rate = [speed[one] + speed[two]]
    for wall in setup.scene.walls:
        path.append((disks.x - np.array(wall.point)) @ np.array(wall.normal) - disks.radius)
        rate.append(speed)
    gaps, closing = np.concatenate(path), np.concatenate(rate)
    met = np.divide(gaps, closing, out=np.where(gaps > 0.0, math.inf, 0.0), where=closing > 0.0)
    return float(np.min(met, initial=math.inf)) - 1.5 * setup.numerics.dt


def soft_reason(engine: EngineInfo) -> str:
    """Words for the reason of a tolerance; empty for all except soft contacts."""
    if engine.contact != "soft":
        return ""
    reason = (
        engine.softness_why
        if engine.softness is not None
        else "the engine does not say how soft: the most that it might state"
    )
    return f"; a soft contact does not remove {contact_softness(engine):g} of the approach velocity per step ({reason})"


def at_observed(observed: Observed, engine: EngineInfo, name: str, expected: FloatArray) -> FloatArray:
    """The truth of a quantity; NaN, no truth, for energies, loads of walls and stresses that an engine may leave out and does."""
    silent = not engine.reference and name.startswith(OPTIONAL) and not np.isfinite(observed.series[name][1]).any()
    return np.full_like(expected, np.nan) if silent else expected


def sweeps_of(engine: EngineInfo, numerics: Numerics) -> int:
    """Sweeps over the contacts in a step, each of which rounds the velocities; 0 for engines that declare none."""
    return int(engine.option(engine.sweeps, numerics)) if engine.contact == "impulse" and engine.sweeps else 0


def single_precision(engine: EngineInfo) -> str:
    """Words for the reason of a tolerance that holds `single`; empty for engines that compute in double precision."""
    return "; single precision" if engine.precision == "float32" else ""


def phase_error(phase: float, beta: float, share: float = 1.0) -> float:
    """Relative error of the speed after an impact on a spring and dashpot, by where in a contact step it falls.

    With ``phase = omega dt``, dt the contact step, an undamped contact of any scheme equivalent to central differences keeps
    ``v_{n+1/2}^2 + omega^2 x_n x_{n+1}``. At entry and exit, a fraction phi into the step, the product is ``-phi (1 - phi) (v dt)^2``,
    so that ``|e - 1| <= phase^2/8 (1 + phase^2)``. With a dashpot the force jumps at touch by ``c v``; the sampled jump is up to dt/2
    early or late, which scales e by ``1 +- beta phase``; a dashpot that sees ``v_{n-1/2}`` acts as ``beta (1 + beta phase/2)``, another
    ``beta phase`` at most since ``|d ln e/d ln beta| <= 2``. Second-order terms of the dashpot: the same again, squared. ``share`` is the
    part of the speed that the dashpot's error is of.
    """
    damped = 2.0 * beta * phase
    return phase**2 / 8.0 * (1.0 + phase**2) + share * damped * (1.0 + damped)


def around_contact(t: FloatArray, begin: float, duration: float, dt: float) -> NDArray[np.bool_]:
    """Samples in a contact, or as near to it as a step may place the impact, shape (s,)."""
    return np.asarray((t > begin - 1.5 * dt) & (t < begin + duration + 1.5 * dt))


def second_half(t: FloatArray) -> int:
    """Sample from which the second half of the run counts; never the last one."""
    return min(int(np.searchsorted(t, 0.5 * t[-1])), len(t) - 2)


def last(values: FloatArray) -> float:
    """Last value of a series."""
    return float(values[-1])


def series_and_final(
    names: Sequence[str],
    expected: Mapping[str, FloatArray],
    *,
    truth: TruthKind,
    source: str,
    tolerance: Mapping[str, tuple[float, float, str]],
    sizes: Mapping[str, float] | None = None,
) -> list[Check]:
    """A check of each series and of its final value ``<name>_final``.

    ``tolerance`` maps a name to (atol, rtol, why); rtol refers to the largest value of the series in both checks, and so do relative
    errors, or to the physical size in ``sizes`` where that is larger.
    """
    found = []
    for name in names:
        atol, rtol, why = tolerance[name]
        curve = expected[name]
        scale = float(np.abs(curve[np.isfinite(curve)]).max(initial=0.0))
        norms: tuple[tuple[str, Norm, float | FloatArray], ...] = (
            (name, "max", curve),
            (f"{name}_final", "scalar", last(curve)),
        )
        found += [
            Check(
                quantity=quantity,
                norm=norm,
                truth=truth,
                expected=value,
                source=source,
                atol=atol + rtol * scale,
                why=why,
                scale=max(scale, (sizes or {}).get(name, 0.0)),
            )
            for quantity, norm, value in norms
        ]
    return found
