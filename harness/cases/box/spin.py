"""A box spins on the spot until friction has stopped it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import (
    OFF,
    PAIR,
    G,
    askew_of,
    box_checks,
    box_on_plane,
    frame_at,
    slack,
    spring_step,
    turned_angle,
)
from ninedisk.harness.cases.common import (
    EXACT_STEP_RTOL,
    last,
    numerics_of,
    single_precision,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.differences import follows_associated_rule
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.box import stopping_box

HALF = np.array([0.5, 0.35, 0.2])
"""Half the edges of the box of size 1 [m]."""

YAW = 0.35
"""Angle of the longest edge to the x axis at time 0 [rad]."""

SOURCE = "Coulomb's law at the corners, which are equally far from the axis"
BEYOND = 1.2
"""Default length of the run, in times of the stop: what goes on moving shows."""


class BoxSpin:
    """The corners of a face share the load in many ways; friction has the moment ``mu m g r`` in all of them, and no resultant."""

    id = "box/spin"
    version = 1
    title = "A box spins to a stop"
    source = SOURCE
    requirement = "stops after I w/(mu m g r), r half the diagonal of the face, on the spot and without rising"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.3, low=1e-3, high=1.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("spin", 3.0, high=30.0, unit="rad/s", help="initial spin"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the mass stays"),
        Parameter.positive("dt", 0.01, high=0.1, unit="s", help="step"),
        Parameter.positive("duration", None, unit="s", help="length of the run; none: 1.2 I w/(mu m g r)"),
    )  # fmt: skip
    figures = (
        Figure(
            title="The stop of a spin",
            quantities=(Plotted("spin", "spin"), Plotted("aside", "displacement of the centre")),
            compare="mu",
            shows="Spin about the normal, and how far the centre moves.",
            allows="The spin falls on a straight line; the centre stays where it is.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Three sizes, two coefficients."""
        return [{}, {"mu": 0.7, "size": 0.1, "dt": 0.0004}, {"size": 10.0, "dt": 0.1}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box on a plane."""
        half, up = float(params["size"]) * HALF, frame_at(0.0).up
        scene = box_on_plane(half=half, mu=params["mu"], yaw=YAW, gravity=-G * up, omega=params["spin"] * up)
        n_steps = whole_steps(params, BEYOND * params["spin"] / (_slowing(params) * G))
        return SphereSetup(
            scene=scene,
            numerics=numerics_of(params, n_steps=n_steps, contact_dt=spring_step(params["dt"], half)),
            watch=(PAIR,),
            labels={"floor": PAIR},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Spin and turn about the normal, other spins, and what the centre moves by."""
        omega, moved = history.omega[:, 0], history.x[:, 0] - history.x[0, 0]
        series = {
            "spin": ("rad/s", omega[:, 2]),
            "turned": ("rad", turned_angle(history)),
            "tilting": ("rad/s", np.hypot(omega[:, 0], omega[:, 1])),
            "aside": ("m", np.hypot(moved[:, 0], moved[:, 1])),
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {f"{name}_final": (series[name][0], last(series[name][1])) for name in ("turned", "aside")}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The angle, and what leaves the place."""
        angle = float(_path(params, observed.t)[0][-1])
        return (
            Headline(name="angle in which a spinning box stops", use="sliding", quantity="turned_final", expected=angle, source=SOURCE,
                     scale=angle, scale_is="stopping angle"),
            Headline(name="displacement of a box that spins on the spot", use="sliding", quantity="aside_final", expected=0.0,
                     source="friction without resultant", scale=angle * _arm(params), scale_is="path of a corner"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The motion in continuous time for all engines; exact steps where the scheme has them."""
        return box_checks((_exact, _continuous), params, setup, observed, engine, Difference.FRICTION_PYRAMID)


def _arm(params: Mapping[str, Any]) -> float:
    """From the axis to a corner [m]."""
    return float(params["size"] * np.hypot(HALF[0], HALF[1]))


def _slowing(params: Mapping[str, Any]) -> float:
    """Angular deceleration over gravity [1/m]: mu r/(I/m), I/m = r^2/3."""
    return float(3.0 * params["mu"] / _arm(params))


def _path(params: Mapping[str, Any], t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angle [rad] and spin [rad/s] at times."""
    return stopping_box(t, mu=_slowing(params), speed=params["spin"], g=G)


def _sooner(engine: EngineInfo) -> float:
    """By which part of its time a box stops sooner whose friction is between mu and 1.41 mu times the load; so much less it turns, and that
    is the largest part of the initial spin that it lacks."""
    return 1.0 - math.sqrt(0.5) if Difference.FRICTION_PYRAMID in engine.differences else 0.0


def _exact(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Each step takes the same of the spin, the last one what is left; angles are sums of the spins."""
    numerics, spin = setup.numerics, float(params["spin"])
    if engine.scheme == "semi-implicit-euler":
        theta = 1.0
    elif engine.scheme == "theta" and numerics.sliding == "coulomb":
        theta = numerics.theta
    else:
        return []
    steps = np.arange(numerics.n_steps + 1)
    spins = np.maximum(spin - _slowing(params) * G * numerics.dt * steps, 0.0)
    angle = np.concatenate([[0.0], np.cumsum(numerics.dt * (theta * spins[1:] + (1.0 - theta) * spins[:-1]))])
    off = slack(engine, float(params["size"]) * HALF, dt=numerics.dt, n_steps=numerics.n_steps)
    # Rounding decides whether a stop that ends with a step takes one more.
    rough = 1e-9 * spin + 3.0 * off.speed / _arm(params)
    aside = OFF if askew_of(engine) else _sooner(engine)
    pyramid = "; friction of a pyramid, at corners up to 1.41 times as strong" if _sooner(engine) else ""
    return [
        Check(quantity=name, norm="max", truth="exact-step", expected=values[observed.step],
              source=f"{engine.scheme}: exact spins and their sum", rtol=EXACT_STEP_RTOL, atol=(rough + aside * spin) * time, scale=scale,
              why=f"exact solution of this very scheme: round-off and the solver's tolerance{single_precision(engine)}{pyramid}")
        for name, values, time, scale in (("spin", spins, 1.0, spin), ("turned", angle, float(observed.t[-1]), float(angle[-1])))
    ]  # fmt: skip


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics, t, mu, half = setup.numerics, observed.t, params["mu"], float(params["size"]) * HALF
    dt, t_end, arm, spin0 = numerics.dt, float(t[-1]), _arm(params), float(params["spin"])
    angle, spin = _path(params, t)
    slows = _slowing(params) * G
    off = slack(engine, half, dt=dt, n_steps=numerics.n_steps)
    # A force at a corner turns the box by three times what it moves the centre.
    turning = 3.0 * off.speed / arm
    atol = {
        "spin": turning + 0.5 * slows * dt,
        "turned": 0.5 * spin0 * dt + turning * t_end + off.overlap / arm,
        "tilting": off.speed / float(half.min()),
        "aside": off.speed * t_end + off.overlap,
        "gap": off.overlap,
    }
    why = f"first order in the step: w dt/2{soft_reason(engine)}{single_precision(engine)}"
    if sooner := _sooner(engine):
        atol["spin"] += sooner * spin0
        atol["turned"] += sooner * float(angle[-1])
        why += "; friction of a pyramid, at corners up to 1.41 times as strong"
    if Difference.KEEPS_KN in engine.differences:
        why += "; overlaps of the load over kn"
    if Difference.FRICTION_LAGS in engine.differences:
        atol["spin"] += slows * dt
        atol["turned"] += slows * dt * (spin0 / slows + dt)
        why += f"; no friction in the first step: {slows * dt:.3g} rad/s"
    if askew_of(engine):
        # What tilts the box lasts for a step: the contacts that it presses on put it back.
        turned, tilted = float(angle[-1]), spin0 * arm * dt
        for name, size in (
            ("spin", spin0),
            ("turned", turned),
            ("tilting", spin0),
            ("aside", turned * arm),
            ("gap", tilted),
        ):
            atol[name] += OFF * size
        why += f"; friction is off by up to {OFF:g} of its bound"
    if follows_associated_rule(engine, numerics):
        # As of a box that slides: a step in touch lifts by mu times the slip, a flight has no friction, a landing takes what it left out.
        fall, lift = G * dt, mu * spin0 * arm
        depth = (fall + lift) * dt + lift**2 / (2.0 * G)
        flight = 2.0 * (lift + fall) / G
        lost = 3.0 * mu * (fall + 2.0 * lift) / arm
        atol["spin"] += lost
        atol["turned"] += lost * (spin0 / slows + flight)
        atol["tilting"] += (fall + lift) / float(half.min())
        atol["aside"] += depth + mu * lift * flight
        atol["gap"] += depth
        why += f"; a sliding contact opens and lands again: up to {fall + lift:.3g} m/s"
    zero = np.zeros_like(t)
    rows: list[tuple[str, FloatArray, float]] = [
        ("spin", spin, spin0), ("turned", angle, float(angle[-1])), ("tilting", zero, spin0), ("aside", zero, float(angle[-1]) * arm),
        ("gap", zero, float(half[2])),
    ]  # fmt: skip
    return [
        Check(quantity=name, norm="max", truth="analytic", expected=expected, source=SOURCE, atol=atol[name], scale=scale, why=why)
        for name, expected, scale in rows
    ]  # fmt: skip


CASE = BoxSpin()
