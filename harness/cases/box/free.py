"""A box in flight: Euler's equations, with a spin about any axis or near the intermediate one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.box.scene import KN, MASS, box_axes
from ninedisk.harness.cases.common import last, numerics_of, single, single_precision, whole_steps
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.free_rotation import Rotation, euler_steps, free_rotation

HALF = np.array([0.5, 0.3, 0.2])
"""Half the edges [m]: the moments of inertia about them grow in this order."""

TURN = np.array([0.5, 0.1, -0.7, 0.5])
"""Orientation at time 0, a unit quaternion (w, x, y, z): no axis of the box lies along one of the scene."""

SPINS = {"any": np.array([3.0, 1.5, -2.0]), "intermediate": np.array([0.05, 4.0, 0.02])}
"""Spins about the axes of the box [rad/s]."""

VELOCITY = np.array([0.7, -0.3, 1.1])

SOURCE = "Euler's equations, integrated to 1e-13"


class _Truth(NamedTuple):
    """Axes of the box, shape (s, 3, 3), spins about the scene's axes, shape (s, 3), momentum and energy at time 0."""

    axes: FloatArray
    omega: FloatArray
    momentum: FloatArray
    energy: float


class FreeBox:
    """No force acts: energy and angular momentum stay as they are while the spin moves about the body.

    Near the intermediate axis the box turns over again and again. Any error grows by the rate of that, so that orientations are judged by
    what Euler's explicit rule with the same step errs by; energy and momentum have no such growth.
    """

    id = "box/free"
    version = 1
    title = "A box in flight turns as Euler's equations say"
    source = SOURCE
    requirement = "I dw/dt = I w x w about the axes of the box; energy and angular momentum are kept; the centre moves straight on"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="spin", default="any", choices=tuple(SPINS), in_id=True,
                  help="about no axis of the box, or near the intermediate one"),
        Parameter.positive("dt", 0.005, unit="s", in_id=True, help="step"),
        Parameter.positive("duration", 2.0, high=20.0, unit="s", help="length of the run"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Rotation in flight",
            quantities=(
                Plotted("about_second", "spin about the intermediate axis"),
                Plotted("energy", "energy over that of time 0"),
            ),
            compare="spin",
            shows="The spin about the box's intermediate axis, and the energy of the rotation.",
            allows="Near the intermediate axis the spin changes its sign; how soon depends on the errors of the steps before.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both spins, and half the step: errors of first order halve; near the intermediate axis until the box has turned over."""
        return [{}, {"dt": 0.0025}, {"spin": "intermediate", "duration": 5.0}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box, no wall and no gravity."""
        law = SphereLaw(kn=KN, ks=KN, restitution=0.0, regularised=True)
        box = Spheres(
            x=np.zeros((1, 3)),
            mass=np.array([MASS]),
            half_sizes=HALF[None, :],
            quaternion=TURN[None, :],
            v=VELOCITY[None, :],
            omega=(rotation_matrix(TURN) @ SPINS[params["spin"]])[None, :],
        )
        n_steps = whole_steps(params, params["duration"])
        return SphereSetup(
            scene=SphereScene(spheres=box, sphere_sphere=law),
            numerics=numerics_of(params, n_steps=n_steps, contact_dt=params["dt"]),
            watch=(),
            labels={},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Errors of the orientation [1], spin about the box's own axes, energy and momentum over those of time 0."""
        truth = _exact_rotation(params, setup)
        inertia = setup.scene.spheres.inertia[0]
        axes, omega = box_axes(history), history.omega[:, 0]
        own = np.einsum("sji,sj->si", axes, omega)
        momentum = np.einsum("sij,sj->si", axes, inertia * own)
        size = float(np.linalg.norm(truth.momentum))
        series = {
            "orientation": ("1", _apart(axes, truth.axes)),
            "about_second": ("rad/s", own[:, 1]),
            "energy": ("1", 0.5 * own**2 @ inertia / truth.energy),
            "momentum": ("1", np.linalg.norm(momentum - truth.momentum, axis=1) / size),
            "off_line": ("m", np.linalg.norm(history.x[:, 0] - history.t[:, None] * VELOCITY, axis=1)),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Energy, momentum and orientation in the end."""
        return (
            Headline(name="energy of a free rotation", use="energy", quantity="energy_final", expected=1.0, source="conservation",
                     scale=1.0, scale_is="initial energy"),
            Headline(name="angular momentum of a free rotation", use="energy", quantity="momentum_final", expected=0.0,
                     source="conservation", scale=1.0, scale_is="initial angular momentum"),
            Headline(name="orientation of a box in flight", use="energy", quantity="orientation_final", expected=0.0, source=SOURCE,
                     scale=2.0, scale_is="that of opposite axes"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Twice what Euler's explicit rule of the same step errs by; the largest of the run so far, as errors may cross zero."""
        numerics = setup.numerics
        truth, inertia = _exact_rotation(params, setup), setup.scene.spheres.inertia[0]
        plain = _plain_steps(params, setup)
        axes = _axes(plain.quaternion)
        own = plain.spin
        energy = 0.5 * own**2 @ inertia / truth.energy
        momentum = np.einsum("sij,sj->si", axes, inertia * own) - truth.momentum
        off = {
            "orientation": _apart(axes, truth.axes),
            "energy": np.abs(energy - 1.0),
            "momentum": np.linalg.norm(momentum, axis=1) / float(np.linalg.norm(truth.momentum)),
        }
        rough = 1e-12 * numerics.n_steps + single(engine, 1.0, numerics.n_steps)
        why = f"twice what Euler's explicit rule errs by with this step{single_precision(engine)}"
        path = float(np.linalg.norm(VELOCITY)) * float(observed.t[-1])
        expected = {"orientation": 0.0, "energy": 1.0, "momentum": 0.0}
        return [
            *(
                Check(quantity=name, norm="max", truth="analytic", expected=np.full_like(observed.t, expected[name]), source=SOURCE,
                      atol=2.0 * float(off[name].max()) + rough, scale=1.0, why=why)
                for name in off
            ),
            Check(quantity="off_line", norm="max", truth="analytic", expected=np.zeros_like(observed.t), source="Newton's first law",
                  atol=1e-12 * path * numerics.n_steps + single(engine, path, numerics.n_steps), scale=path,
                  why=f"sum of equal displacements: round-off{single_precision(engine)}"),
        ]  # fmt: skip


def _start(params: Mapping[str, Any], setup: Any) -> dict[str, Any]:
    return {"inertia": setup.scene.spheres.inertia[0], "spin": SPINS[params["spin"]], "quaternion": TURN}


def _exact_rotation(params: Mapping[str, Any], setup: Any) -> _Truth:
    numerics = setup.numerics
    found = free_rotation(numerics.sampled_steps() * numerics.dt, **_start(params, setup))
    axes, inertia = _axes(found.quaternion), setup.scene.spheres.inertia[0]
    omega = np.einsum("sij,sj->si", axes, found.spin)
    spin = SPINS[params["spin"]]
    return _Truth(axes, omega, rotation_matrix(TURN) @ (inertia * spin), float(0.5 * spin**2 @ inertia))


def _plain_steps(params: Mapping[str, Any], setup: Any) -> Rotation:
    numerics = setup.numerics
    found = euler_steps(numerics.n_steps, dt=numerics.dt, **_start(params, setup))
    sampled = numerics.sampled_steps()
    return Rotation(found.spin[sampled], found.quaternion[sampled])


def _axes(quaternions: FloatArray) -> FloatArray:
    return np.array([rotation_matrix(each) for each in quaternions])


def _apart(one: FloatArray, two: FloatArray) -> FloatArray:
    """Largest distance of an axis of the box from where it should be, at each sample: 2 where it points the other way."""
    apart: FloatArray = np.linalg.norm(one - two, axis=1).max(axis=1)
    return apart


CASE = FreeBox()
