"""Which problems and engines a request means, and running them suite by suite."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from ninedisk.harness.api.engine import Engine
from ninedisk.harness.results.schema import Row

TIME_LIMIT, USUAL_REPEATS = 120.0, 5
"""Of one engine on one problem, where nothing else is asked for."""
TIME_LIMITS, REPEATS = {"coulomb": 2.0, "coulomb3d": 5.0}, {"coulomb": 2, "coulomb3d": 3}
"""Of suites with many small problems; here of one answer."""
Wanted = Callable[[str], bool]


class ProgressReporter(Protocol):
    """Given what begins, and how much of it is done."""

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
        """Report."""
        ...


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is to be measured; ``sizes`` empty, ``repeats`` or ``time_limit`` None: the usual ones.

    ``brought`` are engines that no registry knows, for flows. ``files`` is the folder of the problems of the suite coulomb3d.
    """

    suites: tuple[str, ...]
    problem_wanted: Wanted
    engine_wanted: Wanted
    sizes: tuple[int, ...]
    large: bool
    repeats: int | None
    time_limit: float | None
    brought: tuple[Engine, ...] = ()
    files: Path | None = None


def run_suites(request: Request, notify: ProgressReporter) -> Iterator[list[Row]]:
    """Rows of all suites of the request, as soon as those measured together are complete."""
    suites = {
        "dem": _dem,
        "spheres": _spheres,
        "cd": _cd,
        "coulomb": _coulomb,
        "coulomb3d": _coulomb3d,
        "flow": _flow,
        "harness": _harness,
    }
    for suite in request.suites:
        problems = suites[suite](request, partial(notify, "settling a packing"))
        for k, (name, measure) in enumerate(problems.items()):

            def of_problem(what: str, name: str = name, done: int = k, total: int = len(problems)) -> None:
                notify(f"{name}: {what}", done, total)

            limit = request.time_limit or TIME_LIMITS.get(suite, TIME_LIMIT)
            yield from measure(
                repeats=request.repeats or REPEATS.get(suite, USUAL_REPEATS), time_limit=limit, notify=of_problem
            )


Measure = Callable[..., Iterator[list[Row]]]
"""Measures one problem: ``measure(repeats=..., time_limit=..., notify=...)``."""
Progress = Callable[[int, int], None]
"""Called with the steps done and all steps while a packing is made."""


def _sizes(request: Request, usual: tuple[int, ...], more: tuple[int, ...]) -> list[int]:
    return list(request.sizes) or [*usual, *(more if request.large else ())]


def _dem(request: Request, progress: Progress) -> dict[str, Measure]:
    from ninedisk.harness.api.registry import engines_that_load
    from ninedisk.harness.bench import dem, nine_disks

    engines = engines_that_load(lambda name: name != "dem" and request.engine_wanted(name))
    makers = dem.problem_makers(_sizes(request, dem.SIZES, dem.LARGE), request.problem_wanted, progress)
    found: dict[str, Measure] = {name: partial(dem.run_size, make, engines) for name, make in makers.items()}
    arms = () if request.sizes and 9 not in request.sizes else nine_disks.ARMS
    found |= {nine_disks.problem_name(arm): partial(nine_disks.run, arm, engines) for arm in arms}
    found |= {nine_disks.accuracy_name(arm): partial(nine_disks.run_accuracy, arm, engines) for arm in arms}
    return {name: measure for name, measure in found.items() if name in makers or request.problem_wanted(name)}


def _spheres(request: Request, progress: Progress) -> dict[str, Measure]:
    from ninedisk.harness.api.registry import engines_that_load
    from ninedisk.harness.bench import dem, spheres

    makers = spheres.problem_makers(_sizes(request, spheres.SIZES, spheres.LARGE), request.problem_wanted, progress)
    engines = engines_that_load(lambda name: name != "dem" and request.engine_wanted(name)) if makers else {}
    return {name: partial(dem.run_size, make, engines) for name, make in makers.items()}


def _cd(request: Request, progress: Progress) -> dict[str, Measure]:
    from ninedisk.harness.bench import cd

    makers = cd.problems(_sizes(request, cd.SIZES, cd.LARGE), large=request.large, progress=progress)
    names = [name for name in makers if request.problem_wanted(name)]
    if not names:  # what is installed is slow to find out
        return {}
    bases = set(cd.BASE.values())
    chosen = [each for each in cd.solvers() if each.name in bases or request.engine_wanted(each.name)]
    return {name: partial(cd.run_problem, name, makers[name], chosen) for name in names}


def _coulomb(request: Request, _: Progress) -> dict[str, Measure]:
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.bench import coulomb, problem_set

    sizes = _sizes(request, coulomb.SIZES, coulomb.LARGE)
    for n in sizes:
        if n not in problem_set.SIZES:
            allowed = ", ".join(str(each) for each in problem_set.SIZES)
            raise UsageError(f"--size {n} is not one of the set's in the suite coulomb: use {allowed}")
    states = {f"{family}-{n}": (family, n) for n in sizes for family in problem_set.FAMILIES}
    wanted = {name: state for name, state in states.items() if request.problem_wanted(name)}
    if not wanted:
        return {}
    bases = set(coulomb.BASE.values())
    chosen = [each for each in coulomb.racers() if each.name in bases or request.engine_wanted(each.name)]
    return {name: partial(coulomb.run_state, *state, chosen) for name, state in wanted.items()}


def _coulomb3d(request: Request, _: Progress) -> dict[str, Measure]:
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.bench import coulomb3d
    from ninedisk.harness.bench.coulomb import BASE

    if request.files is None:
        raise UsageError("the suite coulomb3d solves problems out of files: add --files FOLDER")
    files = {
        name: path for name, path in coulomb3d.problem_files(request.files).items() if request.problem_wanted(name)
    }
    base = BASE["coulomb"]
    chosen = [each for each in coulomb3d.racers() if each.name == base or request.engine_wanted(each.name)]
    return {name: partial(coulomb3d.run_file, path, chosen) for name, path in files.items()}


def _flow(request: Request, progress: Progress) -> dict[str, Measure]:
    from ninedisk.harness.api.registry import engine_table, get_engine
    from ninedisk.harness.bench import flow

    makers = flow.problems(_sizes(request, flow.SIZES, flow.LARGE), progress)
    chosen = flow.entries(request.engine_wanted, [engine.id for engine in request.brought])
    engines = {name: get_engine(name) for name in engine_table() if name in {each.engine for each in chosen}}
    engines |= {engine.id: engine for engine in request.brought}
    return {
        name: partial(flow.run_problem, make, chosen, engines)
        for name, make in makers.items()
        if request.problem_wanted(name)
    }


def _harness(request: Request, _: Progress) -> dict[str, Measure]:
    from ninedisk.harness.bench import harness

    return {name: partial(harness.run, (), name) for name in harness.PROBLEMS if request.problem_wanted(name)}
