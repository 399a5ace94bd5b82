"""Gas of elastic smooth disks in a box: energy over many collisions, momentum between hits of the walls.

How many collisions a run has, and how much energy they may cost an engine, is derived.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    contact_softness,
    contact_step,
    drift_in_flight,
    flight_checks,
    last,
    numerics_of,
    single,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.differences import checks_with_allowance
from ninedisk.references.analytic.impact.gas import pair_rate, wall_rate

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

NAMES = ("left", "right", "bottom", "top")


SIGMAS = 6.0
"""Standard deviations of a sum of independent errors that a tolerance allows: one run in 10^9 has more."""

MEETING = 10.0
"""Energy of approach, in units of the mean energy of a disk, of all contacts that go on at one time, at most."""


FREE = 10
"""Samples at the end of the run among which one is taken to be without contact: contacts last 8 ms, and there is one in four at a time."""


class ElasticGas:
    """Equal disks on a square lattice with random velocities, four smooth walls, no gravity.

    Two engines do not keep to the same trajectories for long: each collision multiplies a difference by the free path over the
    radius. What every engine has to keep is compared: energy, momentum and angular momentum while no disk is near a wall, the room
    of the box, and disks that do not spin. Energy is that of motion and, of springs, that of the overlaps at the samples.
    """

    id = "gas/elastic"
    version = 1
    title = "Gas of elastic disks in a box"
    source = "conservation laws of elastic smooth disks; collision rate by kinetic theory (Enskog)"
    requirement = (
        "energy over a hundred collisions; momentum and angular momentum between hits of the walls; no spin; no escape"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="rows", default=3, low=2, high=32, whole=True, unit="-", in_id=True, help="disks in a row and in a column"),
        Parameter(name="spacing", default=3.0, low=2.1, unit="m", help="of the lattice at the start; the box has that much a disk"),
        Parameter.positive("speed", 5.0, unit="m/s", help="root mean square of the velocities"),
        Parameter(name="seed", default=1, low=0, high=2**31, whole=True, help="of the random velocities"),
        Parameter.positive("dt", 5e-3, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("duration", 3.0, unit="s", help="length of the run"),
        Parameter.positive("kn", 2.5e5, unit="N/m", help="stiffness of spring engines: 2.5e5 makes contacts of 8 ms"),
        Parameter(name="phase", default=0.1, low=1e-3, high=0.5, unit="-", only_for="spring",
                  help="omega dt of a contact of two disks at most, where contact_dt does not say otherwise"),
        CONTACT_DT,
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Nine disks; springs with half the step; Newton's law in contact dynamics."""
        return ({"rows": 3}, {"rows": 3, "phase": 0.05}, {"rows": 3, "impact": "newton"})

    def build(self, params: Mapping[str, Any]) -> Setup:
        """A lattice in the middle of the box; the velocities have no mean."""
        rows, spacing, speed, kn = params["rows"], params["spacing"], params["speed"], params["kn"]
        side = rows * spacing
        if speed * math.sqrt(0.5 * MASS / kn) > 0.05 * RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: disks would overlap by more than a twentieth of the radius; "
                f"use kn > {0.5 * MASS * (20.0 * speed / RADIUS) ** 2:.3g}"
            )
        if speed * params["dt"] > 0.1 * RADIUS:
            raise ParameterError(
                f"dt = {params['dt']:g} s is not allowed: a disk would move by more than a tenth of its radius in a step; "
                f"use dt < {0.1 * RADIUS / speed:.3g}"
            )
        law = ContactLaw(kn=kn, restitution=1.0, regularised=True)
        place = spacing * (np.arange(rows) + 0.5)
        v = np.random.default_rng(params["seed"]).standard_normal((rows**2, 2))
        v -= v.mean(axis=0)
        v *= speed / math.sqrt(float((v**2).sum(axis=1).mean()))
        x = np.array([(a, b) for b in place for a in place])
        faces = (
            ((0.0, 0.0), (1.0, 0.0)),
            ((side, 0.0), (-1.0, 0.0)),
            ((0.0, 0.0), (0.0, 1.0)),
            ((0.0, side), (0.0, -1.0)),
        )
        scene = Scene(
            disks=Disks(x=x, v=v, radius=np.full(rows**2, RADIUS), mass=np.full(rows**2, MASS)),
            disk_disk=law,
            walls=tuple(
                Wall(name=name, point=point, normal=n, law=law) for name, (point, n) in zip(NAMES, faces, strict=True)
            ),
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], params["phase"] / math.sqrt(2.0 * kn / MASS)),
            theta=0.5,
        )
        return Setup(scene=scene, numerics=numerics, watch=(), labels={})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Energy, jumps of the momenta over samples between which no disk can have met a wall, overlap with walls, spin.

        ``energy_kept`` is the largest kinetic energy of the last `FREE` samples: while springs touch, they hold a part of it.
        """
        x, v = history.x, history.v
        kinetic = 0.5 * MASS * (v**2).sum(axis=(1, 2))
        gaps = wall_gaps(params, x)
        elastic = 0.5 * params["kn"] * (np.maximum(-gaps, 0.0) ** 2).sum(axis=1)
        elastic += 0.5 * params["kn"] * overlaps_squared(x)
        first = 0.5 * MASS * float((setup.scene.disks.v**2).sum())
        momentum = MASS * v.sum(axis=1)
        angular = MASS * (x[:, :, 0] * v[:, :, 1] - x[:, :, 1] * v[:, :, 0]).sum(axis=1)
        far = _far_from_walls(params, setup, gaps)
        change = np.hypot(*np.diff(momentum, axis=0).T)
        turn = np.abs(np.diff(angular))
        series = {
            "kinetic": ("1", kinetic / first),
            "kinetic_level": ("1", contact_free_level(kinetic / first)),
            "energy": ("1", (kinetic + elastic) / first),
            "momentum_jump": ("kg m/s", _conserved_changes(far, change)),
            "angular_jump": ("kg m^2/s", _conserved_changes(far, turn)),
            "spin": ("rad/s", np.abs(history.omega).max(axis=1)),
            "outside": ("m", np.maximum(-gaps.min(axis=1), 0.0)),
        }
        scalars = {
            f"{name}_final": (series[name][0], last(series[name][1])) for name in ("kinetic", "kinetic_level", "energy")
        }
        scalars["energy_kept"] = ("1", float((kinetic / first)[-FREE:].max()))
        scalars["drift_in_flight"] = ("m/s", drift_in_flight(setup, history))
        scalars["energy_gain"] = ("1", float(series["kinetic"][1].max() - 1.0))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Energy and momentum of elastic disks, whatever the engine does in a contact."""
        return (
            Headline(name="energy kept", use="energy", quantity="energy_kept", expected=1.0, source="conservation of energy",
                     scale=1.0, scale_is="initial energy"),
            Headline(name="momentum between hits of the walls", use="energy", quantity="momentum_jump", expected=0.0,
                     source="conservation of momentum", scale=MASS * params["speed"], scale_is="momentum of a disk"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,  # noqa: ARG002
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Conservation laws; energy may only fall where contact dynamics has theta's impact law, which depends on the phase."""
        speed, n, numerics = params["speed"], params["rows"] ** 2, setup.numerics
        hits = expected_collisions(params, setup)
        momentum, size = MASS * speed, params["rows"] * params["spacing"]
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "expected": 0.0}
        rough = n * single(engine, momentum, 2.0)
        fastest = speed * math.sqrt(n)  # all the energy in one disk
        deep = fastest * (numerics.dt if engine.contact != "spring" else math.sqrt(MASS / params["kn"]))
        on_pairs = "impulses act on two disks in opposite directions: round-off of a sum over all disks"
        # Impulses act at the positions of a step's begin, middle or end, and overlaps are taken out along the line of centres: a way
        # of v dt in either case, times the momentum exchanged. Central differences have forces and positions at one time.
        places = 0.0 if engine.scheme == "central-difference" else n * MASS * speed**2 * numerics.dt
        found = [
            Check(quantity="momentum_jump", source="conservation between hits of the walls", why=on_pairs, scale=momentum,
                  atol=n * 1e-13 * momentum + rough, **common),
            Check(quantity="angular_jump", source="conservation between hits of the walls",
                  why="impulses act along the line of centres, of the positions in which the contact is found",
                  atol=(n * 1e-13 * momentum + rough) * size + places, scale=n * momentum * size, **common),
            Check(quantity="spin", source="smooth disks",
                  why="no force has a moment: impulses of 2 m v at an arm that is the rounding of a coordinate, hit by hit",
                  atol=2.0 * hits.all / n * 4.0 * speed * _rounding(engine, size) / RADIUS**2, scale=speed / RADIUS, **common),
            Check(quantity="outside", source="walls", why="displacement in a step, or overlap of a spring, of a disk with all the energy",
                  atol=deep, scale=RADIUS, **common),
             *flight_checks(setup, engine),
        ]  # fmt: skip
        if engine.scheme == "theta" and numerics.impact == "theta":
            why = "an impact by theta's law keeps e_eff^2 <= 1 of the energy of approach: round-off of each"
            bound = Check(quantity="energy_gain", norm="scalar", truth="analytic", expected=0.0,
                          source="theta scheme, theta = 1/2: e_eff(phase) <= 1", why=why, atol=1e-10, scale=1.0)  # fmt: skip
            # What a hit keeps of the energy of approach is all or nothing or anything between, by its phase: all may go in time.
            kept = KnownDifference(
                finding=f"{engine.id}/restitution-depends-on-phase",
                size=1.0,
                why="theta's impact law keeps e_eff^2 of each energy of approach, from 0 to 1 by the moment of the impact in its step",
            )
            whole: dict[str, Any] = {
                "truth": "analytic",
                "expected": 1.0,
                "source": "conservation of energy",
                "atol": 1e-13 * hits.all,
                "known": kept,
            }
            why = f"e = 1 keeps the energy of each of {hits.all:.0f} collisions: round-off"
            return [
                *found,
                bound,
                Check(quantity="kinetic", norm="max", why=why, **whole),
                Check(quantity="kinetic_final", norm="scalar", why=why, **whole),
            ]
        if engine.contact == "soft" and Difference.IMPACT_AS_SPRINGS not in engine.differences:
            # What a soft contact lets through is lost: as tight as for a rigid one.
            rigid = energy_bounds(params, setup, replace(engine, contact="impulse", softness=None), hits)
            found.append(
                Check(quantity="energy_gain", norm="scalar", truth="analytic", expected=0.0, source="a contact that gives way takes energy",
                      why=rigid.why, atol=rigid.atol, scale=1.0)
            )  # fmt: skip
        return [
            *found,
            *checks_with_allowance(
                Difference.NORMAL_TURNS_IN_IMPACT,
                setup,
                engine,
                lambda setup, engine: _energy_checks(params, setup, engine, hits),
            ),
        ]


def _energy_checks(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, hits: Hits) -> list[Check]:
    limit = energy_bounds(params, setup, engine, hits)
    quantity = "kinetic"
    if engine.contact == "spring":
        quantity = "energy"
    elif Difference.IMPACT_AS_SPRINGS in engine.differences:
        quantity = "kinetic_level"
    common: dict[str, Any] = {
        "truth": "analytic",
        "expected": 1.0,
        "source": "conservation of energy",
        "atol": limit.atol,
    }
    return [
        Check(quantity=quantity, norm="max", why=limit.why, **common),
        Check(quantity=f"{quantity}_final", norm="scalar", why=limit.why, **common),
    ]


def contact_free_level(kinetic: FloatArray) -> FloatArray:
    """The largest of five samples around each: contacts that last less than a step hold energy at single samples only."""
    padded = np.pad(kinetic, 2, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 5).max(axis=1))


