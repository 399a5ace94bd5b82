"""Disks at rest under gravity: a column, and a disk on two others between smooth walls.

How far springs, rounding and soft contacts may take a stack from its statics is derived.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    GRAVITY,
    THETA,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    single,
    single_precision,
    slack_time,
    soft_reason,
    sweeps_of,
    whole_steps,
)
from ninedisk.harness.cases.differences import checks_with_allowance
from ninedisk.references.analytic.assembly.stack import column_forces, pyramid_forces

RADIUS, MASS = 0.5, 1.0
UNEQUAL_RADII, UNEQUAL_MASSES = (0.5, 0.25, 0.75, 0.375), (3.0, 2.0, 1.0, 0.6)
"""Of the unequal column, the lowest disk first [m], [kg]; radii are sums of halves, so that rounding opens no contact, and the
light disks are on top, so that sweeps of impulses converge as fast as among equal ones."""

TILT = math.radians(35.0)
"""Lines of centres of the pyramid to the vertical: the lower disks are 0.15 m apart."""

PHASE = 0.1
"""Default resolution of a contact: ``sqrt(kn/m) dt <= PHASE``; the fastest mode of a column is below twice that."""


class Stack:
    """Smooth disks that rest on each other.

    ``start=touching`` begins without any force: rigid contacts find theirs in the first step, springs settle on critical
    dashpots. ``start=equilibrium`` begins with the overlaps of the forces, on elastic contacts without any damping: nothing may move.
    """

    id = "static/stack"
    version = 1
    title = "Stack of disks at rest"
    beside_headlines = (("base", "the load that a floor reports is shown by the forces of its contacts"),)
    source = "statics: equilibrium of forces"
    requirement = (
        "every contact of a column bears the weight above it; a disk on two others presses the walls apart by "
        "weight tan(angle)/2 each"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="arrangement", default="column", choices=("column", "unequal", "pyramid"), in_id=True,
            help="disks upon each other, equal or four unequal ones, or one disk on two between walls",
        ),
        Parameter(
            name="start", default="touching", choices=("touching", "equilibrium"), in_id=True,
            help="without overlaps and forces, or, for elastic contacts, with those of equilibrium",
        ),
        Parameter(name="n", default=4, low=1, high=20, whole=True, help="disks of the column"),
        Parameter.positive("dt", 0.01, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("duration", None, unit="s", help="length of the run; none: 1 s, or 0.1 s from equilibrium"),
        GRAVITY,
        Parameter(name="kn", default=1e6, low=1e4, unit="N/m", help="normal stiffness of spring engines"),
        CONTACT_DT,
        THETA,
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each arrangement from either start."""
        return [
            {"arrangement": arrangement, "start": start}
            for arrangement in ("column", "unequal", "pyramid")
            for start in ("touching", "equilibrium")
        ]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disks on a floor; the pyramid between two walls."""
        kn, rests = params["kn"], params["start"] == "equilibrium"
        law = ContactLaw(kn=kn) if rests else ContactLaw(kn=kn, beta=1.0, restitution=0.0, regularised=True)
        walls = {"floor": ((0.0, 0.0), (0.0, 1.0))}
        weight = MASS * params["g"]
        radius, mass = _sizes(params)
        if params["arrangement"] != "pyramid":
            n = len(mass)
            overlap = column_forces(mass * params["g"]) / kn * rests
            heights = np.cumsum(radius + np.append(0.0, radius[:-1]) - overlap)
            x = np.column_stack([np.zeros(n), heights])
            labels: dict[str, Pair] = {"floor": (0, n)} | {f"layer_{k}": (k - 1, k) for k in range(1, n)}
        else:
            x, half_room = _pyramid(weight, kn if rests else math.inf)
            walls |= {"left": ((-half_room, 0.0), (1.0, 0.0)), "right": ((half_room, 0.0), (-1.0, 0.0))}
            labels = {"side_left": (0, 2), "side_right": (1, 2), "wall_left": (0, 4), "wall_right": (1, 5)}
            labels |= {"floor_left": (0, 3), "floor_right": (1, 3)}
        scene = Scene(
            disks=Disks(x=x, radius=radius, mass=mass),
            disk_disk=law,
            walls=tuple(Wall(name=name, point=p, normal=normal, law=law) for name, (p, normal) in walls.items()),
            gravity=(0.0, -params["g"]),
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, 0.1 if rests else 1.0),
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(kn / float(mass.min()))),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=tuple(labels.values()), labels=labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Force and gap of every contact; ``motion`` is the largest way of any disk; ``base`` the force on the floor.

        ``fn_<contact>_rest`` is the mean over the last quarter of the run, ``force_error`` the largest difference of one from the
        statics of rigid disks; in that quarter ``force_swing`` is the largest range of a force, ``creep`` the largest way of a disk.
        """
        series, scalars = {}, {}
        late = slice(-max(len(history.step) // 4, 1), None)
        for name, pair in setup.labels.items():
            column = history.contact(pair)
            series[f"fn_{name}"] = ("N", history.fn[:, column])
            series[f"gap_{name}"] = ("m", history.gap[:, column])
            scalars[f"fn_{name}_rest"] = ("N", float(history.fn[late, column].mean()))
            scalars[f"gap_{name}_final"] = ("m", last(history.gap[:, column]))
        moved = np.abs(history.x - setup.scene.disks.x).max(axis=(1, 2))
        series["motion"] = ("m", moved)
        scalars["motion_final"] = ("m", last(moved))
        statics = rigid_forces(params, setup)
        off = [abs(scalars[f"fn_{name}_rest"][1] - force) for name, force in statics.items()]
        scalars["force_error"] = ("N", float(np.max(off)))
        scalars["force_swing"] = ("N", float(np.ptp(history.fn[late], axis=0).max()))
        scalars["creep"] = ("m", float(np.hypot(*np.moveaxis(history.x[late] - history.x[late][0], 2, 0)).max()))
        scalars["base"] = ("N", float(-history.wall_force[late, 0, 1].mean()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Statics of rigid disks: every contact bears what is above it, all the time, and nothing creeps."""
        total = float(setup.scene.disks.mass.sum()) * params["g"]
        at_rest: dict[str, Any] = {"expected": 0.0, "source": "statics: nothing moves"}
        return (
            Headline(name="contact forces at rest", use="rest", quantity="force_error", expected=0.0,
                     source="equilibrium of forces", scale=total, scale_is="weight of all disks"),
            Headline(name="swing of the forces", use="rest", quantity="force_swing", scale=total,
                     scale_is="weight of all disks", **at_rest),
            Headline(name="creep at rest", use="rest", quantity="creep", scale=RADIUS, scale_is="radius", **at_rest),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Statics: step by step where nothing has to settle, at rest for all."""

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            return _checks(params, setup, observed, engine)

        return checks_with_allowance(Difference.IMPULSES_OF_OTHERS, setup, engine, found)


def _checks(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    bounds = stack_bounds(params, setup, observed, engine)
    forces = _truth(params, setup, engine)
    mixed = 0.0
    if Difference.IMPULSES_OF_OTHERS in engine.differences and params["arrangement"] == "pyramid":
        mixed = max(forces.values()) - min(forces.values())  # forces at floor and wall may be exchanged
        bounds = bounds._replace(force=bounds.force + mixed, step_force=bounds.step_force + mixed)
    bears = sum(force for name, force in forces.items() if name.startswith("floor"))
    source = "equilibrium of forces"
    found = [
        Check(quantity="base", norm="scalar", truth="analytic", expected=bears, source="weight of all disks",
              atol=bounds.force + mixed, why=bounds.why),
        _motion(setup, bounds),
    ]  # fmt: skip
    for name, force in forces.items():
        found += [
            Check(quantity=f"fn_{name}_rest", norm="scalar", truth="analytic", expected=force, source=source,
                  atol=bounds.force, why=bounds.why),
            Check(quantity=f"gap_{name}_final", norm="scalar", truth="analytic", source="overlap fn/kn",
                  expected=-force / params["kn"] if bounds.yields else 0.0, atol=bounds.length, why=bounds.why, scale=RADIUS),
        ]  # fmt: skip
        if bounds.from_step is not None:
            held = np.where(observed.step >= bounds.from_step, force, np.nan)
            found.append(
                Check(quantity=f"fn_{name}", norm="max", truth="analytic", expected=held, source=source,
                      atol=bounds.step_force, why=bounds.why)
            )  # fmt: skip
    return found


def _sizes(params: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Radius and mass of each disk."""
    if params["arrangement"] == "unequal":
        return np.array(UNEQUAL_RADII), np.array(UNEQUAL_MASSES)
    n = 3 if params["arrangement"] == "pyramid" else params["n"]
    return np.full(n, RADIUS), np.full(n, MASS)


def _pyramid(weight: float, kn: float) -> tuple[np.ndarray[Any, np.dtype[np.float64]], float]:
    """Centres, and half the room between the walls [m], such that the lines of centres have the angle `TILT`."""
    side, wall = 0.5 * weight / math.cos(TILT), 0.5 * weight * math.tan(TILT)
    chord = 2.0 * RADIUS - side / kn
    low, reach = RADIUS - 1.5 * weight / kn, chord * math.sin(TILT)
    x = np.array([[-reach, low], [reach, low], [0.0, low + chord * math.cos(TILT)]])
    return x, reach + RADIUS - wall / kn


def _truth(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> dict[str, float]:
    """Force of every contact by its label [N]; springs that settle change the pyramid's angle."""
    settles = params["start"] == "touching" and (
        engine.contact == "spring" or Difference.KEEPS_KN in engine.differences
    )
    return rigid_forces(params, setup, kn=params["kn"] if settles else math.inf)


def rigid_forces(params: Mapping[str, Any], setup: Setup, kn: float = math.inf) -> dict[str, float]:
    """Force of every contact by its label [N], of rigid disks or of those that have settled on springs ``kn`` [N/m]."""
    weight = MASS * params["g"]
    if params["arrangement"] != "pyramid":
        return dict(zip(setup.labels, column_forces(setup.scene.disks.mass * params["g"]).tolist(), strict=True))
    rest = pyramid_forces(weight=weight, chord=2.0 * RADIUS, half_width=2.0 * RADIUS * math.sin(TILT), kn=kn)
    return {name: getattr(rest, name.split("_")[0]) for name in setup.labels}


def _motion(setup: Setup, bounds: StackBounds) -> Check:
    source = "statics: nothing moves" if bounds.motion == 0.0 else "overlaps of the weights"
    return Check(
        quantity="motion_final", norm="scalar", truth="analytic", expected=0.0, source=source,
        atol=bounds.motion + bounds.length * len(setup.scene.disks), why=bounds.why, scale=RADIUS,
    )  # fmt: skip


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
        left = _remaining_swing(params, disks.mass, t_end)
        force, why = left * weight + params["kn"] * length, f"round-off; settling has left {left:.1g} of the weight"
        length += left * weight / params["kn"]
        return StackBounds(force, force, length, _top_displacement(params, setup), True, None, why)
    if rests:
        why = "starts in equilibrium: residual of the solver, round-off of the heights"
        force = EXACT_STEP_RTOL * weight + params["kn"] * 8.0 * float(np.spacing(height))
        return StackBounds(force, force, force / params["kn"], 0.0, True, 1, why)
    network = contact_network(setup, params["g"])
    speed = params["g"] * slack_time(engine, setup.numerics.dt) * len(disks)
    length = 1e-12 + speed * t_end + single(engine, height, setup.numerics.n_steps)
    why = "rigid contacts bear the weight at once: residual of the solver, round-off"
    why += soft_reason(engine) + single_precision(engine)
    sweeps = sweeps_of(engine, setup.numerics)
    # Each sweep rounds a force and the speeds that it follows from.
    force = EXACT_STEP_RTOL * weight + single(engine, weight, 3 * sweeps) + contact_softness(engine) * weight
    if Difference.KEEPS_KN in engine.differences:
        why += "; overlaps fn/kn, into which it settles"
        return StackBounds(force, force, length, _top_displacement(params, setup), True, None, why)
    # While a soft contact still gives way it hands its part on to the others; at rest it bears what statics asks for.
    step = force + contact_softness(engine) * network.softened
    if sweeps:
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


def _top_displacement(params: Mapping[str, Any], setup: Setup) -> float:
    """Way of the top disk [m]: at most all contacts' overlaps of the whole weight, steepened by the pyramid's tilt."""
    scene = setup.scene
    weight = float(scene.disks.mass.sum()) * float(params["g"])
    return 4.0 * len(scene.disks) * weight / float(params["kn"])


def _remaining_swing(params: Mapping[str, Any], mass: FloatArray, t_end: float) -> float:
    """Part of the weight by which the slowest mode of the stack still swings after half the time.

    A chain of n disks on a floor has the frequencies ``2 omega sin((2 j - 1) pi/(2 (2 n + 1)))``, those of the heaviest disk at least. With
    dashpots of at least ``c = 2 sqrt(m kn)``, m the least effective mass of a pair, proportional to the springs, a mode of frequency
    w decays at ``c w^2/(2 kn)``. Contacts may open and close at first; half the time is left for that. The pyramid's modes are
    stiffer than those of a column of three.
    """
    n, kn, light = len(mass), params["kn"], 0.5 * float(mass.min())
    slowest = 2.0 * math.sqrt(kn / float(mass.max())) * math.sin(0.5 * math.pi / (2 * n + 1))
    return float(n * math.exp(-(slowest**2) * math.sqrt(light / kn) * 0.5 * t_end))


CASE = Stack()
