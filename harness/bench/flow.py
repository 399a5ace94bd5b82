"""Suite ``flow``: contact dynamics stepped in time, beside physics engines and the in-house DEM at several stiffnesses.

Problems are many rigid frictional disks in motion, from states without overlap.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core import packings
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.history import History, Pair
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, Wall
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.harness.api.engine import Engine, EngineRun, SupportLevel
from ninedisk.harness.bench.dem import cached_scene, packing
from ninedisk.harness.bench.friction import SOLVED_AT, friction_of, near_pairs
from ninedisk.harness.bench.measure import (
    Contender,
    Measured,
    Reporter,
    Sample,
    UnsupportedProblemError,
    installed,
    interleave,
    timings,
)
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.schema import Row
from ninedisk.harness.wire.external import ExternalEngine

FloatArray = NDArray[np.float64]
Steps = Callable[[int, int], None]
"""Called with the steps done and all steps while a packing is made."""

SIZES, LARGE = (1_000,), (10_000,)
STEP, STEPS = 5e-3, 40
"""Step [s] and number of steps; at 10 m/s a disk moves by a tenth of its radius in a step."""
FROUDE, LEAD = 0.1, 0.5
"""Centrifugal over gravity at the rim of a drum, and the turns that it makes before the measurement: the disks lie in a slope and flow
down it. The same rate of turns at every size would press the disks of a large drum to its rim."""
OPEN = 1.5
"""Time that a hopper discharges before the measurement [s]: the disks inside flow, those outside fall as far as 11 m."""
OUTLET = 10.0
"""Width of a hopper's outlet in mean diameters: wide enough that no arch stops the flow."""
BASE = "cd, Coulomb"
UNIT = "s/simulated s"
BOUND = 0.5
"""Of the distance between centres of mass at the end, over the mean radius."""
STIFFNESS = (1.0, 10.0, 100.0)
"""Of the DEM's springs over those that the scene came with."""
TOLERANCE, LOOSER, TIGHT = 1e-4, (1e-3, 1e-2, 1e-1), 1e-8
"""Of contact dynamics, in each step, on natural map and duality gap."""
ACCEPTED, STEP_LIMIT = 0.9, 20.0
"""Looser bound up to which a step of the tight one may miss it, and seconds for one: such a step is counted, a run that stops is not
timed."""
SAMPLES = 20
"""Samples on the way."""
LEAST_PENETRATION = 1e-14
"""Rounding of coordinates that are tens of radii large, over the radii."""
LEAST_FRICTION = 1e-4
"""Less than one of some 100 loaded contacts with friction the wrong way in one of 40 steps, which counts 5e-4: smaller errors say which
contact's slip was just above the threshold."""


