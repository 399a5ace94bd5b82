"""Disk that rolls on a plane against rolling resistance, of each of its three models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import ROLLING_MODELS
from ninedisk.core.scene import BodyForce, ContactLaw, Disks, Rolling, Scene, Wall
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    contact_step,
    last,
    numerics_of,
    round_off_speed,
    single,
    single_precision,
    slack_time,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.rolling.slip_to_roll import shear_frequency
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.rolling_resistance import (
    EquivalentDisk,
    Rolled,
    against_constant_torque,
    against_spring,
    against_viscous_torque,
    equivalent_disk,
    oscillation,
)
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK

RADIUS, MASS, MU, GRAVITY = 0.5, 1.0, 0.5, 10.0
"""Of the disk [m], [kg], the friction coefficient, and gravity [m/s^2]: friction is three times what rolling needs, and more."""

SPEED = 1.0
"""On the level plane [m/s], along which the disk is thrown rolling."""

DEGREES = {"level": 0.0, "incline": 10.0, "hold": 2.0}
"""Slopes: tan(10 deg) = 0.18 is above the coefficient of rolling friction, 0.1, and tan(2 deg) = 0.035 is below half of it."""

RADII, MASSES, PRESS = (0.5, 0.25), (2.0, 0.5), 5.0
"""Of the two disks that are pressed together [m], [kg], and by which force [N]."""

PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: omega dt, omega the higher of the normal and the shear frequency."""

NAMES = ("x", "vx", "spin")


