"""A box on a plane: its scene, what is seen of it, and what any engine may be off by."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.harness.api.case import Check, FloatArray, Observed, SphereSetup
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import contact_softness, contact_step, single, slack_time
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule

MASS, G, KN = 3.0, 10.0, 1e7
"""Mass [kg], gravity [m/s^2], and the stiffness [N/m] of contacts that are no better than springs."""

PAIR = (0, 1)

PHASE = 0.1
"""Resolution of springs, omega dt."""

SOLVED = 2e-9
"""Residual of an exact solver over the load: ours, asked for 1e-8, comes to about 1e-9, and of four corners two may be off by that to one
side."""


SOLVED_IN_SINGLE = 3.0
"""Half units by which a speed is off that a solver in single precision finds: a sum of impulses is off by a unit before it is rounded."""


class Frame(NamedTuple):
    """Unit vectors of the plane: along what drives the box, across, and up."""

    along: FloatArray
    across: FloatArray
    up: FloatArray


ASKEW = (Difference.BOX_FRICTION_ASKEW, Difference.MISSED_TOLERANCE_GIVES_PYRAMID)
"""Differences that turn the friction of a box."""

OFF = 0.3
"""Part of its bound by which that friction is off: 2 sin(0.15) of a direction that is off by 0.3 rad, as the differences say."""


def box_checks(
    parts: Sequence[Callable[[Any, Any, Observed, EngineInfo], list[Check]]],
    params: Any,
    setup: SphereSetup,
    observed: Observed,
    engine: EngineInfo,
    *patch: Difference,
) -> Sequence[Check]:
    """Checks of all ``parts`` of a box that may slide, with what a difference of the engine explains beyond them.

    ``patch`` are differences of the friction of a face that the parts have sizes for.
    """
    others = LIFTS if follows_associated_rule(engine, setup.numerics) else Difference.FRICTION_LAGS
    own = next((each for each in patch if each in engine.differences), None)

    def found(setup: Any, engine: EngineInfo) -> list[Check]:
        return [check for part in parts for check in part(params, setup, observed, engine)]

    return checks_with_allowance(askew_of(engine) or own or others, setup, engine, found)


def askew_of(engine: EngineInfo) -> Difference | None:
    """The difference of an engine that turns the friction of a box; None where it has none."""
    return next((each for each in ASKEW if each in engine.differences), None)


def frame_at(angle: float) -> Frame:
    """The frame whose first vector has this angle [rad] to the x axis."""
    c, s = math.cos(angle), math.sin(angle)
    return Frame(np.array([c, s, 0.0]), np.array([-s, c, 0.0]), np.array([0.0, 0.0, 1.0]))


def about_z(angle: float) -> list[float]:
    """Quaternion (w, x, y, z) of a turn about z [rad]."""
    return [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)]


def box_on_plane(
    *,
    half: Any,
    mu: float,
    yaw: float,
    gravity: FloatArray,
    v: FloatArray | None = None,
    omega: FloatArray | None = None,
) -> SphereScene:
    """One box that stands on the plane z = 0 with a face."""
    law = SphereLaw(kn=KN, ks=KN, mu=mu, restitution=0.0, regularised=True)
    box = Spheres(
        x=np.array([[0.0, 0.0, half[2]]]),
        mass=np.array([MASS]),
        half_sizes=np.array([half]),
        quaternion=np.array([about_z(yaw)]),
        v=np.zeros((1, 3)) if v is None else v[None, :],
        omega=np.zeros((1, 3)) if omega is None else omega[None, :],
    )
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
    x, y, z = gravity.tolist()
    return SphereScene(spheres=box, sphere_sphere=law, walls=(floor,), gravity=(x, y, z))


def seen(history: History, frame: Frame) -> dict[str, tuple[str, FloatArray]]:
    """Series of a box on the plane.

    ``down`` and ``across`` are displacements, ``speed`` that along the first vector of the frame, ``spin`` positive where the box tips
    that way, ``turning`` the size of the other spins. ``fs`` is positive against the first vector.
    """
    x, v, omega = history.x[:, 0], history.v[:, 0], history.omega[:, 0]
    moved = x - x[0]
    return {
        "down": ("m", moved @ frame.along),
        "across": ("m", moved @ frame.across),
        "speed": ("m/s", v @ frame.along),
        "gap": ("m", history.gap[:, 0]),
        "spin": ("rad/s", omega @ frame.across),
        "turning": ("rad/s", np.hypot(omega @ frame.along, omega @ frame.up)),
        "fn": ("N", history.fn[:, 0]),
        "fs": ("N", 0.0 - history.fs[:, 0] @ frame.along),
    }


def pressure_centre(history: History, frame: Frame, begin: int) -> float:
    """Where the plane presses from a sample on, along the first vector from below the centre of mass [m]; NaN where no moment is known.

    The force ``(-fs, fn)`` at ``(p, -z)`` from the centre has the moment ``z fs - p fn`` about the second vector.
    """
    if history.moment is None:
        return math.nan
    moment = history.moment[begin:, 0] @ frame.across
    height = history.x[begin - 1 : -1, 0] @ frame.up  # where the contacts of a step are found
    fs, fn = 0.0 - history.fs[begin:, 0] @ frame.along, history.fn[begin:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sum(height * fs - moment) / np.sum(fn))


def turned_angle(history: History) -> FloatArray:
    """Angle of the box's rotation since time 0 [rad]; NaN where no orientation is known."""
    if history.quaternion is None:
        return np.full(len(history.t), np.nan)
    one, rest = history.quaternion[0, 0], history.quaternion[:, 0]
    vector = rest[:, 1:] * one[0] - rest[:, :1] * one[1:] - np.cross(rest[:, 1:], one[1:])
    angle: FloatArray = 2.0 * np.arctan2(np.linalg.norm(vector, axis=1), np.abs(rest @ one))
    return angle


