"""A triangular lattice in a periodic cell that deforms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.core.scene.cell import Cell
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import at_observed, round_off_speed
from ninedisk.references.analytic.assembly.lattice import moduli, sheared, stretched

RADIUS, MASS, KN, KS = 0.5, 1.0, 1e4, 5e3
OVERLAP, STRAIN = 4e-3, 1e-3
"""Of neighbours at time 0, of the radius; strain at the end, half of which opens no contact."""

COLUMNS, ROWS = 6, 6
SPACING = (2.0 - OVERLAP) * RADIUS
INERTIA = 0.5 * MASS * RADIUS**2
DURATION, SAMPLES = 0.05, 25
"""Time [s], two to three swings of a disk in shear, and samples of it."""

RATES: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "compression": ((-1.0, 0.0), (0.0, -1.0)),
    "stretch": ((1.0, 0.0), (0.0, -1.0)),
    "shear": ((0.0, 1.0), (0.0, 0.0)),
}
"""Deformation at the end, over the strain."""

PAIRS = {"along": (0, ROWS), "across the edge": (0, (COLUMNS - 1) * ROWS)}
AXES = (("xx", 0, 0), ("xy", 0, 1), ("yx", 1, 0), ("yy", 1, 1))
FloatArray = NDArray[np.float64]


class Lattice:
    """Touching disks in a triangular lattice, which the cell compresses, stretches or shears by a thousandth.

    Every disk is a centre of inversion: it moves with the cell, whoever looks. Stretching has a closed form at any strain. In shear the
    disks swing about half the flow's rotation: central differences of these swings are exact, too, to first order in the strain.
    """

    id = "cell/lattice"
    version = 1
    title = "Triangular lattice in a periodic cell"
    source = "closed forms of the lattice with springs kn and ks: K = (sqrt3/2) kn, G = (sqrt3/4)(kn + ks)"
    requirement = "disks move with the cell; its stress is that of the springs, through the edges as well"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mode", default="compression", choices=tuple(RATES), in_id=True, help="how the cell deforms"),
        Parameter(name="frame", default=0.0, low=-100.0, high=100.0, unit="m/s", in_id=True, help="velocity of all disks along x and y"),
        Parameter(name="steps", default=200, low=SAMPLES, whole=True, help=f"contact steps, a multiple of {SAMPLES}"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each mode; one that is seen by an observer who flies past."""
        return [{"mode": mode} for mode in RATES] + [{"mode": "shear", "frame": 3.0}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Disks in the flow from the start; friction that lets no contact slide."""
        x = SPACING * np.array(
            [(i + 0.5 * (j % 2), 0.5 * np.sqrt(3.0) * j) for i in range(COLUMNS) for j in range(ROWS)]
        )
        rate, steps = _rate(params), max(1, params["steps"] // SAMPLES) * SAMPLES
        cell = Cell(
            size=(COLUMNS * SPACING, 0.5 * np.sqrt(3.0) * ROWS * SPACING),
            rate=((rate[0, 0], rate[0, 1]), (0.0, rate[1, 1])),
        )
        scene = Scene(
            disks=Disks(
                x=x, v=x @ rate.T + params["frame"], radius=np.full(len(x), RADIUS), mass=np.full(len(x), MASS)
            ),
            disk_disk=ContactLaw(kn=KN, ks=KS, mu=2.0),
            cell=cell,
        )
        numerics = Numerics(dt=DURATION / SAMPLES, n_steps=SAMPLES, contact_dt=DURATION / steps)
        return Setup(scene=scene, numerics=numerics, watch=tuple(PAIRS.values()), labels=PAIRS)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Stress, forces in the cell and through its edge, energies, and how far disks are from where the cell takes them."""
        rate, x, t = _rate(params), setup.scene.disks.x, history.t
        flown = x + t[:, None, None] * (x @ rate.T + params["frame"])
        nothing = np.full((len(t), 2, 2, 2), np.nan)
        stress = nothing if history.stress is None else history.stress
        momentum = np.sum(setup.scene.disks.mass[:, None] * history.v, axis=1)
        series = {
            "astray": ("m", np.abs(history.x - flown).max(axis=(1, 2))),
            "omega": ("rad/s", history.omega.mean(axis=1)),
            "swing": ("rad/s", np.ptp(history.omega, axis=1)),
            "momentum": ("N s", np.abs(momentum - momentum[0]).max(axis=1)),
            "fn": ("N", history.fn[:, 0]),
            "fn_across": ("N", history.fn[:, 1]),
            **{f"stress_{name}": ("N/m", stress[:, 0, a, b]) for name, a, b in AXES},
            "stress_kinetic": ("N/m", np.abs(stress[:, 1]).max(axis=(1, 2))),
        }
        series["energy_fed"] = ("J", history.energy.get("cell_work", np.full(len(t), np.nan)))
        return Observed(
            step=history.step, t=t, series=series, scalars={"modulus": ("N/m", _modulus(params, stress[:, 0]))}
        )

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """Bulk or shear modulus, at this compression."""
        touching, name = moduli(kn=KN, ks=KS), "bulk" if params["mode"] == "compression" else "shear"
        expected = _modulus(params, _expected(params, setup, observed.t)[0])
        return (
            Headline(name="modulus of a lattice", use="rest", quantity="modulus", expected=expected, source=self.source,
                     scale=getattr(touching, name), scale_is=f"{name} modulus of disks that just touch"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Closed forms to round-off where they hold at any strain, and to the next order of the strain in shear.

        Slip that is measured at the end of a step is off by half of a step's turning. A contact's branch is known to its own round-off,
        which kn makes a force; the trapezoidal rule errs by a twelfth of ``(dt/T)^2`` of what bends a power that is nearly straight.
        """
        numerics, t = setup.numerics, observed.t
        dt = numerics.contact_dt or numerics.dt
        steps, far = DURATION / dt, float(np.abs(setup.scene.disks.x).max() + abs(params["frame"]) * DURATION + 4.0)
        place = round_off_speed(far, dt) * DURATION
        stress, omega = _expected(params, setup, t)
        shear, pressure = moduli(kn=KN, ks=KS).shear * STRAIN, float(stress[0, 0, 0])
        spins = params["mode"] == "shear"
        turning = 1.0 / steps if Capability.SLIP_MIDDLE not in engine.capabilities else (1.0 / steps) ** 2
        off = 8.0 * KN * place / RADIUS + STRAIN * turning * shear
        why = "round-off of positions as a force; turning of a contact in a step"
        if spins:
            off += 4.0 * STRAIN * shear + 2.0 * STRAIN**2 * pressure / OVERLAP
            why += "; the next order of the strain, of the shear stress and of the contact forces' turning"
        truth: Any = "exact-step" if spins else "analytic"
        found = [
            Check(quantity="astray", norm="max", truth="analytic", expected=0.0, source="inversion about each disk", atol=place,
                  scale=STRAIN * SPACING, why="round-off of positions and forces, in each step"),
            Check(quantity="momentum", norm="max", truth="analytic", expected=0.0, source="forces in pairs", atol=
                  MASS * COLUMNS * ROWS * place / DURATION, scale=MASS * SPACING * STRAIN / DURATION, why="round-off of forces"),
            Check(quantity="swing", norm="max", truth="analytic", expected=0.0, source="all disks are alike",
                  atol=KS * place * RADIUS / INERTIA * DURATION, scale=STRAIN / DURATION, why="round-off of positions as a torque"),
        ]  # fmt: skip
        if spins:
            if Capability.LEVER_ARM_RADIUS in engine.capabilities:
                size = (4.0 * STRAIN + turning) * STRAIN / DURATION
                found.append(
                    Check(quantity="omega", norm="max", truth="exact-step", expected=omega, source="swing of a disk among six", atol=size,
                          scale=STRAIN / DURATION, why="the next order of the strain; turning of a contact in a step")
                )  # fmt: skip
        else:
            force = KN * (2.0 * RADIUS - SPACING * (1.0 + t / DURATION * STRAIN * RATES[params["mode"]][0][0]))
            found += [
                Check(quantity=name, norm="max", truth="analytic", expected=force, source="spring between neighbours", atol=KN * place,
                      scale=KN * OVERLAP * RADIUS, why="round-off of positions as a force")
                for name in ("fn", "fn_across")
            ]  # fmt: skip
        if not spins:
            energy = COLUMNS * ROWS * _stretched(params, t).energy
            fed = at_observed(observed, engine, "energy_fed", energy - energy[0])
            straight = STRAIN / OVERLAP / (12.0 * steps**2)
            found.append(
                Check(quantity="energy_fed", norm="max", truth="analytic", expected=fed, source="elastic energy of the contacts",
                      atol=straight * float(energy[0]) + off * STRAIN * COLUMNS * ROWS, scale=float(np.ptp(energy)),
                      why="trapezoidal rule; " + why)
            )  # fmt: skip
        return found + [
            Check(quantity=f"stress_{name}", norm="max", truth=truth,
                  expected=at_observed(observed, engine, f"stress_{name}", stress[:, a, b]), source=self.source, atol=off, scale=shear,
                  why=why)
            for name, a, b in AXES
        ] + [
            Check(quantity="stress_kinetic", norm="max", truth="analytic",
                  expected=at_observed(observed, engine, "stress_kinetic", np.zeros_like(t)), source="no disk moves beside the flow",
                  atol=MASS * (place / DURATION) ** 2 / SPACING**2 * 4.0, scale=shear, why="round-off of velocities, squared")
        ]  # fmt: skip


def _rate(params: Mapping[str, Any]) -> FloatArray:
    return STRAIN / DURATION * np.array(RATES[params["mode"]])


def _stretched(params: Mapping[str, Any], t: FloatArray) -> Any:
    rate = _rate(params)
    return stretched(t=t, rate=(rate[0, 0], rate[1, 1]), spacing=SPACING, radius=RADIUS, kn=KN, ks=KS)


def _expected(params: Mapping[str, Any], setup: Setup, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stress [N/m], shape (s, 2, 2), and spin [rad/s], shape (s,)."""
    if params["mode"] != "shear":
        return _stretched(params, t).stress, np.zeros_like(t)
    dt = setup.numerics.contact_dt or setup.numerics.dt
    found = sheared(t=t, rate=_rate(params)[0, 1], spacing=SPACING, radius=RADIUS, kn=KN, ks=KS, inertia=INERTIA, dt=dt)
    return found.stress, found.omega


def _modulus(params: Mapping[str, Any], stress: FloatArray) -> float:
    """Modulus [N/m] between the first sample and the last one."""
    change = stress[-1] - stress[0]
    if params["mode"] == "compression":
        return float(0.25 * np.trace(change) / STRAIN)
    if params["mode"] == "stretch":
        return float(0.25 * (change[1, 1] - change[0, 0]) / STRAIN)
    return float(-0.5 * (change[0, 1] + change[1, 0]) / STRAIN)


CASE = Lattice()
