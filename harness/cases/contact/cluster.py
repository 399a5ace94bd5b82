"""Unequal disks in contact that swing a little: nothing about a body or a pair is the same for two of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk.scene import NINE_DISK_CD, cd_settings
from ninedisk.references.analytic.contact.cluster import Swing, Touch, cluster_swing

OVERLAP = 1e-6
"""Of every contact at time 0 [m]: 1e-5 of the smallest radius, which is what the linear motion leaves out."""

KN, KS, MU = 1e5, 6e4, 2.0
"""Of contacts between disks [N/m]; friction that lets none of them slide."""

OMEGA = math.sqrt(KN)
"""Of one kilogram on such a contact [rad/s]."""

DURATION, SAMPLES = 0.9 / OMEGA, 10
"""Length of the run [s], in which no contact opens, and samples of it."""

WALL_LAWS = {"floor": (1.5e5, 5e4, 0.2), "left": (8e4, 8e4, 0.05), "right": (2e5, 1e5, 0.3), "lid": (6e4, 3e4, 0.15)}
"""kn, ks [N/m] and damping ratio of each wall."""

FloatRow = tuple[float, ...]


@dataclass(frozen=True)
class Cluster:
    """Centres [m], radii [m], masses [kg], moments of inertia over m R^2, who rotates, walls as (point, normal), dashpot between disks."""

    x: FloatArray
    radius: FloatArray
    mass: FloatArray
    ratio: FloatArray
    rotating: tuple[bool, ...]
    walls: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    beta: float


class UnequalCluster:
    """Disks that touch, with masses, radii, and separate inertias, velocities and spins, on springs that stay closed and stick.

    ``six``: six disks of equal size around one, each touching three, the middle one six. ``many``: nine small disks of unequal size
    around a large one that is 1e4 times heavier. ``box``: three disks between four walls, each of another law; one disk has
    the inertia of a ring, ``blocked`` keeps one from turning. Displacements are so small that the motion is linear.
    """

    id = "contact/cluster"
    version = 1
    title = "Cluster of unequal disks"
    source = "small oscillations of bodies on springs and dashpots: Landau & Lifshitz, Mechanics, sections 23 and 25"
    requirement = "each body moves by its own mass, inertia and radius, each contact by its own law, in all directions"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="arrangement", default="six", choices=("six", "many", "box"), in_id=True,
                  help="six disks around one, nine small ones around a large one, or three between walls"),
        Parameter(name="blocked", default=False, help="whether the first disk of the box cannot turn"),
        Parameter(name="xi", default=0.0, low=0.0, high=1e3, unit="1/s", help="global damping"),
        Parameter(name="steps", default=1000, low=SAMPLES, whole=True, help=f"steps of every engine, a multiple of {SAMPLES}"),
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each arrangement; one disk that cannot turn; global damping of velocities and spins."""
        further: tuple[dict[str, Value], ...] = (
            {"arrangement": "box", "blocked": True},
            {"arrangement": "six", "xi": 200.0},
        )
        return [*({"arrangement": name} for name in ("six", "many", "box")), *further]

    def sticks(self, params: Mapping[str, Any]) -> bool:  # noqa: ARG002
        """No contact slides."""
        return True

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disks, all contacts closed."""
        given = cluster(params["arrangement"], params["blocked"])
        walls = []
        for name, (point, normal) in given.walls.items():
            kn, ks, beta = WALL_LAWS[name]
            walls.append(Wall(name=name, point=point, normal=normal, law=ContactLaw(kn=kn, ks=ks, mu=MU, beta=beta)))
        velocity = start(given)
        scene = Scene(
            disks=Disks(
                x=given.x, v=velocity[:, :2], omega=velocity[:, 2], radius=given.radius, mass=given.mass,
                inertia=given.ratio * given.mass * given.radius**2, rotating=np.array(given.rotating),
            ),
            disk_disk=ContactLaw(kn=KN, ks=KS, mu=MU, beta=given.beta),
            walls=tuple(walls),
            xi=params["xi"],
        )  # fmt: skip
        steps = max(1, params["steps"] // SAMPLES) * SAMPLES
        dt = DURATION / steps
        numerics = Numerics(
            dt=dt, n_steps=steps, contact_dt=dt, sample_every=steps // SAMPLES, **cd_settings(params)
        )  # fmt: skip
        labels = {f"{i}-{_name(scene, j)}": (i, j) for i, j in _pairs(given)}
        return Setup(scene=scene, numerics=numerics, watch=tuple(labels.values()), labels=labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Velocities and spins of all disks, forces of all contacts; ``misfit``: root of the share of the energy that is astray."""
        series: dict[str, tuple[str, FloatArray]] = {}
        for k in range(len(setup.scene.disks)):
            series |= {
                f"vx_{k}": ("m/s", history.v[:, k, 0]),
                f"vy_{k}": ("m/s", history.v[:, k, 1]),
                f"omega_{k}": ("rad/s", history.omega[:, k]),
            }
        for name, pair in setup.labels.items():
            column = history.contact(pair)
            series |= {f"fn_{name}": ("N", history.fn[:, column]), f"fs_{name}": ("N", history.fs[:, column])}
        given = cluster(params["arrangement"], params["blocked"])
        off = np.concatenate([history.v, history.omega[:, :, None]], axis=2) - truth(params, history.t).velocity
        energy = 0.5 * (inertias(given) * off**2).sum(axis=(1, 2))
        scalars = {"misfit": ("1", float(np.sqrt(energy.max() / total_energy(given))))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the motion of all bodies is from that of their springs."""
        return (
            Headline(name="motion of unequal disks", use="impacts", quantity="misfit", expected=0.0, source=self.source, scale=1.0,
                     scale_is="root of the initial energy"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The linear motion. What a step changes of a mode is bounded by the energy; a light body has more of it in its speed."""
        if params["regime"] == "quasi-static":
            return []
        given, exact = cluster(params["arrangement"], params["blocked"]), truth(params, observed.t)
        relative = scheme_error(given, exact, setup.numerics.dt, engine, params["theta"])
        why = f"the scheme's step changes a mode by {relative:.2g} of its amplitude at most; overlap over radius"
        energy = total_energy(given)
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "source": self.source, "why": why}
        found = [
            Check(quantity="misfit", norm="scalar", truth="analytic", expected=0.0, source=self.source, atol=relative, why=why,
                  scale=1.0)
        ]  # fmt: skip
        for k, own in enumerate(inertias(given)):
            for c, name in enumerate((f"vx_{k}", f"vy_{k}", f"omega_{k}")):
                most = math.sqrt(2.0 * energy / own[c])
                found.append(
                    Check(quantity=name, expected=exact.velocity[:, k, c], atol=relative * most, scale=most, **common)
                )
        # A force at time 0 is that of no step yet.
        later = np.where(observed.step > 0, 1.0, np.nan)
        laws = [setup.scene.law(pair) for pair in setup.watch]
        for k, (name, law) in enumerate(zip(setup.labels, laws, strict=True)):
            for kind, force, stiffness in (("fn", exact.fn, law.kn * (1.0 + 2.0 * law.beta)), ("fs", exact.fs, law.ks)):
                most = (
                    math.sqrt(2.0 * energy * law.kn) * stiffness / law.kn
                    if kind == "fn"
                    else math.sqrt(2.0 * energy * stiffness)
                )
                found.append(
                    Check(
                        quantity=f"{kind}_{name}",
                        expected=force[:, k] * later,
                        atol=relative * most,
                        scale=most,
                        **common,
                    )
                )
        return found


