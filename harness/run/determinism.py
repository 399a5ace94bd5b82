"""Determinism: is a run the same run again, whatever an engine did before, however many threads it has, and in any order of bodies?

Each kind of repetition (`ninedisk.harness.results.schema.DETERMINISM_KINDS`) is a run that must end as the reference run did, in
their own processes, so that nothing but what the kind asks for has changed. What is not the same to the last bit is held against
what round-off can grow to: it is fed in each step, and its growth is measured on the same scene, by a run that starts a little
beside. Scenes have contacts that begin, slide and end: two dozen disks that fall into a box, nine smooth ones, or two dozen
spheres, eight on engines that take too long for more.
"""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import CoreError
from ninedisk.core.history import History, Pair
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, PlaneWall, Scene, Spheres, SphereScene, Wall
from ninedisk.harness.api.engine import Engine, EngineError, EngineInfo, SupportLevel, facts_of
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.support import contact_steps, support_of
from ninedisk.harness.results.schema import DETERMINISM_KINDS, Row
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.run.limits import time_limit_from_environment
from ninedisk.harness.wire.external import ExternalEngine
from ninedisk.harness.wire.protocol import Request, decode_answer, encode_request

Progress = Callable[[int, int, str], None]
Edits = Sequence[tuple[str, str, str, str]]

AGAIN = Path(__file__).parents[1] / "engines" / "drivers" / "again.py"
"""Runs the driver of an engine several times in one process."""

ROUNDINGS = 8.0
"""Roundings of a coordinate or a velocity in a step: sums of a few terms, half a unit each, as in `ninedisk.harness.cases.common`."""

SCENES = {"pile": (6, 4, 0.3), "smooth": (3, 3, 0.0)}
"""Columns, rows and friction, the scene that shows more first."""

IN_SPACE = {"spheres": (3, 3, 0.3), "few-spheres": (2, 2, 0.3)}
"""The same for spheres, in layers of as many columns each way."""

SLOW = {
    "dart": "its Gauss-Seidel takes thousands of sweeps a step in a pile: a minute a run of 27 spheres, seconds of 8"
}
"""Engines that are given the last scene of spheres, and why: ten repetitions are to take minutes."""

MANY, MANY_SPHERES = (50, 44), (14, 11)
"""Columns and rows of the scenes for threads: the DEM shares the work of 2,000 disks or spheres and more."""

SPACING, STIFFNESS, GRAVITY, DT = 1.0, 1e5, 10.0, 5e-3
STEPS, FEW_STEPS, FAILING_STEPS = 70, 40, 4
"""Of the scene, 0.35 s: all rows have met and press on each other. Of the many disks. Of runs that should fail."""


def falling(columns: int, rows: int, mu: float) -> Scene:
    """Disks of unequal size and velocity that are about to fall into a box."""
    rng = np.random.default_rng(1)
    grid = np.array([(i, j) for j in range(rows) for i in range(columns)], dtype=np.float64)
    radius = rng.uniform(0.46, 0.495, len(grid))
    ks = 0.8 * STIFFNESS if mu > 0.0 else 0.0
    law = ContactLaw(kn=STIFFNESS, ks=ks, mu=mu, restitution=0.0, regularised=True)
    faces = {
        "left": ((0.0, 0.0), (1.0, 0.0)),
        "right": ((SPACING * columns, 0.0), (-1.0, 0.0)),
        "bottom": ((0.0, 0.0), (0.0, 1.0)),
    }
    return Scene(
        disks=Disks(
            x=SPACING * (grid + 0.5) + rng.uniform(-0.004, 0.004, grid.shape),
            v=rng.uniform(-0.5, 0.5, grid.shape),
            radius=radius,
            mass=math.pi * radius**2,
        ),
        disk_disk=law,
        walls=tuple(Wall(name=name, point=point, normal=normal, law=law) for name, (point, normal) in faces.items()),
        gravity=(0.0, -GRAVITY),
    )


