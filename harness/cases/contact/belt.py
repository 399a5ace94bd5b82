"""A belt that starts, stops and reverses, with a block and a disk on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
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
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.references.analytic.contact.belt import BeltMotion, belt_motion

RADIUS, MASS = np.array([0.5, 0.3]), np.array([1.0, 4.0])
"""Of the block, which is a disk that cannot turn, and of the disk."""

EASE = (1.0, 3.0)
"""What friction changes the slip by, over what it changes the velocity by: 1 + m R^2/I."""

MU, GRAVITY, SPEED = 0.3, 10.0, 0.3
PULL = MU * GRAVITY
SEGMENTS = ((0.05, 0.0), (0.25, SPEED), (0.2, 0.0), (0.25, -SPEED))
"""Duration [s] and speed [m/s] of the belt, which rests afterwards: the block needs 0.1 s to reach the speed."""

DURATION = 0.9
"""Length of the run [s]."""

TILT = 0.5
"""Direction of the belt, to x [rad]; gravity stands on it."""

APART = 3.0
PHASE = 0.1
"""Resolution of a contact, omega dt."""

NAMES = ("block", "disk")


class Belt:
    """A floor that moves along itself by segments of time; bodies start at rest, without shear forces.

    A block follows it at most as fast as friction lets it. A disk comes to roll: a third of each change of the belt's speed goes into its
    velocity, two thirds into its spin. Gravity stands on the belt, which lies along no axis.
    """

    id = "contact/belt"
    version = 1
    title = "Block and disk on a belt that starts, stops and reverses"
    source = "Coulomb's law and Newton's second law"
    requirement = (
        "a block takes over the belt's speed at mu g, a disk a third of it; both stop and turn back with the belt"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter.positive("dt", 1e-3, high=1e-2, unit="s", help="step; sampling of spring engines"),
        Parameter(name="kn", default=1e7, low=1e5, unit="N/m", help="normal and shear stiffness of spring engines"),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """One variant."""
        return ({},)

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Both bodies in touch with the belt; springs bear the weight from the start."""
        kn, dt = params["kn"], params["dt"]
        along, up = _axes()
        law = ContactLaw(kn=kn, ks=kn, mu=MU, beta=0.5, restitution=0.0, regularised=True)
        heights = RADIUS - MASS * GRAVITY / kn
        disks = Disks(
            x=np.array([k * APART * along + height * up for k, height in enumerate(heights)]),
            radius=RADIUS, mass=MASS, rotating=np.array([False, True]),
        )  # fmt: skip
        motion = tuple(
            WallSegment(duration=duration, velocity=(float(speed * along[0]), float(speed * along[1])))
            for duration, speed in SEGMENTS
        )
        belt = Wall(name="belt", point=(0.0, 0.0), normal=(float(up[0]), float(up[1])), law=law, motion=motion)
        gravity = -GRAVITY * up
        numerics = numerics_of(
            params,
            n_steps=math.ceil(DURATION / dt * (1.0 - 1e-12)),
            contact_dt=contact_step(dt, PHASE / math.sqrt(3.0 * kn / float(MASS.min()))),
        )
        # The disks never meet: friction of theirs in place of the belt's shows.
        scene = Scene(
            disks=disks,
            disk_disk=replace(law, mu=2.0 * MU),
            walls=(belt,),
            gravity=(float(gravity[0]), float(gravity[1])),
        )
        return Setup(scene=scene, numerics=numerics, watch=((0, 2), (1, 2)), labels={"block": (0, 2), "disk": (1, 2)})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Displacements and velocities along the belt, the disk's spin (positive when it rolls back), the belt's displacement."""
        along, _ = _axes()
        series = {}
        for k, name in enumerate(NAMES):
            series[f"x_{name}"] = ("m", (history.x[:, k] - setup.scene.disks.x[k]) @ along)
            series[f"v_{name}"] = ("m/s", history.v[:, k] @ along)
        series["spin_disk"] = ("rad/s", history.omega[:, 1])
        series["wall_place"] = ("m", history.wall_point[:, 0] @ along)
        scalars = {f"{name}_final": (series[name][0], float(series[name][1][-1])) for name in ("x_block", "x_disk")}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Does the belt take both along?"""
        return tuple(
            Headline(name=f"velocity of the {name} on the belt", use="moving-walls", quantity=f"v_{name}",
                     expected=_exact_motion(observed.t, k).v, source=self.source, scale=SPEED, scale_is="speed of the belt")
            for k, name in enumerate(NAMES)
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],  # noqa: ARG002
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """The belt's path, and how bodies follow it."""
        size = 1e-12 + single(engine, SPEED, setup.numerics.n_steps)
        path = at_observed(observed, engine, "wall_place", _exact_motion(observed.t, 0).belt)
        found = [
            Check(quantity="wall_place", norm="max", truth="analytic", expected=path, source="prescribed path", atol=size,
                  scale=SPEED, why="round-off" + single_precision(engine))
        ]  # fmt: skip

        def followed(setup: Setup, engine: EngineInfo) -> list[Check]:
            return _observed_motion(setup, observed, engine, self.source)

        return [*found, *checks_with_allowance(LIFTS, setup, engine, followed)]


