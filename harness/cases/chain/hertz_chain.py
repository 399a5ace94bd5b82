"""Row of spheres that touch without load, of which the first is struck: Nesterenko's solitary wave."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import Elastic, SphereLaw, moduli
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.claims import Cells, Claim, UndecidedError, Verdict, scalar
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import single, single_precision
from ninedisk.harness.cases.impact.sphere_impact import MARGIN
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.hertz import contact_moduli, solitary_speed
from ninedisk.references.hertz_chain import stepped_row, struck_row

STEEL, DENSITY, RADIUS = (2e11, 0.3), 7800.0, 0.01
LINE = np.array([0.6, 0.0, 0.8])
"""Direction of the row, along no axis."""

SAMPLE = 0.1
"""Interval of samples over the time in which the struck sphere would move by the overlap's natural size."""

SHOWN = (4, 9, 14)
"""Spheres whose velocities are shown and held to the truth."""

BEGIN, END = 9, 14
"""Spheres between which the speed is measured: the wave has its own form there, to 1e-3."""

LONG_WAVES = 0.02
"""Of the speed: what one may ask of an equation for waves that are long beside a sphere, of a wave of five spheres."""


def nesterenko(cells: Cells) -> Verdict:
    """The speed by the long-wave equation, of the largest velocity that the wave has."""
    found = [(scalar(cell, "wave_speed"), scalar(cell, "peak"), cell) for cell in cells if cell.observed is not None]
    if not found:
        raise UndecidedError("no run has a wave")
    e_star, _ = contact_moduli(STEEL, STEEL)
    ratios = [
        speed / solitary_speed(e_star=e_star, radius=RADIUS, mass=_mass(), speed=peak) for speed, peak, _ in found
    ]
    worst = max(ratios, key=lambda ratio: abs(ratio - 1.0))
    return abs(worst - 1.0) <= LONG_WAVES, f"measured speed over Nesterenko's: {worst:.4f}"


class Wave(NamedTuple):
    """Speed [m/s], largest velocity of a sphere [m/s], and width at half of it in diameters."""

    speed: float
    peak: float
    width: float


