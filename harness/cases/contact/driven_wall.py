"""A block on a floor that shakes along itself, and a disk that a turning wall strikes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    around_contact,
    at_observed,
    contact_softness,
    contact_step,
    numerics_of,
    round_off_speed,
    single,
    single_precision,
    slack_time,
    soft_reason,
)
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.harness.cases.impact.held_disk import impact_error
from ninedisk.references.analytic.impact.prescribed_partner import Carried, Struck, carried, struck_by_turning_wall
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration

RADIUS, MASS, MU, GRAVITY = 0.5, 1.0, 0.5, 10.0
AMPLITUDE, FREQUENCY = 0.02, 10.0
"""Of the floor [m], [rad/s]: its acceleration, 2 m/s^2, is less than half of what friction can give."""

PLACE, RATE, RESTITUTION = (1.5, 0.55), 1.0, 0.5
"""Centre of the disk that is struck [m], seen from the pivot; rate of the wall [rad/s]; coefficient of restitution."""

SURFACE = (0.4, 0.0)
"""The point by which the turning wall is given [m], not its pivot."""

PAIR = (0, 1)
PHASE = 0.05
"""Resolution of a spring contact, omega dt."""

AFTER = 0.04
"""Time after the impact [s]."""


class DrivenWall:
    """``motion=shake``: a floor carries a block by friction; ``motion=turn``: a wall turns about a pivot and strikes a disk at rest."""

    id = "contact/driven-wall"
    version = 3
    title = "Disk at a wall that shakes along itself, or turns"
    source = (
        "prescribed path and Newton's second law; Newton's restitution for the velocity of the wall's point of contact"
    )
    requirement = "a block that sticks moves as the floor does; a disk leaves a turning wall with 1 + e of its speed at the contact"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="motion", default="shake", choices=("shake", "turn"), in_id=True, help="motion of the wall"),
        Parameter.positive("dt", 1.5e-4, high=1e-2, unit="s", help="step; sampling of spring engines"),
        Parameter(name="kn", default=1e8, low=1e6, unit="N/m", help="stiffness of spring engines"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both motions."""
        return [{"motion": "shake"}, {"motion": "turn"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk and one wall; springs of the floor start with the load that they then bear."""
        shakes = params["motion"] == "shake"
        kn, dt = params["kn"], params["dt"]
        place = (0.0, RADIUS - MASS * GRAVITY / kn) if shakes else PLACE
        beta = 1.0 if shakes else beta_for(RESTITUTION)
        law = ContactLaw(
            kn=kn, ks=kn, mu=MU if shakes else 0.0, beta=beta, restitution=0.0 if shakes else RESTITUTION, regularised=True
        )  # fmt: skip
        motion = (
            WallSegment(amplitude=(AMPLITUDE, 0.0), frequency=FREQUENCY, phase=0.5 * math.pi)
            if shakes
            else WallSegment(angular_velocity=RATE, pivot=(0.0, 0.0))
        )
        scene = Scene(
            disks=Disks(
                x=np.array([place]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
                rotating=np.array([not shakes]),
            ),
            disk_disk=law,
            walls=(Wall(name="wall", point=SURFACE, normal=(0.0, 1.0), law=law, motion=(motion,)),),
            gravity=(0.0, -GRAVITY if shakes else 0.0),
            initial_shear={PAIR: -MASS * AMPLITUDE * FREQUENCY**2} if shakes else {},
        )
        until = 2.0 * math.pi / FREQUENCY if shakes else _struck_disk().time + AFTER
        numerics = numerics_of(
            params,
            n_steps=math.ceil(until / dt),
            contact_dt=contact_step(dt, PHASE / (math.sqrt(kn / MASS) * max(1.0, beta))),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Way and velocity of the disk, forces on it, and the wall as the engine reports it."""
        normal = np.column_stack([np.cos(history.wall_angle[:, 0]), np.sin(history.wall_angle[:, 0])])
        travel = history.x[:, 0] - setup.scene.disks.x[0]
        series = {
            "x": ("m", travel[:, 0]),
            "vx": ("m/s", history.v[:, 0, 0]),
            "wall_place": ("m", (history.wall_point[:, 0] * normal).sum(axis=1)),
            "wall_angle": ("rad", history.wall_angle[:, 0]),
        }
        scalars = {}
        if params["motion"] == "shake":
            series |= {
                "fn": ("N", history.fn[:, 0]),
                "fs": ("N", history.fs[:, 0]),
                "wall_x": ("m", history.wall_point[:, 0, 0]),
            }
        else:
            series |= {
                "y": ("m", travel[:, 1]),
                "vy": ("m/s", history.v[:, 0, 1]),
                "spin": ("rad/s", history.omega[:, 0]),
            }
            struck = np.flatnonzero(history.v[:, 0, 1] > 0.5 * _struck_disk().velocity[1])
            scalars = {
                "vx_final": ("m/s", float(history.v[-1, 0, 0])),
                "vy_final": ("m/s", float(history.v[-1, 0, 1])),
                "t_struck": ("s", float(history.t[struck[0]]) if len(struck) else math.nan),
            }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Does the wall take the disk along?"""
        if params["motion"] == "shake":
            return (
                Headline(name="motion that the wall gives", use="moving-walls", quantity="x", expected=_carried_disk(observed).x,
                         source="the floor's own path", scale=2.0 * AMPLITUDE, scale_is="stroke of the floor"),
            )  # fmt: skip
        speed = math.hypot(*_struck_disk().velocity)
        return (
            Headline(name="motion that the wall gives", use="moving-walls", quantity="vy_final", expected=_struck_disk().velocity[1],
                     source=self.source, scale=speed, scale_is="speed of the disk"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The wall's pose, and closed forms with the first order of an engine's own step."""
        shakes, t = params["motion"] == "shake", observed.t
        path = {"wall_place": np.zeros_like(t), "wall_angle": np.full_like(t, 0.5 * math.pi)}
        if shakes:
            path["wall_x"] = SURFACE[0] + _carried_disk(observed).x
        else:
            path["wall_angle"] = path["wall_angle"] + RATE * t
        size = 1e-12 + single(engine, 4.0, setup.numerics.n_steps)
        found = [
            Check(quantity=name, norm="max", truth="analytic", expected=at_observed(observed, engine, name, curve),
                  source="prescribed path", atol=size, scale=AMPLITUDE, why="round-off" + single_precision(engine))
            for name, curve in path.items()
        ]  # fmt: skip
        return [*found, *(_shaken_block if shakes else _turned_wall)(setup, observed, engine)]


def _shaken_block(setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """A block that sticks.

    An engine takes the wall's velocity at either end of its step or the mean over it, and adds it to the position at once or a
    step later: a step's change of velocity, a step's way. Its force is a difference of such velocities, a step's change of
    the acceleration late and as much uneven; the first step has half the acceleration, or none. Springs are
    ``m a/ks`` behind, and follow as slowly as ``W^2/omega^2`` says. A soft contact lets through a part of each step's change.
    """
    dt = (setup.numerics.contact_dt or setup.numerics.dt) if engine.contact == "spring" else setup.numerics.dt
    t, weight = observed.t, MASS * GRAVITY
    top, rate, pull = AMPLITUDE, AMPLITUDE * FREQUENCY, AMPLITUDE * FREQUENCY**2
    curve, s = _carried_disk(observed), contact_softness(engine)
    rough = single(engine, max(rate, GRAVITY * setup.numerics.dt), setup.numerics.n_steps)
    atol = {
        "x": 2.0 * rate * dt
        + 1e-10 * top
        + (rough + pull * slack_time(engine, dt)) * t[-1]
        + single(engine, top, len(t)),
        "vx": 2.0 * pull * dt + 1e-10 * rate + rough + pull * slack_time(engine, dt),
        "fs": MASS * pull * (2.0 * FREQUENCY * dt + s) + 1e-9 * weight + single(engine, weight, 1),
        "fn": (1e-9 + s) * weight + single(engine, weight, 1),
    }
    why = "the wall's velocity of either end of a step" + soft_reason(engine) + single_precision(engine)
    if engine.contact == "spring":
        law = setup.scene.walls[0].law
        slow = MASS * FREQUENCY**2 / law.ks
        speed = 2.0 * round_off_speed(RADIUS, dt) + 4.0 * slow * rate
        force = law.kn * 16.0 * float(np.spacing(RADIUS)) + 4.0 * slow * MASS * pull
        atol["x"] += 2.0 * slow * top + speed * t[-1]
        atol["vx"] += speed
        atol |= {"fs": atol["fs"] + force, "fn": atol["fn"] + force}
        why = f"a step of the contact, and shear springs that follow within {slow:.2g} of the acceleration; round-off"
    expected = {"x": curve.x, "vx": curve.v, "fs": MASS * curve.a, "fn": np.full_like(t, weight)}
    later = observed.step > 1
    return [
        Check(quantity=name, norm="max", truth="analytic",
              expected=np.where(later, truth, np.nan) if name in ("fn", "fs") else truth,
              source="the block moves with the floor; Newton's second law", atol=float(atol[name]), why=why)
        for name, truth in expected.items()
    ]  # fmt: skip


def _turned_wall(setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """An impact somewhere in a step: the wall's direction is that of some time within two steps, its lever likewise."""
    struck, numerics = _struck_disk(), setup.numerics
    speed, law = math.hypot(*struck.velocity), setup.scene.walls[0].law
    turn = RATE * 2.0 * numerics.dt * (1.0 + math.hypot(*PLACE) / PLACE[0])
    lasts = contact_duration(kn=law.kn, m_eff=MASS, beta=law.beta)
    error, why = impact_error(engine, setup, law, MASS, struck.approach, RESTITUTION)
    off = speed * turn + error + speed * RATE * lasts * (engine.contact == "spring")
    t = observed.t
    event = around_contact(t, struck.time, lasts, numerics.dt)
    after = np.where(event, np.nan, np.where(t < struck.time, 0.0, 1.0))
    found = [
        Check(quantity=name, norm="max", truth="analytic", expected=after * value, source="Newton's restitution",
              atol=off, scale=speed, why=f"the wall turns by {turn:.2g} rad in what an impact may be late or early; {why}")
        for name, value in zip(("vx", "vy"), struck.velocity, strict=True)
    ]  # fmt: skip
    found += [
        Check(quantity=f"{name}_final", norm="scalar", truth="analytic", expected=value, source="Newton's restitution",
              atol=off, scale=speed, why=found[0].why)
        for name, value in zip(("vx", "vy"), struck.velocity, strict=True)
    ]  # fmt: skip
    travel, flown = 2.0 * numerics.dt * speed, float(t[-1] - struck.time)
    found += [
        Check(quantity=name, norm="max", truth="analytic", expected=np.maximum(t - struck.time, 0.0) * value,
              source="flight after the impact", atol=travel + off * flown, scale=speed * flown, why="two steps' way; " + found[0].why)
        for name, value in zip(("x", "y"), struck.velocity, strict=True)
    ]  # fmt: skip
    found.append(
        Check(quantity="t_struck", norm="scalar", truth="analytic", expected=struck.time, source="the wall's path",
              atol=2.0 * numerics.dt + lasts, why="an impact falls anywhere in a step and is seen at its end")
    )  # fmt: skip
    found.append(
        Check(quantity="spin", norm="max", truth="analytic", expected=0.0, source="smooth wall",
              atol=1e-12 + single(engine, speed / RADIUS, numerics.n_steps), scale=speed / RADIUS, why="no force has a moment")
    )  # fmt: skip
    return found


def _struck_disk() -> Struck:
    return struck_by_turning_wall(place=PLACE, radius=RADIUS, rate=RATE, restitution=RESTITUTION)


def _carried_disk(observed: Observed) -> Carried:
    return carried(observed.t, amplitude=AMPLITUDE, frequency=FREQUENCY)


CASE = DrivenWall()
