"""A sphere on a ring of others on a plane: the forces with which it stands, and how it comes down where friction is too small."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    contact_softness,
    contact_step,
    last,
    single,
    single_precision,
    slack_time,
    soft_reason,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.assembly.sphere_ring import RingForces, ring_angle, ring_forces, top_displacement

RADIUS, MASS, G = 0.5, 2.0, 10.0
KN, KS_OVER_KN, BETA = 1e7, 0.8, 0.3
LEGS = {"tetrahedron": 3, "pyramid": 4}
SPREAD = 1.1
"""Distance of neighbours in the ring, in diameters: they do not touch."""

TURN = 0.3
"""Of the ring about the vertical [rad]: no leg lies on an axis."""

PHASE = 0.1
"""Of the fastest swing of a leg, which has two contacts with both springs, omega dt."""

FASTEST = math.sqrt(2.0 * KN * (1.0 + KS_OVER_KN * 3.5) / MASS)
"""More than the fastest swing of a leg [rad/s]."""

LAST = 0.2
"""Share of the run, at its end, over which forces are averaged."""


class Stack:
    """``share`` of the friction coefficient at which the heap stands: above 1 it stands, below the top slides down between rolling legs.

    A sphere of the ring has friction at two places, whose moments balance: it stands if mu >= tan(angle/2), angle that of the lines of
    centres to the vertical. What a tetrahedron's contacts bear follows from equilibrium alone; a pyramid's legs may bear unlike loads two
    by two, and their mean is judged.
    """

    id = "spheres/stack"
    version = 1
    title = "Tetrahedron and pyramid of spheres"
    source = "statics and dynamics of rigid spheres with Coulomb friction"
    requirement = (
        "each leg bears W/n along the line of centres and W/n tan(angle/2) across, at the plane as much and its own weight; with less "
        "friction than tan(angle/2) the heap comes down as Newton and Euler say"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="heap", default="tetrahedron", choices=tuple(LEGS), in_id=True, help="three or four spheres bear one"),
        Parameter(name="share", default=1.2, low=0.0, high=100.0, unit="-", in_id=True,
                  help="friction coefficient over the least one with which the heap stands"),
        Parameter.positive("dt", 2e-3, high=1e-2, unit="s", help="step; sampling of spring engines"),
        Parameter(name="duration", default=0.25, low=0.05, high=10.0, unit="s", help="length of the run"),
        CONTACT_DT,
    )  # fmt: skip
    figures = (
        Figure(
            title="What a leg bears",
            quantities=(
                Plotted("top_n", "normal force at the top"), Plotted("top_s", "friction at the top"),
                Plotted("floor_n", "normal force at the plane"), Plotted("floor_s", "friction at the plane"),
            ),
            compare="heap",
            where={"share": (1.2,)},
            shows="Forces of a leg, the mean over the legs, from the release on.",
            allows="Statics determine all four; springs swing about them until their dashpots have taken the energy of the release.",
        ),
        Figure(
            title="How far the top comes down",
            quantities=(Plotted("down", "displacement of the top"),),
            compare="share",
            shows="Way of the top with a fifth more friction than the heap needs to stand, and with a fifth less.",
            allows="Between both lies tan(angle/2). An engine that creeps comes down with enough friction, too.",
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both heaps with a fifth more friction than they need; the tetrahedron with a fifth less."""
        return [{"heap": "tetrahedron"}, {"heap": "pyramid"}, {"heap": "tetrahedron", "share": 0.8}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Springs begin with the overlaps of the normal forces of statics, and without shear."""
        n, angle, forces = _statics(params)
        mu = params["share"] * forces.top_mu
        law = SphereLaw(kn=KN, ks=KS_OVER_KN * KN, mu=mu, beta=BETA, restitution=0.0, regularised=True)
        apart, low = 2.0 * RADIUS - forces.top_n / KN, RADIUS - forces.floor_n / KN
        legs = np.column_stack([apart * math.sin(angle) * _leg_directions(n)[:, :2], np.full(n, low)])
        x = np.vstack([legs, [0.0, 0.0, low + apart * math.cos(angle)]])
        scene = SphereScene(
            spheres=Spheres(x=x, radius=np.full(n + 1, RADIUS), mass=np.full(n + 1, MASS)),
            sphere_sphere=law,
            walls=(PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law),),
            gravity=(0.0, 0.0, -G),
        )
        dt = params["dt"]
        own = contact_step(dt, PHASE / FASTEST) if params["contact_dt"] is None else params["contact_dt"]
        numerics = Numerics(
            dt=dt,
            n_steps=max(1, math.ceil(params["duration"] / dt * (1.0 - 1e-12))),
            contact_dt=own,
            sample_every=5,
            impact="newton",
            sliding="coulomb",
        )
        tops, feet = [(k, n) for k in range(n)], [(k, n + 1) for k in range(n)]
        return SphereSetup(
            scene=scene, numerics=numerics, watch=(*tops, *feet), labels={"top": tops[0], "plane": feet[0]}
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Forces of the mean leg, how unlike the legs are, way of the top, and what leaves the axis."""
        n = len(setup.scene.spheres) - 1
        x = history.x
        up = x[:, n, None] - x[:, :n]
        up = up / np.linalg.norm(up, axis=2)[:, :, None]
        out = np.array(up)
        out[:, :, 2] = 0.0
        out = -out / np.linalg.norm(out, axis=2)[:, :, None]
        along = np.cross(np.cross(out, up), up)  # in the plane of both, at right angles to the line of centres
        along *= (np.sign(along[:, :, 2]) / np.linalg.norm(along, axis=2))[:, :, None]
        forces = {
            "top_n": history.fn[:, :n],
            "top_s": -np.einsum("snd,snd->sn", history.fs[:, :n], along),
            "floor_n": history.fn[:, n:],
            "floor_s": -np.einsum("snd,snd->sn", history.fs[:, n:], out),
        }
        series = {name: ("N", each.mean(axis=1)) for name, each in forces.items()}
        series["down"] = ("m", x[0, n, 2] - x[:, n, 2])
        series["aside"] = ("m", np.hypot(x[:, n, 0], x[:, n, 1]))
        late = history.t >= (1.0 - LAST) * history.t[-1]
        scalars = {f"{name}_mean": ("N", float(each[late].mean())) for name, each in forces.items()}
        scalars["unlike"] = ("N", float(np.ptp(forces["top_n"][late].mean(axis=0))))
        scalars["down_final"] = ("m", last(series["down"][1]))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Friction at the top where the heap stands; how far it comes down."""
        _, _, forces = _statics(params)
        stands = params["share"] >= 1.0
        return (
            Headline(name="friction in a heap", use="rest", quantity="top_s_mean", expected=forces.top_s if stands else math.nan,
                     source="statics", scale=MASS * G, scale_is="weight of a sphere"),
            Headline(name="displacement of the top of a heap", use="rest", quantity="down_final",
                     expected=float(_top_displacement(params, observed.t)[-1]), source="Newton and Euler for rigid spheres", scale=RADIUS,
                     scale_is="radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Forces of a heap that stands; the displacement of the top; the axis."""
        n, angle, forces = _statics(params)
        down, t_end = _top_displacement(params, observed.t), float(observed.t[-1])

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            path, share, why = _allowance(params, setup, engine, down, t_end)
            rows: list[tuple[str, float]] = []
            if params["share"] >= 1.0:
                rows = [(f"{name}_mean", getattr(forces, name)) for name in ("top_n", "top_s", "floor_n", "floor_s")]
                rows += [("unlike", 0.0)] if n == 3 or engine.contact == "spring" else []
            # Friction that fades, or of a contact that opens now and then, lies between none and all.
            least = float(_top_displacement(params, observed.t, stronger=0.0)[-1] - down[-1])
            known = None
            if Difference.FRICTION_LAGS in engine.differences and least:
                known = KnownDifference(
                    finding=f"{engine.id}/friction-of-a-heap-fades",
                    size=path + least,
                    why="a heap without any friction comes down by that much more",
                )
            if follows_associated_rule(engine, setup.numerics):
                path += least
            lean = path
            if Difference.FRICTION_PYRAMID in engine.differences:
                # At rest its axes are any: up to 1.41 times as strong on any leg. The top comes down by less, and leans about a leg that
                # holds.
                stronger = float(down[-1] - _top_displacement(params, observed.t, stronger=math.sqrt(2.0))[-1])
                path, lean = path + stronger, lean + stronger / math.tan(angle)
                why += "; friction up to 1.41 times as strong"
            return [
                *(
                    Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source="statics", scale=MASS * G,
                          atol=share * MASS * G, why=why)
                    for name, expected in rows
                ),
                Check(quantity="down", norm="max", truth="analytic", expected=down, source=self.source, atol=path, scale=RADIUS, why=why,
                      known=known),
                Check(quantity="aside", norm="max", truth="analytic", expected=np.zeros_like(down), source="symmetry of the ring",
                      atol=lean, scale=RADIUS, why=why),
            ]  # fmt: skip

        pyramid = Difference.FRICTION_PYRAMID
        return checks_with_allowance(pyramid if pyramid in engine.differences else LIFTS, setup, engine, found)