class Resistance:
    """``plane=level``: a rolling disk slows down; ``incline``: one at rest rolls down; ``hold``: one at rest stays, if it can.

    ``plane=pair``: two smooth disks, unlike each other, are pressed together by forces and turn at different rates; their spins' difference
    is that of a disk that rolls (`equivalent_disk`). For x and vx put the way and speed of a rim of the reduced radius.
    """

    id = "rolling/resistance"
    version = 1
    title = "Rolling resistance: constant, viscous, elastic-plastic"
    source = "Ai, Chen, Rotter & Ooi, Powder Technology 206 (2011) 269-282, models A, B and C; Newton and Euler for a disk that rolls"
    requirement = (
        "constant: a = (2/3) g (sin - mu_r cos), at rest where tan(angle) <= mu_r; viscous: v' = (2/3) g (sin - mu_r cos v/(1 m/s)); "
        "elastic-plastic: a swing of omega^2 = 2 kr/(3 m R^2) that yields at mu_r R fn"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="model", default="constant", choices=ROLLING_MODELS, in_id=True, help="rolling resistance"),
        Parameter(name="plane", default="level", choices=(*DEGREES, "pair"), in_id=True, help="level, to roll down, to hold, or two disks"),
        Parameter.positive("mu_r", 0.1, high=0.5, unit="-", help="coefficient of rolling friction"),
        Parameter(name="kr", default=12.0, low=0.1, high=1e3, unit="N m/rad", help="rolling stiffness of the elastic-plastic model"),
        Parameter(name="beta", default=0.0, low=0.0, high=0.9, unit="-", help="damping ratio of the elastic-plastic model"),
        Parameter(name="preload", default=True, help="whether spring engines start with the shear force of the motion"),
        Parameter.positive("dt", 0.01, high=0.05, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("duration", 2.0, unit="s", help="length of the run"),
        Parameter(name="kn", default=1e7, low=1e5, unit="N/m", help="normal and shear stiffness of spring engines"),
        CONTACT_DT,
    )  # fmt: skip
    figures = (
        Figure(
            title="Against rolling resistance",
            quantities=(Plotted("x", "distance along the plane"), Plotted("vx", "velocity along the plane")),
            compare="model",
            shows="A disk thrown along a level plane, rolling, and one put at rest on inclines.",
            allows="A constant torque stops it, a viscous one never does and lets it creep down any slope; a spring holds it, swinging.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each model on the level and on the incline; what holds, with and without a dashpot; springs that start without a shear force."""
        return [
            *({"model": model, "plane": plane} for plane in ("level", "incline") for model in ROLLING_MODELS),
            *({"model": model, "preload": False} for model in ROLLING_MODELS[:2]),
            *({"model": model, "plane": "pair"} for model in ROLLING_MODELS),
            {"model": "elastic-plastic", "plane": "pair", "beta": 0.3},
            {"model": "constant", "plane": "hold"},
            {"model": "elastic-plastic", "plane": "hold"},
            {"model": "elastic-plastic", "plane": "hold", "beta": 0.3},
        ]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane, gravity tilted; springs carry the forces of the motion from the start."""
        kn, angle, speed = params["kn"], _angle(params), _speed(params)
        sprung = params["model"] == "elastic-plastic"
        rolling = Rolling(
            model=params["model"],
            mu=params["mu_r"],
            kr=params["kr"] if sprung else 0.0,
            beta=params["beta"] if sprung else 0.0,
        )
        if params["plane"] == "pair":
            return _pair(params, rolling)
        law = ContactLaw(kn=kn, ks=kn, mu=MU, restitution=0.0, rolling=rolling, regularised=True)
        # The disk is body i and the plane's normal is +y, hence t = +x: friction up the incline is fs < 0.
        friction = MASS * (GRAVITY * math.sin(angle) - float(_truth(params, np.zeros(1)).ax[0]))
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS - MASS * GRAVITY * math.cos(angle) / kn]]),
                v=np.array([[speed, 0.0]]),
                omega=np.array([-speed / RADIUS]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(GRAVITY * math.sin(angle), -GRAVITY * math.cos(angle)),
            initial_shear={PAIR: -friction} if friction and params["preload"] else {},
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / shear_frequency(kn, MASS, UNIFORM_DISK)),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Way and velocity along the plane, spin (positive forward) and slip; of a pair the gain of the angular momentum, over I."""
        vx, spin = history.v[:, 0, 0], 0.0 - history.omega[:, 0]
        if params["plane"] == "pair":
            disk, inertia = _disk(params), setup.scene.disks.inertia
            kept = (history.omega @ inertia - setup.scene.disks.omega @ inertia) / inertia.sum()
            spin = history.omega[:, 0] - history.omega[:, 1]
            rolled = disk.radius * (history.angle[:, 0] - history.angle[:, 1])
            series = {
                "x": ("m", rolled),
                "vx": ("m/s", disk.radius * spin),
                "spin": ("rad/s", spin),
                "slip": ("m/s", disk.radius * kept),
            }
            scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
            return Observed(step=history.step, t=history.t, series=series, scalars=scalars)
        series = {
            "x": ("m", history.x[:, 0, 0] - setup.scene.disks.x[0, 0]),
            "vx": ("m/s", vx),
            "spin": ("rad/s", spin),
            "slip": ("m/s", vx - RADIUS * spin),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the disk gets and how it spins, in parts of what it would have without resistance."""
        t_end = float(observed.t[-1])
        free = _speed(params) * t_end + _disk(params).g * math.sin(_angle(params)) * t_end**2 / (
            2.0 * (1.0 + UNIFORM_DISK)
        )
        truth, fastest = _truth(params, observed.t), _speed(params) + _disk(params).g * t_end
        return (
            Headline(name="spin against rolling resistance", use="rolling", quantity="spin", expected=truth.vx / _disk(params).radius,
                     source=self.source, scale=fastest / _disk(params).radius, scale_is="spin of a free fall in that time"),
            Headline(name="distance against rolling resistance", use="rolling", quantity="x_final",
                     expected=last(_truth(params, observed.t).x), source=self.source, scale=free, scale_is="distance without resistance"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Newton and Euler for the disk that rolls without slip; how far an engine may be from that."""
        truth = _truth(params, observed.t)
        expected = {
            "x": truth.x,
            "vx": truth.vx,
            "spin": truth.vx / _disk(params).radius,
            "slip": np.zeros_like(truth.x),
        }
        speed, why = _speed_error(params, setup, observed, engine)
        t_end = float(observed.t[-1])
        fastest = float(np.abs(truth.vx).max())
        # Rigid engines sum positions from the speed at one end of each step, springs from that of its middle.
        lag = 0.0 if engine.contact == "spring" else fastest * setup.numerics.dt
        size = {"x": speed * t_end + lag, "vx": speed, "spin": 2.0 * speed / _disk(params).radius, "slip": 3.0 * speed}
        scales = {
            "x": _disk(params).g * params["mu_r"] * t_end**2,
            "vx": fastest,
            "spin": fastest / _disk(params).radius,
            "slip": fastest,
        }
        common: dict[str, Any] = {"truth": "analytic", "source": self.source, "why": why}
        found = []
        for name, curve in expected.items():
            each = {"atol": size[name], "scale": max(scales[name], 1e-300), **common}
            found += [
                Check(quantity=name, norm="max", expected=curve, **each),
                Check(quantity=f"{name}_final", norm="scalar", expected=last(curve), **each),
            ]
        return found


def _angle(params: Mapping[str, Any]) -> float:
    return math.radians(DEGREES.get(params["plane"], 0.0))


def _disk(params: Mapping[str, Any]) -> EquivalentDisk:
    """The disk that rolls, or the one that a pair is as."""
    if params["plane"] != "pair":
        return EquivalentDisk(MASS, RADIUS, UNIFORM_DISK, GRAVITY, 1.0)
    (r_1, r_2), (m_1, m_2) = RADII, MASSES
    return equivalent_disk(
        radius_1=r_1, radius_2=r_2, mass_1=m_1, mass_2=m_2, inertia_1=0.5 * m_1 * r_1**2, inertia_2=0.5 * m_2 * r_2**2, force=PRESS
    )  # fmt: skip


def _pair(params: Mapping[str, Any], rolling: Rolling) -> Setup:
    """Along x, in equilibrium of their springs; smooth, so that nothing but rolling resistance turns them."""
    kn, disk = params["kn"], _disk(params)
    law = ContactLaw(kn=kn, restitution=0.0, rolling=rolling, regularised=True)
    scene = Scene(
        disks=Disks(
            x=np.array([[0.0, 0.0], [sum(RADII) - PRESS / kn, 0.0]]),
            radius=np.array(RADII),
            mass=np.array(MASSES),
            omega=np.array([0.25 + SPEED / disk.radius, 0.25]),
        ),
        disk_disk=law,
        forces=(BodyForce(disk=0, force=(PRESS, 0.0)), BodyForce(disk=1, force=(-PRESS, 0.0))),
    )
    stiff = math.sqrt(kn * sum(1.0 / mass for mass in MASSES))
    numerics = numerics_of(
        params,
        n_steps=whole_steps(params, params["duration"]),
        contact_dt=contact_step(params["dt"], PHASE / stiff),
    )
    return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})


def _speed(params: Mapping[str, Any]) -> float:
    return SPEED if params["plane"] in ("level", "pair") else 0.0


def _truth(params: Mapping[str, Any], t: np.ndarray[Any, Any]) -> Rolled:
    disk = _disk(params)
    given: dict[str, float] = {
        "mu_r": params["mu_r"], "angle": _angle(params), "g": disk.g, "speed": _speed(params), "inertia_ratio": disk.inertia_ratio,
    }  # fmt: skip
    if params["model"] == "constant":
        return against_constant_torque(t, **given)
    if params["model"] == "viscous":
        return against_viscous_torque(t, **given)
    return against_spring(
        t, **given, kr=params["kr"], beta=params["beta"] * disk.damping, mass=disk.mass, radius=disk.radius
    )


def _speed_error(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> tuple[float, str]:
    """Error of the velocity [m/s] that a step may make, and why.

    The rate at which the law answers is 0 for a constant torque, ``mu_r g cos/(1 + k)`` per m/s for a viscous one and omega for a
    spring. A scheme of first order is off by ``rate h`` of the velocity's change times ``rate t``, or once; one of second order, central
    differences without a dashpot, by half of ``rate h`` of that.

    The sign of a spin that is near 0 changes from step to step: the torque turns the disk by ``M h/I`` in one of them, ``2 mu_r g h``
    of the rim's speed, to either side, and for two steps where the sign is that of the last one.
    """
    numerics, law, disk = setup.numerics, setup.scene.disk_disk, _disk(params)
    spring, constant = engine.contact == "spring", params["model"] == "constant"
    h = (numerics.contact_dt or numerics.dt) if spring else numerics.dt
    t_end, angle, mu_r, g = float(observed.t[-1]), _angle(params), params["mu_r"], disk.g
    pull = g * math.sin(angle)
    change = _speed(params) + (pull + mu_r * g) * t_end
    rate, beta = 0.0, 0.0
    if params["model"] == "viscous":
        rate = mu_r * g * math.cos(angle) / (1.0 + disk.inertia_ratio)
    elif not constant:
        rate = oscillation(
            mu_r=mu_r, kr=params["kr"], angle=angle, g=g, mass=disk.mass, radius=disk.radius, inertia_ratio=disk.inertia_ratio
        ).omega  # fmt: skip
        beta = params["beta"] * disk.damping
        change = max(_speed(params), (mu_r * g + pull) / rate)  # of a swing
    second = spring and beta == 0.0 and params["model"] == "elastic-plastic"
    error = change * rate * h * max(1.0, rate * t_end) * (0.5 * rate * h if second else 1.0)
    error += 4.0 * mu_r * g * h if constant else 0.0
    why = f"rate h = {rate * h:.2g}" if rate else f"a torque whose sign is late, h = {h:.2g} s"
    if spring:
        # Where the force along the plane changes by F at once, the shear spring swings with F/m over its frequency; elsewhere it lags.
        stiff = shear_frequency(law.kn, MASS, UNIFORM_DISK)
        jump = mu_r * g if constant else 2.0 * beta * rate * change
        jump += 0.0 if params["preload"] else mu_r * g + pull
        jump = 0.0 if params["plane"] == "pair" else jump  # smooth
        arm = disk.mass * g / law.kn / disk.radius * (change + float(np.abs(_truth(params, observed.t).vx).max()))
        error += 2.0 * jump / stiff + change * (rate / stiff) ** 2
        error += arm + round_off_speed(RADIUS, h) * (1.0 + MU)
        why += "; swing on the shear spring, lever arm within the overlap, round-off"
    else:
        soft = g * slack_time(engine, numerics.dt) + single(engine, change, numerics.n_steps)
        error += 2.0 * (mu_r * g + pull) * h + soft + 1e-9 * change
        why += (
            "; what acts in the two steps in which it begins and ends" + soft_reason(engine) + single_precision(engine)
        )
    return error, why


CASE = Resistance()
