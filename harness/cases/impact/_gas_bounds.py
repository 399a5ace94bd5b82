"""Collisions that a gas of disks has in a run, and how much energy they may cost an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import single, soft_reason, softness
from ninedisk.references.analytic.gas import pair_rate, wall_rate

SIGMAS = 6.0
"""Standard deviations of a sum of independent errors that a tolerance allows: one run in 10^9 has more."""

MEETING = 10.0
"""Energy of approach, in units of the mean energy of a disk, of all contacts that go on at one time, at most."""


class EnergyBound(NamedTuple):
    """Tolerance of the energy over its first value, and why."""

    atol: float
    why: str


class Hits(NamedTuple):
    """Collisions of a run: of pairs, and with walls."""

    pairs: float
    walls: float

    @property
    def all(self) -> float:
        """Both."""
        return self.pairs + self.walls


def expected_collisions(params: Mapping[str, Any], setup: Setup) -> Hits:
    """Collisions of the run by kinetic theory."""
    n, side = params["rows"] ** 2, params["rows"] * params["spacing"]
    radius = float(setup.scene.disks.radius[0])
    thermal = params["speed"] / math.sqrt(2.0)
    room = side - 2.0 * radius
    time = setup.numerics.n_steps * setup.numerics.dt
    return Hits(
        pairs=time * pair_rate(n=n, area=side**2, radius=radius, thermal=thermal),
        walls=time * wall_rate(n=n, area=room**2, length=4.0 * room, thermal=thermal),
    )


def energy_bounds(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, hits: Hits) -> EnergyBound:
    """By the kind of the engine's contacts.

    The energy of approach along the normal is on average the mean energy of a disk, 1/n of all, and its square twice that squared
    (it is distributed exponentially over collisions).

    Springs: an elastic contact keeps ``v_{n+1/2}^2 + omega^2 x_n x_{n+1}`` (`ninedisk.harness.cases.impact._impact.binding_impact`). The
    parts phi, phi' of a step in which it begins and ends change its energy by ``eps (phi' (1 - phi') - phi (1 - phi))``,
    ``eps = (omega dt)^2``. Phases are uniform and independent: no mean, a variance of ``eps^2/90``. While a contact goes on, the
    energy at the steps lacks up to eps/4 of that of the spring.

    Rigid contacts with e = 1 keep the energy exactly, in any number at one time: round-off; soft ones lose what they let through.
    """
    n = params["rows"] ** 2
    if engine.contact == "spring":
        contact_dt = setup.numerics.contact_dt or setup.numerics.dt
        eps = 2.0 * params["kn"] / float(setup.scene.disks.mass[0]) * contact_dt**2
        walk = SIGMAS * eps * math.sqrt(2.0 * hits.all / 90.0) / n
        why = (
            f"random phases of {hits.all:.0f} collisions, {SIGMAS:g} standard deviations, and contacts under way: "
            f"omega dt = {math.sqrt(eps):.3g}"
        )
        return EnergyBound(walk + 0.25 * eps * MEETING / n, why)
    lost = 2.0 * hits.all / n * 2.0 * 2.0 * softness(engine)
    rough = 1e-13 * hits.all + 2.0 * single(engine, 1.0, 2.0 * hits.all / n)
    why = f"e = 1 keeps the energy of each of {hits.all:.0f} collisions: round-off"
    why += (" of single precision" if engine.precision == "float32" else "") + soft_reason(engine)
    if engine.normal_turns_in_impact:
        lost += _gain_of_turning(params, setup, hits)
        why += "; restitution and impulse along normals of either end of the step: energy is gained, first order in dt"
    return EnergyBound(rough + lost, why)


def _gain_of_turning(params: Mapping[str, Any], setup: Setup, hits: Hits) -> float:
    """Energy over its first value, twice the mean gain, of pairs whose normal turns between restitution and impulse.

    In a step the normal turns by ``v_t dt/sigma`` and so takes ``v_t^2 dt/sigma`` from the approach that the impulse meets, but not
    from the one that restitution sees: a gain of ``m/2 v_n v_t^2 dt/sigma``. Over collisions the mean of v_n is ``sqrt(pi/2) a`` and
    that of v_t^2 is ``a^2``, with ``a^2 = 2 kT/m``. Each hit gains of what the gas has by then.
    """
    n, sigma = params["rows"] ** 2, 2.0 * float(setup.scene.disks.radius[0])
    turn = math.sqrt(math.pi) * params["speed"] / math.sqrt(2.0) * setup.numerics.dt / sigma
    return math.expm1(2.0 * turn * hits.pairs / n)
