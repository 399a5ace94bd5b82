"""Contacts that stick while spheres move and turn as one body does: the shear force turns with its contact and does nothing else.

Spheres are so heavy that their contacts do not move them: places and spins are those of free motion, and every engine with springs can
be asked, whether it has prescribed motion or not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    ParameterError,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import single, single_precision
from ninedisk.harness.cases.differences import FINDING_WORDS
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.contact.turned_shear import kept_shear, turned_by, turned_shear

RADIUS, KN, MU = 0.5, 1e3, 1.0
MASS = 1e12
"""[kg]: no contact moves it."""
OVERLAP, KS = 1e-8, 1e-4
"""Of spheres that turn in one place [m], where it makes no difference then at which end of it their surfaces meet; so soft that the spring
sticks up to ``MU KN OVERLAP/KS``, 0.1 m [N/m]."""

CLOSEST, HALF = 0.85, 0.45
"""Distance of two spheres that pass, and half of their path [m]: the normal turns by 56 degrees, overlaps are 0.04 to 0.15."""

LOADED, TURN, SAMPLES = 0.02, 2.0, 100
"""Time for which the plane waits before it turns with the sphere [s]; angular speed of that [rad/s]; samples of a run."""

CENTRE = (0.2, -0.1, 0.3)
"""Of the first sphere [m]."""

SOURCE = "the spring's equation in a frame that turns with the contact"

AXES = {"across": (0.0, 1.0, 0.0), "skew": (2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0)}
"""Of what turns: across the normal z at the beginning, and neither across nor along it."""


class Turned:
    """Four contacts that stick: on a plane that turns with its sphere, of two spheres in one place, and of two that pass.

    ``plane``: a sphere turns about its centre over a plane at rest until LOADED; from then on the plane turns about the same centre, with
    the same spin: one rigid body, whose normal and shear force turn once. ``spun``: two spheres in place have spins whose sum has a part
    about the normal, which turns the spring while slip of one direction feeds it: a circle. ``passed``: a sphere passes another
    one on a straight line, neither spins; the normal turns by a radian.
    """

    id = "spheres/turned"
    version = 1
    title = "Contacts that stick and turn"
    source = "a shear force turns with the bodies that it acts between"
    requirement = "the shear force of a contact that sticks turns with it: as the normal does, and about it by the mean of both spins"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="plane", choices=("plane", "spun", "passed"), in_id=True,
                  help="plane and sphere turn as one body; two spheres that spin about their normal; one that passes another"),
        Parameter(name="axis", default="across", choices=tuple(AXES), in_id=True,
                  help="of the turn, across the normal or skew; of kind plane"),
        Parameter(name="turns", default=1.0, low=0.1, high=100.0, unit="-", help="of the plane with its sphere"),
        Parameter(name="steps", default=2000, low=200, high=1e6, whole=True, unit="-", help="contact steps of the run, a multiple of 100"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Shear on a contact that turns",
            quantities=(
                Plotted("along", "along the first tangent, turned with the contact"), Plotted("across", "across it")
            ),
            compare="kind",
            shows="The shear spring in a frame that turns with the contact, of a plane that turns with its sphere, and of two spheres.",
            allows="A straight line where both bodies turn as one; a spring that does not turn about the normal goes on in its first "
            "direction where spheres spin.",
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each kind; the plane about both axes, and three times."""
        return [
            {"kind": "plane"}, {"kind": "plane", "axis": "skew"}, {"kind": "plane", "axis": "skew", "turns": 3.0}, {"kind": "spun"},
            {"kind": "passed"},
        ]  # fmt: skip

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Contacts overlap from the start, their springs begin unloaded."""
        kind, steps = params["kind"], int(params["steps"])
        if steps % SAMPLES:
            raise ParameterError(
                f"steps = {steps} is not allowed: a run has {SAMPLES} samples; use a multiple of {SAMPLES}"
            )
        law = SphereLaw(kn=KN, ks=KS, mu=MU)
        one = np.array(CENTRE)
        walls: tuple[PlaneWall, ...] = ()
        if kind == "plane":
            x, y, z = AXES[params["axis"]]
            spin = (TURN * x, TURN * y, TURN * z)
            motion = (PlaneSegment(duration=LOADED), PlaneSegment(angular_velocity=spin, pivot=CENTRE))
            floor = (CENTRE[0], CENTRE[1], CENTRE[2] - RADIUS + OVERLAP)
            walls = (PlaneWall(name="plane", point=floor, normal=(0.0, 0.0, 1.0), law=law, motion=motion),)
            spheres = Spheres(x=one[None], omega=np.array([spin]), radius=np.array([RADIUS]), mass=np.array([MASS]))
            duration = LOADED + 2.0 * math.pi / TURN * params["turns"]
            # The plane begins to turn where a step ends, so that no step has half of it.
            dt = LOADED / max(1, round(LOADED * steps / duration))
        else:
            (apart, v), spins = self._pair(kind)
            places, v = np.stack([one, one + apart]), np.stack([np.zeros(3), v])
            spheres = Spheres(x=places, v=v, omega=spins, radius=np.full(2, RADIUS), mass=np.full(2, MASS))
            dt = 1.0 / steps
        scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=walls)
        every = steps // SAMPLES
        numerics = Numerics(dt=every * dt, n_steps=SAMPLES, contact_dt=dt, impact="newton", sliding="coulomb")
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})

    def _pair(self, kind: str) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
        """From the first to the second at time 0 and its velocity; both spins."""
        near = 2.0 * RADIUS - OVERLAP
        if kind == "spun":
            n = np.array([1.0, 2.0, 2.0]) / 3.0
            tangent = np.array([2.0, 1.0, -2.0]) / 3.0
            return (near * n, np.zeros(3)), np.stack([2.5 * n + 0.06 * tangent, 1.5 * n + 0.02 * tangent])
        path, side = np.array([2.0, -1.0, 2.0]) / 3.0, np.array([2.0, 2.0, -1.0]) / 3.0
        return (CLOSEST * side - HALF * path, 2.0 * HALF * path), np.zeros((2, 3))

    def _truth(
        self, params: Mapping[str, Any], setup: SphereSetup, t: FloatArray, *, share: float = 1.0, cut: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Spring [m] and the frame that turns with the contact, shape (s, 3) and (s, 2, 3).

        ``share`` is the part of the spins' mean by which the spring turns about the normal, ``cut`` what arms lack to the radius [m].
        """
        spheres = setup.scene.spheres
        spins, arm = spheres.omega, RADIUS - cut
        if params["kind"] != "plane":
            return turned_shear(
                apart=spheres.x[1] - spheres.x[0], v=spheres.v[1] - spheres.v[0], roll=arm * (spins[0] + spins[1]),
                spin=share * (spins[0] + spins[1]), t=t,
            )  # fmt: skip
        spin, n = spins[0], np.array([0.0, 0.0, -1.0])
        later = np.maximum(t - LOADED, 0.0)
        # The plane has half of the twist while it waits.
        loaded, frame = turned_shear(
            apart=n, v=np.zeros(3), roll=arm * spin, spin=share * spin, t=np.minimum(t, LOADED)
        )
        about = (share - 1.0) * float(spin @ n) * n
        shear = turned_by(turned_by(loaded, about, later), spin, later)
        return shear, np.stack([turned_by(frame[:, k], spin, later) for k in (0, 1)], axis=1)

    def _kept(self, params: Mapping[str, Any], setup: SphereSetup, t: FloatArray) -> FloatArray:
        """The spring [m] of an engine that does not turn it, in the tangent plane, shape (s, 3)."""
        spheres = setup.scene.spheres
        spins = spheres.omega
        if params["kind"] != "plane":
            return kept_shear(
                apart=spheres.x[1] - spheres.x[0], v=spheres.v[1] - spheres.v[0], roll=RADIUS * spins.sum(axis=0), t=t
            )
        # It begins on a plane at rest and stays as it was then, while the normal turns.
        spin, n, later = spins[0], np.array([0.0, 0.0, -1.0]), np.maximum(t - LOADED, 0.0)
        spring = -np.minimum(t, LOADED)[:, None] * np.cross(RADIUS * spin, n)
        turned = turned_by(np.tile(n, (len(t), 1)), spin, later)
        return np.asarray(spring - np.einsum("sj,sj->s", spring, turned)[:, None] * turned)

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """The spring's parts along a frame that turns with the contact, and out of the tangent plane; ``astray``, the way off the truth."""
        shear = history.fs[:, 0] / KS
        truth, frame = self._truth(params, setup, history.t)
        normal = np.cross(frame[:, 0], frame[:, 1])
        parts = np.einsum("sj,skj->ks", shear, frame)
        series = {
            "along": ("m", parts[0]),
            "across": ("m", parts[1]),
            "out": ("m", np.einsum("sj,sj->s", shear, normal)),
        }
        astray = float(np.linalg.norm(shear[-1] - truth[-1]) / np.linalg.norm(truth[-1]))
        return Observed(step=history.step, t=history.t, series=series, scalars={"astray": ("1", astray)})

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the shear force is off in the end, in size and direction."""
        return (
            Headline(name="shear force that turned", use="moving-walls", quantity="astray", expected=0.0, source=SOURCE, scale=1.0,
                     scale_is="shear force"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Parts of the spring at all times, each within its scheme's order."""
        t, dt = observed.t, float(setup.numerics.contact_dt or setup.numerics.dt)
        truth, frame = self._truth(params, setup, t)
        axes = (frame[:, 0], frame[:, 1], np.cross(frame[:, 0], frame[:, 1]))
        spheres, end, n_steps = setup.scene.spheres, float(t[-1]), round(float(t[-1]) / dt)
        spin, speed = (
            float(np.linalg.norm(spheres.omega.sum(axis=0))),
            float(np.linalg.norm(np.diff(spheres.v, axis=0))),
        )
        turn, size = spin + speed / CLOSEST, float(np.linalg.norm(truth, axis=1).max())
        across = float(np.linalg.norm(np.cross(spheres.omega.sum(axis=0), axes[2][0])))
        fed = (RADIUS * across + speed) * (LOADED if params["kind"] == "plane" else end)
        # A step turns by `turn dt`: its slip is that of its middle, turned by half of its own twist.
        exact = (turn * dt) ** 2 / 12.0 * (turn * end * size + fed)
        exact += spin * OVERLAP * end + float(np.spacing(2.0)) * n_steps + single(engine, 1.0, n_steps)
        why = f"second order of steps that turn by {turn * dt:.2g} rad; arms off by the overlap"
        if engine.turns_shear != "exactly":
            exact += 0.55 * (turn * dt) ** 2 * n_steps * size
            why += "; shear forces turned to first order, by half the square of each step's rotation"
        known, reason = 0.0, ""
        words = "ratchet"
        if Capability.SLIP_MIDDLE not in engine.capabilities:
            known += 0.5 * (turn + 0.5 * spin) * dt * fed
            reason = "half a step's rotation of all slip"
        if Difference.SHEAR_KEEPS_TWIST in engine.differences:
            straight, _ = self._truth(params, setup, t, share=0.0)
            off = float(np.linalg.norm(straight - truth, axis=1).max())
            if off > known:
                words = FINDING_WORDS[Difference.SHEAR_KEEPS_TWIST]
                reason += "; what a spring lacks that does not turn about the normal"
            known += off
        if Difference.SHEAR_KEEPS_DIRECTION in engine.differences:
            known += float(np.linalg.norm(self._kept(params, setup, t) - truth, axis=1).max())
            words = FINDING_WORDS[Difference.SHEAR_KEEPS_DIRECTION]
            reason += "; what a spring is off that turns neither with the normal nor about it"
        excuse = KnownDifference(finding=f"{engine.id}/{words}", size=exact + known, why=reason) if known else None
        if single(engine, 1.0, 1) > OVERLAP:
            truth = np.full_like(truth, np.nan)  # rounding alone opens the contact
        return [
            Check(quantity=name, norm="max", truth="analytic", expected=np.einsum("sj,sj->s", truth, axis), source=SOURCE, atol=exact,
                  scale=size, why=why + single_precision(engine), known=excuse)
            for name, axis in zip(("along", "across", "out"), axes, strict=True)
        ]  # fmt: skip


CASE = Turned()