def _rounding(engine: EngineInfo, size: float) -> float:
    """Unit in the last place of a coordinate [m]."""
    return float(np.spacing(np.float32(size))) if engine.precision == "float32" else float(np.spacing(size))


def wall_gaps(params: Mapping[str, Any], x: FloatArray) -> FloatArray:
    """Gap to each of the walls [m], shape (s, 2 d n)."""
    side = params["rows"] * params["spacing"]
    flat = x.reshape(len(x), -1)
    return np.concatenate([flat - RADIUS, side - flat - RADIUS], axis=1)


def overlaps_squared(x: FloatArray) -> FloatArray:
    """Sum over pairs of disks of their overlap squared [m^2], shape (s,)."""
    one, two = np.triu_indices(x.shape[1], 1)
    total = np.zeros(len(x))
    for row, places in enumerate(x):
        apart = np.hypot.reduce((places[one] - places[two]).T)
        total[row] = (np.maximum(2.0 * RADIUS - apart, 0.0) ** 2).sum()
    return total


def _far_from_walls(params: Mapping[str, Any], setup: Setup, gaps: FloatArray) -> NDArray[np.bool_]:
    """Pairs of neighbouring samples between which no disk can have met a wall, shape (s - 1,).

    No disk is faster than the energy allows for all of it in one: the margin is that displacement in a step.
    """
    fastest = params["speed"] * params["rows"]
    clear = gaps.min(axis=1) > fastest * setup.numerics.dt
    return np.asarray(clear[1:] & clear[:-1])