@dataclass(frozen=True, kw_only=True)
class FlowProblem:
    """A scene of rigid disks and how long it is followed."""

    name: str
    scene: Scene
    dt: float = STEP
    steps: int = STEPS

    @property
    def n(self) -> int:
        """Number of disks."""
        return len(self.scene.disks)

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return self.dt * self.steps

    def numerics(self) -> Numerics:
        """Sampled `SAMPLES` times on the way."""
        return Numerics(dt=self.dt, n_steps=self.steps, sample_every=max(1, self.steps // SAMPLES))

    def with_stiffness(self, kn: float) -> Scene:
        """The scene with springs of this stiffness [N/m] in all contacts, damped almost to no rebound."""

        def law(old: ContactLaw) -> ContactLaw:
            return replace(old, kn=kn, ks=0.5 * kn, beta=0.7)

        walls = tuple(replace(wall, law=law(wall.law)) for wall in self.scene.walls)
        return self.scene.replace(disk_disk=law(self.scene.disk_disk), walls=walls)


def problems(sizes: list[int], progress: Steps | None = None) -> dict[str, Callable[[], FlowProblem]]:
    """Makers of the problems by name."""
    made: dict[str, Callable[[], FlowProblem]] = {}
    for n in sizes:
        made[f"drum-{n}"] = lambda n=n: FlowProblem(name=f"drum-{n}", scene=without_contacts(turning_drum(n, progress)))  # type: ignore[misc]
        made[f"collapse-{n}"] = lambda n=n: FlowProblem(  # type: ignore[misc]
            name=f"collapse-{n}", scene=without_contacts(packings.collapse(packing(n, progress=progress)))
        )
        made[f"hopper-{n}"] = lambda n=n: FlowProblem(
            name=f"hopper-{n}", scene=without_contacts(open_hopper(n, progress))
        )  # type: ignore[misc]
    return made


def turning_drum(n: int, notify: Steps | None = None) -> Scene:
    """A drum of ``n`` disks after `LEAD` turns on the in-house DEM, with the velocities of that time."""
    rim = math.hypot(*packings.drum(n).walls[0].point)
    turns = math.sqrt(FROUDE * packings.GRAVITY / rim) / (2.0 * math.pi)
    name = f"drum-{n}-{FROUDE:g}-{LEAD:g}"
    return cached_scene(
        name, lambda: advanced_scene(LEAD / turns, packings.drum(n, turns_per_second=turns), notify), Scene
    )


def open_hopper(n: int, notify: Steps | None = None) -> Scene:
    """A hopper of ``n`` grains `OPEN` seconds after its plug has gone, with the velocities of that time and all walls at rest."""

    def full() -> Scene:
        return packings.settle(packings.hopper(n, outlet=OUTLET), progress=notify)

    def flowing() -> Scene:
        scene = advanced_scene(OPEN, packings.discharge(cached_scene(f"hopper-{n}-{OUTLET:g}", full, Scene)), notify)
        return scene.replace(walls=tuple(replace(wall, motion=()) for wall in scene.walls))

    return cached_scene(f"hopper-{n}-{OUTLET:g}-{OPEN:g}", flowing, Scene)


def advanced_scene(lead: float, scene: Scene, notify: Steps | None) -> Scene:
    """The scene ``lead`` seconds [s] later on the in-house DEM, walls and velocities as they are then."""
    from ninedisk.core.dem.critical import critical_time_step
    from ninedisk.core.dem.session import DemSession

    steps = int(np.ceil(lead / (0.2 * critical_time_step(scene))))
    dt = lead / steps
    numerics = Numerics(dt=dt, n_steps=steps, contact_dt=dt, sample_every=steps)
    history = DemSession(scene, numerics).run(notify)
    disks = replace(scene.disks, x=history.x[-1], v=history.v[-1], omega=history.omega[-1])
    return scene.replace(disks=disks, walls=tuple(_wall_at(wall, lead) for wall in scene.walls), initial_shear={})


def _wall_at(wall: Wall, time: float) -> Wall:
    """A wall as it is at a time [s], with its motion."""
    pose = wall_poses(compile_motion((wall,)), time)[0]
    return replace(wall, point=(pose[0], pose[1]), normal=(pose[2], pose[3]))


def without_contacts(scene: Scene) -> Scene:
    """The scene with rigid contacts and all radii scaled down so far that nothing overlaps; masses stay.

    Rigid engines would take the overlaps of springs for errors to be mended, each in its own way.
    """

    def rigid(law: ContactLaw) -> ContactLaw:
        return replace(law, beta=0.0, restitution=0.0, regularised=True)

    radius = scene.disks.radius
    deepest = max(0.0, float(-relative_gaps(scene, scene.disks.x, 0.0).min(initial=0.0)))
    disks = replace(scene.disks, radius=radius * (1.0 - 1.001 * deepest))
    walls = tuple(replace(wall, law=rigid(wall.law)) for wall in scene.walls)
    return scene.replace(disks=disks, walls=walls, disk_disk=rigid(scene.disk_disk), initial_shear={})


def relative_gaps(scene: Scene, x: FloatArray, time: float) -> FloatArray:
    """Gaps of all pairs that touch or overlap, over the sum of the two radii (a wall has none), shape (k,).

    Parameters
    ----------
    scene : Scene
    x : ndarray, shape (n, 2)
        Centres [m] at ``time`` [s].
    """
    radius, n = scene.disks.radius, len(scene.disks)
    poses = wall_poses(compile_motion(scene.walls), time)
    pairs = PairFinder(radius, len(scene.walls), scene.disks.fixed).within(
        np.ascontiguousarray(x), poses, 1e-12 * float(radius.min())
    )
    i, j = pairs[pairs[:, 1] < n].T
    apart_by = np.hypot(*(x[j] - x[i]).T)
    reach = radius[i] + radius[j]
    k, w = pairs[pairs[:, 1] >= n].T
    wall = poses[w - n]
    height = ((x[k] - wall[:, 0:2]) * wall[:, 2:4]).sum(axis=1)
    return np.concatenate([apart_by / reach - 1.0, height / radius[k] - 1.0])


@dataclass(frozen=True, kw_only=True)
class Entry:
    """An engine with one setting of its accuracy."""

    name: str
    engine: str
    numerics: Mapping[str, Any]
    options: Mapping[str, Any]
    stiffness: float = 1.0
    iterations: int = -1


def entries(wanted: Callable[[str], bool], brought: Sequence[str] = ()) -> list[Entry]:
    """Ours, always, the settings of the engines that are wanted, and those that were brought, as they are."""
    found = [
        *(
            Entry(
                name=BASE if tolerance == TOLERANCE else f"{BASE} to {tolerance:g}",
                engine="cd",
                # The same sweeps as gauss-seidel's; a step in which they stall is solved by another method.
                numerics={"solver": "auto", "sliding": "coulomb"},
                options={"cd.tolerance": tolerance},
            )
            for tolerance in (TOLERANCE, *LOOSER)
        ),
        Entry(
            name=f"{BASE} to {TIGHT:g}",
            engine="cd",
            numerics={"solver": "auto", "sliding": "coulomb"},
            options={"cd.tolerance": TIGHT, "cd.accept": ACCEPTED, "cd.time_limit": STEP_LIMIT},
        ),
        Entry(
            name="cd, associated",
            engine="cd",
            numerics={"solver": "gauss-seidel"},
            options={"cd.tolerance": TOLERANCE},
        ),
        *(
            Entry(name=f"dem, kn x {factor:g}", engine="dem", numerics={}, options={}, stiffness=factor)
            for factor in STIFFNESS
        ),
    ]
    ladders = {
        "pymunk": ("iterations", (10, 30, 100, 300)),
        "box2d": ("velocity_iterations", (10, 30, 100, 300)),
        "bullet": ("iterations", (10, 30, 100, 300)),
        "mujoco": ("iterations", (100,)),
    }
    for engine, (option, counts) in ladders.items():
        if wanted(engine):
            found += [
                Entry(
                    name=f"{engine}, {count} iterations",
                    engine=engine,
                    numerics={},
                    options={f"{engine}.{option}": count},
                    iterations=count,
                )
                for count in counts
            ]
    return found + [Entry(name=engine, engine=engine, numerics={}, options={}) for engine in brought]


def run_problem(
    make: Callable[[], FlowProblem],
    chosen: Sequence[Entry],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    notify: Reporter,
) -> Iterator[list[Row]]:
    """Rows of one problem. The first entry is the base of ratios and of the check."""
    notify("making the flow")
    problem = make()
    contenders = [Contender(name=each.name, run=partial(_run, problem, each, engines[each.engine])) for each in chosen]
    found = interleave(contenders, repeats=repeats, time_limit=time_limit, notify=notify)
    base = found[chosen[0].name]
    rows = [new_row(**_row(problem, each, found[each.name], base)) for each in chosen]
    # Neither springs nor engines that are not there are judged; and nobody's time has the reporting of forces in it.
    judged = [
        Contender(name=each.name, run=partial(_run_watched, problem, each, engines[each.engine]))
        for each, row in zip(chosen, rows, strict=True)
        if row["status"] == "pass" and engines[each.engine].info().scheme in SOLVED_AT
    ]
    watched = interleave(judged, repeats=1, time_limit=time_limit, notify=lambda text: notify(f"friction, {text}"))
    for row in rows:
        for sample in watched[row["engine"]].samples if row["engine"] in watched else ():
            row["friction_error"] = sample.facts["friction_error"]
    ladder = [row for row in rows if row["engine"].startswith(BASE)]
    for entry, row in zip(chosen, rows, strict=True):
        row["equal_ratio"] = time_at_equal("penetration", row, ladder, LEAST_PENETRATION)
        row["equal_friction_ratio"] = time_at_equal("friction_error", row, ladder, LEAST_FRICTION)
        if entry.engine == "cd":
            row["tolerance"] = entry.options["cd.tolerance"]
    yield rows


def time_at_equal(error: str, row: Row, ladder: Sequence[Row], least: float) -> float:
    """Time of a row over that of ours, between the two rungs of the ladder of tolerances next to its error.

    Both logarithms are interpolated. NaN where the row has no time or no such error, or a smaller one than every rung; beyond the rung
    with the largest ours is taken as that is, which has both less error and its time.

    Parameters
    ----------
    error : str
        Column of an error.
    row : Row
    ladder : sequence of Row
        Ours.
    least : float
        What the error cannot be distinguished from 0 by: a smaller one counts as this, and of several such rungs the fastest.
    """
    times: dict[float, float] = {}
    for each in ladder:
        if math.isfinite(each["median_s"]) and math.isfinite(each[error]):
            size = max(each[error], least)
            times[size] = min(each["median_s"], times.get(size, math.inf))
    size = max(row[error], least) if math.isfinite(row[error]) else math.nan
    if not (times and math.isfinite(row["median_s"]) and size >= min(times)):
        return math.nan
    ours = np.exp(np.interp(math.log(size), *np.log(np.array(sorted(times.items()))).T))
    return float(row["median_s"] / ours)


def energy_gained(history: History, scene: Scene) -> float:
    """Largest growth of kinetic energy and gravity's from one sample to the next, less the walls' work, over the largest kinetic energy.

    Elastic energy counts where an engine reports it. NaN where walls move and an engine does not report their work; below 0 where energy
    always falls.
    """
    disks, given = scene.disks, history.energy
    kinetic = 0.5 * (
        (disks.mass * (history.v**2).sum(axis=2)).sum(axis=1) + (disks.inertia * history.omega**2).sum(axis=1)
    )
    energy = kinetic - (disks.mass * (history.x @ np.array(scene.gravity))).sum(axis=1)
    nothing = np.zeros(len(energy))
    work = given.get("wall_work", np.full(len(energy), np.nan) if any(wall.motion for wall in scene.walls) else nothing)
    grown = np.diff(energy + given.get("elastic", nothing) - work)
    return float(grown.max() / kinetic.max())


def _run(problem: FlowProblem, entry: Entry, engine: Engine, limit: float) -> Sample:
    info = installed(engine.info())
    done = _end_reason(problem, entry, engine, limit, problem.numerics(), ())
    history, scene = done.history, problem.scene
    deep = [-relative_gaps(scene, x, t) for x, t in zip(history.x[1:], history.t[1:], strict=True)]
    facts = {
        "version": info.version,
        "centre": history.x[-1].mean(axis=0),
        "penetration": float(np.mean([each.clip(min=0.0).sum() / problem.n for each in deep])),
        "deepest": float(max(each.max(initial=0.0) for each in deep)),
        "energy_gained": energy_gained(history, scene),
        "settings": dict(done.settings),
    }
    return Sample(seconds=done.timings.advance, whole=done.timings.setup + done.timings.advance, facts=facts)


def _run_watched(problem: FlowProblem, entry: Entry, engine: Engine, limit: float) -> Sample:
    """The same run again, every step sampled and contacts watched."""
    done = _end_reason(
        problem, entry, engine, limit, problem.numerics().replace(sample_every=1), near_pairs(problem.scene)
    )
    error = friction_of(done.history, problem.scene, engine.info().scheme)
    return Sample(seconds=done.timings.advance, facts={"friction_error": error})


def _end_reason(
    problem: FlowProblem, entry: Entry, engine: Engine, limit: float, plain: Numerics, watch: Sequence[Pair]
) -> EngineRun:
    scene = problem.with_stiffness(entry.stiffness * problem.scene.disk_disk.kn)
    numerics = plain.replace(**entry.numerics, options=dict(entry.options))
    support = engine.supports(scene, numerics)
    if support.level is SupportLevel.NO:
        lacks = [f"{engine.info().name} lacks " + ", ".join(support.missing)] if support.missing else []
        raise UnsupportedProblemError("; ".join([*lacks, *support.notes]))
    if isinstance(engine, ExternalEngine):  # one in its own process can be stopped
        engine = copy(engine)
        engine.time_limit = limit
    return engine.run(scene, numerics, watch)


def _row(problem: FlowProblem, entry: Entry, measured: Measured, base: Measured) -> Row:
    head: Row = {
        "suite": "flow",
        "problem": problem.name,
        "engine": entry.name,
        "threads": 1,
        "disks": problem.n,
        "steps": problem.steps,
        "iterations": entry.iterations,
    }
    if not measured.samples:
        return head | timings(measured, None, "")
    first = measured.samples[0].facts
    settings = first["settings"]
    head |= {
        "engine_version": first["version"] or "",
        "penetration": first["penetration"],
        "deepest": first["deepest"],
        "energy_gained": first["energy_gained"],
        "settings": json.dumps({"dt [s]": problem.dt, **settings}, default=str),
    }
    if entry.engine == "cd":
        missed = settings.get("steps that missed the tolerance", [])
        head |= {
            "missed": len(missed),
            "worst_missed": max((error for _, error in missed), default=0.0),
            "iterations": int(settings["iterations"]),
            "natural_map": float(settings["largest natural-map residual"]),
            "duality_gap": float(settings["largest relative duality gap"]),
        }
    if not base.samples:
        return head | {"status": base.status, "reason": f"no run of {BASE} to check against: {base.reason}"}
    radius = float(problem.scene.disks.radius.mean())
    apart = float(np.hypot(*(first["centre"] - base.samples[0].facts["centre"]))) / radius
    head |= {
        "check": f"centre of mass at the end against {BASE}, in mean radii (single grains part by chaos, their mean does not)",
        "check_value": apart,
        "check_bound": BOUND,
    }
    if not apart <= BOUND:
        return head | {
            "status": "fail",
            "reason": f"centres of mass are {apart:.3g} radii apart: another flow is not timed",
        }
    row = timings(measured, base, BASE)
    return head | row | {"status": "pass", "rate": row["median_s"] / problem.seconds, "rate_unit": UNIT}
