"""The DEM engines of the suite ``dem``, each with all of its steps in one call: no sampling, no wire format between steps."""

from __future__ import annotations

import json
import os
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ninedisk
from ninedisk.core.law import LeverArm, SlipAt
from ninedisk.core.scene import ContactLaw
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError
from ninedisk.harness.bench.dem_problems import SKIN, SKIN_FLOWING, DemProblem
from ninedisk.harness.bench.measure import Sample
from ninedisk.harness.run.isolation import run_isolated

DRIVERS = Path(__file__).parent / "drivers"
FloatArray = NDArray[np.float64]


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
        What was chosen on purpose.
    threads_by : str
        Argument of the command that tells the number of threads, ``{}`` standing for it; empty for an engine that has one.
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
    from ninedisk.core.dem.session import DemSession

    begin = time.perf_counter()
    session = DemSession(problem.scene, problem.numerics(), particles=[0], threads=threads)
    set_up = time.perf_counter() - begin
    session.warm_up()
    begin = time.perf_counter()
    history = session.run()
    seconds = time.perf_counter() - begin
    _, state = session.snapshot()
    facts = {"x": state["x"], "kinetic": float(history.energy["kinetic"][-1]), "state": _bits(state)}
    return Sample(seconds=seconds, whole=set_up + seconds, facts={**facts, "version": ninedisk.__version__})


def core_memory(problem: DemProblem) -> float:
    """Bytes a disk of the arrays that a session holds after a few steps, lists included.

    The scene that it was given, and what it has computed once and keeps, are not counted. Nor are Python's own objects: how
    many of them there are depends on what else the process has done, and they do not grow with the packing.
    """
    from ninedisk.core.dem.session import DemSession

    few = problem.numerics().replace(dt=problem.contact_dt, n_steps=5)
    DemSession(problem.scene, few, particles=[0]).run()  # what the scene computes once, it computes here
    arrays = [tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)]
    tracemalloc.start()
    try:
        session = DemSession(problem.scene, few, particles=[0])
        session.run()
        traces = tracemalloc.take_snapshot().filter_traces(arrays).traces
    finally:
        tracemalloc.stop()
    del session
    return float(sum(trace.size for trace in traces)) / problem.n


def run_peer(peer: Peer, engine: Engine, problem: DemProblem, limit: float, threads: int = 1) -> Sample:
    """One run of an external engine in a process of its own, with more than one thread only if it has `Peer.threads_by`.

    Raises
    ------
    EngineNotInstalledError, EngineTimeoutError, EngineError
    """
    info = engine.info()
    if not info.installed:
        raise EngineNotInstalledError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    scene = problem.scene
    disks = scene.disks
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"ninedisk-bench-{peer.id}-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        arrays, answer = folder / "disks.npz", folder / "answer.npz"
        np.savez(
            arrays, x=disks.x, v=disks.v, omega=disks.omega, radius=disks.radius, mass=disks.mass, inertia=disks.inertia
        )
        request = {
            "disks": str(arrays),
            "answer": str(answer),
            "law": _law(scene.disk_disk),
            "walls": [{"point": wall.point, "normal": wall.normal, "law": _law(wall.law)} for wall in scene.walls],
            "gravity": scene.gravity,
            "dt": problem.contact_dt,
            "steps": problem.steps,
            "skin": problem.skin,
            **_extra(peer, engine, problem, folder),
        }
        command = [*_told(peer, engine, threads), str(DRIVERS / f"{peer.id}_bench.py")]
        environment = {**engine.environment(folder), "OMP_NUM_THREADS": str(threads)}  # type: ignore[attr-defined]
        finished = run_isolated(command, stdin=json.dumps(request), time_limit=limit, cwd=folder, env=environment)
        try:
            with np.load(answer) as data:
                found = {key: data[key] for key in data.files}
        except (OSError, ValueError) as error:
            said = finished.last_lines() or "it printed nothing"
            raise EngineError(f"{info.name} ended without a readable answer ({error}): {said}") from error
    if "error" in found:
        raise EngineError(f"{info.name} gave up: {found['error']}")
    facts = {"x": found["x"], "kinetic": float(found["kinetic"]), "version": str(found["version"])}
    resident = float(found["memory"]) / problem.n
    return Sample(
        seconds=float(found["seconds"]), whole=time.perf_counter() - begin, facts={**facts, "resident": resident}
    )


def runner(peer: Peer, engine: Engine, problem: DemProblem, threads: int) -> Callable[[float], Sample]:
    """`run_peer` with all but the limit given."""
    return partial(run_peer, peer, engine, problem, threads=threads)


def _told(peer: Peer, engine: Engine, threads: int) -> list[str]:
    """The engine's command without its script, with this number of threads."""
    words = list(engine.command()[:-1])  # type: ignore[attr-defined]
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


def _bits(state: Mapping[str, FloatArray]) -> bytes:
    """Hash of a state: equal for equal bits."""
    import hashlib

    digest = hashlib.sha256()
    for name in sorted(state):
        digest.update(np.ascontiguousarray(state[name]).tobytes())
    return digest.digest()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
