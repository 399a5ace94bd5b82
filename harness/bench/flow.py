"""Suite ``flow``: contact dynamics stepped in time, beside physics engines and the in-house DEM at several stiffnesses."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.engine import Engine, EngineNotInstalledError, SupportLevel
from ninedisk.harness.bench.flow_problems import FlowProblem, relative_gaps
from ninedisk.harness.bench.measure import (
    Contender,
    Measured,
    Sample,
    Tell,
    UnsupportedProblemError,
    interleave,
    timings,
)
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.tables import Row
from ninedisk.harness.wire.external import ExternalEngine

BASE = "cd, Coulomb"
UNIT = "s/simulated s"
BOUND = 0.5
"""Of the distance between centres of mass at the end, over the mean radius."""
STIFFNESS = (1.0, 10.0, 100.0)
"""Of the DEM's springs over the gallery's."""
TOLERANCE, LOOSER = 1e-4, (1e-3, 1e-2, 1e-1)
"""Of contact dynamics, in each step, on natural map and duality gap."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """An engine with one setting of its accuracy."""

    name: str
    engine: str
    numerics: Mapping[str, Any]
    options: Mapping[str, Any]
    stiffness: float = 1.0
    iterations: int = -1


def entries(wanted: Callable[[str], bool]) -> list[Entry]:
    """Ours, always, and the settings of the engines that are wanted."""
    found = [
        *(
            Entry(
                name=BASE if tolerance == TOLERANCE else f"{BASE} to {tolerance:g}",
                engine="cd",
                numerics={"solver": "gauss-seidel", "sliding": "coulomb"},
                options={"cd.tolerance": tolerance},
            )
            for tolerance in (TOLERANCE, *LOOSER)
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
    return found


def run(
    makers: Mapping[str, Callable[[], FlowProblem]],
    chosen: Sequence[Entry],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    tell: Callable[[str, str], None],
) -> Iterator[list[Row]]:
    """Rows of all problems, one problem after the other."""
    for name, make in makers.items():
        tell(name, "making the flow")
        problem = make()
        told: Tell = partial(tell, name)
        yield run_problem(problem, chosen, engines, repeats=repeats, time_limit=time_limit, tell=told)


def run_problem(
    problem: FlowProblem,
    chosen: Sequence[Entry],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    tell: Tell,
) -> list[Row]:
    """Rows of one problem. The first entry is the base of ratios and of the check."""
    contenders = [Contender(name=each.name, run=partial(_run, problem, each, engines[each.engine])) for each in chosen]
    found = interleave(contenders, repeats=repeats, time_limit=time_limit, tell=tell)
    base = found[chosen[0].name]
    return [new_row(**_row(problem, each, found[each.name], base)) for each in chosen]


def _run(problem: FlowProblem, entry: Entry, engine: Engine, limit: float) -> Sample:
    info = engine.info()
    if not info.installed:
        raise EngineNotInstalledError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    scene = problem.with_stiffness(entry.stiffness * problem.scene.disk_disk.kn)
    numerics: Numerics = problem.numerics().replace(**entry.numerics, options=dict(entry.options))
    support = engine.supports(scene, numerics)
    if support.level is SupportLevel.NO:
        lacks = [f"{info.name} lacks " + ", ".join(support.missing)] if support.missing else []
        raise UnsupportedProblemError("; ".join([*lacks, *support.notes]))
    if isinstance(engine, ExternalEngine):  # one in a process of its own can be stopped
        engine = copy(engine)
        engine.time_limit = limit
    done = engine.run(scene, numerics, ())
    history = done.history
    deep = [-relative_gaps(scene, x, t) for x, t in zip(history.x[1:], history.t[1:], strict=True)]
    facts = {
        "version": info.version,
        "centre": history.x[-1].mean(axis=0),
        "penetration": float(np.mean([each.clip(min=0.0).sum() / problem.n for each in deep])),
        "deepest": float(max(each.max(initial=0.0) for each in deep)),
        "settings": dict(done.settings),
    }
    return Sample(seconds=done.timings.advance, whole=done.timings.setup + done.timings.advance, facts=facts)


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
        "settings": json.dumps({"dt [s]": problem.dt, **settings}, default=str),
    }
    if entry.engine == "cd":
        head |= {
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
