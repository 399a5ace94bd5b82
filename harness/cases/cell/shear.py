"""Simple shear of disks in a periodic cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.core.scene.cell import Cell
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import at_observed
from ninedisk.references.analytic.assembly.dense_flow import simple_shear

RADIUS, MASS, KN, RATE = 0.5, 1.0, 1e4, 0.5
"""Means of radii [m] and masses [kg], stiffness [N/m], shear rate [1/s]."""

SIZES = (0.8, 1.2)
"""Radii over their mean, evenly distributed."""

STEP = 2.5e-4
"""Contact step [s]: omega dt = 0.04 of the lightest pair."""

STRAIN, SAMPLES = 4.0, 400
WINDOW = 400
"""Steps of a run that is sampled at each."""

SPREAD = 150
"""Rounds in which disks are moved off each other before the start."""

FloatArray = NDArray[np.float64]


class Shear:
    """A few hundred disks of several sizes at a given solid fraction; the cell shears them at a constant rate.

    ``kind=balance`` samples each step of the first tenth of a second. Forces act in pairs through the edges as well: momentum stays. The
    shear forces turn disks: with arms that end in the middle of the overlap ``A (sigma_xy - sigma_yx) = d/dt sum I omega``, by the
    trapezoidal rule over steps exactly. Without friction and dashpots the energy of motion and springs grows by what the cell feeds.

    ``kind=flow`` goes on to a strain of 4, and averages over its second half: effective friction and solid fraction lie beside the
    law of dense flows, as near as a few hundred disks can show.
    """

    id = "cell/shear"
    version = 1
    title = "Simple shear in a periodic cell"
    beside_headlines = (
        (
            "*",
            "a flow has no closed form: what edges of the cell do to momentum is known, stresses are held to identities",
        ),
    )
    source = (
        "balances of momentum, spin and energy; da Cruz, Emam, Prochnow, Roux & Chevoir, Phys. Rev. E 72 (2005) 021309"
    )
    requirement = "momentum, spins and energy balance at every step; friction of a dense flow in its band"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="balance", choices=("balance", "flow"), in_id=True, help="every step of a short run, or a long run"),
        Parameter(name="mu", default=0.4, low=0.0, high=1.0, in_id=True, help="friction; 0: neither friction nor dashpots"),
        Parameter(name="fraction", default=0.78, low=0.5, high=0.8, in_id=True, help="area of the disks over that of the cell"),
        Parameter(name="rows", default=14, low=8, high=30, whole=True, help="as many disks in a row and in a column"),
        Parameter(name="seed", default=1, low=0, high=2**31, whole=True, help="of sizes and places"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Balances with and without losses; a flow."""
        return [{"kind": "balance"}, {"kind": "balance", "mu": 0.0}, {"kind": "flow"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Disks that nearly overlap, in the flow."""
        rng, n = np.random.default_rng(params["seed"]), params["rows"] ** 2
        radius = RADIUS * rng.uniform(*SIZES, n)
        side = math.sqrt(math.pi * float(np.sum(radius**2)) / params["fraction"])
        grid = (np.stack(np.meshgrid(*2 * [np.arange(params["rows"])]), axis=-1).reshape(-1, 2) + 0.5) * (
            side / params["rows"]
        )
        x = _spread(grid + rng.normal(0.0, 0.1 * RADIUS, grid.shape), radius, side)
        rough = params["mu"] > 0.0
        scene = Scene(
            disks=Disks(
                x=x, v=np.column_stack([RATE * x[:, 1], np.zeros(n)]), radius=radius, mass=MASS * (radius / RADIUS) ** 2
            ),
            disk_disk=ContactLaw(
                kn=KN, ks=0.5 * KN, mu=params["mu"], beta=0.6 if rough else 0.0, lever_arm="torque-overlap"
            ),
            cell=Cell(size=(side, side), rate=((0.0, RATE), (0.0, 0.0))),
        )
        if params["kind"] == "balance":
            numerics = Numerics(dt=STEP, n_steps=WINDOW, contact_dt=STEP)
        else:
            dt = STEP * round(STRAIN / (RATE * SAMPLES * STEP))
            numerics = Numerics(dt=dt, n_steps=SAMPLES, contact_dt=STEP)
        return Setup(scene=scene, numerics=numerics, watch=(), labels={})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Momentum, spin and energy that no force accounts for; stresses, friction and inertial number."""
        scene, t = setup.scene, history.t
        disks, cell = scene.disks, scene.cell
        assert cell is not None
        area = cell.size[0] * cell.size[1]
        stress = np.full((len(t), 2, 2, 2), np.nan) if history.stress is None else history.stress
        momentum = np.sum(disks.mass[:, None] * history.v, axis=1)
        series: dict[str, tuple[str, FloatArray]] = {
            "momentum": ("N s", np.hypot(*(momentum - momentum[0]).T)),
            "stress_normal": ("N/m", 0.5 * np.trace(stress.sum(axis=1), axis1=1, axis2=2)),
            "stress_shear": ("N/m", -0.5 * (stress[:, :, 0, 1] + stress[:, :, 1, 0]).sum(axis=1)),
        }
        scalars: dict[str, tuple[str, float]] = {}
        if params["kind"] == "balance":
            spin = history.omega @ disks.inertia
            torque = area * (stress[:, 0, 0, 1] - stress[:, 0, 1, 0])
            series["stress_spin"] = ("N m s", _summed(t, torque) - (spin - spin[0]))
            unknown = np.full(len(t), np.nan)
            names = ("kinetic", "elastic", "cell_work")
            kinetic, elastic, fed = (history.energy.get(name, unknown) for name in names)
            kept = kinetic + elastic - fed
            series["energy"] = ("J", kept - kept[0])
        else:
            late = stress[len(t) // 2 :].sum(axis=1).mean(axis=0)
            pressure = 0.5 * float(np.trace(late))
            inertial = RATE * math.sqrt(float(disks.mass.mean()) / pressure) if pressure > 0.0 else math.nan
            scalars = {
                "friction": ("1", -0.5 * float(late[0, 1] + late[1, 0]) / pressure if pressure > 0.0 else math.nan),
                "fraction": ("1", params["fraction"]),
                "inertial_number": ("1", inertial),
            }
        return Observed(step=history.step, t=t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Momentum that forces through the edges should leave alone."""
        weight = float(np.sum(setup.scene.disks.mass)) * RATE * RADIUS
        return (
            Headline(name="momentum in a sheared cell", use="invariance", quantity="momentum", expected=0.0,
                     source="forces in pairs", scale=weight, scale_is="momentum of the flow over a radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Balances to round-off, energy to the second order of the step; the law of dense flows to the scatter of its source."""
        scene, t = setup.scene, observed.t
        disks, n = scene.disks, len(scene.disks)
        fast = float(np.abs(disks.v).max()) + STRAIN
        steps = t[-1] / STEP
        # A force of kn R at most is rounded on either disk in each step.
        rough = n * 4.0 * float(np.spacing(fast * MASS)) * steps
        found = [
            Check(quantity="momentum", norm="max", truth="analytic", expected=0.0, source="forces in pairs", atol=rough,
                  scale=float(np.sum(disks.mass)) * RATE * RADIUS, why="round-off of each disk's velocity in each step")
        ]  # fmt: skip
        if params["kind"] == "balance":
            found.append(
                Check(quantity="stress_spin", norm="max", truth="analytic",
                      expected=at_observed(observed, engine, "stress_spin", np.zeros_like(t)), source="balance of spins",
                      atol=n * KN * 64.0 * float(np.spacing(float(np.abs(disks.x).max()))) * t[-1] * 2.0 * RADIUS,
                      scale=float(np.sum(disks.inertia)) * RATE, why="round-off of the forces of six contacts a disk, in each step")
            )  # fmt: skip
            if params["mu"] == 0.0:
                # Springs that close or open within a step err by an eighth of (omega dt)^2 of their energy, and swing by as much.
                phase = STEP * math.sqrt(2.0 * KN / (MASS * SIZES[0] ** 2))
                kinetic = 0.5 * float(np.sum(disks.mass)) * (RATE * RADIUS) ** 2
                found.append(
                    Check(quantity="energy", norm="max", truth="analytic",
                          expected=at_observed(observed, engine, "energy", np.zeros_like(t)), source="smooth springs lose nothing",
                          atol=phase**2 * kinetic, scale=kinetic, why="a part (omega dt)^2 of what moves beside the flow, second order")
                )  # fmt: skip
            return found
        inertial = observed.scalars["inertial_number"][1]
        silent = not (math.isfinite(inertial) or engine.reference)  # the engine does not report the stress
        law = simple_shear(inertial_number=np.nan_to_num(inertial))
        mu_law, phi_law = (math.nan, math.nan) if silent else (law.friction, law.fraction)
        why = "scatter of the source, softer contacts here (kn/P some 600), and the mean of a few hundred disks over a strain of 2"
        found += [
            Check(quantity="friction", norm="scalar", truth="published", expected=mu_law, source=self.source, atol=0.08,
                  why=why, scale=1.0),
            Check(quantity="fraction", norm="scalar", truth="published", expected=phi_law, source=self.source, atol=0.03,
                  why=why, scale=1.0),
        ]  # fmt: skip
        return found


def _summed(t: FloatArray, rate: FloatArray) -> FloatArray:
    """Integral from the first sample, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))])


def _spread(x: FloatArray, radius: FloatArray, side: float) -> FloatArray:
    """Centres in the square cell, moved off each other along their normals round by round, half of each overlap a disk."""
    for _ in range(SPREAD):
        x = x - side * np.floor(x / side)
        x[x >= side] = 0.0  # rounded up
        i, j = cKDTree(x, boxsize=np.full(2, side)).query_pairs(2.0 * float(radius.max()), output_type="ndarray").T
        d = x[j] - x[i]
        d -= side * np.round(d / side)
        apart = np.hypot(*d.T)
        reach = radius[i] + radius[j]
        push = (np.where(apart < reach, 0.5 * (reach - apart) / np.where(apart > 0.0, apart, 1.0), 0.0) * d.T).T
        np.add.at(x, i, -push)
        np.add.at(x, j, push)
    return np.asarray(x - side * np.floor(x / side))


CASE = Shear()
