"""Suite ``dem``: particle-steps per second, memory and threads of the in-house DEM beside LAMMPS and YADE.

Problems are packings that have settled, some of them made to flow; each engine does all steps in one call, without sampling and without
a wire format between steps. One that computes other physics gets no time.
"""

from __future__ import annotations

import gzip
import json
import os
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

import ninedisk
from ninedisk.core import packings
from ninedisk.core.compile import source_hash
from ninedisk.core.dem.arrays import SORT_FROM
from ninedisk.core.dem.counts import Counts
from ninedisk.core.errors import CoreError, InvalidSceneError
from ninedisk.core.law import ContactLaw, LeverArm, SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.core.scene.bodies import Disks
from ninedisk.harness.api.engine import Engine
from ninedisk.harness.bench.measure import (
    DRIVERS,
    Contender,
    Measured,
    Reporter,
    Sample,
    ask_driver,
    installed,
    interleave,
    timings,
    usable_cores,
)
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.cases.matched import with_slip_at
from ninedisk.harness.results.schema import Row

FloatArray = NDArray[np.float64]
Kind = TypeVar("Kind", Scene, SphereScene)
UNIT = "particle-steps/s"
MOST_THREADS = 4
READINGS = 10
"""Of pairs and contacts, spread over the run."""
SIZES, LARGE = (100, 1_000, 10_000), (100_000, 1_000_000)
WORK, WORK_SHORT = 20_000_000, 5_000_000
"""Particle-steps of a problem; the short ones are for engines that need seconds for as many. 500 steps of 10,000 disks are enough for
steady rates: our lists are built once in them, as often as on average in the long run (4 times in 2,000 steps), and the packing that
has lost its shear forces has the contacts of the long run from step 200 on, 3 % fewer than at first. Positions in YADE are 6e-4 off by
then, of the 3e-3 that its check allows."""
MOST_STEPS, MOST_STEPS_FLOWING, MOST_STEPS_SHORT, FEWEST_STEPS = 20_000, 4_000, 1_000, 60
"""Fewer steps would time the first and the last. Flowing runs are over before the chaos of collisions makes round-off visible, short
runs are over before the dashpots of the few contacts that YADE has to guess show in the positions."""
FLOWS_FROM = 1_000
"""Disks from which there is a flowing problem: fewer are all boundary."""
STEP = 0.1
"""Contact step over the critical one."""
SKIN, SKIN_FLOWING = 0.05, 0.2
"""Skin over the mean radius for peers, which keep one: the smaller the better where nothing moves. Ours adapts its own."""
SPEED = 20.0
"""Of the top of the packing in the flowing problem [m/s]; the speed grows linearly with height."""
LARGEST_SETTLED = 10_000
"""Disks from which a packing is made of copies of a smaller one, side by side."""


@dataclass(frozen=True, kw_only=True)
class DemProblem:
    """A scene, its contact step [s], the number of steps, the skin of neighbour lists [m], and radii [m] that end classes of sizes.

    Contacts start without shear force: no engine has to take over another one's history, and the packing that loses it moves,
    so that there is something to compare.
    """

    name: str
    scene: Any
    contact_dt: float
    steps: int
    skin: float
    short: bool = False
    classes: tuple[float, ...] = ()

    suite: ClassVar[str] = "dem"

    @property
    def n(self) -> int:
        """Number of disks."""
        return len(self.scene.bodies)

    @property
    def sort_from(self) -> int:
        """Bodies from which a run shares its work among threads."""
        return SORT_FROM

    @property
    def peers(self) -> Sequence[Peer]:
        """External engines that have this kind of problem."""
        return PEERS

    def session(self, numerics: Numerics, threads: int = 1) -> Any:
        """The in-house DEM at time 0."""
        from ninedisk.core.dem.session import DemSession

        return DemSession(self.scene, numerics, particles=[0], threads=threads)

    def law(self, law: Any) -> dict[str, float]:
        """What an external engine is given of a law."""
        return _law(law)

    def bound(self, peer: Peer) -> tuple[float, str]:
        """Largest `error` of an engine, with its reason."""
        return peer.bound, peer.why

    def error(self, sample: Sample, ours: Sample) -> float:
        """Difference of the last positions from the in-house run."""
        return position_error(sample, ours, self.scene.bodies.x)

    error_of: ClassVar[str] = "positions, over the largest displacement,"
    """What `error` compares."""

    def numerics(self) -> Numerics:
        """The whole run as one sampling interval; dashpots see the velocity of half a step before, as in all the engines."""
        return Numerics(dt=self.contact_dt * self.steps, n_steps=1, contact_dt=self.contact_dt, damping_form="lagged")

    def with_conventions(self, disks: LeverArm, walls: LeverArm, slip_at: SlipAt) -> DemProblem:
        """The same with the lever arms of one engine, and slip measured where in the step it has it."""
        scene = with_slip_at(self.scene, slip_at)
        turned = [replace(wall, law=replace(wall.law, lever_arm=walls)) for wall in scene.walls]
        law = replace(scene.disk_disk, lever_arm=disks)
        return replace(self, scene=scene.replace(disk_disk=law, walls=tuple(turned)))


