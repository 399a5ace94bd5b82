"""Free disks under forces and torques: constant, or by segments that begin and end within steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import single, single_precision
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.contact.segments import Driven, under_segments

RADIUS, MASS = 0.5, 2.0
"""Of each disk [m], [kg]."""

V0, SPIN0 = (0.4, 0.1), 1.0
"""Velocity [m/s] and spin [rad/s] at time 0."""

FORCE, TORQUE = (3.0, -1.0), 0.2
"""[N], [N m]."""

SPANS = ((0.0732, 0.2119), (0.1871, 0.4567))
"""Segments [s], which overlap: no end is at a step or half-way between two. The second one is opposite, of half the size."""

SHIFT = 10.0
"""Distance of the disks [m]: they never meet."""


class Forces:
    """``span=constant``: throughout the run; ``span=segments``: two segments, both in force for a while."""

    id = "motion/forces"
    version = 2
    title = "Forces and torques on free disks"
    source = "Newton's second law: the momentum is the impulse of the force, wherever in a step it begins"
    requirement = "m v = F t for each disk's own force, I omega = M t for its torque; a step in which a force begins gets its part of it"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="span", default="segments", choices=("constant", "segments"), in_id=True, help="how long the forces act"),
        Parameter.positive("dt", 1e-3, high=0.05, unit="s", help="step"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Motion under forces",
            quantities=(
                Plotted("x", "displacement along x"),
                Plotted("vx", "velocity along x"),
                Plotted("spin", "spin"),
            ),
            compare="span",
            shows="Two disks in flight, one pushed and one turned as well, and a third that nothing acts on.",
            allows="Velocities are those of the forces' impulses to round-off; places are off by what a step of the scheme makes of them.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both spans."""
        return [{"span": "constant"}, {"span": "segments"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The first disk is pushed, the second one pushed and turned, the third one is left alone."""
        forces = [
            BodyForce(
                disk=disk,
                force=(size * FORCE[0], size * FORCE[1]),
                torque=size * TORQUE * (disk == 1),
                begin=begin,
                end=end,
            )
            for disk in (0, 1)
            for begin, end, size in _force_segments(params)
        ]
        disks = Disks(
            x=np.array([[0.0, 0.0], [SHIFT, 0.0], [2.0 * SHIFT, 0.0]]),
            v=np.array([V0, V0, V0]),
            omega=np.array([0.0, SPIN0, SPIN0]),
            radius=np.full(3, RADIUS),
            mass=np.full(3, MASS),
        )
        law = ContactLaw(kn=100.0, restitution=0.0, regularised=True)
        numerics = Numerics(dt=params["dt"], n_steps=math.ceil(0.6 / params["dt"]), contact_dt=params["dt"])
        return Setup(scene=Scene(disks=disks, disk_disk=law, forces=tuple(forces)), numerics=numerics, watch=())

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Ways and velocities of the first disk, spins of the second one, and what is not as Newton's first law has it of the third."""
        path = history.x - setup.scene.disks.x
        alone = np.abs(history.v[:, 2] - np.array(V0)).max(axis=1)
        series = {
            "x": ("m", path[:, 0, 0]),
            "y": ("m", path[:, 0, 1]),
            "vx": ("m/s", history.v[:, 0, 0]),
            "vy": ("m/s", history.v[:, 0, 1]),
            "vx_turned": ("m/s", history.v[:, 1, 0]),
            "spin": ("rad/s", history.omega[:, 1]),
            "alone": ("m/s", alone),
        }
        scalars = {f"{name}_final": (unit, float(values[-1])) for name, (unit, values) in series.items()}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Where the pushed disk gets, along its motion and across it, and the spin that a torque gives."""
        end, across = _exact_translation(params, observed.t, 0), _exact_translation(params, observed.t, 1)
        turned = _exact_spin(params, observed.t)
        scale = float(np.abs(end.path - V0[0] * observed.t).max(initial=0.0))
        return (
            Headline(name="distance under a force", use="energy", quantity="x_final", expected=float(end.path[-1]), source=self.source,
                     scale=scale, scale_is="distance that the force adds"),
            Headline(name="distance across", use="energy", quantity="y_final", expected=float(across.path[-1]), source=self.source,
                     scale=scale, scale_is="distance that the force adds"),
            Headline(name="spin under a torque", use="energy", quantity="spin_final", expected=float(turned[-1]), source=self.source,
                     scale=float(np.abs(turned - SPIN0).max(initial=0.0)) or 1.0, scale_is="spin that the torque adds"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Impulses to round-off where no force begins or ends within a step; places to the first order of any scheme."""
        dt, t = setup.numerics.dt, observed.t
        # A step gets its mean force: within half of one to either side of an end velocities are between two.
        ends = [time for begin, end, _ in _force_segments(params) for time in (begin, end) if 0.0 < time < math.inf]
        near = np.zeros_like(t, dtype=bool)
        for time in ends:
            near |= np.abs(t - time) < dt
        fastest = abs(V0[0]) + 2.0 * FORCE[0] * float(t[-1]) / MASS
        # Half a unit of the last place in each of up to 256 substeps (MuJoCo takes 200), always in the same direction.
        sums = 128.0 * np.finfo(np.float64).eps * setup.numerics.n_steps
        rough = sums * fastest + single(engine, fastest, setup.numerics.n_steps)
        spun = SPIN0 + 2.0 * TORQUE * float(t[-1]) / (0.5 * MASS * RADIUS**2)
        of_spin = sums * spun + single(engine, spun, setup.numerics.n_steps)
        length = fastest * float(t[-1]) + SHIFT
        place = _place_in_step(setup, engine)
        central = place is not None
        lag = 1.5 * FORCE[0] / MASS * (0.125 * dt * len(ends) if central else float(t[-1])) * dt
        lag += rough * float(t[-1]) + single(engine, length, setup.numerics.n_steps)
        common: dict[str, Any] = {"truth": "analytic", "source": self.source}
        exact = "impulses are exact: round-off of up to 256 substeps a step" + single_precision(engine)
        late = (
            "positions by exact speeds at one place in each step: F dt^2/(8 m) for each end of a segment"
            if central
            else "positions by the speed of either end of a step: first order in dt"
        )
        curves = {f"{axis}": _exact_translation(params, t, k) for k, axis in enumerate("xy")}
        # The sum of speeds at a step's end is the trapezoidal one and half of what the speed has changed by, times dt.
        shift = {name: 0.5 * (place or 0.0) * dt * (curve.rate - curve.rate[0]) for name, curve in curves.items()}
        angular = _exact_spin(params, t)
        expected: dict[str, tuple[FloatArray, float, str, float]] = {
            "x": (curves["x"].path + shift["x"], lag, late, float(np.abs(curves["x"].path).max())),
            "y": (curves["y"].path + shift["y"], lag, late, float(np.abs(curves["y"].path).max())),
            "vx": (np.where(near, np.nan, curves["x"].rate), rough, exact, fastest),
            "vy": (np.where(near, np.nan, curves["y"].rate), rough, exact, fastest),
            "vx_turned": (np.where(near, np.nan, curves["x"].rate), rough, exact, fastest),
            "spin": (np.where(near, np.nan, angular), of_spin, exact, spun),
            "alone": (np.zeros_like(t), rough, exact, fastest),
        }
        return [
            check
            for name, (curve, atol, why, scale) in expected.items()
            for check in (
                Check(quantity=name, norm="max", expected=curve, atol=atol, why=why, scale=scale, **common),
                Check(quantity=f"{name}_final", norm="scalar", expected=float(curve[-1]), atol=atol, why=why, scale=scale, **common),
            )
        ]  # fmt: skip


def _force_segments(params: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """(begin, end, size) of the segments."""
    if params["span"] == "constant":
        return [(0.0, math.inf, 1.0)]
    return [(*SPANS[0], 1.0), (*SPANS[1], -0.5)]


def _place_in_step(setup: Setup, engine: EngineInfo) -> float | None:
    """Where in a step lies the speed by which a scheme moves positions: -1 its begin, 0 its middle, 1 its end; None if not known."""
    places = {"central-difference": 0.0, "semi-implicit-euler": 1.0, "position-first-euler": -1.0}
    if engine.scheme == "theta":
        return 2.0 * setup.numerics.theta - 1.0
    if engine.scheme == "moreau-jean":
        return 2.0 * float(engine.option("theta", setup.numerics)) - 1.0
    return places.get(engine.scheme)


def _exact_spin(params: Mapping[str, Any], t: FloatArray) -> FloatArray:
    """Spin [rad/s] under the torque, shape (s,)."""
    segments = [(b, min(e, 1e3), TORQUE * s) for b, e, s in _force_segments(params)]
    return under_segments(t, inertia=0.5 * MASS * RADIUS**2, start=SPIN0, segments=segments).rate


def _exact_translation(params: Mapping[str, Any], t: FloatArray, axis: int) -> Driven:
    until = float(t[-1]) + 1.0
    segments = [(begin, min(end, until), size * FORCE[axis]) for begin, end, size in _force_segments(params)]
    return under_segments(t, inertia=MASS, start=V0[axis], segments=segments)


CASE = Forces()
