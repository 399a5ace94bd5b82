"""A disk that a wall pushes away, and a disk on a floor that shakes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
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
from ninedisk.harness.cases.common import at_observed
from ninedisk.harness.cases.nine_disk.scene import DAMPING_FORM, NINE_DISK_CD, cd_settings
from ninedisk.references.analytic.contact.driven_contact import shaken_contact
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, contact_history
from ninedisk.references.exact_steps.normal_contact import (
    NormalSteps,
    Plane,
    normal_contact_central,
    normal_contact_theta,
)

RADIUS, MASS = 0.5, 1.0
PUSH_GAP, PUSH_SPEED = 0.06, 6.0
"""Way of the pushing wall to the disk [m], longer than the skin of a neighbour list is wide, and its speed [m/s]."""

GRAVITY, AMPLITUDE, FREQUENCY, PHASE = 10.0, 3e-5, 300.0, 0.5 * math.pi
"""Of the shaken floor [m/s^2], [m], [rad/s], [rad]: it starts from rest, and its acceleration stays below gravity."""

PAIR = (0, 1)


class MovingWall:
    """A disk and one smooth wall that moves along its normal, elastic or with a dashpot.

    ``motion=push``: the wall comes at a constant speed and strikes a disk at rest, which for an observer on the wall is an impact.
    ``motion=shake``: the wall is a floor that bears the disk's weight and moves harmonically; contact is never lost.
    """

    id = "contact/moving-wall"
    version = 2
    title = "Disk at a moving wall"
    beside_headlines = tuple(
        (name, "loads, places of walls and energies are reported beside the motion, and move nothing")
        for name in ("load_*", "wall_place", "energy_*")
    )
    source = "an impact seen from the wall; driven linear oscillator, Landau & Lifshitz, Mechanics, section 26"
    requirement = "a pushed disk leaves with 1 + e of the wall's speed; on a shaken floor the force is that of a driven oscillator"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="motion", default="push", choices=("push", "shake"), in_id=True, help="motion of the wall"),
        Parameter(name="beta", default=0.2, low=0.0, high=0.9, unit="-", in_id=True, help="contact damping ratio"),
        Parameter(name="kn", default=1e6, low=1e4, unit="N/m", help="normal stiffness"),
        Parameter.positive("dt", 5e-6, unit="s", help="step of every engine"),
        Parameter(name="steps", default=6000, low=1, whole=True, help="steps of the run"),
        DAMPING_FORM,
        *NINE_DISK_CD,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both motions with and without dashpot."""
        return [{"motion": motion, "beta": beta} for motion in ("push", "shake") for beta in (0.2, 0.0)]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disk above the wall; its height of 0 is that of touching a wall at rest."""
        if _omega(params) * params["dt"] > 0.2:
            raise ParameterError(
                f"dt = {params['dt']:g} s is not allowed: a contact must last many steps; use at most {0.2 / _omega(params):g} s"
            )
        law = ContactLaw(kn=params["kn"], beta=params["beta"])
        pushed = params["motion"] == "push"
        motion = (
            WallSegment(velocity=(0.0, PUSH_SPEED))
            if pushed
            else WallSegment(amplitude=(0.0, AMPLITUDE), frequency=FREQUENCY, phase=PHASE)
        )
        height = RADIUS + _start(params)
        scene = Scene(
            disks=Disks(x=[(0.0, height)], radius=RADIUS, mass=MASS),  # type: ignore[arg-type]
            disk_disk=law,
            walls=(Wall(name="wall", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=(motion,)),),
            gravity=(0.0, 0.0 if pushed else -GRAVITY),
        )
        numerics = Numerics(
            dt=params["dt"],
            n_steps=params["steps"],
            contact_dt=params["dt"],
            damping_form=params["damping_form"],
            **cd_settings(params),
        )
        if not pushed and _force_swing(params) >= MASS * GRAVITY:
            raise ParameterError(
                f"kn = {params['kn']:g} N/m is not allowed: the shaken disk would lift; use a stiffer contact, "
                f"whose frequency is further above {FREQUENCY:g} rad/s"
            )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Motion of disk and wall, force from either side, energies as the engine reports them."""
        normal = np.column_stack([np.cos(history.wall_angle[:, 0]), np.sin(history.wall_angle[:, 0])])
        blank = np.full(len(history.step), np.nan)
        series = {
            "y": ("m", history.x[:, 0, 1] - RADIUS),
            "vy": ("m/s", history.v[:, 0, 1]),
            "gap": ("m", history.gap[:, 0]),
            "fn": ("N", history.fn[:, 0]),
            "load_wall": ("N", -history.wall_force[:, 0, 1]),
            "wall_place": ("m", (history.wall_point[:, 0] * normal).sum(axis=1)),
            "wall_angle": ("rad", history.wall_angle[:, 0]),
            "energy_kinetic": ("J", np.asarray(history.energy.get("kinetic", blank))),
            "energy_elastic": ("J", np.asarray(history.energy.get("elastic", blank))),
        }
        scalars = {"vy_final": ("m/s", float(history.v[-1, 0, 1]))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Motion and force of a disk on the scene's spring and dashpot, continuous in time."""
        if params["regime"] == "quasi-static":
            return ()
        truth = _continuous(params, observed.t)
        pushed = params["motion"] == "push"
        source = "impact seen from the wall" if pushed else "driven oscillator"
        speed, force = (
            (PUSH_SPEED, MASS * _omega(params) * PUSH_SPEED) if pushed else (AMPLITUDE * FREQUENCY, MASS * GRAVITY)
        )
        return (
            Headline(name="speed of the disk", use="moving-walls", quantity="vy", expected=truth["vy"], source=source,
                     scale=speed, scale_is="largest speed of the wall"),
            Headline(name="force of the wall", use="moving-walls", quantity="fn", expected=truth["fn"], source=source,
                     scale=force, scale_is="largest force of an elastic impact" if pushed else "weight"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of the theta scheme and of central differences whose dashpots see ``v_n`` to second order; closed forms for all."""
        if params["regime"] == "quasi-static":
            return []
        found: list[Check] = []
        t = np.asarray(np.arange(setup.numerics.n_steps + 1) * setup.numerics.dt, dtype=np.float64)
        place, _ = _wall(params, t)
        common = {"norm": "max", "truth": "analytic", "source": "prescribed path", "why": "round-off"}
        for name, curve in (("wall_place", place), ("wall_angle", np.full_like(t, 0.5 * math.pi))):
            expected = at_observed(observed, engine, name, curve[observed.step])
            found.append(Check(quantity=name, expected=expected, atol=1e-14, **common))  # type: ignore[arg-type]
        exact = engine.scheme == "central-difference" and params["damping_form"] == "central"
        if exact and (params["beta"] == 0.0 or engine.second_order_dashpots):
            found += _curve_checks(
                params, observed, engine, _stepped(params, t, normal_contact_central), "exact-step", 0.0
            )
        elif engine.scheme == "theta":
            steps = partial(normal_contact_theta, theta=params["theta"])
            found += _curve_checks(params, observed, engine, _stepped(params, t, steps), "exact-step", 0.0)
        continuous, relative = _continuous(params, t), _relative(params, engine)
        found += _curve_checks(params, observed, engine, continuous, "analytic", relative)
        final = float(continuous["vy"][-1])
        return [*found, _leaves_wall(params, final, relative)] if params["motion"] == "push" else found


def _omega(params: Mapping[str, Any]) -> float:
    return math.sqrt(params["kn"] / MASS)


def _start(params: Mapping[str, Any]) -> float:
    return PUSH_GAP if params["motion"] == "push" else -MASS * GRAVITY / float(params["kn"])


def _wall(params: Mapping[str, Any], t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Place [m] and velocity [m/s] of the wall."""
    if params["motion"] == "push":
        return PUSH_SPEED * t, np.full_like(t, PUSH_SPEED)
    angle = FREQUENCY * t + PHASE
    return AMPLITUDE * (np.sin(angle) - math.sin(PHASE)), AMPLITUDE * FREQUENCY * np.cos(angle)


def _force_swing(params: Mapping[str, Any]) -> float:
    """Largest deviation of the force from its mean value [N]."""
    if params["motion"] == "push":
        return MASS * _omega(params) * PUSH_SPEED * (1.0 + 2.0 * float(params["beta"]))
    # A dashpot's share of the force is at most 2 beta of the spring's at frequencies up to the contact's own.
    swing = shaken_contact(
        np.zeros(1), kn=params["kn"], mass=MASS, beta=params["beta"], g=GRAVITY, amplitude=AMPLITUDE,
        frequency=FREQUENCY, phase=PHASE,
    ).swing  # fmt: skip
    return swing * (1.0 + 2.0 * float(params["beta"]))


def _stepped(params: Mapping[str, Any], t: FloatArray, scheme: Callable[..., NormalSteps]) -> dict[str, FloatArray]:
    place, rate = _wall(params, t)
    steps = scheme(
        (Plane(1, place, rate, params["kn"], params["beta"]),), mass=MASS,
        g=0.0 if params["motion"] == "push" else GRAVITY, y=_start(params), vy=0.0, dt=params["dt"], n_steps=len(t) - 1,
    )  # fmt: skip
    return _curves(params, steps.y, steps.vy, steps.overlap[:, 0], steps.fn[:, 0])


def _continuous(params: Mapping[str, Any], t: FloatArray) -> dict[str, FloatArray]:
    """Closed forms; NaN where a contact with a dashpot begins or ends: there the force jumps, or its slope does."""
    place, rate = _wall(params, t)
    kn, beta = params["kn"], params["beta"]
    if params["motion"] == "shake":
        found = shaken_contact(
            t, kn=kn, mass=MASS, beta=beta, g=GRAVITY, amplitude=AMPLITUDE, frequency=FREQUENCY, phase=PHASE
        )
        fn = kn * found.overlap + 2.0 * beta * math.sqrt(MASS * kn) * found.rate
        return _curves(params, place - found.overlap, rate - found.rate, found.overlap, fn)
    since = t - PUSH_GAP / PUSH_SPEED
    overlap, closing, fn = contact_history(np.maximum(since, 0.0), kn=kn, m_eff=MASS, beta=beta, speed=PUSH_SPEED)
    free = since < 0.0
    overlap, closing = np.where(free, PUSH_SPEED * since, overlap), np.where(free, PUSH_SPEED, closing)
    end = contact_duration(kn=kn, m_eff=MASS, beta=beta)
    near = (np.abs(since) < 1.5 * params["dt"]) | (np.abs(since - end) < 1.5 * params["dt"])
    return _curves(
        params, place - overlap, rate - closing, overlap, np.where(near | free, np.where(near, np.nan, 0.0), fn)
    )


def _curves(
    params: Mapping[str, Any], y: FloatArray, vy: FloatArray, overlap: FloatArray, fn: FloatArray
) -> dict[str, FloatArray]:
    return {
        "y": y, "vy": vy, "gap": -overlap, "fn": fn, "load_wall": fn, "energy_kinetic": 0.5 * MASS * vy**2,
        "energy_elastic": 0.5 * params["kn"] * np.maximum(overlap, 0.0) ** 2,
    }  # fmt: skip


def _relative(params: Mapping[str, Any], engine: EngineInfo) -> float:
    """What a step changes of an oscillation of the contact, at most: some multiple of ``omega dt``, or of its square.

    Central differences are of second order; the dashpot's force jumps when a contact begins, anywhere in a step, which is
    ``2 beta omega dt`` of the impulse. Third-order Runge-Kutta shrinks the amplitude by ``(omega dt)^3/24`` per radian, its own dt, and is
    of second order where a contact begins. The theta scheme damps by ``theta omega dt/2`` per radian (`ninedisk.references.exact_steps
    .cd_row`) and begins a step late or early. Other schemes are of first order. Errors grow until the contact ends, half a period
    later, or, on the shaken floor, until the free oscillation has faded or reversed; what is damped is no more than all.
    """
    phase, beta = _omega(params) * params["dt"], params["beta"]
    central = engine.scheme == "central-difference"
    per_radian = phase**2 / 24.0 if central else 0.5 * phase
    if engine.scheme == "runge-kutta-3":
        phase = min(phase, float(engine.options["phase"].default))
        central, per_radian = True, phase**3 / 24.0
    radians = math.pi
    if params["motion"] == "shake":
        radians = min(_omega(params) * params["steps"] * params["dt"], 1.0 / beta if beta > 0.0 else math.inf)
    offset = phase**2 if central else phase
    if engine.scheme == "theta":
        return float(1.0 - math.exp(-0.5 * params["theta"] * phase * radians) + offset + 2.0 * beta * phase)
    return float(min(per_radian * radians + offset + 2.0 * beta * phase, 2.0))


def _curve_checks(
    params: Mapping[str, Any], observed: Observed, engine: EngineInfo, curves: Mapping[str, FloatArray],
    truth: TruthKind, relative: float,
) -> list[Check]:  # fmt: skip
    """Checks of all curves that the engine reports; ``relative`` is 0 for exact steps."""
    omega, steps, dt = _omega(params), params["steps"], params["dt"]
    rounding = float(np.spacing(2.0 * RADIUS)) * (8.0 + steps)
    force = relative * _force_swing(params) + params["kn"] * rounding
    speed = relative * _force_swing(params) / (MASS * omega) + omega * rounding
    # After the impact the disk flies on with the speed that it has.
    place = force / params["kn"] + (speed * steps * dt if params["motion"] == "push" else 0.0)
    largest = float(np.nanmax(np.abs(curves["vy"])))
    deepest = float(np.nanmax(np.abs(np.minimum(curves["gap"], 0.0))))
    # A damped contact goes on overlapping, by 2 beta speed/omega at first, for a while after its force has ended.
    off, tail = force / params["kn"], 2.0 * params["beta"] * largest / omega
    touching = off + 4.0 * speed / omega
    atol = {
        "y": place, "gap": place, "vy": speed, "fn": force, "load_wall": force,
        "energy_kinetic": MASS * (largest + speed) * speed,
        "energy_elastic": params["kn"] * max((deepest + off) * off, (tail + touching) * touching),
    }  # fmt: skip
    why, source = "round-off of the coordinates, added up", "the scheme's own steps of one disk at a moving plane"
    if relative:
        why = f"the scheme's step changes an oscillation by {relative:.2g} of its amplitude at most"
        source = "impact seen from the wall" if params["motion"] == "push" else "driven oscillator"
    return [
        Check(
            quantity=name, norm="max", truth=truth, expected=at_observed(observed, engine, name, curve[observed.step]),
            source=source, atol=atol[name], why=why,
        )
        for name, curve in curves.items()
        if atol[name] < 0.5 * float(np.nanmax(np.abs(curve)))  # a bound near the quantity itself would let almost anything pass
    ]  # fmt: skip


def _leaves_wall(params: Mapping[str, Any], final: float, relative: float) -> Check:
    return Check(
        quantity="vy_final", norm="scalar", truth="analytic", expected=final, source="(1 + e) of the wall's speed",
        atol=PUSH_SPEED * (1.0 + 2.0 * params["beta"]) * relative,
        why=f"the scheme's step changes an oscillation by {relative:.2g} of its amplitude at most",
    )  # fmt: skip


CASE = MovingWall()