def _leg_directions(n: int) -> FloatArray:
    """From the axis to each leg, shape (n, 3)."""
    turn = TURN + 2.0 * math.pi * np.arange(n) / n
    return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])


def _statics(params: Mapping[str, Any]) -> tuple[int, float, RingForces]:
    n = LEGS[params["heap"]]
    angle = ring_angle(n=n, spread=SPREAD)
    return n, angle, ring_forces(n=n, angle=angle, top=MASS * G, each=MASS * G)


def _top_displacement(params: Mapping[str, Any], t: FloatArray, *, stronger: float = 1.0) -> FloatArray:
    """Way of the top [m] with friction that is by this factor stronger."""
    n, angle, forces = _statics(params)
    if params["share"] >= 1.0 or stronger * params["share"] >= 1.0:
        return np.zeros_like(t)
    mu = stronger * params["share"] * forces.top_mu
    return top_displacement(t, n=n, angle=angle, mu=mu, top=MASS * G, each=MASS * G, radius=RADIUS, g=G)


class _Swings(NamedTuple):
    """Of a heap on springs that sticks and stays symmetric: how far it moves until friction is there [m], the largest speed of that
    [m/s], and the rate at which the slowest swing decays [1/s]."""

    path: float
    speed: float
    decay: float


def _swings(params: Mapping[str, Any]) -> _Swings:
    """Linear swings of a leg and its share of the top: height of the top, distance from the axis, height of the leg, turn times R.

    Rows of ``b`` are what the two overlaps and the two slips change by. The heap is released without shear forces, away from its rest by q,
    what they lack over the stiffness K; the energy ``q K q/2`` of that bounds each coordinate and each velocity ever after. Dashpots act
    along the normals alone, through whatever a swing moves there.
    """
    n, angle, forces = _statics(params)
    s, c = math.sin(angle), math.cos(angle)
    b = np.array([[-c, -s, c, 0.0], [0.0, 0.0, -1.0, 0.0], [-s, c, s, 1.0], [0.0, 1.0, 0.0, -1.0]])
    mass = np.array([MASS / n, MASS, MASS, 0.4 * MASS])
    stiff = b.T @ np.diag([KN, KN, KS_OVER_KN * KN, KS_OVER_KN * KN]) @ b
    damp = b[:2].T @ np.diag([2.0 * BETA * math.sqrt(0.5 * MASS * KN), 2.0 * BETA * math.sqrt(MASS * KN)]) @ b[:2]
    inverse = np.linalg.inv(stiff)
    moved = inverse @ b[2:].T @ np.array([forces.top_s, forces.floor_s])
    energy = float(moved @ stiff @ moved)
    path = float((np.abs(moved) + np.sqrt(np.diag(inverse) * energy)).max())
    system = np.block([[np.zeros((4, 4)), np.eye(4)], [-stiff / mass[:, None], -damp / mass[:, None]]])
    return _Swings(path, float(np.sqrt(energy / mass).max()), -float(np.linalg.eigvals(system).real.max()))


