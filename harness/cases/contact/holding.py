"""Contacts that hold what lies, slides or hangs at them: by adhesion, by friction under cohesion, by friction alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import CONTACT_DYNAMICS, single, single_precision

MASS, RADIUS, GRAVITY, SPEED = 2.0, 1.0, 10.0, 1.0
"""Of each disk [kg], [m]; gravity [m/s^2]; speed of what slides at time 0 [m/s]."""

PYRAMIDS = ("pyramid", "rough-pyramid")
# A pyramid can rest from mu = 0.473 on, by a linear program of its equilibrium: rigid contacts are held to that. Springs that are loaded
# at once slip first and then keep rolling apart at 0.6; an independent program finds the same 0.1743 mm after 0.02 s. From 0.8 on they
# come to rest.
MU = {"adhesion": 0.5, "cohesion": 0.3, "pyramid": 0.6, "rough-pyramid": 1.0, "row": 0.3}
PULL, NEAR = 50.0, 5e-3
"""Adhesion, of which mu times is 5/4 of a disk's weight [N]; gap of a disk that falls beside the wall [m]."""

KN, SHARE = 1e6, 0.4
"""Stiffness of springs [N/m], cohesion over it."""

LAYERS, ROW = 4, 16
SWEEPS = 220
"""Most sweeps of Gauss-Seidel in a row: it would need some thousand, so that forces have to be found otherwise."""
DT = {"adhesion": 0.01, "cohesion": 1e-4, "pyramid": 0.01, "rough-pyramid": 0.01, "row": 0.01}
STEPS = {"adhesion": 40, "cohesion": 1500, "pyramid": 20, "rough-pyramid": 20, "row": 10}


