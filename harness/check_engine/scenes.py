"""Scenes of probes that need no springs: a disk in the air, and a disk at rest or sliding on a floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.check_engine.claims import Claim, Probe, contact_error, round_off
from ninedisk.references.analytic.spring_dashpot import beta_of_restitution, contact_duration

R, M, KN, G = 0.5, 2.0, 1e6, 9.81
"""Radius [m], mass [kg], stiffness [N/m] and gravity [m/s^2]: no two alike, so that one in place of another shows."""

FLOOR = (0, 1)
"""The contact of a single disk with a single wall."""


def has_springs(info: EngineInfo) -> bool:
    """Whether contacts of the engine follow the scene's kn; else its contacts are rigid, and kn only regularises them."""
    return Capability.LINEAR_CONTACT in info.capabilities


def some_disks(**state: Any) -> Disks:
    """Disks of the probes' radius and mass, in a state; `Disks` takes lists as well as arrays."""
    return Disks(**{"radius": R, "mass": M, **state})


def law(info: EngineInfo, **changes: Any) -> ContactLaw:
    """The contact law of a probe in the engine's own kind of contact."""
    rigid = {} if has_springs(info) else {"regularised": True, "restitution": 0.0}
    values: dict[str, Any] = {"kn": KN, "ks": KN, **rigid, **changes}
    return ContactLaw(**values)


def on_floor(
    contact: ContactLaw,
    *,
    overlap: float = 0.0,
    gravity: tuple[float, float] = (0.0, -G),
    motion: Sequence[WallSegment] = (),
    x: float = 0.0,
    **disk: Any,
) -> Scene:
    """One disk above a floor through the origin; ``disk`` goes to `Disks`."""
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact, motion=tuple(motion))
    moved = some_disks(x=[[x, R - overlap]], **disk)
    return Scene(disks=moved, disk_disk=contact, walls=(floor,), gravity=gravity)


def resting_overlap(info: EngineInfo, mass: float = M, kn: float = KN) -> float:
    """Overlap at which springs carry a disk [m]; 0 for rigid contacts."""
    return mass * G / kn if has_springs(info) else 0.0


def free_flight(info: EngineInfo, **sampling: int) -> Probe:
    """A disk without forces: the state it was given, moved on. ``sampling`` goes to `Numerics`."""
    v, omega = np.array([1.5, -0.7]), 2.0
    moved = some_disks(x=[[0.3, 0.4]], v=[v], omega=[omega])
    scene = Scene(disks=moved, disk_disk=law(info))
    numerics = Numerics(dt=0.01, n_steps=17).replace(**sampling)
    eps = round_off(info)

    def claims(history: History) -> list[Claim]:
        t = numerics.sampled_steps() * numerics.dt
        why = "round-off: nothing acts"
        mend = "report positions in m, angles in rad, and the state at the sampled step itself"

        def claim(quantity: str, unit: str, value: ArrayLike, expected: ArrayLike, *, observed: bool = True) -> Claim:
            return Claim(
                quantity=quantity,
                unit=unit,
                value=value,
                expected=expected,
                bound=10 * eps,
                why=why,
                mend=mend,
                observed=observed,
            )

        return [
            claim("x", "m", history.x[:, 0], [0.3, 0.4] + t[:, None] * v),
            claim("v", "m/s", history.v[:, 0], np.tile(v, (len(t), 1))),
            claim("angle", "rad", history.angle[:, 0], omega * t, observed=False),
            claim("omega", "rad/s", history.omega[:, 0], np.full(len(t), omega), observed=False),
        ]

    return Probe(name="free flight", setup=Setup(scene=scene, numerics=numerics, watch=()), claims=claims)


def fall(info: EngineInfo) -> Probe:
    """A disk in a field that is no multiple of an axis: v to round-off, x to the first order of every scheme."""
    g = np.array([3.0, -G])
    moved = some_disks(x=[[0.0, 0.0]], v=[[0.2, 1.0]])
    scene = Scene(disks=moved, disk_disk=law(info), gravity=(3.0, -G))
    numerics = Numerics(dt=0.005, n_steps=40)

    def claims(history: History) -> list[Claim]:
        t = (numerics.sampled_steps() * numerics.dt)[:, None]
        lag = 0.5 * G * float(t[-1, 0]) * numerics.dt * (1.0 + 1e-6) + round_off(info)
        mend = "apply Scene.gravity as an acceleration [m/s^2] to both components, once a step"
        return [
            Claim(quantity="v", unit="m/s", value=history.v[:, 0], expected=[0.2, 1.0] + g * t, bound=10 * round_off(info),
                  why="a constant acceleration is exact in v", mend=mend),
            Claim(quantity="x", unit="m", value=history.x[:, 0], expected=[0.2, 1.0] * t + 0.5 * g * t**2, bound=lag,
                  why="g t dt/2: half a step's lag of first-order schemes", mend=mend),
        ]  # fmt: skip

    return Probe(name="fall", setup=Setup(scene=scene, numerics=numerics, watch=()), claims=claims)