def problem_makers(
    sizes: list[int], wanted: Callable[[str], bool], notify: Callable[[int, int], None] | None = None
) -> dict[str, Callable[[], list[DemProblem]]]:
    """A maker of the wanted problems of each size, by the first one's name: one size at a time is held in memory."""
    return {
        names[0]: partial(_problem_of_size, n, names, notify)
        for n in dict.fromkeys(sizes)
        if (names := [name for name in _names(n) if wanted(name)])
    }


def _names(n: int) -> list[str]:
    names = [f"settled-{n}"]
    names += [f"settled-{n}-short"] if n <= SIZES[-1] else []
    return [*names, *([f"flowing-{n}"] if FLOWS_FROM <= n <= SIZES[-1] else [])]


def _problem_of_size(n: int, names: list[str], notify: Callable[[int, int], None] | None) -> list[DemProblem]:
    from ninedisk.core.dem.critical import critical_time_step

    settled = packing(n, progress=notify)
    scene = settled.replace(disk_disk=_by_beta(settled), initial_shear={})
    dt = STEP * critical_time_step(scene)
    found = []
    for name in names:
        short = name.endswith("-short")
        flows = name.startswith("flowing")
        work = WORK_SHORT if short else WORK
        most = MOST_STEPS_SHORT if short else MOST_STEPS_FLOWING if flows else MOST_STEPS
        steps = min(most, max(FEWEST_STEPS, work // len(scene.disks)))
        chosen = sheared_packing(scene) if flows else scene
        skin = (SKIN_FLOWING if flows else SKIN) * float(scene.disks.radius.mean())
        found.append(DemProblem(name=name, scene=chosen, contact_dt=dt, steps=steps, skin=skin, short=short))
    return found


def _by_beta(scene: Scene) -> ContactLaw:
    """The disks' law; a restitution would be a second, contradicting word about the damping that ``beta`` gives."""
    return replace(scene.disk_disk, restitution=None)


def sheared_packing(scene: Scene) -> Scene:
    """The packing without its right wall and sheared from the start: lists have to be built again and again."""
    disks = scene.disks
    v = np.column_stack([SPEED * disks.x[:, 1] / disks.x[:, 1].max(), np.zeros(len(disks))])
    moving = Disks(x=disks.x, v=v, radius=disks.radius, mass=disks.mass)
    return scene.replace(disks=moving, walls=tuple(wall for wall in scene.walls if wall.name != "right"))


def packing(n: int, *, aspect: float = 1.0, progress: Callable[[int, int], None] | None = None) -> Scene:
    """A settled packing of about ``n`` disks; above `LARGEST_SETTLED` copies of one of that size.

    Parameters
    ----------
    n : int
        Disks, >= 1.
    aspect : float
        Height over width.
    progress : callable, optional
        Called with (steps done, at most to do) while one settles.

    Returns
    -------
    Scene
        At rest, with the shear forces of its contacts unless it is made of copies. It comes from the user's cache folder if it
        has been made before by the same packings.
    """
    if n > LARGEST_SETTLED:
        one = packing(LARGEST_SETTLED, aspect=aspect, progress=progress).replace(initial_shear={})
        return packings.side_by_side(one, n // LARGEST_SETTLED)
    return cached_scene(
        f"packing-{n}-{aspect:g}", lambda: packings.settled_packing(n, aspect=aspect, progress=progress), Scene
    )


def cached_scene(name: str, make: Callable[[], Kind], kind: type[Kind]) -> Kind:
    """A scene that takes long to make: from the user's cache folder if the same packings have made it before."""
    path = packing_folder() / f"{name}-{_recipe()}.json.gz"
    try:
        with gzip.open(path, "rt", encoding="utf-8") as file:
            return kind.from_dict(json.load(file))
    except (OSError, EOFError, ValueError, InvalidSceneError):
        pass  # not there, or cut off: made anew
    scene = make()
    _store_scene(scene, path)
    return scene


def _store_scene(scene: Scene | SphereScene, path: Path) -> None:
    half = path.with_name(f".tmp-{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with gzip.open(half, "wt", encoding="utf-8", compresslevel=4) as file:
            file.write(json.dumps(scene.to_dict()))
        half.replace(path)
    except OSError:
        half.unlink(missing_ok=True)  # no room or no right to write: the next run settles it again


def packing_folder() -> Path:
    """Where settled packings are kept."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "ninedisk" / "packings"


def _recipe() -> str:
    """Hash of the sources of `ninedisk.core.packings`: another recipe makes another packing."""
    return source_hash(Path(packings.__file__).parent)[:12]


@dataclass(frozen=True, kw_only=True)
class Peer:
    """An external engine.

    Attributes
    ----------
    id : str
    arms : (str, str)
        Lever arms of its contacts between disks and with walls: the in-house run that it is held against has the same.
    slip_at : {"middle", "end"}
        Where in the step it measures slip: the run that it is held against does so there, the run that is timed where our default has it.
    bound : float
        Largest difference of a position from that run, over the largest displacement of the run, with its reason ``why``.
    short : bool
        Whether it is so slow that only the short problems are run.
    settings : mapping
        What was chosen deliberately.
    threads_by : str
        Argument of the command that reports the number of threads, ``{}`` standing for it; empty for an engine that has one.
    """

    id: str
    arms: tuple[LeverArm, LeverArm]
    slip_at: SlipAt
    bound: float
    why: str
    short: bool
    settings: Mapping[str, Any]
    threads_by: str = ""


LAMMPS = Peer(
    id="lammps",
    arms=("torque-overlap", "radius"),
    slip_at="end",
    bound=1e-6,
    why="same scheme and law: round-off, amplified where contacts open and close",
    short=False,
    settings={
        "pair_style": "granular: hooke, linear_history, coeff_restitution with e(beta), limit_damping",
        "neigh_modify": "delay 0 every 1 check yes",
        "skin / mean radius": f"{SKIN:g}, flowing {SKIN_FLOWING:g}",
        "steps": "one run command; the first lists are built before the clock starts",
        "threads": "one: pair_style granular has no variant with threads",
    },
)
YADE = Peer(
    id="yade",
    arms=("overlap", "overlap"),
    slip_at="end",
    bound=3e-3,
    why="dashpots of contacts that form on the way are up to 2 % off between disks, 22 % at walls",
    short=True,
    settings={
        "contact_law": "Law2_ScGeom_ViscElPhys_Basic",
        "dashpots": "of the first contacts pair by pair, of later ones by one constant for each body",
        "collider": "InsertionSortCollider, Verlet distance half the skin",
        "skin / mean radius": f"{SKIN:g}",
        "steps": "a loop over O.step; contacts are found before the clock starts",
    },
    threads_by="-j{}",
)
PEERS = (LAMMPS, YADE)


def run_core(problem: DemProblem, threads: int, limit: float) -> Sample:  # noqa: ARG001
    """One run of the in-house DEM from time 0; kernels are compiled and loaded before the clock starts."""
    begin = time.perf_counter()
    session = problem.session(problem.numerics(), threads)
    set_up = time.perf_counter() - begin
    session.warm_up()
    begin = time.perf_counter()
    history = session.run()
    seconds = time.perf_counter() - begin
    _, state = session.snapshot()
    facts = {"x": state["x"], "kinetic": float(history.energy["kinetic"][-1]), "state": _state_hash(state)}
    return Sample(seconds=seconds, whole=set_up + seconds, facts={**facts, "version": ninedisk.__version__})


def core_memory(problem: DemProblem) -> float:
    """Bytes a disk of the arrays that a session holds after a few steps, lists included.

    The scene that it was given, and what it has computed once and keeps, are not counted. Nor are Python's own objects: how
    many of them there are depends on what else the process has done, and they do not grow with the packing.
    """
    few = problem.numerics().replace(dt=problem.contact_dt, n_steps=5)
    problem.session(few).run()  # what the scene computes once, it computes here
    arrays = [tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)]
    tracemalloc.start()
    try:
        session = problem.session(few)
        session.run()
        traces = tracemalloc.take_snapshot().filter_traces(arrays).traces
    finally:
        tracemalloc.stop()
    del session
    return float(sum(trace.size for trace in traces)) / problem.n


def run_peer(peer: Peer, engine: Engine, problem: DemProblem, limit: float, threads: int = 1) -> Sample:
    """One run of an external engine in its own process, with more than one thread only if it has `Peer.threads_by`.

    Raises
    ------
    EngineNotInstalledError, EngineTimeoutError, EngineError
    """
    installed(engine.info())
    scene = problem.scene
    disks = scene.bodies
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"ninedisk-bench-{peer.id}-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        arrays = folder / "disks.npz"
        np.savez(
            arrays, x=disks.x, v=disks.v, omega=disks.omega, radius=disks.radius, mass=disks.mass, inertia=disks.inertia
        )
        request = {
            "disks": str(arrays),
            "law": problem.law(scene.law_of_bodies),
            "walls": [
                {"point": wall.point, "normal": wall.normal, "law": problem.law(wall.law)} for wall in scene.walls
            ],
            "gravity": scene.gravity,
            "dt": problem.contact_dt,
            "steps": problem.steps,
            "skin": problem.skin,
            "classes": problem.classes,
            **_extra(peer, engine, problem, folder),
        }
        command = [*_command(peer, engine, threads), str(DRIVERS / f"{peer.id}_bench.py")]
        environment = {**engine.environment(folder), "OMP_NUM_THREADS": str(threads)}  # type: ignore[attr-defined]
        found = ask_driver(command, request, folder, limit=limit, environment=environment)
    facts = {"x": found["x"], "kinetic": float(found["kinetic"]), "version": str(found["version"])}
    resident = float(found["memory"]) / problem.n
    return Sample(
        seconds=float(found["seconds"]), whole=time.perf_counter() - begin, facts={**facts, "resident": resident}
    )


def runner(peer: Peer, engine: Engine, problem: DemProblem, threads: int) -> Callable[[float], Sample]:
    """`run_peer` with all except the limit given."""
    return partial(run_peer, peer, engine, problem, threads=threads)


def _command(peer: Peer, engine: Engine, threads: int) -> list[str]:
    """The engine's command up to its driver, with this number of threads."""
    words = list(engine.command())  # type: ignore[attr-defined]
    del words[words.index(str(engine.copied)) :]  # type: ignore[attr-defined]
    if threads > 1:
        words[words.index(peer.threads_by.format(1))] = peer.threads_by.format(threads)
    return words


def _extra(peer: Peer, engine: Engine, problem: DemProblem, folder: Path) -> dict[str, Any]:
    if peer.id != LAMMPS.id:
        return {}
    one = problem.numerics()
    return {"libmpi": engine.extra(problem.scene, one, folder)["libmpi"]}  # type: ignore[attr-defined]


def _law(law: ContactLaw) -> dict[str, float]:
    return {"kn": law.kn, "ks": law.ks, "mu": law.mu, "beta": law.beta}


def _state_hash(state: Mapping[str, FloatArray]) -> bytes:
    """Hash of a state: equal for equal bits."""
    import hashlib

    digest = hashlib.sha256()
    for name in sorted(state):
        digest.update(np.ascontiguousarray(state[name]).tobytes())
    return digest.digest()


def run_size(
    make: Callable[[], list[DemProblem]],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    notify: Reporter,
) -> Iterator[list[Row]]:
    """Rows of the problems of one size, one after the other."""
    notify("settling")
    for problem in make():

        def of_problem(what: str, name: str = problem.name) -> None:
            notify(f"{name}: {what}")

        yield run_problem(problem, engines, repeats=repeats, time_limit=time_limit, notify=of_problem)


def run_problem(
    problem: DemProblem, engines: Mapping[str, Engine], *, repeats: int, time_limit: float, notify: Reporter
) -> list[Row]:
    """Rows of one problem: the core with 1, 2, .. threads, and every peer that has the time for it.

    Parameters
    ----------
    problem : DemProblem
    engines : mapping
        Registered engines by id; "dem" represents the core, which is always run: ratios refer to it.
    """
    peers = [peer for peer in problem.peers if peer.id in engines and (problem.short or not peer.short)]
    more = range(2, 2 if problem.n < problem.sort_from else min(MOST_THREADS, usable_cores()) + 1)
    teams = [] if problem.short else more
    runs = [(peer, k) for peer in peers for k in (1, *(more if peer.threads_by else ()))]
    contenders = [Contender(name="dem", run=partial(run_core, problem, 1))]
    contenders += [
        Contender(name=_with_threads(peer.id, k), run=runner(peer, engines[peer.id], problem, k), cores=k)
        for peer, k in runs
    ]
    contenders += [Contender(name=_with_threads("dem", k), run=partial(run_core, problem, k), cores=k) for k in teams]
    measured = interleave(contenders, repeats=repeats, time_limit=time_limit, notify=notify)
    base = measured["dem"]
    rows = [_core_row(problem, 1, base, base)]
    rows[0] |= _run_facts(problem, notify)
    rows += [_core_row(problem, k, measured[_with_threads("dem", k)], base) for k in teams]
    rows += [_peer_row(problem, peer, k, measured[_with_threads(peer.id, k)], base, notify) for peer, k in runs]
    return [new_row(**row) for row in rows]


def _with_threads(engine: str, threads: int) -> str:
    return engine if threads == 1 else f"{engine}, {threads} threads"


def _head(problem: DemProblem, engine: str, threads: int, measured: Measured) -> Row:
    version = measured.samples[0].facts["version"] if measured.samples else ""
    return {
        "suite": problem.suite,
        "problem": problem.name,
        "engine": engine,
        "engine_version": version,
        "threads": threads,
        "disks": problem.n,
        "steps": problem.steps,
    }


def _core_row(problem: DemProblem, threads: int, measured: Measured, base: Measured) -> Row:
    head = _head(problem, "dem", threads, measured)
    if not measured.samples or not base.samples:
        return head | timings(measured, None, "")
    same = all(sample.facts["state"] == base.samples[0].facts["state"] for sample in measured.samples)
    what = "every repeat" if threads == 1 else f"one thread and {threads}"
    head |= {
        "check": f"state after the last step equal to the last bit in {what}",
        "check_value": 0.0 if same else 1.0,
        "check_bound": 0.0,
        "settings": json.dumps({"contact_dt [s]": problem.contact_dt, "damping_form": "lagged"}),
    }
    if not same:
        return head | {"status": "fail", "reason": "the final states differ: nothing was timed"}
    return head | _timed(problem, measured, base)


def _peer_row(
    problem: DemProblem, peer: Peer, threads: int, measured: Measured, base: Measured, notify: Reporter
) -> Row:
    head = _head(problem, peer.id, threads, measured)
    if not measured.samples:
        return head | timings(measured, None, "")
    notify(f"dem, with the conventions of {peer.id}, for the check")
    try:
        ours = run_core(problem.with_conventions(*peer.arms, peer.slip_at), 1, float("inf"))
    except CoreError as error:
        return head | {"status": "error", "reason": f"no in-house run to check against: {error}"}
    worst = max(problem.error(sample, ours) for sample in measured.samples)
    bound, why = problem.bound(peer)
    head |= {
        "check": f"{problem.error_of} against the in-house DEM with the same lever arms and slip of the step's {peer.slip_at} ({why})",
        "check_value": worst,
        "check_bound": bound,
        "resident_per_disk": float(np.median([sample.facts["resident"] for sample in measured.samples])),
        "settings": json.dumps({"threads": threads, **peer.settings, "contact_dt [s]": problem.contact_dt}),
    }
    if not worst <= bound:
        return head | {"status": "fail", "reason": f"positions differ by {worst:.3g}: other physics is not timed"}
    return head | _timed(problem, measured, base)


def position_error(sample: Sample, ours: Sample, start: NDArray[np.float64]) -> float:
    """Largest difference of a position from the in-house run, over that run's largest displacement; inf for no numbers."""
    x, own = sample.facts["x"], ours.facts["x"]
    moved = float(np.abs(own - start).max())
    apart = float(np.abs(x - own).max())
    return apart / moved if np.isfinite(apart) and moved > 0.0 else float("inf")


def _timed(problem: DemProblem, measured: Measured, base: Measured) -> Row:
    row = timings(measured, base, "dem")
    return row | {"status": "pass", "rate": problem.n * problem.steps / row["median_s"], "rate_unit": UNIT}


def _run_facts(problem: DemProblem, notify: Reporter) -> Row:
    """Memory, and mean numbers of listed pairs and contacts, walls included."""
    if problem.short:
        return {}
    notify("memory")
    memory = core_memory(problem)
    notify("pairs and contacts")
    counts = mean_counts(problem)
    return {
        "bytes_per_disk": memory,
        "listed_pairs": counts.pairs + counts.wall_pairs,
        "contacts": counts.contacts + counts.wall_contacts,
        "rebuilds": counts.rebuilds,
    }


def mean_counts(problem: DemProblem) -> Counts:
    """Counts of its own run, means of `READINGS` over its steps; rebuilds are those of the whole run."""
    # The same contact steps, each of them a step at which the run may be stopped, only the last one sampled.
    numerics = problem.numerics().replace(
        dt=problem.contact_dt, n_steps=problem.steps, sample_from=problem.steps, sample_every=problem.steps
    )
    session = problem.session(numerics)
    readings, done = [], 0
    for k in range(1, READINGS + 1):
        until = k * problem.steps // READINGS
        if until > done:
            session.advance(until - done)
            readings.append(session.counts)
        done = until
    means = (round(sum(each) / len(readings)) for each in list(zip(*readings, strict=True))[1:])
    return Counts(readings[-1].rebuilds, *means)
