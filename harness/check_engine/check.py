"""All checks of one adapter."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from ninedisk.harness.api.capabilities import SPACE, Capability, capabilities_needed
from ninedisk.harness.api.engine import Engine, EngineUnsupportedError, SupportLevel, facts_of
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cases.adapter.probe_of import probe_in_space, probe_of
from ninedisk.harness.cases.adapter.probes import Probe, falling_disk, free_flight, resting_disks
from ninedisk.harness.cases.adapter.space import resting_sphere
from ninedisk.harness.cases.adapter.unequal import unequal_probes, unequal_spheres
from ninedisk.harness.check_engine import conduct
from ninedisk.harness.check_engine.outcomes import REFUSED, Bench, Outcome, attempt, outcome

Progress = Callable[[int, int, str], None]

UNEVEN = {"sample_every": 3, "sample_from": 4, "sample_until": 10}
"""Sampling that is neither every step nor regular: steps 0, 4, 7, 10 and 17."""


def check_engine(engine: Engine, progress: Progress | None = None, only: Sequence[str] = ()) -> list[Outcome]:
    """Run every check on an engine that is installed, or those whose names match one of the patterns ``only``.

    Raises
    ------
    EngineError
        If `Engine.info` fails.
    UsageError
        If a pattern matches no check.
    """
    info = facts_of(engine)
    bench = Bench(engine, info)
    checks: list[Check] = [("facts", lambda: conduct.facts(engine.id, info), frozenset()), *_checks(bench)]
    names = [name for name, _, _ in checks]
    for pattern in only:
        if not fnmatch.filter(names, pattern):
            raise UsageError(f"no check matches {pattern!r}: the checks of this engine are {', '.join(names)}")
    checks = [each for each in checks if not only or any(fnmatch.fnmatchcase(each[0], p) for p in only)]
    outcomes = []
    for done, (name, check, needs) in enumerate(checks):
        if progress is not None:
            progress(done, len(checks), name)
        outcomes.append(attempt(name, check, needs))
    return outcomes


Check = tuple[str, Callable[[], Outcome], frozenset[Capability]]
"""Name of a check, what it does, and what its scene asks of an engine: nothing where its physics does not matter."""


def _checks(bench: Bench) -> Iterator[Check]:
    info = bench.info()
    simplest = next((probe for probe in _simplest_first(bench) if _accepts_scene(bench, probe)), None)
    if simplest is None:
        why = (
            "neither a disk in flight, nor one that falls, nor two at rest on a floor, nor a sphere on one is supported"
        )
        yield "scenes", lambda: outcome("scenes", [(why, "support at least one of them")]), frozenset()
        return
    touching = next((probe for probe in (resting_disks(info), simplest) if _accepts_scene(bench, probe)), simplest)
    flight = free_flight(info, **UNEVEN) if info.plane else resting_sphere(info, **UNEVEN)
    for name, check, probe in (
        ("form", conduct.form, touching),
        ("sampling", conduct.sampling, flight),
        ("copies", conduct.copies, simplest),
        ("settings", conduct.settings, touching),
        ("determinism", conduct.determinism, touching),
        ("input", conduct.input_unchanged, touching),
        ("warm-up", conduct.start, simplest),
        ("refusals", conduct.impossible, simplest),
    ):
        yield name, _bound(bench, name, check, probe), frozenset()
    for name, probe in (("units: flight", flight), ("units: weights and pairs", resting_disks(info))):
        yield name, _judge_probe(bench, name, probe), _needs(probe)
    unlike = [
        *(unequal_probes(info) if info.plane else ()),
        *(unequal_spheres(info) if Capability.SPHERES in info.capabilities else ()),
    ]
    for name, probe in unlike:
        yield name, _judge_probe(bench, name, probe, strict=True), _needs(probe)
    for asked in Capability:
        if probe_in_space(asked, info) is None and not info.plane:
            continue
        if asked in SPACE - {Capability.SPHERES} and Capability.SPHERES not in info.capabilities:
            continue
        own = probe_of(asked, info)
        yield f"supports: {asked.name}", partial(conduct.capability, bench, own, asked), _needs(own)


def _needs(probe: Probe) -> frozenset[Capability]:
    return capabilities_needed(probe.setup.scene, probe.setup.numerics)


def _simplest_first(bench: Bench) -> Iterator[Probe]:
    yield free_flight(bench.info())
    yield falling_disk(bench.info())
    yield resting_disks(bench.info())
    yield resting_sphere(bench.info())


def _accepts_scene(bench: Bench, probe: Probe) -> bool:
    """Whether the engine takes the scene, also once it has it: an engine behind a command may refuse only then."""
    if not _runs(bench, probe):
        return False
    try:
        bench.run_of(probe)
    except EngineUnsupportedError:
        return False
    except Exception:  # the checks that run it say so
        return True
    return True


def _runs(bench: Bench, probe: Probe) -> bool:
    return bench.supports(probe.setup.scene, probe.setup.numerics).level is not SupportLevel.NO


def _bound(bench: Bench, name: str, check: Callable[[Bench, Probe], Outcome], probe: Probe) -> Callable[[], Outcome]:
    def run() -> Outcome:
        if not _runs(bench, probe):
            return Outcome(
                check=name, status=REFUSED, found=f"the scene of this check ({probe.title}) is not supported"
            )
        return check(bench, probe)

    return run


def _judge_probe(bench: Bench, name: str, probe: Probe, *, strict: bool = False) -> Callable[[], Outcome]:
    def judge(bench: Bench, probe: Probe) -> Outcome:
        support = bench.supports(probe.setup.scene, probe.setup.numerics)
        return conduct.judge_probe(name, bench, probe, support, strict=strict)

    return _bound(bench, name, judge, probe)
