"""A box hits a plane with one corner: impulse and spin of a single impact with friction."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import KN, MASS, OFF, PAIR, askew_of, box_checks, corner_response, spring_step
from ninedisk.harness.cases.common import (
    EXACT_STEP_RTOL,
    contact_softness,
    last,
    numerics_of,
    single,
    single_precision,
    soft_reason,
    sweeps_of,
    whole_steps,
)
from ninedisk.harness.cases.differences import excused_checks, follows_associated_rule
from ninedisk.harness.cases.pyramid import pyramid_impulse
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.free_rotation import euler_steps, free_rotation
from ninedisk.references.analytic.impact.corner_impact import CornerImpact, corner_impact

HALF = np.array([0.5, 0.35, 0.2])
"""Half the edges of the box of size 1 [m]."""

TURN = np.array([0.9, 0.25, -0.3, 0.2]) / math.sqrt(1.0025)
"""Orientation at time 0, a unit quaternion (w, x, y, z): the lowest corner is 0.23 of the size below the next one."""

VELOCITIES = {"slides": (3.0, -2.0, -1.0), "turns": (-0.4, 0.6, -1.0), "falls": (0.0, 0.0, -1.0)}
"""Velocities at time 0 [m/s]; in the second one the impact turns the direction of slip by more than a right angle with mu = 0.3."""

GIVEN_BACK = math.exp(-2.0)
"""Part of the speed that a critically damped contact gives back which does not pull: it ends after two time constants."""

SOURCE = "Newton's restitution and Coulomb's friction of one impulse"
AXES = ("x", "y", "z")


class _Truth(NamedTuple):
    """The impact, and the spin at the samples [rad/s], shape (s, 3): NaN at time 0."""

    impact: CornerImpact
    spin: FloatArray


class CornerDrop:
    """The corner touches at time 0; there is no gravity, and the corner leaves the plane again after the one impact.

    A corner off the centre of mass couples what is normal with what is not: a box that falls straight down slips, one that slides may
    turn its slip around within the impact. The truth is the law of schemes that know the end of the impact alone: restitution of the
    normal velocity, friction against the slip at the end.
    """

    id = "box/corner-drop"
    version = 1
    title = "A box hits a plane with a corner"
    source = SOURCE
    requirement = "one impulse within the cone: the corner's normal velocity is reversed by e, and it sticks or friction opposes its slip"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="approach", default="slides", choices=tuple(VELOCITIES), in_id=True,
                  help="velocity: fast along the plane, one whose slip turns around, or straight down"),
        Parameter(name="mu", default=0.3, low=0.0, high=1.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter(name="restitution", default=0.0, low=0.0, high=1.0, unit="-", in_id=True, help="Newton's coefficient"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the mass stays"),
        Parameter.positive("dt", 0.001, high=0.01, unit="s", help="step"),
        Parameter.positive("duration", None, high=0.1, unit="s", help="length of the run; none: 20 steps"),
    )  # fmt: skip
    figures = (
        Figure(
            title="The impact",
            quantities=(Plotted("impulse_x", "impulse along x"), Plotted("impulse_z", "normal impulse")),
            compare="mu",
            shows="Change of the momentum since time 0.",
            allows="It is the same in all engines from the first step on; soft contacts take some substeps.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """A corner that slides, turns, slips from rest and sticks; with a rebound; in three sizes."""
        return [
            {},
            {"restitution": 0.5},
            {"approach": "turns"},
            {"approach": "turns", "restitution": 0.5},
            {"approach": "turns", "mu": 0.8},
            {"approach": "falls", "mu": 0.2},
            {"size": 0.1},
            {"size": 10.0},
        ]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box above a plane that it touches with a corner."""
        law = SphereLaw(kn=KN, ks=KN, mu=params["mu"], restitution=params["restitution"], regularised=True)
        half = params["size"] * HALF
        box = Spheres(
            x=np.array([[0.0, 0.0, -_arm(half)[2]]]),
            mass=np.array([MASS]),
            half_sizes=half[None, :],
            quaternion=TURN[None, :],
            v=np.array([VELOCITIES[params["approach"]]]),
        )
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        setup = SphereSetup(
            scene=SphereScene(spheres=box, sphere_sphere=law, walls=(floor,)),
            numerics=numerics_of(
                params, n_steps=whole_steps(params, 20 * params["dt"]), contact_dt=spring_step(params["dt"], half)
            ),
            watch=(PAIR,),
            labels={"floor": PAIR},
        )
        _impact(params, setup)
        return setup

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Change of the momentum, spin, and their sizes in the end."""
        impulse = MASS * (history.v[:, 0] - setup.scene.spheres.v[0])
        spin = history.omega[:, 0]
        series = {
            **{f"impulse_{name}": ("N s", impulse[:, k]) for k, name in enumerate(AXES)},
            **{f"spin_{name}": ("rad/s", spin[:, k]) for k, name in enumerate(AXES)},
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {
            "impulse_normal": ("N s", last(impulse[:, 2])),
            "impulse_shear": ("N s", float(np.hypot(*impulse[-1, :2]))),
            "spin": ("rad/s", float(np.linalg.norm(spin[-1]))),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Both parts of the impulse, and the spin."""
        impact, spin = _truth(params, setup)
        normal = float(impact.impulse[2])
        size = float(np.linalg.norm(spin[-1]))
        return (
            Headline(name="normal impulse on a corner", use="impacts", quantity="impulse_normal", expected=normal, source=SOURCE,
                     scale=normal, scale_is="normal impulse"),
            Headline(name="shear impulse on a corner", use="impacts", quantity="impulse_shear",
                     expected=float(np.hypot(*impact.impulse[:2])), source=SOURCE, scale=normal, scale_is="normal impulse"),
            Headline(name="spin after an impact on a corner", use="impacts", quantity="spin", expected=size, source=SOURCE, scale=size,
                     scale_is="spin after the impact"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The same for all engines, from the first step on; soft contacts are given the run."""
        if Difference.IMPACT_AS_SPRINGS in engine.differences:
            right = _checks(params, setup, observed, engine)
            return excused_checks(right, _by_springs(params, setup, right), f"{engine.id}/corner-rebounds")
        return box_checks((_checks,), params, setup, observed, engine, Difference.FRICTION_PYRAMID)


def _arm(half: FloatArray) -> FloatArray:
    """From the centre to the lowest corner [m]."""
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half @ rotation_matrix(TURN).T
    lowest: FloatArray = corners[int(np.argmin(corners[:, 2]))]
    return lowest


def _impact(params: Mapping[str, Any], setup: Any, *, mu: float | None = None, dilates: bool = False) -> CornerImpact:
    box = setup.scene.spheres
    return corner_impact(
        mass=MASS,
        inertia=box.inertia[0],
        axes=rotation_matrix(TURN),
        arm=_arm(box.half_sizes[0]),
        velocity=box.v[0],
        spin=(0.0, 0.0, 0.0),
        mu=params["mu"] if mu is None else mu,
        restitution=params["restitution"],
        dilates=dilates,
    )


def _explained(params: Mapping[str, Any], setup: Any, engine: EngineInfo) -> tuple[ArrayLike, ArrayLike, str]:
    """What a difference of the engine changes of the impulse [N s] and of the spin [rad/s], of each component or of all, and why."""
    impact, mu = _impact(params, setup), params["mu"]
    if follows_associated_rule(engine, setup.numerics):
        other, why = _impact(params, setup, dilates=True), "a sliding corner parts by mu times its slip"
    elif Difference.FRICTION_LAGS in engine.differences:
        other, why = _impact(params, setup, mu=0.0), "no friction in the first step"
    elif askew_of(engine) and impact.mode == "slides":
        # p = a/(W_nn - mu W_nt d) (-mu d, 1), of a d that is off by OFF; column n of W is what an impulse without friction does.
        bare, pressed = _impact(params, setup, mu=0.0), float(impact.impulse[2])
        column = (bare.slip - setup.scene.spheres.v[0]) / float(bare.impulse[2])
        across = float(np.hypot(*column[:2]))
        off = OFF * mu * pressed * (1.0 + math.hypot(1.0, mu) * across / (float(column[2]) - mu * across))
        box = setup.scene.spheres
        arm = float(np.linalg.norm(_arm(box.half_sizes[0])))
        return off, off * arm / float(box.inertia[0].min()), f"friction is off by up to {OFF:g} of its bound"
    elif Difference.FRICTION_PYRAMID in engine.differences:
        p, box, turn = _pyramid(params, setup), setup.scene.spheres, rotation_matrix(TURN)
        spin = turn @ ((turn.T @ np.cross(_arm(box.half_sizes[0]), p)) / box.inertia[0])
        t = setup.numerics.sampled_steps() * setup.numerics.dt
        one, two = (_in_space(free_rotation(t, **_start(each, setup))) for each in (impact, impact._replace(spin=spin)))
        return np.abs(p - impact.impulse), np.abs(two - one).max(axis=0), "friction of a pyramid along the velocity"
    else:
        return 0.0, 0.0, ""
    return (
        float(np.linalg.norm(other.impulse - impact.impulse)),
        float(np.linalg.norm(other.spin - impact.spin)),
        why,
    )


def _pyramid(params: Mapping[str, Any], setup: Any) -> FloatArray:
    """The impulse with friction that is bounded along the velocity and across it [N s]."""
    box = setup.scene.spheres
    turn, arm, v = rotation_matrix(TURN), _arm(box.half_sizes[0]), box.v[0]
    arms = np.cross(np.eye(3), arm)  # rows: e x r, of which -[r] e = e x r
    response = np.eye(3) / MASS + arms @ (turn @ np.diag(1.0 / box.inertia[0]) @ turn.T) @ arms.T
    return pyramid_impulse(response, v, rebound=-params["restitution"] * float(v[2]), mu=params["mu"], centre=v)


def _truth(params: Mapping[str, Any], setup: Any) -> _Truth:
    impact, numerics = _impact(params, setup), setup.numerics
    start = _start(impact, setup)
    found = free_rotation(numerics.sampled_steps() * numerics.dt, **start)
    spin = _in_space(found)
    spin[0] = np.nan
    return _Truth(impact, spin)


def _start(impact: CornerImpact, setup: Any) -> dict[str, Any]:
    own = rotation_matrix(TURN).T @ impact.spin
    return {"inertia": setup.scene.spheres.inertia[0], "spin": own, "quaternion": TURN}


def _in_space(found: Any) -> FloatArray:
    """Spins about the axes of space."""
    return np.array([rotation_matrix(q) @ w for q, w in zip(found.quaternion, found.spin, strict=True)])


def _by_springs(params: Mapping[str, Any], setup: Any, right: Sequence[Check]) -> list[Check]:
    """The checks for a contact that only pushes, over many steps: it gives back e^-2 if critically damped, and may lose its friction."""
    impact, bare = _impact(params, setup), _impact(params, setup, mu=0.0)
    size = {
        "impulse": np.linalg.norm(bare.impulse - impact.impulse) + GIVEN_BACK * np.linalg.norm(impact.impulse),
        "spin": np.linalg.norm(bare.spin - impact.spin) + GIVEN_BACK * np.linalg.norm(impact.spin),
    }
    why = "the contact rebounds at up to e^-2, and friction ends a part of the slip"
    return [
        replace(check, atol=check.atol + float(size[check.quantity.split("_")[0]]), why=f"{check.why}; {why}")
        for check in right
    ]


def _checks(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics = setup.numerics
    impact, spin = _truth(params, setup)
    half = setup.scene.spheres.half_sizes[0]
    # The impact may be at either end of its step, and after it Euler's explicit rule errs by this much.
    plain = _in_space(euler_steps(numerics.n_steps, dt=numerics.dt, **_start(impact, setup)))
    turning = 2.0 * float(np.abs(plain[numerics.sampled_steps()][1:] - spin[1:]).max())
    turning += float(np.abs(np.diff(plain, axis=0)).max())
    pressed, turned = float(np.linalg.norm(impact.impulse)), float(np.linalg.norm(impact.spin))
    soft = corner_response(half) * contact_softness(engine)
    steps = numerics.n_steps + sweeps_of(engine, numerics)
    speed = float(np.linalg.norm(setup.scene.spheres.v[0]))
    off_impulse = (EXACT_STEP_RTOL + soft) * pressed + single(engine, MASS * speed, steps)
    off_spin = (EXACT_STEP_RTOL + soft) * turned + turning + single(engine, turned, steps)
    why = f"one impulse: round-off{soft_reason(engine)}{single_precision(engine)}"
    beyond, beyond_spin, explained = _explained(params, setup, engine)
    if explained:
        why += f"; {explained}"
    turns = f"{why}; the rotation of one step, and twice what Euler's explicit rule errs by"
    beyond, beyond_spin = np.broadcast_to(beyond, 3), np.broadcast_to(beyond_spin, 3)
    expected = np.broadcast_to(impact.impulse, (len(observed.t), 3)).copy()
    expected[0] = np.nan
    found = []
    for k, name in enumerate(AXES):
        for quantity, truth, atol, scale, reason in (
            ("impulse", expected, off_impulse + float(beyond[k]), pressed, why),
            ("spin", spin, off_spin + float(beyond_spin[k]), turned, turns),
        ):
            found.append(
                Check(quantity=f"{quantity}_{name}", norm="max", truth="analytic", expected=truth[:, k], source=SOURCE, atol=atol,
                      scale=scale, why=reason)
            )  # fmt: skip
    return found


CASE = CornerDrop()