def _allowance(
    params: Mapping[str, Any], setup: SphereSetup, engine: EngineInfo, down: FloatArray, t_end: float
) -> tuple[float, float, str]:
    """What a place [m] and forces, over the weight of a sphere, may be off by, and why."""
    numerics, falls = setup.numerics, params["share"] < 1.0
    rough = 1e-9 + single(engine, 1.0, numerics.n_steps)
    if engine.contact == "spring":
        swings, overlap = _swings(params), MASS * G / KN / RADIUS
        left = 2.0 * math.exp(-swings.decay * (1.0 - LAST) * t_end)
        path = swings.path + (swings.speed * t_end + 8.0 * overlap * float(down[-1]) if falls else 0.0)
        return path + rough, 4.0 * overlap + left + rough, (
            f"shear springs begin unloaded and come up over {swings.path:.2g} m, {swings.speed:.2g} m/s; overlaps of {overlap:.2g} radii; "
            f"swings of which {left:.2g} is left"
        )  # fmt: skip
    dt, pull = numerics.dt, 2.0 * float(down[-1]) / t_end**2
    # First order: velocities are those of an angle that is a step old, places are summed from one end of each step.
    path = G * slack_time(engine, dt) * t_end + 2.0 * MASS * G / KN + rough + 2.0 * pull * dt * t_end
    path += contact_softness(engine) * (float(down[-1]) + RADIUS * MASS * G / KN)
    why = (
        "overlaps that the scene begins with; first order of the steps" + soft_reason(engine) + single_precision(engine)
    )
    if engine.contact == "impulse":
        rough += 0.25 * single(engine, RADIUS, 8) / (G * dt**2)  # a step takes out what a height, a unit off, parts
    # Overlaps turn the lines of centres by their share of a radius.
    return path, 4.0 * (contact_softness(engine) + MASS * G / KN / RADIUS) + rough, why


CASE = Stack()
