"""A disk that orbits another one in contact: the normal turns by several revolutions, and so do both disks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import LeverArm
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk.scene import NINE_DISK_CD, cd_settings

RADIUS, MASS = np.array([0.4, 0.5]), np.array([2.0, 1.0])
"""Of the disk in the middle and of the one around it."""

PERIOD, ORBIT, SQUEEZE = 5e-3, 0.24, 0.25
"""Time of a revolution [s], its radius [m], and the overlap of the orbiting disk with each smooth wall in the middle [m]."""

FREQUENCY = 2.0 * math.pi / PERIOD
SPIN = np.array([1.3, 0.5]) * FREQUENCY
"""Of both disks [rad/s]."""

KN, MU = 1e-12, 100.0
"""Normal and shear stiffness of the rough contact [N/m]: too weak to move anything; friction that does not let it slide."""

SAMPLES = 20
"""Samples of a revolution."""

FACES = {"left": (1.0, 0.0), "right": (-1.0, 0.0), "bottom": (0.0, 1.0), "top": (0.0, -1.0)}
PAIR = (0, 1)
CENTRAL = ("central-difference", "theta", "runge-kutta-3")
"""Schemes that turn a harmonic oscillator with an error of second order."""


class Orbit:
    """Four smooth walls are the springs on which a disk moves in a circle, around a disk that rests between the same walls.

    The contact of the two is rough and far too weak to move anything: its shear force records the slip, ``ks`` times
    ``(orbit Omega - R_1 w_1 - R_2 w_2) t``, along a tangent that turns by several revolutions. Spins stay what they were.
    """

    id = "contact/orbit"
    version = 1
    title = "Disk that orbits another one in contact"
    source = "uniform motion in a circle; the slip is the arc less what both surfaces turn by"
    requirement = "the shear force follows the tangent through all revolutions, and angles go on counting"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="arm", default="radius", choices=("radius", "overlap"), in_id=True, help="lever arm R, or R - overlap/2"),
        Parameter(name="turns", default=3, low=1, high=100, whole=True, help="revolutions of the run"),
        Parameter(name="steps", default=1000, low=SAMPLES, whole=True,
                  help=f"steps of every engine in a revolution, a multiple of {SAMPLES}"),
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Either arm, as engines have one or the other."""
        return [{"arm": "radius"}, {"arm": "overlap"}]

    def sticks(self, params: Mapping[str, Any]) -> bool:  # noqa: ARG002
        """The rough contact does not slide: its friction is a hundred times its normal force."""
        return True

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disk in the middle, and the other one at its right, moving up."""
        if params["steps"] % SAMPLES:
            raise ParameterError(
                f"steps = {params['steps']} is not allowed: a revolution has {SAMPLES} samples; use a multiple of {SAMPLES}"
            )
        # Two springs act along each axis.
        smooth = ContactLaw(kn=0.5 * float(MASS[1]) * FREQUENCY**2)
        away = float(RADIUS[1]) - SQUEEZE
        scene = Scene(
            disks=Disks(
                x=np.array([(0.0, 0.0), (ORBIT, 0.0)]), v=np.array([(0.0, 0.0), (0.0, ORBIT * FREQUENCY)]), omega=SPIN,
                radius=RADIUS, mass=MASS,
            ),
            disk_disk=ContactLaw(kn=KN, ks=KN, mu=MU, lever_arm=params["arm"]),
            walls=tuple(
                Wall(name=name, point=(-away * n[0], -away * n[1]), normal=n, law=smooth) for name, n in FACES.items()
            ),
        )  # fmt: skip
        numerics = Numerics(
            dt=PERIOD / SAMPLES,
            n_steps=SAMPLES * params["turns"],
            contact_dt=PERIOD / params["steps"],
            **cd_settings(params),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Shear as a length fs/ks, place of the orbiting disk, angles and gap."""
        series = {
            "shear": ("m", history.fs[:, 0] / KN),
            "x": ("m", history.x[:, 1, 0]),
            "y": ("m", history.x[:, 1, 1]),
            "angle_1": ("rad", history.angle[:, 0]),
            "angle_2": ("rad", history.angle[:, 1]),
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {"shear_final": ("m", float(series["shear"][1][-1]))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """Shear after all revolutions, and the angle by which the middle disk has turned."""
        end = float(setup.numerics.n_steps * setup.numerics.dt)
        size = abs(_slip(params)) * end
        return (
            Headline(name="shear after several revolutions", use="rolling", quantity="shear_final", expected=-_slip(params) * end,
                     source=self.source, scale=size, scale_is="slip"),
            Headline(name="angle of a disk that spins", use="rolling", quantity="angle_1", expected=SPIN[0] * observed.t,
                     source="nothing turns it", scale=float(SPIN[0]) * end, scale_is="angle at the end"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,  # noqa: ARG002
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """A circle run through at the scheme's own frequency, to the order of the scheme."""
        steps, t = params["steps"], observed.t
        turn = 2.0 * math.pi / steps
        radians = 2.0 * math.pi * params["turns"]
        first = 0.0 if engine.scheme in CENTRAL else turn
        if engine.scheme == "theta":
            # Its springs damp by theta omega dt/2 per radian, see `ninedisk.references.exact_steps.cd_row`.
            first = -math.expm1(-0.5 * params["theta"] * turn * radians)
        # A step's chord and frequency are off by a twelfth of its square at most, its radius by an eighth.
        relative = first + turn**2
        late = radians * turn**2 / 12.0 + first
        rough = steps * params["turns"] * float(np.spacing(2.0 * np.abs(SPIN).max() * params["turns"] * PERIOD)) + 1e-12
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "source": self.source}
        why = f"a step turns the normal by {turn:.2g} rad: its square" + (
            ", and the first order of the scheme" if first else ""
        )
        path = {"x": ORBIT * np.cos(FREQUENCY * t), "y": ORBIT * np.sin(FREQUENCY * t)}
        found = [
            Check(quantity=name, expected=curve, atol=ORBIT * (relative + late) + rough, scale=ORBIT, why=why, **common)
            for name, curve in path.items()
        ]  # fmt: skip
        found += [
            Check(quantity=f"angle_{k + 1}", expected=spin * t, atol=rough, why="nothing turns a disk: round-off of a sum", **common)
            for k, spin in enumerate(SPIN)
        ]  # fmt: skip
        found.append(
            Check(quantity="gap", expected=np.full_like(t, ORBIT - float(RADIUS.sum())), atol=ORBIT * relative + rough, scale=ORBIT,
                  why=why, **common)
        )  # fmt: skip
        arm = _arm(params, engine)
        slip, grown = _slip({"arm": arm}), 0.0
        if engine.turns_shear != "exactly" and LEVER_ARMS[arm] not in engine.turns_exactly_with:
            # Each step adds half the square of its rotation to a force that grows in proportion to the time.
            grown = 0.25 * turn**2 * steps * params["turns"]
            why += "; shear forces turned to first order, by half the square of each step's rotation"
        arc, end = ORBIT * FREQUENCY + float(np.abs(RADIUS * SPIN).sum()), float(params["turns"] * PERIOD)
        off = relative * arc * end + grown * abs(slip) * end + rough
        off += abs(slip) * PERIOD / steps  # a force of the step before
        found.append(Check(quantity="shear", expected=-slip * t, atol=off, scale=abs(slip) * end, why=why, **common))
        return found


def _arm(params: Mapping[str, Any], engine: EngineInfo) -> LeverArm:
    """The lever arm of the scene where the engine has it, else its own: the headline shows what that does."""
    asked: LeverArm = params["arm"]
    if LEVER_ARMS[asked] in engine.capabilities:
        return asked
    return "overlap" if LEVER_ARMS["overlap"] in engine.capabilities else "radius"


def _slip(params: Mapping[str, Any]) -> float:
    """Velocity of the middle disk's surface along the tangent, seen from the other's [m/s]."""
    arm = RADIUS - (0.5 * (float(RADIUS.sum()) - ORBIT) if params["arm"] == "overlap" else 0.0)
    return float(arm @ SPIN) - ORBIT * FREQUENCY


CASE = Orbit()