def weights(info: EngineInfo) -> Probe:
    """Two disks of unlike mass at rest on a floor, watched in an order of their own: each contact carries its own weight."""
    masses = np.array([1.0, 3.0])
    overlap = np.array([resting_overlap(info, mass) for mass in masses])
    contact = law(info)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    moved = some_disks(x=[[0.0, R - overlap[0]], [3.0, R - overlap[1]]], mass=masses)
    scene = Scene(disks=moved, disk_disk=contact, walls=(floor,), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20, sample_from=20)
    allowed, weight = contact_error(info), masses * G

    def claims(history: History) -> list[Claim]:
        fn, gap = history.fn[-1], history.gap[-1]
        sunk = [-overlap[1], -overlap[0], 3.0 - 2.0 * R]
        why = "equilibrium: round-off and the solver's tolerance"
        slack = 1e-9 if has_springs(info) else max(1e-3, allowed) * R
        return [
            Claim(quantity="fn of the pairs (1, 2), (0, 2), (0, 1)", unit="N", value=fn, expected=[weight[1], weight[0], 0.0],
                  bound=float(allowed * weight.max()), why=why,
                  mend="give columns in the order of `watch`, forces in N (impulses divided by dt), compression positive, open contacts 0"),
            Claim(quantity="gap of the same pairs", unit="m", value=gap, expected=sunk, bound=slack,
                  why="kn gap = weight" if has_springs(info) else "rigid disks may sink by a thousandth of their radius",
                  mend="gaps are positive where open, negative where bodies overlap: centre distance less radii"),
            Claim(quantity="force on the floor", unit="N", value=history.wall_force[-1, 0], expected=[0.0, -float(weight.sum())],
                  bound=float(allowed * weight.sum()), why=why,
                  mend="wall_force is the force of the disks ON the wall, summed over them", observed=False),
        ]  # fmt: skip

    watch = ((1, 2), (0, 2), (0, 1))
    return Probe(name="weights", setup=Setup(scene=scene, numerics=numerics, watch=watch), claims=claims)


def sliding(info: EngineInfo, *, rotating: bool) -> Probe:
    """A disk thrown along a floor: it slows by mu g and, where it can turn, spins up by 2 mu g/R."""
    mu, speed = 0.1, 1.0
    numerics = Numerics(dt=0.002, n_steps=50, sliding="coulomb")
    scene = on_floor(law(info, mu=mu), overlap=resting_overlap(info), v=[[speed, 0.0]], rotating=rotating)
    end = numerics.dt * numerics.n_steps
    slow = mu * G * numerics.dt + contact_error(info) * mu * G * end

    def claims(history: History) -> list[Claim]:
        spin = -2.0 * mu * G * end / R if rotating else 0.0
        why = "friction may act one step less, in the first"
        return [
            Claim(quantity="v along the floor", unit="m/s", value=history.v[-1, 0, 0], expected=speed - mu * G * end, bound=slow, why=why,
                  mend="friction on a sliding disk is mu fn against its slip"),
            Claim(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=spin, bound=2.0 * slow / R, why=why,
                  mend="a disk's inertia is that of Disks.inertia; a blocked disk keeps its spin; counter-clockwise is positive"),
            Claim(quantity="mean fs", unit="N", value=np.mean(history.fs[1:, 0]), expected=-mu * M * G, bound=slow / end * M,
                  why=why, observed=False,
                  mend="the shear force on the first body counts along t = (-n_y, n_x), n from the first body to the second"),
        ]  # fmt: skip

    name = "sliding" if rotating else "sliding without rotation"
    return Probe(name=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def rebound(info: EngineInfo) -> Probe:
    """A disk that touches a floor at 2 m/s, faster than any engine's threshold of rebounds, and leaves at half of it.

    The springs and dashpots that stand for such a contact give the same restitution.
    """
    e, speed = 0.5, 2.0
    beta = beta_of_restitution(e)
    scene = on_floor(
        ContactLaw(kn=KN, beta=beta, regularised=True, restitution=e), gravity=(0.0, 0.0), v=[[0.0, -speed]]
    )
    count = 2 + math.ceil(contact_duration(kn=KN, m_eff=M, beta=beta) / 0.001)
    numerics = Numerics(dt=0.001, contact_dt=5e-6, n_steps=count, impact="newton")
    bound, why = (
        (0.01, "first order in contact_dt: omega t omega contact_dt")
        if has_springs(info)
        else (contact_error(info), "the solver's tolerance")
    )

    def claims(history: History) -> list[Claim]:
        return [
            Claim(quantity="v after the impact", unit="m/s", value=history.v[-1, 0, 1], expected=e * speed, bound=bound * speed, why=why,
                  mend="the relative normal velocity after an impact is -restitution times that before"),
        ]  # fmt: skip

    return Probe(name="rebound", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def damped(info: EngineInfo, form: str) -> Probe:
    """A disk in a viscous medium: v0 exp(-xi t), its discrete form where the engine's scheme has one."""
    xi, speed = 2.0, 1.0
    scene = Scene(disks=some_disks(x=[[0.0, 0.0]], v=[[speed, 0.0]]), disk_disk=law(info), xi=xi)
    numerics = Numerics(
        dt=0.01,
        contact_dt=0.01,
        n_steps=50,
        sample_from=50,
        theta=0.5,
        damping_form="central" if form == "central" else "lagged",
    )
    step, count = xi * numerics.dt, numerics.n_steps
    second = speed * step * count * step**2

    def claims(history: History) -> list[Claim]:
        if form == "central":
            expected, bound, why = speed * math.exp(-step * count), second, "second order: xi t (xi dt)^2"
        elif info.scheme == "central-difference":
            expected, bound = speed * (1.0 - 0.5 * step) ** 2 * (1.0 - step) ** (count - 1), second
            why = "the exact steps of v(n+1/2) = (1 - xi dt) v(n-1/2), to second order in the start"
        else:
            expected, bound, why = (
                speed * math.exp(-step * count),
                speed * step * count * step,
                "first order: xi t xi dt",
            )
        mend = "global damping is the force -xi m v (and the moment -xi I omega); see Numerics.damping_form for the velocity that it sees"
        return [
            Claim(
                quantity="v", unit="m/s", value=history.v[-1, 0, 0], expected=expected, bound=bound, why=why, mend=mend
            )
        ]

    return Probe(name=f"damping, {form}", setup=Setup(scene=scene, numerics=numerics, watch=()), claims=claims)
