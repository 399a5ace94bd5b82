"""Probes of damping, forces, preload and cohesion in 3D."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, Cell, Rolling, Spheres, SphereScene
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.adapter.probes import (
    FIRST_ORDER,
    FLOOR,
    KN,
    SHALLOW,
    STEPS,
    WHY,
    ClosedForm,
    G,
    M,
    Probe,
    R,
    contact_error,
    damping_factor,
    has_springs,
    resting_overlap,
    round_off,
)
from ninedisk.harness.cases.adapter.space import ALONG, UP, alone, law, on_floor, probe_of_spheres

V, OMEGA = np.array([0.4, -0.1, 0.7]), np.array([1.0, 2.0, -3.0])
"""Velocity [m/s] and spin [rad/s] of a free sphere."""


def pushed(info: EngineInfo) -> Probe:
    """A free sphere under a force and a torque that begin and end inside steps: their impulse is exact all the same."""
    force, torque = np.array([3.0, -1.0, 2.0]), np.array([0.2, -0.3, 0.1])
    load = BodyForce(disk=0, force=tuple(force), torque=tuple(torque), begin=0.0132, end=0.0573)
    scene = alone(info, v=[V], omega=[OMEGA]).replace(forces=(load,))
    lasts = load.end - load.begin

    def closed_forms(history: History) -> list[ClosedForm]:
        common: dict[str, Any] = {
            "bound": 10.0 * round_off(info), "why": "round-off: the impulse of a step is the mean force times the step",
            "mend": "a force in SphereScene.forces acts from begin to end; the step in which it begins gets its part",
        }  # fmt: skip
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=V + force * lasts / M, **common),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=OMEGA + torque * lasts / (0.4 * M * R**2),
                       **common),
        ]  # fmt: skip

    return probe_of_spheres("forces on spheres", scene, Numerics(dt=0.01, n_steps=10, sample_from=10), closed_forms)


def damped(info: EngineInfo, form: str) -> Probe:
    """A sphere in a viscous medium, which slows its spin, too."""
    xi = 2.0
    scene = alone(info, v=[V], omega=[OMEGA]).replace(xi=xi)
    numerics = Numerics(
        dt=0.01,
        contact_dt=0.01,
        n_steps=50,
        sample_from=50,
        theta=0.5,
        damping_form="central" if form == "central" else "lagged",
    )
    factor, bound, why = damping_factor(info, form, xi * numerics.dt, numerics.n_steps)

    def closed_forms(history: History) -> list[ClosedForm]:
        mend = "global damping is the force -xi m v (and the moment -xi I omega); see Numerics.damping_form for the velocity that it sees"
        return [
            ClosedForm(quantity=name, unit=unit, value=value, expected=factor * before, bound=bound * float(np.abs(before).max()), why=why,
                       mend=mend, observed=name == "v")
            for name, unit, value, before in (("v", "m/s", history.v[-1, 0], V), ("omega", "rad/s", history.omega[-1, 0], OMEGA))
        ]  # fmt: skip

    return probe_of_spheres(f"damping of spheres, {form}", scene, numerics, closed_forms)


def preloaded(info: EngineInfo) -> Probe:
    """A sphere at rest that sticks to a floor by its shear spring, which is under load: after a quarter period it has all of its energy."""
    force, overlap = 1.0, SHALLOW * R
    kn = M * G / overlap
    omega = math.sqrt(3.5 * kn / M)
    scene = on_floor(law(info, kn=kn, ks=kn, mu=100.0), overlap)
    scene = scene.replace(initial_shear={FLOOR: tuple(force * ALONG)})
    numerics = Numerics(dt=0.5 * math.pi / omega / STEPS, n_steps=STEPS, sample_from=STEPS, theta=0.5)
    speed = force / (M * omega)

    def closed_forms(history: History) -> list[ClosedForm]:
        mend = "SphereScene.initial_shear is the shear force on the first body at time 0, a vector"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=speed * ALONG, bound=2.0 * FIRST_ORDER * speed, why=WHY,
                       mend=mend),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=-2.5 * speed / R * np.cross(UP, ALONG),
                       bound=5.0 * FIRST_ORDER * speed / R, why=WHY, mend=mend),
        ]  # fmt: skip

    return probe_of_spheres("preload of a sphere", scene, numerics, closed_forms)


def stuck_deep(info: EngineInfo) -> Probe:
    """A sphere at rest on a floor that half takes back what its spring gives: it lies twice as deep."""
    sunk = M * G / (0.5 * KN)
    scene: SphereScene = on_floor(law(info, cohesion=0.5 * KN, ks=0.0), sunk)
    numerics = Numerics(dt=0.0005, n_steps=20)

    def closed_forms(history: History) -> list[ClosedForm]:
        why, bound = "equilibrium: round-off", round_off(info)
        mend = "cohesion is a force of -cohesion times the overlap beside kn times it; fn is both together"
        return [
            ClosedForm(quantity="overlap", unit="m", value=R - history.x[:, 0] @ UP, expected=np.full(21, sunk), bound=bound * R,
                       why=why, mend=mend),
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=M * G, bound=1e3 * bound * M * G, why=why, mend=mend),
        ]  # fmt: skip

    return probe_of_spheres("cohesion of spheres", scene, numerics, closed_forms)


def slowed(info: EngineInfo) -> Probe:
    """A sphere that rolls along a floor against a torque that grows with its spin: ``v exp(-(5/7) mu g t/(1 m/s))``."""
    mu, speed, end = 0.5, 1.0, 0.1
    contact = law(info, mu=0.5, rolling=Rolling(model="viscous", mu=mu))
    spin = speed / R * np.cross(UP, ALONG)
    scene = on_floor(contact, resting_overlap(info), v=[speed * ALONG], omega=[spin])
    numerics = Numerics(dt=end / STEPS, n_steps=STEPS, sample_from=STEPS, sliding="coulomb", theta=0.5)
    slowing = 5.0 / 7.0 * mu * G
    left = math.exp(-slowing * end)
    # The shear spring, of ks = KN, is not stretched at first: the sphere swings about its motion with that spring's frequency.
    swing = 2.0 * slowing * speed / math.sqrt(3.5 * KN / M) if has_springs(info) else 0.0
    bound = 2.0 * slowing * speed * numerics.dt + swing + contact_error(info) * speed

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "two steps without the torque, and the swing on the shear spring"
        mend = "the torque is mu R^2 fn times the relative spin across the normal (see Rolling), on both bodies, R the reduced radius"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=left * speed * ALONG, bound=bound, why=why, mend=mend),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=left * spin, bound=2.5 * bound / R, why=why,
                       mend=mend),
        ]  # fmt: skip

    return probe_of_spheres("viscous rolling resistance of a sphere", scene, numerics, closed_forms)


def across_the_edge(info: EngineInfo) -> Probe:
    """Two spheres that meet through the third face of a periodic cell only, exchange their velocities, and are back where they began."""
    speed, free = 0.5, 0.2
    contact = law(info, **({} if has_springs(info) else {"restitution": 1.0}))
    x = np.array([[1.0, 1.5, 0.5 * free + R], [1.0, 1.5, 4.0 - 0.5 * free - R]])
    v = np.array([[0.0, 0.0, -speed], [0.0, 0.0, speed]])
    scene = SphereScene(
        spheres=Spheres(x=x, v=v, radius=np.full(2, R), mass=np.full(2, M)),
        sphere_sphere=contact,
        cell=Cell(size=(3.0, 3.5, 4.0)),
    )

    def closed_forms(history: History) -> list[ClosedForm]:
        why, bound = "a twentieth: the phase of the impact in the contact step", 0.05
        mend = "each sphere has images one edge of SphereScene.cell away; positions are not put back into the cell"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1], expected=-v, bound=bound * speed, why=why, mend=mend),
            ClosedForm(quantity="x", unit="m", value=history.x[-1], expected=x, bound=bound * free, why=why, mend=mend),
        ]  # fmt: skip

    numerics = Numerics(dt=0.002, n_steps=200, sample_from=200, impact="newton")
    return probe_of_spheres("periodic cell of spheres", scene, numerics, closed_forms)
