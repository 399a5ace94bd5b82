"""A sheared disk in a box that turns as a whole: contact forces turn with it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk.scene import NINE_DISK_CD, cd_settings

RADIUS, MASS = 0.5, 1.0
NAMES = ("bottom", "right", "top", "left")
"""Walls in the order of their outward directions, a quarter turn each."""

SAMPLES = 50


class RotatingBox:
    """One disk between four rough walls that turn about its centre, under normal and alternating shear forces.

    Shear forces ``+s, -s, +s, -s`` at walls a quarter turn apart have neither a resultant nor a moment: the disk is in equilibrium,
    and stays so in the frame of the box. Nothing but the turning of the shear forces with their contacts keeps it there.
    """

    id = "invariance/objectivity"
    version = 1
    title = "Sheared disk in a turning box"
    source = "objectivity: a rigid rotation changes no contact force in the contact's own frame"
    requirement = (
        "under a rigid rotation normal and shear forces keep their size, and the disk its place and the box's spin"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="arm", default="overlap", choices=("overlap", "radius"), in_id=True,
            help="lever arm of the shear force: R - overlap/2, walls felt there, or R, walls felt on their surface",
        ),
        Parameter(name="turn_deg", default=90.0, low=0.0, high=360.0, unit="deg", help="angle by which the box turns"),
        Parameter.positive("dt", 2.5e-5, unit="s", help="step of every engine"),
        Parameter(name="steps", default=4000, low=SAMPLES, whole=True, help="steps of the run"),
        Parameter(name="kn", default=1e6, low=1e3, unit="N/m", help="normal and shear stiffness"),
        Parameter.positive("fn", 100.0, unit="N", help="normal force of every contact"),
        Parameter(name="fs", default=20.0, low=0.0, unit="N", help="size of the shear forces, below mu fn"),
        Parameter.positive("mu", 0.5, unit="-", help="friction coefficient"),
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Either lever arm; the two conventions differ by the overlap in what a rigid rotation is to them."""
        return [{"arm": "overlap"}, {"arm": "radius"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disk in the origin; every wall turns about it."""
        kn, overlap, rate = params["kn"], params["fn"] / params["kn"], _rate(params)
        if not (overlap < 0.1 * RADIUS and params["fs"] < params["mu"] * params["fn"]):
            raise ParameterError(
                f"fn = {params['fn']:g} N, fs = {params['fs']:g} N are not allowed: fn must stay below {0.1 * RADIUS * kn:g} N (a tenth of "
                f"the radius), fs below mu fn = {params['mu'] * params['fn']:g} N"
            )
        at = "mid-overlap" if params["arm"] == "overlap" else "surface"
        law = ContactLaw(kn=kn, ks=kn, mu=params["mu"], lever_arm=params["arm"], wall_velocity_at=at)  # type: ignore[arg-type]
        motion = (WallSegment(angular_velocity=rate, pivot=(0.0, 0.0)),)
        away = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))
        reach = RADIUS - overlap
        walls = tuple(
            Wall(name=name, point=(reach * x, reach * y), normal=(-x, -y), law=law, motion=motion)
            for name, (x, y) in zip(NAMES, away, strict=True)
        )
        disks = Disks(x=[[0.0, 0.0]], radius=RADIUS, mass=MASS, omega=[_spin(params)])  # type: ignore[arg-type]
        scene = Scene(
            disks=disks,
            disk_disk=law,
            walls=walls,
            initial_shear={(0, k + 1): s for k, s in enumerate(_shears(params))},
        )
        numerics = Numerics(
            dt=params["dt"],
            n_steps=params["steps"],
            contact_dt=params["dt"],
            sample_every=max(params["steps"] // SAMPLES, 1),
            **cd_settings(params),
        )
        labels = {name: (0, k + 1) for k, name in enumerate(NAMES)}
        return Setup(scene=scene, numerics=numerics, watch=tuple(labels.values()), labels=labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Forces in the frames of the contacts, the centre's path and the disk's spin; ``shear`` is the mean size of the four."""
        series = {}
        for name, pair in setup.labels.items():
            column = history.contact(pair)
            series[f"fn_{name}"] = ("N", history.fn[:, column])
            series[f"fs_{name}"] = ("N", history.fs[:, column])
        series["way"] = ("m", np.hypot(history.x[:, 0, 0], history.x[:, 0, 1]))
        series["spin"] = ("rad/s", history.omega[:, 0])
        scalars = {"shear": ("N", float(np.abs(history.fs[-1]).mean()))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Forces turn with the box, and the disk stays in its middle."""
        return (
            Headline(name="shear force", use="invariance", quantity="shear", expected=params["fs"],
                     source="objectivity: forces turn with the box", scale=params["fn"], scale_is="normal force"),
            Headline(name="drift of the resting disk", use="invariance", quantity="way", expected=0.0,
                     source="objectivity: equilibrium in the box", scale=RADIUS, scale_is="radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Nothing changes.

        Tolerances: a rounding of each step's coordinates, all in phase with the disk's swing at worst; engines that turn shear forces
        to first order let them grow by half the square of the rotation in each step; an engine with another lever arm sees the
        walls slip at ``rate overlap`` at most, against which the disk swings on its shear springs, ``Omega^2 = 4 ks R^2/I``; contact
        dynamics takes the rotation of a step along its chord, and so a slip of the square of that rotation.
        """
        steps, dt, kn = setup.numerics.n_steps, setup.numerics.dt, params["kn"]
        length = float(np.spacing(RADIUS)) * (8.0 + 0.5 * steps)
        omega = math.sqrt(8.0 * kn / MASS)  # I = m R^2/2
        rough, size = kn * length, params["fs"]
        growth = 0.0 if engine.turns_shear == "exactly" else math.expm1(0.5 * steps * (_rate(params) * dt) ** 2)
        why = "round-off of the coordinates, added up over the steps"
        why += f"; shear forces turned to first order grow by {growth:.2g} in all" if growth else ""
        slip, residual = 0.0, 0.0
        if LEVER_ARMS[params["arm"]] not in engine.capabilities:
            slip = 2.0 * _rate(params) * params["fn"] / kn
            why += "; another lever arm, by which rigid rotation is slip"
        if engine.contact == "cd":
            slip += 0.5 * _rate(params) * RADIUS * (_rate(params) * dt) ** 2
            residual = 1e-9 * params["fn"]
            why += "; a step's rotation taken along its chord, second order; residual of the solver over the swing's memory"
        shear = rough + growth * size + kn * slip / omega + residual
        # Shear forces that have grown or slipped push the disk, and turn it, by as much over the springs that hold it.
        spin = (shear / kn * omega + slip) / RADIUS
        atol = {"fn": shear, "fs": shear, "way": length + shear / kn, "spin": spin}
        expected = {"way": 0.0, "spin": _spin(params)}
        for name, force in zip(NAMES, _shears(params), strict=True):
            expected |= {f"fn_{name}": params["fn"], f"fs_{name}": force}
        source = "objectivity: forces turn with the box"
        loaded = observed.t >= 0.0 if engine.contact == "spring" else observed.t > 0.0
        found = [
            Check(quantity=name, norm="max", truth="analytic", source=source, why=why, atol=atol[name.split("_")[0]],
                  expected=np.where(loaded, value, np.nan), scale=RADIUS if name == "way" else 0.0)
            for name, value in expected.items()
        ]  # fmt: skip
        found.append(
            Check(quantity="shear", norm="scalar", truth="analytic", expected=size, source=source, atol=shear, why=why)
        )
        return found


def _rate(params: Mapping[str, Any]) -> float:
    return float(math.radians(params["turn_deg"]) / (params["dt"] * params["steps"]))


def _spin(params: Mapping[str, Any]) -> float:
    """Spin without slip: that of the box, or, where an arm R meets walls felt at R - overlap, smaller by overlap/R."""
    short = params["fn"] / params["kn"] / RADIUS if params["arm"] == "radius" else 0.0
    return _rate(params) * (1.0 - short)


def _shears(params: Mapping[str, Any]) -> tuple[float, ...]:
    return tuple(params["fs"] * sign for sign in (1.0, -1.0, 1.0, -1.0))


CASE = RotatingBox()