def _conserved_changes(far: NDArray[np.bool_], change: FloatArray) -> FloatArray:
    """Changes over the step before each sample, 0 where a wall may have acted; NaN stays."""
    return np.concatenate(([0.0], np.where(far | np.isnan(change), change, 0.0)))


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
    n, d, side = len(setup.scene.bodies), setup.scene.dimension, params["rows"] * params["spacing"]
    radius = float(setup.scene.bodies.radius[0])
    thermal = params["speed"] / math.sqrt(d)
    gaps = side - 2.0 * radius
    time = setup.numerics.n_steps * setup.numerics.dt
    return Hits(
        pairs=time * pair_rate(n=n, area=side**d, radius=radius, thermal=thermal, dimension=d),
        walls=time * wall_rate(n=n, area=gaps**d, length=2.0 * d * gaps ** (d - 1), thermal=thermal),
    )


def energy_bounds(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, hits: Hits) -> EnergyBound:
    """By the kind of the engine's contacts.

    The energy of approach along the normal is on average the mean energy of a disk, 1/n of all, and its square twice that squared
    (it is distributed exponentially over collisions).

    Springs: an elastic contact keeps ``v_{n+1/2}^2 + omega^2 x_n x_{n+1}`` (`ninedisk.harness.cases.impact.binary.binding_impact`). The
    parts phi, phi' of a step in which it begins and ends change its energy by ``eps (phi' (1 - phi') - phi (1 - phi))``,
    ``eps = (omega dt)^2``. Phases are uniform and independent: no mean, a variance of ``eps^2/90``. While a contact goes on, the
    energy at the steps lacks up to eps/4 of that of the spring.

    Rigid contacts with e = 1 keep the energy exactly, in any number at one time: round-off; soft ones lose what they let through.
    """
    n = len(setup.scene.bodies)
    if engine.contact == "spring":
        contact_dt = setup.numerics.contact_dt or setup.numerics.dt
        eps = 2.0 * params["kn"] / float(setup.scene.bodies.mass[0]) * contact_dt**2
        walk = SIGMAS * eps * math.sqrt(2.0 * hits.all / 90.0) / n
        why = (
            f"random phases of {hits.all:.0f} collisions, {SIGMAS:g} standard deviations, and contacts under way: "
            f"omega dt = {math.sqrt(eps):.3g}"
        )
        return EnergyBound(walk + 0.25 * eps * MEETING / n, why)
    # The energy falls by that rate of what is left.
    lost = -math.expm1(-2.0 * hits.all / n * 2.0 * 2.0 * contact_softness(engine))
    rough = 1e-13 * hits.all + 2.0 * single(engine, 1.0, 2.0 * hits.all / n)
    why = f"e = 1 keeps the energy of each of {hits.all:.0f} collisions: round-off"
    why += (" of single precision" if engine.precision == "float32" else "") + soft_reason(engine)
    if Difference.NORMAL_TURNS_IN_IMPACT in engine.differences:
        lost += _gain_of_turning(params, setup, hits)
        why += "; restitution and impulse along normals of either end of the step: energy is gained, first order in dt"
    return EnergyBound(rough + lost, why)


def _gain_of_turning(params: Mapping[str, Any], setup: Setup, hits: Hits) -> float:
    """Energy over its first value, twice the mean gain, of pairs whose normal turns between restitution and impulse.

    In a step the normal turns by ``v_t dt/sigma`` and so takes ``v_t^2 dt/sigma`` from the approach that the impulse meets, but not
    from the one that restitution sees: a gain of ``m/2 v_n v_t^2 dt/sigma``. Over collisions the mean of v_n is ``sqrt(pi/2) a`` and
    that of v_t^2 is ``a^2``, with ``a^2 = 2 kT/m``. Each hit gains of what the gas has by then.
    """
    n, sigma = len(setup.scene.bodies), 2.0 * float(setup.scene.bodies.radius[0])
    turn = math.sqrt(math.pi) * params["speed"] / math.sqrt(2.0) * setup.numerics.dt / sigma
    if setup.scene.dimension == 3:  # two directions across, of a third more freedoms: a^2 = 2/3 of the mean square
        turn *= 4.0 / 3.0 * math.sqrt(2.0 / 3.0)
    return math.expm1(2.0 * turn * hits.pairs / n)


CASE = ElasticGas()
