"""How far springs, rounding and soft contacts may take a stack from its statics, derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import EXACT_STEP_RTOL, single, slack_time, soft_reason, softness


class StackBounds(NamedTuple):
    """Tolerances and their reason.

    ``force`` [N] of any contact at rest, ``step_force`` [N] in any step, ``length`` [m] of any gap, ``motion`` [m] that overlaps make
    of the top disk's way; ``yields``: the gap at rest is ``-fn/kn``; ``from_step``: forces are bound step by step from this one on,
    None: at rest only.
    """

    force: float
    step_force: float
    length: float
    motion: float
    yields: bool
    from_step: int | None
    why: str


def stack_bounds(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> StackBounds:
    """Bounds of an engine on a variant."""
    rests = params["start"] == "equilibrium"
    disks = setup.scene.disks
    weight = float(disks.mass.sum()) * params["g"]
    height = float(np.abs(disks.x).max())
    t_end = float(observed.t[-1])
    if engine.contact == "spring":
        steps = t_end / (setup.numerics.contact_dt or setup.numerics.dt)
        # A gap is the difference of coordinates of the size of the stack. Without damping a rounding of the positions in each
        # step, all in phase with a mode at worst, adds up; a dashpot forgets it.
        length = float(np.spacing(height)) * (8.0 + (0.5 * steps if rests else 0.0))
        if rests:
            why = "starts in equilibrium: round-off of the heights, added up over the undamped steps"
            return StackBounds(params["kn"] * length, params["kn"] * length, length, 0.0, True, 0, why)
        left = _left(params, len(disks), t_end)
        force, why = left * weight + params["kn"] * length, f"round-off; settling has left {left:.1g} of the weight"
        length += left * weight / params["kn"]
        return StackBounds(force, force, length, _sunk(params, setup), True, None, why)
    if rests:
        why = "starts in equilibrium: residual of the solver, round-off of the heights"
        force = EXACT_STEP_RTOL * weight + params["kn"] * 8.0 * float(np.spacing(height))
        return StackBounds(force, force, force / params["kn"], 0.0, True, 1, why)
    network = contact_network(setup, params["g"])
    speed = params["g"] * slack_time(engine, setup.numerics.dt, t_end) * len(disks)
    length = 1e-12 + speed * t_end + single(engine, height, setup.numerics.n_steps)
    why = "rigid contacts bear the weight at once: residual of the solver, round-off"
    why += soft_reason(engine) + ("; single precision" if engine.precision == "float32" else "")
    force = EXACT_STEP_RTOL * weight + single(engine, weight, 1) + softness(engine) * weight
    if engine.keeps_kn:
        why += "; overlaps fn/kn, into which it settles"
        return StackBounds(force, force, length, _sunk(params, setup), True, None, why)
    # While a soft contact still gives way it hands its part on to the others; at rest it bears what statics asks for.
    step = force + softness(engine) * network.softened
    if engine.contact == "impulse" and "iterations" in engine.options:
        sweeps = int(engine.option("iterations", setup.numerics))
        step += weight * network.sweep**sweeps
        why += f"; {sweeps} sweeps from zero in the first step leave {network.sweep**sweeps:.1g} of the weight"
    return StackBounds(force, step, length, 0.0, False, 1, why)


class Network(NamedTuple):
    """What a stack's contacts do to each other.

    ``sweep`` is the factor by which a Gauss-Seidel sweep reduces the error of the forces: the spectral radius of its iteration.
    ``softened`` [N] is the change of the forces where every contact gives way by a unit part of what it should withstand: with
    the diagonal D of the Delassus operator W, ``(W + eps D) r = b`` is off by ``eps W^-1 D r``.
    """

    sweep: float
    softened: float


def contact_network(setup: Setup, g: float) -> Network:
    """The numbers of a scene of smooth disks in touch, under gravity g [m/s^2] along -y."""
    disks, walls, n = setup.scene.disks, setup.scene.walls, len(setup.scene.disks)
    jacobian = np.zeros((len(setup.watch), n, 2))
    for row, (i, j) in zip(jacobian, setup.watch, strict=True):
        apart = disks.x[j] - disks.x[i] if j < n else -np.asarray(walls[j - n].normal)
        row[i] = -apart / np.hypot(apart[0], apart[1])
        if j < n:
            row[j] = -row[i]
    flat = jacobian.reshape(len(setup.watch), 2 * n)
    delassus = flat / np.repeat(disks.mass, 2) @ flat.T
    forces = np.linalg.solve(delassus, -flat @ np.tile([0.0, -g], n))
    softened = np.linalg.solve(delassus, np.diag(delassus) * forces)
    error = np.eye(len(delassus)) - np.linalg.solve(np.tril(delassus), delassus)
    return Network(float(np.abs(np.linalg.eigvals(error)).max()), float(np.abs(softened).max()))


def _sunk(params: Mapping[str, Any], setup: Setup) -> float:
    """Way of the top disk [m]: at most all contacts' overlaps of the whole weight, steepened by the pyramid's tilt."""
    scene = setup.scene
    weight = float(scene.disks.mass.sum()) * float(params["g"])
    return 4.0 * len(scene.disks) * weight / float(params["kn"])


def _left(params: Mapping[str, Any], n: int, t_end: float) -> float:
    """Part of the weight by which the slowest mode of the stack still swings after half the time.

    A chain of n disks on a floor has the frequencies ``2 omega sin((2 j - 1) pi/(2 (2 n + 1)))``, and dashpots of at least ``c =
    2 sqrt(m kn/2)``, proportional to the springs, let a mode of frequency w decay at ``c w^2/(2 kn)``. Contacts may open and
    close at first; half the time is left for that. The pyramid's modes are stiffer than those of a column of three.
    """
    omega = math.sqrt(params["kn"])  # of a disk of 1 kg
    slowest = 2.0 * omega * math.sin(0.5 * math.pi / (2 * n + 1))
    return float(n * math.exp(-(slowest**2) / (math.sqrt(2.0) * omega) * 0.5 * t_end))