def box_axes(history: History) -> FloatArray:
    """Axes of the box's frame at each sample, as columns, shape (s, 3, 3); NaN where no orientation is known."""
    if history.quaternion is None:
        return np.full((len(history.t), 3, 3), np.nan)
    return np.array([rotation_matrix(each) for each in history.quaternion[:, 0]])


class Slack(NamedTuple):
    """What a rigid box may be off by in any engine: a speed [m/s], a share of forces, an overlap [m]."""

    speed: float
    share: float
    overlap: float


def corner_response(half: FloatArray) -> float:
    """Largest response of a uniform box to a force at a corner, over that to one at the centre: ``1 + r^2/I``, I over the mass."""
    square = half**2
    return 1.0 + 3.0 * float(square.sum()) / float(square.sum() - square.max())


def spring_step(dt: float, half: FloatArray, mass: float = MASS) -> float:
    """Step of engines with contact springs [s]: `PHASE` of the fastest swing on the four corners of a face."""
    return contact_step(dt, PHASE / math.sqrt(4.0 * corner_response(half) * KN / mass))


def slack(engine: EngineInfo, half: FloatArray, *, dt: float, n_steps: int) -> Slack:
    """Round-off, and what soft contacts let through of a uniform box with these half edges.

    A corner responds to a force by ``1 + r^2/I`` times as much as the centre at most, I the smallest moment of inertia over the mass: a
    contact that is soft by a part of a sphere's response lets through that much more of the speed. Where the load is at one edge two
    corners bear it, so that the overlap of a contact with the scene's stiffness is half the weight over it.
    """
    t_end = dt * n_steps
    speed = corner_response(half) * G * slack_time(engine, dt) + SOLVED * G * t_end + single(engine, G * t_end, n_steps)
    keeps = Difference.KEEPS_KN in engine.differences
    overlap = (0.5 * MASS * G / KN if keeps else 0.0) + speed * t_end + 1e-12
    overlap += single(engine, float(np.linalg.norm(half)), n_steps)  # places are rounded in each step
    return Slack(speed, contact_softness(engine) + 1e-9 + single(engine, 1.0, 1), overlap)