class HertzChain:
    """Equal spheres in a row; the first one has all the momentum.

    Nothing passes through contacts that do not push, so that all sounds are shocks: what runs along the row is one wave of some five
    spheres, followed by smaller ones.
    """

    id = "spheres/hertz-chain"
    version = 1
    title = "Solitary wave in a row of spheres"
    source = (
        "Nesterenko (1983), J. Appl. Mech. Tech. Phys. 24, 733; Coste, Falcon & Fauve (1997), Phys. Rev. E 56, 6104"
    )
    requirement = "velocities, speed and width of the wave are those of the row integrated; nothing leaves the line"
    figures: tuple[Figure, ...] = (
        Figure(
            title="The wave at three spheres",
            quantities=tuple(Plotted(f"v_{k}", f"sphere {k}: v [m/s]") for k in SHOWN),
            shows="Velocities of three spheres along the row.",
            allows="The wave keeps its form and its speed, 0.8 % below that of Nesterenko's long waves.",
        ),
    )
    claims: tuple[Claim, ...] = (
        Claim(
            id="nesterenkos-speed",
            place="Nesterenko (1983)",
            text="The wave's speed is (16/25)^(1/5) a A^(2/5) v^(1/5), with the diameter a, A = (4/3) E* sqrt(R/2)/m and the largest "
            "velocity v.",
            decided_by=f"the speed between spheres {BEGIN} and {END}: confirmed within {LONG_WAVES:.0%}, as the equation is one of long "
            "waves.",
            rule=nesterenko,
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="n", default=20, low=18, high=60, whole=True, unit="-", help="number of spheres"),
        Parameter(name="speed", default=1.0, low=1e-3, high=20.0, unit="m/s", in_id=True, help="of the blow"),
        Parameter(name="substeps", default=8, low=1, high=1000, whole=True, unit="-", only_for="spring", help="contact steps in a sample"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two blows: the speed grows with their fifth root."""
        return [{"speed": 1.0}, {"speed": 0.01}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Spheres that touch, the first of which moves."""
        n = params["n"]
        e_star, _ = moduli(Elastic(E=STEEL[0], nu=STEEL[1]), Elastic(E=STEEL[0], nu=STEEL[1]))
        v = np.zeros((n, 3))
        v[0] = params["speed"] * LINE
        scene = SphereScene(
            spheres=Spheres(
                x=2.0 * RADIUS * np.arange(n)[:, None] * LINE, v=v, radius=np.full(n, RADIUS), mass=np.full(n, _mass())
            ),
            sphere_sphere=SphereLaw(e_star=e_star),
        )
        dt = SAMPLE * _units(params["speed"])[1]
        numerics = Numerics(
            dt=dt, n_steps=_samples(), contact_dt=dt / params["substeps"], impact="newton", sliding="coulomb"
        )
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"first contact": (0, 1)})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Velocities along the row, the wave between `BEGIN` and `END`, and what leaves the line or is lost."""
        along = history.v @ LINE
        across = np.linalg.norm(history.v - along[:, :, None] * LINE, axis=2).max(axis=1)
        wave = _wave(along, history.t)
        series = {f"v_{k}": ("m/s", along[:, k]) for k in SHOWN}
        series["off_line"] = ("m/s", across)
        series["momentum"] = ("m/s", along.sum(axis=1))
        return Observed(
            step=history.step,
            t=history.t,
            series=series,
            scalars={"wave_speed": ("m/s", wave.speed), "peak": ("m/s", wave.peak), "width": ("1", wave.width)},
        )

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Speed and width."""
        truth, _ = _truth(params, setup)
        source = "the row integrated to 1e-12"
        return (
            Headline(name="speed of the wave", use="impacts", quantity="wave_speed", expected=truth.speed, source=source,
                     scale=truth.speed, scale_is="speed of the wave"),
            Headline(name="width of the wave", use="impacts", quantity="width", expected=truth.width, source=source, scale=truth.width,
                     scale_is="width of the wave"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo  # noqa: ARG002
    ) -> Sequence[Check]:  # fmt: skip
        """The row integrated, within what central differences of this step err by; a line; momentum."""
        speed, n, steps = params["speed"], params["n"], setup.numerics.n_steps
        exact, unsure = struck_row(n, SAMPLE * np.arange(steps + 1.0))
        every = setup.numerics.substeps(setup.numerics.contact_dt or setup.numerics.dt)
        rough = stepped_row(n, SAMPLE / every, steps * every, every)
        times = setup.numerics.dt * np.arange(steps + 1.0)
        truth, coarse = _wave(speed * exact, times), _wave(speed * rough, times)
        why = f"{MARGIN:g} times what central differences themselves err by in this step"
        floor = 1e-9 * speed + single(engine, speed, steps)
        source = "the row integrated to 1e-12"
        found = [
            Check(quantity=f"v_{k}", norm="max", truth="converged", expected=speed * exact[:, k], source=source, scale=speed,
                  atol=speed * (MARGIN * float(np.abs(rough - exact)[:, k].max()) + unsure) + floor, uncertainty=speed * unsure, why=why)
            for k in SHOWN
        ]  # fmt: skip
        found += [
            Check(quantity=name, norm="scalar", truth="converged", expected=expected, source=source,
                  atol=MARGIN * abs(expected - other) + expected * (2.0 * unsure + floor / speed) * steps, why=f"{why}; at samples")
            for name, expected, other in (("wave_speed", truth.speed, coarse.speed), ("width", truth.width, coarse.width))
        ]  # fmt: skip
        # Places are kept to one unit in the last place: relative to an overlap, that turns the normal as little as it changes the force.
        why = f"round-off of a thousand steps{single_precision(engine)}"
        return [
            *found,
            Check(quantity="off_line", norm="max", truth="analytic", expected=np.zeros(steps + 1), source="symmetry about the line",
                  atol=floor, scale=speed, why=why),
            Check(quantity="momentum", norm="max", truth="analytic", expected=np.full(steps + 1, speed), source="Newton's third law",
                  atol=n * floor, why=why),
        ]  # fmt: skip


def _mass() -> float:
    return 4.0 / 3.0 * math.pi * RADIUS**3 * DENSITY


def _units(speed: float) -> tuple[float, float]:
    """Natural length [m] and time [s] of a blow: ``(m v^2/K)^(2/5)`` with ``fn = K delta^(3/2)``, and that over the speed."""
    e_star, _ = contact_moduli(STEEL, STEEL)
    length = (_mass() * speed**2 / (4.0 / 3.0 * e_star * math.sqrt(0.5 * RADIUS))) ** 0.4
    return length, length / speed


def _samples() -> int:
    """Until the wave has passed sphere `END` by some."""
    return round((1.25 * END + 2.5) / SAMPLE)


def _truth(params: Mapping[str, Any], setup: SphereSetup) -> tuple[Wave, float]:
    steps = setup.numerics.n_steps
    exact, unsure = struck_row(params["n"], SAMPLE * np.arange(steps + 1.0))
    return _wave(params["speed"] * exact, setup.numerics.dt * np.arange(steps + 1.0)), unsure


def _wave(along: FloatArray, t: FloatArray) -> Wave:
    """By the tops of the velocities of `BEGIN` and `END`, and where that of `END` crosses half its top."""
    if not np.isfinite(along).all():
        return Wave(math.nan, math.nan, math.nan)
    (first, _), (last, peak) = (_parabola_top(along[:, k], t) for k in (BEGIN, END))
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = float(np.float64(2.0 * RADIUS * (END - BEGIN)) / (last - first))
    above = np.flatnonzero(along[:, END] > 0.5 * peak)
    if peak <= 0.0 or not 0 < above[0] <= above[-1] < len(t) - 1:
        return Wave(speed, peak, math.nan)
    up, down = above[0] - 1, above[-1]
    return Wave(
        speed,
        peak,
        speed
        * (_crossing_time(along[:, END], t, down, peak) - _crossing_time(along[:, END], t, up, peak))
        / (2.0 * RADIUS),
    )


def _crossing_time(v: FloatArray, t: FloatArray, k: int, peak: float) -> float:
    """Time between samples k and k + 1 at half the top."""
    return float(t[k] + (t[k + 1] - t[k]) * (0.5 * peak - v[k]) / (v[k + 1] - v[k]))


def _parabola_top(v: FloatArray, t: FloatArray) -> tuple[float, float]:
    """Time and height of the parabola's top through the largest value and its neighbours."""
    k = int(np.clip(np.argmax(v), 1, len(v) - 2))
    a, b, c = (float(each) for each in v[k - 1 : k + 2])
    bend = 2.0 * b - a - c
    if bend <= 0.0:
        return float(t[k]), b
    return float(t[k]) + 0.5 * (float(t[k + 1]) - float(t[k])) * (c - a) / bend, b + (a - c) ** 2 / (8.0 * bend)


CASE = HertzChain()