class Holding:
    """Disks that cannot turn at a wall that attracts, on a cohesive floor, or pushed in a row; disks that can in a pyramid."""

    id = "contact/holding"
    version = 1
    title = "Adhesion, cohesion and friction at work"
    source = "Coulomb's law of fn + adhesion, of fn + cohesion overlap; a pyramid of enough friction rests, a row is pushed by n mu m g"
    requirement = (
        "a closed contact takes its pull and an open one attracts nothing; friction sees the repulsive part of the force; "
        "what can rest rests"
    )
    beside_headlines = tuple(
        (name, "of what rigid contacts hold and springs may not there is no displacement that is true for both")
        for name in ("fallen", "gap", "moved", "sunk")
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="cohesion", choices=tuple(MU), in_id=True, help="what holds"),
        *(replace(each, default="coulomb") if each.name == "sliding" else each for each in CONTACT_DYNAMICS),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """All kinds."""
        return [{"kind": kind} for kind in ("cohesion", "adhesion", "pyramid", "rough-pyramid", "row")]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """In equilibrium from time 0, but for the shear spring of the disk that slides."""
        kind = params["kind"]
        rigid = ContactLaw(kn=1e8, ks=1e8, mu=MU[kind], beta=1.0, restitution=0.0, regularised=True)
        if kind == "adhesion":
            law = replace(rigid, beta=0.0, adhesion=PULL)
            wall = Wall(name="wall", point=(0.0, 0.0), normal=(1.0, 0.0), law=law)
            disks = Disks(x=[[RADIUS, 0.0], [RADIUS + NEAR, 4.0 * RADIUS]], radius=RADIUS, mass=MASS, rotating=False)  # type: ignore[arg-type]
            walls: tuple[Wall, ...] = (wall,)
        elif kind == "row":
            law, along = replace(rigid, mu=0.0), (WallSegment(velocity=(SPEED, 0.0)),)
            floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid)
            walls = (Wall(name="push", point=(0.0, 0.0), normal=(1.0, 0.0), law=law, motion=along), floor)
            x = [[(2.0 * i + 1.0) * RADIUS, RADIUS] for i in range(ROW)]
            disks = Disks(x=x, v=[[SPEED, 0.0]] * ROW, radius=RADIUS, mass=MASS, rotating=False)  # type: ignore[arg-type]
        else:
            law = rigid
            if kind == "cohesion":
                law = ContactLaw(kn=KN, ks=KN, mu=MU[kind], cohesion=SHARE * KN)
            wall = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
            x, v = [[0.0, RADIUS - MASS * GRAVITY / (KN * (1.0 - SHARE))]], [[SPEED, 0.0]]
            if kind in PYRAMIDS:
                x = [
                    [(2.0 * i + j) * RADIUS, (1.0 + j * math.sqrt(3.0)) * RADIUS]
                    for j in range(LAYERS)
                    for i in range(LAYERS - j)
                ]
                v = [[0.0, 0.0]] * len(x)
            disks = Disks(x=x, v=v, radius=RADIUS, mass=MASS, rotating=kind in PYRAMIDS)  # type: ignore[arg-type]
            walls = (wall,)
        dt, every, budget = DT[kind], max(1, STEPS[kind] // 50), kind in (*PYRAMIDS, "row")
        numerics = Numerics(
            dt=dt, n_steps=STEPS[kind], contact_dt=dt if kind == "cohesion" else None, sample_every=every, energy_budget=budget,
            impact=params["impact"], sliding=params["sliding"], solver=params["solver"],
            options={"cd.max_iterations": SWEEPS} if kind == "row" else {},
        )  # fmt: skip
        scene = Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY))
        held = (0, len(disks))
        return Setup(scene=scene, numerics=numerics, watch=(held,), labels={"held": held})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """How far the disks are from where they should be, forces of the first one at its wall."""
        moved = history.x - setup.scene.disks.x
        series = {"fn": ("N", history.fn[:, 0]), "fs": ("N", np.abs(history.fs[:, 0]))}
        if params["kind"] == "cohesion":
            series |= {"slid": ("m", moved[:, 0, 0]), "speed": ("m/s", history.v[:, 0, 0])}
        else:
            series["moved"] = ("m", np.abs(moved[:, 0]).max(axis=1))
            if params["kind"] == "adhesion":
                series |= {"gap": ("m", moved[:, 1, 0] + NEAR), "fallen": ("m", -moved[:, 1, 1])}
            else:
                steady = SPEED * history.t[:, None, None] * np.array([params["kind"] == "row", 0.0])
                series["moved"] = ("m", np.abs(moved - steady).max(axis=(1, 2)))
        if params["kind"] == "pyramid":
            with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 at time 0, or a rounded place over it
                series["sunk"] = ("-", -moved[:, :, 1].mean(axis=1) / (0.5 * GRAVITY * history.t**2))
        last = {name: values[-1] for name, (_, values) in series.items()}
        name = "slid" if params["kind"] == "cohesion" else "moved"
        return Observed(
            step=history.step, t=history.t, series=series, scalars={f"{name}_end": ("m", float(last[name]))}
        )

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """How far it has slid, or moved where it should rest."""
        if params["kind"] == "cohesion":
            end = float(_slide(observed.t)[0][-1])
            return (
                Headline(name="displacement of what holds", use="rest", quantity="slid_end", expected=end, source=self.source,
                         scale=end, scale_is="distance slid"),
            )  # fmt: skip
        expected = math.nan if params["kind"] == "pyramid" else 0.0  # see MU
        return (
            Headline(name="displacement of what holds", use="rest", quantity="moved_end", expected=expected, source=self.source,
                     scale=_fall(setup), scale_is="free fall in the time of the run"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Rest and free fall to the solver's tolerance; sliding to what the shear spring takes until it slides, and the step."""
        t, kind, zero = observed.t, params["kind"], np.zeros(len(observed.t))
        rounded = _Rounded.of(kind, setup, engine)
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "source": self.source}
        started = t > 0.0
        if kind == "cohesion":
            slid, speed = _slide(t)
            slows = _deceleration()
            # The spring reaches the cap after cap/ks at nearly SPEED; until then friction is less, and an implicit force a step late.
            late = MASS * slows / KN / SPEED + 2.0 * setup.numerics.dt
            why = f"shear spring and step: friction is in full {late:.2g} s late at most"
            cap = MASS * slows
            pressed = np.where(started, MASS * GRAVITY, np.nan)
            return [
                Check(quantity="slid", expected=slid, atol=slows * late * float(t[-1]), why=why, scale=float(slid[-1]), **common),
                Check(quantity="speed", expected=speed, atol=slows * late, why=why, scale=SPEED, **common),
                Check(quantity="fs", expected=np.where(t > late, cap, np.nan), atol=1e-6 * cap,
                      why="the cap of a normal force in equilibrium: round-off and the solver's tolerance", scale=cap, **common),
                Check(quantity="fn", expected=pressed, atol=1e-6 * MASS * GRAVITY,
                      why="equilibrium of the overlap at the start: round-off and the solver's tolerance", scale=MASS * GRAVITY, **common),
            ]  # fmt: skip
        weight = MASS * GRAVITY
        solved = "solver's tolerance 1e-12 of the forces, added up over the steps" + single_precision(engine)
        sinks, why = 1e-9 * _fall(setup) + rounded.place, solved
        if engine.contact == "spring":
            if kind == "pyramid":
                why = (
                    "the centre of mass sinks (energy), but no faster than in free fall (momentum): 0 to 1 at any time"
                )
                between = np.where(started, 0.5, np.nan)
                return [Check(quantity="sunk", expected=between, atol=0.5, why=why, scale=1.0, **common)]
            # Springs in series, each under no more than all that presses; loaded at once they swing to twice their rest.
            series, load = (LAYERS, 1.0) if kind in PYRAMIDS else (ROW, MU["row"])
            sinks = 2.0 * series * load * len(setup.scene.disks) * weight / setup.scene.disk_disk.kn
            why = f"contact springs loaded at once, {series} in series, each by no more than all disks"
        if rounded.decides:
            why += "; no truth in single precision: rounding alone decides what holds"
        moved = Check(
            quantity="moved",
            expected=np.where(rounded.decides, np.nan, zero),
            atol=sinks,
            why=why,
            scale=_fall(setup),
            **common,
        )
        if kind in PYRAMIDS:
            return [moved]
        if kind == "row":
            pushed = ROW * MU["row"] * weight
            if engine.contact == "spring":
                return [moved]
            push = np.where(started, pushed, np.nan)
            return [
                moved,
                Check(
                    quantity="fn", expected=push, atol=1e-9 * pushed + rounded.force, why=solved, scale=pushed, **common
                ),
            ]
        dt, n = setup.numerics.dt, np.rint(t / setup.numerics.dt)
        # Positions of the theta scheme under constant acceleration.
        fallen = GRAVITY * dt**2 * (0.5 * n * n + n * (setup.numerics.theta - 0.5))
        force = 1e-9 * weight + rounded.force
        return [
            moved,
            Check(quantity="fs", expected=np.where(started, weight, np.nan), atol=force, why=solved, scale=weight, **common),
            Check(quantity="fn", expected=np.where(started, 0.0, np.nan), atol=force, why=solved, scale=weight, **common),
            Check(quantity="gap", expected=zero + NEAR, atol=1e-12 + rounded.place, why="nothing acts across the wall: round-off",
                  scale=NEAR, **common),
            Check(quantity="fallen", expected=fallen, atol=1e-11 + rounded.place, why="free fall in the scheme: round-off",
                  scale=_fall(setup), **common),
        ]  # fmt: skip


class _Rounded(NamedTuple):
    """What single precision does to what holds; nothing where an engine computes in double precision.

    Attributes
    ----------
    place, force : float
        Errors of a place [m], and of a force that is found from speeds [N].
    decides : bool
        Whether rounding alone decides what holds: stiff springs whose overlaps it changes by more than the weight does, and the pyramid
        of rigid contacts that may rest or slip, since Coulomb's law allows both.
    """

    place: float
    force: float
    decides: bool

    @classmethod
    def of(cls, kind: str, setup: Setup, engine: EngineInfo) -> _Rounded:
        disks, numerics = setup.scene.disks, setup.numerics
        reach = float(np.abs(disks.x).max()) + _fall(setup)
        once = single(engine, reach, 1.0)
        spring = engine.contact == "spring"
        loose = spring and setup.scene.disk_disk.kn * once > MASS * GRAVITY
        fastest = max(SPEED, GRAVITY * numerics.dt * numerics.n_steps)
        drift = single(engine, fastest, numerics.n_steps) * numerics.dt * numerics.n_steps
        place = single(engine, reach, numerics.n_steps) + drift
        force = len(disks) * MASS * single(engine, fastest, 1.0) / numerics.dt
        return cls(place, force, loose or (once > 0.0 and not spring and kind == "pyramid"))


def _deceleration() -> float:
    """``mu (m g + cohesion overlap)/m`` [m/s^2], the overlap ``m g/(kn - cohesion)``."""
    return MU["cohesion"] * GRAVITY / (1.0 - SHARE)


def _slide(t: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    slows = _deceleration()
    return SPEED * t - 0.5 * slows * t**2, SPEED - slows * t


def _fall(setup: Setup) -> float:
    return 0.5 * GRAVITY * (setup.numerics.dt * setup.numerics.n_steps) ** 2


CASE = Holding()