def _axes() -> tuple[FloatArray, FloatArray]:
    """Unit vectors along the belt and away from it."""
    return np.array([math.cos(TILT), math.sin(TILT)]), np.array([-math.sin(TILT), math.cos(TILT)])


def _exact_motion(t: FloatArray, k: int) -> BeltMotion:
    return belt_motion(np.nan_to_num(t), segments=SEGMENTS, pull=PULL, ease=EASE[k])


def _observed_motion(setup: Setup, observed: Observed, engine: EngineInfo, source: str) -> list[Check]:
    """Motion of the bodies.

    Where the belt's speed jumps and where a body ceases to slip, friction acts a step too long or too short, and the belt's velocity
    is that of either end of a step. A shear spring that ceases to slide goes on to swing with ``pull/Omega`` about the belt's motion, and
    lags by its stretch.
    """
    t, numerics = observed.t, setup.numerics
    found: list[Check] = []
    jumps = len(SEGMENTS)
    for k, name in enumerate(NAMES):
        spring = engine.contact == "spring"
        dt = (numerics.contact_dt or numerics.dt) if spring else numerics.dt
        s = contact_softness(engine)
        rough = single(engine, max(SPEED, GRAVITY * dt), numerics.n_steps)
        speed = 2.0 * PULL * dt + rough + 1e-10 + s * 2.0 * SPEED + EASE[k] * PULL * slack_time(engine, dt)
        # A velocity that is two steps early or late, whose changes at `PULL` are a step too long or too short.
        travel = (
            2.0 * SPEED / EASE[k] * dt
            + 2.0 * jumps * PULL * dt**2
            + (rough + PULL * slack_time(engine, dt)) * float(t[-1])
        )
        why = (
            "friction acts a step too long or too short at each change of the belt"
            + soft_reason(engine)
            + single_precision(engine)
        )
        if spring:
            law = setup.scene.walls[0].law
            swing = math.sqrt(EASE[k] * law.ks / MASS[k])
            rounding = 2.0 * round_off_speed(APART, dt)
            # The stretch at the cap is pull/ks m: it is built up at the belt's speed, and left over where the body sticks.
            lag = PULL / swing**2 * EASE[k] / SPEED
            speed += 2.0 * PULL / swing + PULL * lag + rounding
            # A body that swings when it begins to slip has that much more or less speed to lose, at `PULL`.
            travel += jumps * (
                4.0 * PULL / swing**2 * EASE[k] + SPEED * lag + SPEED / EASE[k] / swing
            ) + rounding * float(t[-1])
            why += f"; a shear spring swings with mu g/Omega about the belt's motion, Omega = {swing:.3g}"
        if Difference.KEEPS_KN in engine.differences or spring:
            speed += SPEED * MASS[k] * GRAVITY / (setup.scene.walls[0].law.kn * RADIUS[k])
        if follows_associated_rule(engine, numerics):
            # It hops by mu times its slip and lands again, as in `rolling/incline-disk`.
            fall = GRAVITY * numerics.dt
            hop = MU * (2.0 * SPEED + EASE[k] * MU * fall)
            speed += MU * (fall + 2.0 * hop)
            travel += jumps * (SPEED * 2.0 * hop / GRAVITY + MU * (fall + 2.0 * hop) * 2.0 * hop / GRAVITY)
            why += "; the associated rule: a sliding body hops by mu times its slip"
        exact = _exact_motion(t, k)
        common: dict[str, Any] = {"truth": "analytic", "source": source, "why": why}
        found += [
            Check(quantity=f"v_{name}", norm="max", expected=exact.v, atol=speed, scale=SPEED, **common),
            Check(quantity=f"x_{name}", norm="max", expected=exact.x, atol=travel, **common),
            Check(quantity=f"x_{name}_final", norm="scalar", expected=float(exact.x[-1]), atol=travel, scale=SPEED, **common),
        ]  # fmt: skip
        if EASE[k] > 1.0:
            spin = (EASE[k] - 1.0) / RADIUS[k]
            found.append(
                Check(
                    quantity="spin_disk",
                    norm="max",
                    expected=spin * exact.v,
                    atol=spin * speed,
                    scale=spin * SPEED,
                    **common,
                )
            )
    return found


CASE = Belt()