@lru_cache(maxsize=8)
def cluster(arrangement: str, blocked: bool = False) -> Cluster:
    """The disks of an arrangement; every contact overlaps by `OVERLAP`."""
    if arrangement == "box":
        radius = np.array([0.5, 0.45, 0.3])
        low = radius - OVERLAP
        first = np.array([low[0], low[0]])
        reach = radius[0] + radius[1] - OVERLAP
        second = np.array([first[0] + math.sqrt(reach**2 - (low[0] - low[1]) ** 2), low[1]])
        x = np.array([first, second, _top_centre(first, second, radius)])
        walls = {
            "floor": ((0.0, 0.0), (0.0, 1.0)),
            "left": ((0.0, 0.0), (1.0, 0.0)),
            "right": ((second[0] + low[1], 0.0), (-1.0, 0.0)),
            "lid": ((0.0, x[2, 1] + low[2]), (0.0, -1.0)),
        }
        return Cluster(
            x, radius, np.array([1.0, 3.0, 0.6]), np.array([0.5, 0.9, 0.7]), (not blocked, True, True), walls, 0.1
        )
    if arrangement == "six":
        radius, angles, beta = np.full(7, 0.5), np.radians(10.0 + 60.0 * np.arange(6)), 0.0
        mass = np.array([1.0, 2.0, 0.7, 3.0, 1.4, 0.5, 2.5])
    else:
        radius, beta = np.array([0.5, 0.11, 0.15, 0.12, 0.2, 0.13, 0.16, 0.1, 0.18, 0.14]), 0.1
        mass = np.array([1e4, 1.0, 3.0, 0.6, 2.0, 1.5, 0.8, 0.4, 1.2, 0.9])
        half = np.arcsin(radius[1:] / (radius[0] + radius[1:]))
        between = (2.0 * math.pi - 2.0 * half.sum()) / len(half)
        angles = 0.2 + np.cumsum(2.0 * half + between) - half
    away = radius[0] + radius[1:] - OVERLAP
    ring = away[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    n = len(radius)
    return Cluster(np.vstack([[0.0, 0.0], ring]), radius, mass, np.full(n, 0.5), (True,) * n, {}, beta)


def _top_centre(a: FloatArray, b: FloatArray, radius: FloatArray) -> FloatArray:
    """Centre of the third disk, which lies upon the two others."""
    one, two = radius[0] + radius[2] - OVERLAP, radius[1] + radius[2] - OVERLAP
    apart = float(np.hypot(*(b - a)))
    along = (b - a) / apart
    part = (one**2 - two**2 + apart**2) / (2.0 * apart)
    return np.asarray(a + part * along + math.sqrt(one**2 - part**2) * np.array([-along[1], along[0]]))


def start(given: Cluster) -> FloatArray:
    """Velocities and spins at time 0, shape (n, 3): random, disks of a ring towards the middle besides."""
    random = np.random.default_rng(3)
    n, speed = len(given.x), OVERLAP * OMEGA
    velocity = np.zeros((n, 3))
    if not given.walls:
        inwards = -given.x[1:] / np.hypot(*given.x[1:].T)[:, None]
        velocity[1:, :2] = random.uniform(0.5, 1.0, n - 1)[:, None] * inwards
    velocity += random.uniform(-0.2, 0.2, (n, 3))
    velocity[:, 2] *= np.where(given.rotating, 1.0, 0.0) / given.radius
    return velocity * speed


def _pairs(given: Cluster) -> list[tuple[int, int]]:
    """All pairs in contact."""
    n = len(given.x)
    found = [(i, j) for i in range(n) for j in range(i + 1, n) if _gap_of_pair(given, i, j) < 0.0]
    return found + [
        (i, n + k) for k in range(len(given.walls)) for i in range(n) if _gap_of_pair(given, i, n + k) < 0.0
    ]


def _gap_of_pair(given: Cluster, i: int, j: int) -> float:
    n = len(given.x)
    if j < n:
        return float(np.hypot(*(given.x[j] - given.x[i])) - given.radius[i] - given.radius[j])
    point, normal = list(given.walls.values())[j - n]
    return float((given.x[i] - np.array(point)) @ np.array(normal) - given.radius[i])


def _name(scene: Scene, body: int) -> str:
    n = len(scene.disks)
    return str(body) if body < n else scene.walls[body - n].name


def inertias(given: Cluster) -> FloatArray:
    """Mass, mass and moment of inertia of each disk, shape (n, 3); infinite where it cannot turn."""
    turning = np.where(given.rotating, given.ratio * given.mass * given.radius**2, np.finfo(np.float64).max)
    return np.column_stack([given.mass, given.mass, turning])


def touches(given: Cluster) -> list[Touch]:
    """The contacts for the closed form."""
    found, n = [], len(given.x)
    for i, j in _pairs(given):
        if j < n:
            nx, ny = (given.x[j] - given.x[i]) / np.hypot(*(given.x[j] - given.x[i]))
            found.append(Touch(i, j, (nx, ny), -_gap_of_pair(given, i, j), KN, KS, given.beta))
        else:
            name = list(given.walls)[j - n]
            nx, ny = given.walls[name][1]
            found.append(Touch(i, -1, (-nx, -ny), -_gap_of_pair(given, i, j), *WALL_LAWS[name]))
    return found


@lru_cache(maxsize=8)
def _swing(arrangement: str, blocked: bool, xi: float, times: FloatRow) -> Swing:
    given = cluster(arrangement, blocked)
    return cluster_swing(
        times,
        velocity=start(given),
        radius=given.radius,
        mass=given.mass,
        inertia=inertias(given)[:, 2],
        touches=touches(given),
        xi=xi,
    )


def truth(params: Mapping[str, Any], t: FloatArray) -> Swing:
    """The linear motion at the samples."""
    return _swing(params["arrangement"], params["blocked"], params["xi"], tuple(np.nan_to_num(t).tolist()))


def total_energy(given: Cluster) -> float:
    """Energy at time 0 [J]."""
    velocity = start(given)
    turning = np.where(np.isfinite(inertias(given)), inertias(given), 0.0)
    kinetic = 0.5 * float((turning * velocity**2).sum())
    return kinetic + sum(0.5 * touch.kn * touch.overlap**2 for touch in touches(given))


def scheme_error(given: Cluster, exact: Swing, dt: float, engine: EngineInfo, theta: float) -> float:
    """What steps ``dt`` change of a mode's amplitude, over it.

    By `ninedisk.harness.cases.contact.moving_wall`: central differences turn a mode by ``(omega dt)^2/24`` per radian, others lose or
    gain ``omega dt/2`` per radian; a velocity half a step early changes a dashpot's part by ``2 beta omega dt``. Four largest overlaps
    over the smallest radius are for normals and lever arms that turn and shrink.
    """
    phase = exact.fastest * dt
    radians = exact.fastest * DURATION
    beta = max(touch.beta for touch in touches(given))
    central = engine.scheme == "central-difference"
    per_radian = phase**2 / 24.0 if central else 0.5 * phase * (max(theta, 0.5) if engine.scheme == "theta" else 1.0)
    offset = phase**2 if central else phase
    rest = 4.0 * 2.0 * OVERLAP / float(given.radius.min())
    return per_radian * radians + offset + 2.0 * beta * phase * radians + rest


CASE = UnequalCluster()