def falling_spheres(columns: int, layers: int, mu: float) -> SphereScene:
    """The same of spheres; two opposite walls lean, so that no wall's normal is an axis of all."""
    rng = np.random.default_rng(1)
    grid = np.array(
        [(i, j, k) for k in range(layers) for j in range(columns) for i in range(columns)], dtype=np.float64
    )
    radius = rng.uniform(0.46, 0.495, len(grid))
    ks = 0.8 * STIFFNESS if mu > 0.0 else 0.0
    law = SphereLaw(kn=STIFFNESS, ks=ks, mu=mu, restitution=0.0, regularised=True)
    far = SPACING * columns
    faces = {
        "left": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        "right": ((far, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        "front": ((0.0, 0.0, 0.0), (0.0, 0.8, 0.6)),
        "back": ((0.0, far, 0.0), (0.0, -0.8, 0.6)),
        "bottom": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    }
    return SphereScene(
        spheres=Spheres(
            x=SPACING * (grid + 0.5) + rng.uniform(-0.004, 0.004, grid.shape),
            v=rng.uniform(-0.5, 0.5, grid.shape),
            radius=radius,
            mass=4.0 / 3.0 * math.pi * radius**3,
        ),
        sphere_sphere=law,
        walls=tuple(
            PlaneWall(name=name, point=point, normal=normal, law=law) for name, (point, normal) in faces.items()
        ),
        gravity=(0.0, 0.0, -GRAVITY),
    )


@dataclass(frozen=True)
class Job:
    """One run, or a part of one: ``extra`` as `ninedisk.harness.selftest.driver` reads it."""

    scene: Scene | SphereScene
    numerics: Numerics
    watch: tuple[Pair, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)


Outcome = History | EngineError


class NoAnswerError(EngineError):
    """The process ended before it answered."""


class NotApplicableError(Exception):
    """The engine has nothing that a kind could be asked of; the message says what."""


@dataclass
class Trial:
    """An engine on one scene: the reference run, and what round-off can be made of it.

    Parameters
    ----------
    engine : Engine
    scene_id : str
        A key of `SCENES` or of `IN_SPACE`.
    edits : sequence of (module, function, code, replacement)
        Defects planted into the core, for engines of this process.
    """

    engine: Engine
    scene_id: str
    edits: Edits = ()

    def __post_init__(self) -> None:
        self.info = self.engine.info()
        self.numerics = Numerics(dt=DT, n_steps=STEPS, contact_dt=DT / 20.0, theta=1.0)
        self.job = _with_watched_contacts(self.falling(*(SCENES | IN_SPACE)[self.scene_id]), self.numerics)
        self._growth: FloatArray | None = None

    def falling(self, columns: int, rows: int, mu: float) -> Scene | SphereScene:
        """A scene of the trial's kind."""
        return (falling_spheres if self.scene_id in IN_SPACE else falling)(columns, rows, mu)

    def run_in_one_process(self, *jobs: Job) -> list[Outcome]:
        """Run jobs one after the other in one fresh process."""
        if isinstance(self.engine, ExternalEngine):
            return _external(self.engine, jobs)
        with tempfile.TemporaryDirectory(prefix="ninedisk-determinism-", ignore_cleanup_errors=True) as name:
            files = [Path(name) / f"answer-{k}.json" for k in range(len(jobs))]
            texts = _requests(jobs, [job.extra for job in jobs], files)
            asked = {"engine": self.engine.id, "edits": list(self.edits), "requests": texts}
            ended = _end_process([sys.executable, "-m", "ninedisk.harness.selftest.driver"], asked, os.environ)
            return [_answer(*each, ended) for each in zip(jobs, files, strict=True)]

    def run_in_fresh_process(self, job: Job) -> History:
        """Run one job in a fresh process, an external engine's as any of its runs; raises `EngineError`."""
        if isinstance(self.engine, ExternalEngine):
            return self.engine.run(job.scene, job.numerics, job.watch).history
        return _require_answer(self.run_in_one_process(job)[0])

    @cached_property
    def reference(self) -> tuple[History, History]:
        """The run that all others are held against, and the same input again in its process; raises `EngineError`."""
        if not self.repeats:
            only = self.run_in_fresh_process(self.job)
            return only, only
        one, two = self.run_in_one_process(self.job, self.job)
        return _require_answer(one), _require_answer(two)

    @property
    def first(self) -> History:
        """The reference run."""
        return self.reference[0]

    @property
    def repeats(self) -> bool:
        """Whether one process of the engine takes several runs."""
        return not isinstance(self.engine, ExternalEngine) or hasattr(self.engine, "driver")

    def growth(self) -> FloatArray:
        """Largest growth so far of a difference at the start, at each sample, >= 1; the start is off by the root of the precision."""
        if self._growth is None:
            scene, rng, small = self.job.scene, np.random.default_rng(2), math.sqrt(_precision(self.info))
            away = small * rng.choice((-1.0, 1.0), (2, *scene.bodies.x.shape))
            scales = scales_of(scene)
            x, v = scene.bodies.x + scales[0] * away[0], scene.bodies.v + scales[1] * away[1]
            beside = self.run_in_fresh_process(replace(self.job, scene=_with_bodies(scene, x=x, v=v)))
            grown = state_difference(self.first, beside, scales) / small
            self._growth = np.maximum.accumulate(np.maximum(grown, 1.0))
        return self._growth

    def allowance(self, same_until: int) -> FloatArray:
        """What round-off may have become at each sample of two runs that were the same, bit for bit, until a step.

        Units are those of `state_difference`. In each of the engine's own steps since then every coordinate is rounded `ROUNDINGS`
        times, to the precision of the scene's size, and so is every velocity in each sweep over the contacts; after n steps that is n
        times as much at most, times the growth of what was there first. `growth` is that of a start that is off in a random direction
        of all coordinates and velocities; the worst one grows by the root of their number more. A solver that stops at a tolerance leaves
        velocities as vague as that, relative to those that a step can stop.
        """
        options = self.info.options
        own = contact_steps(self.job.scene, self.numerics)[0] if self.info.contact == "spring" else 1
        own *= int(options["substeps"].default) if "substeps" in options else 1
        sweeps = int(options[self.info.sweeps].default) if self.info.sweeps else 1
        places = scene_extent(self.job.scene) / scales_of(self.job.scene)[0]
        each = max(ROUNDINGS * _precision(self.info) * (places + sweeps), tolerance_of(self.info))
        steps = np.maximum(self.first.step - same_until, 0)
        worst = math.sqrt(2.0 * self.job.scene.bodies.x.size)
        return np.asarray(each * own * steps * worst * self.growth(), dtype=np.float64)


def measure(engine: Engine, progress: Progress | None = None, edits: Edits = (), *, space: bool = False) -> list[Row]:
    """Every kind of repetition on one engine, of disks or of spheres.

    Parameters
    ----------
    engine : Engine
        One that is installed.
    progress : callable, optional
        Called with (kinds done, kinds in all, what begins).
    edits : sequence of (module, function, code, replacement)
        Defects planted into the core, for engines of this process.
    space : bool
        Whether the scene is that of spheres.

    Returns
    -------
    list of dict
        A row a kind, with the columns of `ninedisk.harness.results.schema.DETERMINISM_COLUMNS`.

    Raises
    ------
    UsageError
        If the engine is not installed, or supports no such scene.
    """
    info = facts_of(engine)
    if not info.installed:
        raise UsageError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    kinds = list(DETERMINISM_KINDS)
    notify = progress or (lambda *_: None)
    notify(0, len(kinds), f"{engine.id}: reference")
    trial, note = _first(engine, edits, IN_SPACE if space else SCENES)
    rows = []
    for done, kind in enumerate(kinds):
        notify(done, len(kinds), f"{engine.id}: {DETERMINISM_KINDS[kind][0]}")
        row: Row = {
            "engine": engine.id,
            "engine_name": info.name,
            "engine_version": info.version or "",
            "kind": kind,
            "scene": "spheres" if space else trial.scene_id,
            "scene_why": note,
            "verdict": "not applicable",
            "difference": math.nan,
            "allowance": math.nan,
            "growth": math.nan,
            "first_step": -1,
            "beyond_step": -1,
            "reason": "",
        }
        try:
            row |= measure_kind(trial, kind)
        except NotApplicableError as error:
            row["reason"] = str(error)
        except (EngineError, CoreError) as error:
            row |= {"verdict": "broken", "reason": str(error).splitlines()[0]}
        rows.append(row)
    notify(len(kinds), len(kinds), "")
    return rows


def _first(engine: Engine, edits: Edits, scenes: Iterable[str]) -> tuple[Trial, str]:
    """The first scene that the engine runs, and why none before."""
    notes = []
    for scene_id in scenes:
        if scene_id == "spheres" and engine.id in SLOW:
            notes.append(f"{scene_id}: {SLOW[engine.id]}")
            continue
        trial = Trial(engine, scene_id, edits)
        support = support_of(engine, trial.job.scene, trial.numerics)
        if support.level is SupportLevel.NO:
            notes.append(f"{scene_id}: it lacks {', '.join(support.missing) or '; '.join(support.notes)}")
            continue
        try:
            trial.reference  # noqa: B018
            return trial, "; ".join(notes)
        except EngineError as error:
            notes.append(f"{scene_id}: {str(error).splitlines()[0]}")
    raise UsageError(f"{engine.id} runs none of the scenes: {'; '.join(notes)}")


def measure_kind(trial: Trial, kind: str) -> Row:
    """Verdict and numbers of one kind of `DETERMINISM_KINDS`.

    Raises
    ------
    NotApplicableError
        If the engine has nothing that it could be asked of.
    EngineError
        If a run failed that should not.
    """
    job, numerics = trial.job, trial.numerics
    if kind == "twice":
        _requirement(trial.repeats, "each run is its own process")
        return compare_runs(trial, *trial.reference)
    if kind == "process":
        return compare_runs(trial, trial.first, trial.run_in_fresh_process(job))
    if kind == "error":
        _requirement(trial.repeats, "each run is its own process")
        *failed, after = trial.run_in_one_process(*_failing_jobs(job), job)
        _requirement(
            any(isinstance(each, EngineError) for each in failed), "no run failed: it ends well whatever the velocities"
        )
        _requirement(
            not isinstance(after, NoAnswerError), f"a run that fails ends its process: {str(after).splitlines()[0]}"
        )
        return compare_runs(trial, trial.first, _require_answer(after))
    if kind == "scene":
        _requirement(trial.repeats, "each run is its own process")
        few = (2, 1) if trial.scene_id in IN_SPACE else (4, 2)
        other = _with_watched_contacts(
            trial.falling(*few, 0.5 * job.scene.law_of_bodies.mu), numerics.replace(n_steps=STEPS // 2)
        )
        return compare_runs(trial, trial.first, _require_answer(trial.run_in_one_process(other, job)[1]))
    if kind == "threads":
        name = f"{trial.engine.id}.threads"
        _requirement("threads" in trial.info.options, "it has no option for threads")
        size = MANY_SPHERES if trial.scene_id in IN_SPACE else MANY
        many = Job(trial.falling(*size, job.scene.law_of_bodies.mu), numerics.replace(n_steps=FEW_STEPS))
        more = replace(many, numerics=many.numerics.replace(options={name: 2}))
        one, two = trial.run_in_one_process(many, more)
        return compare_runs(trial, _require_answer(one), _require_answer(two), grows=False)
    if kind == "restart":
        _requirement(hasattr(trial.engine, "resume"), "no restart")
        with tempfile.TemporaryDirectory(prefix="ninedisk-determinism-") as name:
            file = str(Path(name) / "checkpoint.npz")
            trial.run_in_one_process(replace(job, extra={"save": [STEPS // 2, file]}))
            return compare_runs(trial, trial.first, trial.run_in_fresh_process(replace(job, extra={"resume": file})))
    if kind == "watched":
        return compare_runs(trial, trial.first, trial.run_in_fresh_process(replace(job, watch=())))
    if kind == "sampled":
        return compare_runs(
            trial, trial.first, trial.run_in_fresh_process(replace(job, numerics=numerics.replace(sample_every=7)))
        )
    n, m = len(job.scene.bodies), len(job.scene.walls)
    rng = np.random.default_rng(3)
    order = rng.permutation(n) if kind == "bodies" else np.arange(n)
    walls = np.roll(np.arange(m), 1) if kind == "walls" else np.arange(m)
    return compare_runs(
        trial, trial.first, in_order(trial.run_in_fresh_process(reordered(job, order, walls)), job, order, walls)
    )


def compare_runs(trial: Trial, one: History, two: History, *, grows: bool = True) -> Row:
    """Verdict and numbers of a run that should be the reference's.

    Bit for bit all that both report counts, forces and energies too; the size of a difference is that of the state, of forces and
    energies where these alone differ. ``grows``: whether the reference run's growth is that of this scene.
    """
    one, two = common_samples(one, two)
    alike = {name: _identical(a, b) for name, a, b in _arrays(one, two)}
    same = np.array(list(alike.values())).all(axis=0)
    if same.all():
        return {"verdict": "bitwise", "difference": 0.0}
    found, alone = state_difference(one, two, scales_of(trial.job.scene)), ""
    if found.any() and grows:
        rows = np.searchsorted(trial.first.step, one.step)
        same_until = int(one.step[max(int(np.argmax(found > 0.0)) - 1, 0)])
        allowed = trial.allowance(same_until)[rows]
        growth = float(trial.growth()[rows[-1]])
    else:  # sums over all bodies, in another order
        if not found.any():
            others = ", ".join(name for name, each in alike.items() if not each.all())
            found, alone = (
                report_difference(one, two),
                f"the motion is the same to the last bit, and this is not: {others}",
            )
        allowed, growth = np.full(len(found), one.x.shape[1] * _precision(trial.info)), math.nan
    beyond = np.flatnonzero(~(found <= allowed))
    worst = int(beyond[np.argmax(found[beyond])]) if len(beyond) else int(np.argmax(found))
    return {
        "verdict": "different" if len(beyond) else "round-off",
        "difference": float(found[worst]),
        "allowance": float(allowed[worst]),
        "growth": growth,
        "first_step": int(one.step[int(np.argmin(same))]),
        "beyond_step": int(one.step[beyond[0]]) if len(beyond) else -1,
        "reason": alone,
    }


def scene_extent(scene: Scene | SphereScene) -> float:
    """Largest coordinate of the bodies and the walls' points [m]."""
    points = np.concatenate([scene.bodies.x, [wall.point for wall in scene.walls]])
    return float(np.abs(points).max())


def scales_of(scene: Scene | SphereScene) -> tuple[float, float]:
    """Length [m] and velocity [m/s] that differences are relative to: the mean radius, and that of a fall through the scene."""
    return float(scene.bodies.radius.mean()), math.sqrt(2.0 * GRAVITY * scene_extent(scene))


def state_difference(one: History, two: History, scales: tuple[float, float]) -> FloatArray:
    """Largest difference of any body at each sample: centres over the length, velocities, the rim's too, over the velocity, rotations."""
    length, speed = scales
    parts = (
        (one.x - two.x) / length,
        (one.v - two.v) / speed,
        one.angle - two.angle,
        (one.omega - two.omega) * length / speed,
    )
    largest = [np.abs(part).reshape(len(one.step), -1).max(axis=1) for part in parts]
    return np.asarray(np.max(largest, axis=0))


def report_difference(one: History, two: History) -> FloatArray:
    """Largest difference at each sample of what is given besides the state, each over its own largest value."""
    found = np.zeros(len(one.step))
    for _, a, b in _arrays(one, two):
        largest = float(np.abs(a[np.isfinite(a)]).max(initial=0.0))
        gap = np.abs(a - b).reshape(len(a), -1)
        gap = np.where(np.isnan(a).reshape(gap.shape) == np.isnan(b).reshape(gap.shape), np.nan_to_num(gap), math.inf)
        found = np.maximum(found, gap.max(axis=1, initial=0.0) / (largest or 1.0))
    return found


def common_samples(one: History, two: History) -> tuple[History, History]:
    """Both at the samples and with the watched contacts that both have."""
    _, first, second = np.intersect1d(one.step, two.step, return_indices=True)
    pairs = tuple(pair for pair in one.pairs if pair in two.pairs)
    return _at(one, first, pairs), _at(two, second, pairs)


def reordered(job: Job, order: Any, walls: Any) -> Job:
    """The job with its bodies and walls given in another order, ``order[k]`` the old number of body k."""
    n, bodies, scene = len(job.scene.bodies), job.scene.bodies, job.scene
    place = np.concatenate([np.argsort(order), n + np.argsort(walls)])
    columns = {
        name: getattr(bodies, name)[order]
        for name in ("x", "v", "omega", "radius", "mass", "inertia", "rotating", "held")
    }
    reported = _with_bodies(scene, **columns).replace(walls=tuple(scene.walls[k] for k in walls))
    return replace(job, scene=reported, watch=tuple(_with_places(pair, place) for pair in job.watch))


def in_order(history: History, job: Job, order: Any, walls: Any) -> History:
    """The history of `reordered` in the order of the job's scene; what a swapped pair's sides report stays as it is."""
    back, walls_back = np.argsort(order), np.argsort(walls)
    found = {name: getattr(history, name)[:, back] for name in ("x", "v", "angle", "omega")}
    found |= {name: getattr(history, name)[:, walls_back] for name in ("wall_point", "wall_angle", "wall_force")}
    return replace(history, **found, pairs=job.watch)


def tolerance_of(info: EngineInfo) -> float:
    """Relative tolerance at which the engine's contact solver stops; 0 where it has no such option."""
    option = info.options.get("tolerance")
    return 0.0 if option is None else float(option.default)


def _with_bodies(scene: Scene | SphereScene, **columns: Any) -> Scene | SphereScene:
    """The scene with other values in some columns of its bodies."""
    name = "spheres" if isinstance(scene, SphereScene) else "disks"
    return scene.replace(**{name: replace(scene.bodies, **columns)})


def _with_watched_contacts(scene: Scene | SphereScene, numerics: Numerics) -> Job:
    """The job with a contact of each wall and three between bodies watched, whether or not they touch."""
    n = len(scene.bodies)
    return Job(scene, numerics, (*((k % n, n + k) for k in range(len(scene.walls))), (0, 1), (1, 2), (2, 3)))


def _failing_jobs(job: Job) -> Iterator[Job]:
    """Runs that should end with an error during the run: a body so fast that its place is no number, or that it leaves through a wall.

    Few steps: a solver with an absolute tolerance does all its sweeps in each of them.
    """
    for speed in (1e300, 1e30, 1e6):
        v = np.array(job.scene.bodies.v)
        v[0] = 0.0
        v[0, -1] = -speed
        yield replace(job, scene=_with_bodies(job.scene, v=v), numerics=job.numerics.replace(n_steps=FAILING_STEPS))


def _with_places(pair: Pair, place: Any) -> Pair:
    one, two = int(place[pair[0]]), int(place[pair[1]])
    return min(one, two), max(one, two)


def _requirement(fulfilled: bool, otherwise: str) -> None:
    if not fulfilled:
        raise NotApplicableError(otherwise)


def _require_answer(outcome: Outcome) -> History:
    if isinstance(outcome, EngineError):
        raise outcome
    return outcome


def _precision(info: EngineInfo) -> float:
    """Half a unit in the last place of 1."""
    return float(np.finfo(info.precision).eps) / 2.0


def _at(history: History, rows: Any, pairs: tuple[Pair, ...]) -> History:
    columns = [history.pairs.index(pair) for pair in pairs]
    names = ("step", "t", "x", "v", "angle", "omega", "wall_point", "wall_angle", "wall_force")
    found = {name: getattr(history, name)[rows] for name in names}
    found |= {name: getattr(history, name)[rows][:, columns] for name in ("gap", "fn", "fs")}
    return replace(history, pairs=pairs, energy={name: value[rows] for name, value in history.energy.items()}, **found)


def _arrays(one: History, two: History) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    names = ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force")
    yield from ((name, getattr(one, name), getattr(two, name)) for name in names)
    yield from ((f"energy {name}", value, two.energy[name]) for name, value in one.energy.items() if name in two.energy)


def _identical(one: FloatArray, two: FloatArray) -> Any:
    """Whether all bits of each sample are the same, shape (s,); any NaN is like any other."""
    same = (np.ascontiguousarray(one).view(np.int64) == np.ascontiguousarray(two).view(np.int64)) | (
        np.isnan(one) & np.isnan(two)
    )
    return same.reshape(len(one), -1).all(axis=1)


def _external(engine: Any, jobs: Sequence[Job]) -> list[Outcome]:
    """Run jobs in one process of an engine's driver, whose requests and answers are those of its adapter."""
    with tempfile.TemporaryDirectory(prefix="ninedisk-determinism-", ignore_cleanup_errors=True) as name:
        folders = [Path(name) / str(k) for k in range(len(jobs))]
        for folder in folders:
            folder.mkdir()
        extras = [engine.extra(job.scene, job.numerics, folder) for job, folder in zip(jobs, folders, strict=True)]
        files = [folder / "answer.json" for folder in folders]
        asked = {"driver": str(engine.driver), "requests": _requests(jobs, extras, files)}
        command = [str(AGAIN) if part == str(engine.driver) else part for part in engine.command()]
        ended = _end_process(command, asked, engine.environment(Path(name)), engine.working_folder(Path(name)))
        return [_answer(*each, ended) for each in zip(jobs, files, strict=True)]


def _requests(jobs: Sequence[Job], extras: Sequence[Mapping[str, Any]], files: Sequence[Path]) -> list[str]:
    return [
        encode_request(
            Request(scene=job.scene, numerics=job.numerics, watch=job.watch, answer_file=str(file), extra=extra)
        )
        for job, extra, file in zip(jobs, extras, files, strict=True)
    ]


def _end_process(
    command: Sequence[str], asked: Mapping[str, Any], env: Mapping[str, str], cwd: Path | None = None
) -> str:
    """Run the process; how it ended, if not well: what it answered before that counts all the same."""
    try:
        limit = len(asked["requests"]) * time_limit_from_environment()
        run_isolated(command, stdin=json.dumps(asked), env=env, cwd=cwd, time_limit=limit)
    except EngineError as error:
        return str(error)
    return ""


def _answer(job: Job, file: Path, ended: str) -> Outcome:
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        return NoAnswerError(ended or "its process gave no answer")
    try:
        answer = decode_answer(text, scene=job.scene, numerics=job.numerics, watch=job.watch, folder=file.parent)
    except EngineError as error:
        return error
    return answer.run.history
