"""Which problems and engines a request means, and running them suite by suite."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from ninedisk.harness.results.schema import Row

Wanted = Callable[[str], bool]


class Tell(Protocol):
    """Told what begins, and how much of it is done."""

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
        """Report."""
        ...


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is to be measured; ``sizes`` empty: the usual ones."""

    suites: tuple[str, ...]
    problem_wanted: Wanted
    engine_wanted: Wanted
    sizes: tuple[int, ...]
    large: bool
    repeats: int
    time_limit: float


def run_suites(request: Request, tell: Tell) -> Iterator[list[Row]]:
    """Rows of all suites of the request, as soon as those measured together are complete."""
    runs = {"dem": _dem, "cd": _cd, "flow": _flow, "harness": _harness}
    for suite in request.suites:
        yield from runs[suite](request, tell)


class _Place:
    """Says which of several problems is under way, and how far a packing has settled."""

    def __init__(self, tell: Tell, names: Sequence[str]) -> None:
        self._tell, self._names = tell, list(names)

    def __call__(self, problem: str, what: str) -> None:
        self._tell(f"{problem}: {what}", self._names.index(problem), len(self._names))

    def settling(self, done: int, total: int) -> None:
        self._tell("settling a packing", done, total)


def _sizes(request: Request, usual: tuple[int, ...], more: tuple[int, ...]) -> list[int]:
    return list(request.sizes) or [*usual, *(more if request.large else ())]


def _dem(request: Request, tell: Tell) -> Iterator[list[Row]]:
    from ninedisk.harness.api.registry import engines_that_load
    from ninedisk.harness.bench import accuracy, dem_problems, dem_suite, nine_disks

    engines = engines_that_load(lambda name: name != "dem" and request.engine_wanted(name))
    sizes = _sizes(request, dem_problems.SIZES, dem_problems.LARGE)
    wanted = request.problem_wanted
    every = () if request.sizes and 9 not in request.sizes else nine_disks.ARMS
    small = {part: [arm for arm in every if wanted(part.problem_name(arm))] for part in (nine_disks, accuracy)}
    first = dem_problems.makers(sizes, wanted)
    place = _Place(tell, [*first, *(part.problem_name(arm) for part, arms in small.items() for arm in arms)])
    makers = dem_problems.makers(sizes, wanted, place.settling)
    yield from dem_suite.run(makers, engines, repeats=request.repeats, time_limit=request.time_limit, tell=place)
    for part, arms in small.items():
        yield from part.run(arms, engines, repeats=request.repeats, time_limit=request.time_limit, tell=place)


def _cd(request: Request, tell: Tell) -> Iterator[list[Row]]:
    from ninedisk.harness.bench import cd_problems, cd_solvers, cd_suite

    sizes = _sizes(request, cd_problems.SIZES, cd_problems.LARGE)
    names = [name for name in cd_problems.problems(sizes, large=request.large) if request.problem_wanted(name)]
    if not names:  # the solvers are slow to load
        return iter(())
    place = _Place(tell, names)
    makers = cd_problems.problems(sizes, large=request.large, tell=place.settling)
    bases = set(cd_suite.BASE.values())
    return cd_suite.run(
        {name: makers[name] for name in names},
        [each for each in cd_solvers.solvers() if each.name in bases or request.engine_wanted(each.name)],
        repeats=request.repeats,
        time_limit=request.time_limit,
        tell=place,
    )


def _flow(request: Request, tell: Tell) -> Iterator[list[Row]]:
    from ninedisk.harness.api.registry import engine_table, get_engine
    from ninedisk.harness.bench import flow as flow_problems
    from ninedisk.harness.bench import flow as flow_suite

    sizes = _sizes(request, flow_problems.SIZES, flow_problems.LARGE)
    names = [name for name in flow_problems.problems(sizes) if request.problem_wanted(name)]
    place = _Place(tell, names)
    makers = flow_problems.problems(sizes, place.settling)
    chosen = flow_suite.entries(request.engine_wanted)
    return flow_suite.run(
        {name: makers[name] for name in names},
        chosen,
        {name: get_engine(name) for name in engine_table() if name in {each.engine for each in chosen}},
        repeats=request.repeats,
        time_limit=request.time_limit,
        tell=place,
    )


def _harness(request: Request, tell: Tell) -> Iterator[list[Row]]:
    from ninedisk.harness.bench import harness_suite

    names = [name for name in harness_suite.PROBLEMS if request.problem_wanted(name)]
    return harness_suite.run(
        (), names, repeats=request.repeats, time_limit=request.time_limit, tell=_Place(tell, names)
    )
