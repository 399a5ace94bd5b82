"""What a row of disks does that is hit at one end: several laws, and which of them binds an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import FloatArray, Observed, ParameterError, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import EXACT_STEP_RTOL, single, soft_reason, softness
from ninedisk.harness.cases.impact._impact import ROUND_OFF
from ninedisk.references.analytic.chain import ChainHistory, chain_of_collisions, chain_of_springs, touching_row
from ninedisk.references.exact_steps.chain import ChainSteps, chain_theta


class Truth(NamedTuple):
    """Velocities at the samples, shape (s, n), NaN while an impact goes on; absolute tolerance [m/s]; final ones; and why."""

    v: FloatArray
    final: FloatArray
    atol: float
    source: str
    why: str


def gaps_of(params: Mapping[str, Any]) -> tuple[float, ...]:
    """Gaps between the disks of the row [m]."""
    return (float(params["gap"]),) * int(params["n"] - 1)


@lru_cache(maxsize=32)
def _springs(gaps: tuple[float, ...], speed: float, mass: float, kn: float, beta: float) -> tuple[ChainHistory, float]:
    return chain_of_springs(gaps=gaps, speed=speed, mass=mass, kn=kn, beta=beta)


def spring_chain(params: Mapping[str, Any], setup: Setup) -> tuple[ChainHistory, float]:
    """The row of springs of this variant.

    Raises
    ------
    ParameterError
        If the row moves by less than the rounding of its gaps, or does not end.
    """
    law = setup.scene.disk_disk
    try:
        return _springs(gaps_of(params), params["speed"], params["mass"], law.kn, law.beta)
    except ValueError as error:
        raise ParameterError(
            f"gap = {params['gap']:g} m, speed = {params['speed']:g} m/s, mass = {params['mass']:g} kg, kn = {params['kn']:g} N/m "
            f"and restitution = {params['restitution']:g} together are not allowed: {error}; move them towards their defaults"
        ) from error


def collisions(params: Mapping[str, Any]) -> ChainHistory:
    """Two disks at a time, in a row with gaps.

    Raises
    ------
    ParameterError
        If the collisions coincide or never end.
    """
    try:
        return chain_of_collisions(gaps=gaps_of(params), speed=params["speed"], restitution=params["restitution"])
    except ValueError as error:
        raise ParameterError(
            f"restitution = {params['restitution']:g} with gap = {params['gap']:g} m: {error}"
        ) from error


def binding_truth(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> Truth:
    """The law that binds an engine.

    With gaps all engines have the same truth but for e < 1: one collision after the other. In a row that touches, springs
    (and engines whose impacts are a spring's motion over steps of their own) spread the impact over all contacts; engines that
    solve for impulses at all contacts at once follow Newton's law at each of them.
    """
    if engine.contact == "spring":
        return _by_springs(params, setup, observed)
    dt, t = setup.numerics.dt, observed.t
    e, speed = params["restitution"], params["speed"]
    atol = speed * (ROUND_OFF + (params["n"] - 1) * (1.0 + e) * softness(engine))
    atol += 2.0 * single(engine, speed, setup.numerics.n_steps)
    why = "impulses at velocity level: round-off" + (" of single precision" if engine.precision == "float32" else "")
    why += soft_reason(engine)
    if params["gap"] > 0.0:
        history = collisions(params)
        v = history.velocities(t)
        for k, event in enumerate(history.t[1:]):
            v[np.abs(t - event) <= (k + 2.5) * dt] = np.nan
        return Truth(v, history.v[-1], atol, "one collision after the other, Newton's restitution", why)
    if engine.impact_as_springs:
        history, _ = spring_chain(params, setup)
        final, source = (
            history.v[-1],
            "linear springs in a row, pushing only: the engine's impacts are a spring's motion",
        )
    else:
        final = touching_row(n=params["n"], speed=speed, restitution=e)
        source = "Newton's law at all contacts at once (Moreau)"
    v = np.where((t > 1.5 * dt)[:, None], final, np.nan)
    return Truth(v, final, atol + EXACT_STEP_RTOL * speed, source, f"{why}; residual of a solver of several contacts")


def _by_springs(params: Mapping[str, Any], setup: Setup, observed: Observed) -> Truth:
    """Event by event.

    Each contact begins and ends somewhere in a contact step, and its speeds are off by what
    `ninedisk.harness.cases.impact._impact.binding_impact` derives: of the approach by the square of the phase, of what is left of it by a
    dashpot's share. While several contacts act, the frequencies of the scheme are high by ``(omega dt)^2/24``, at most that of the
    row's fastest mode, which turns the modes' phases by that times omega T.
    """
    law, t = setup.scene.disk_disk, observed.t
    history, end = spring_chain(params, setup)
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    phase = math.sqrt(2.0 * law.kn / params["mass"]) * contact_dt
    fast = math.sqrt(2.0) * phase
    damped = 2.0 * law.beta * phase
    left = float(np.abs(np.diff(history.v[-1])).max()) / params["speed"]
    share = (params["n"] - 1) * (phase**2 / 8.0 * (1.0 + phase**2) + left * damped * (1.0 + damped))
    share += fast**3 / 24.0 * _time_of_many(history) / contact_dt
    first = params["gap"] / params["speed"]
    dt = setup.numerics.dt
    v = np.where((t < first - 1.5 * dt)[:, None], history.v[0], history.v[-1])
    v[(t >= first - 1.5 * dt) & (t <= end + 1.5 * dt)] = np.nan
    why = f"phase of each contact in the contact step, and of the row's modes: omega dt = {phase:.3g}, beta = {law.beta:.4g}"
    source = "linear springs in a row, pushing only: solved event by event"
    return Truth(v, history.v[-1], params["speed"] * (share + ROUND_OFF), source, why)


def _time_of_many(history: ChainHistory) -> float:
    """Time [s] of pieces at whose begin or end more than one contact is closed."""
    closed = (np.diff(history.x, axis=1) <= 0.0).sum(axis=1) > 1
    return float(np.diff(history.t)[closed[:-1] | closed[1:]].sum())


def exact_steps(params: Mapping[str, Any], setup: Setup) -> ChainSteps:
    """Exact steps of the theta scheme on this variant."""
    numerics = setup.numerics
    return chain_theta(
        gaps=gaps_of(params),
        speed=params["speed"],
        dt=numerics.dt,
        theta=numerics.theta,
        restitution=params["restitution"] if numerics.impact == "newton" else None,
        n_steps=numerics.n_steps,
    )
