"""The nine-disk distortion on every engine with contact springs: time of a step, and accuracy against cost.

Time of a step: without and with start-up, as the case asks and with the last state only. Accuracy: finer and finer contact steps,
forces held against their limit.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.law import SlipAt
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.registry import get_case, get_engine
from ninedisk.harness.bench.measure import Contender, Measured, Reporter, Sample, installed, interleave, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.cases.matched import core_history, slip_of
from ninedisk.harness.results.schema import Row
from ninedisk.harness.run.process_guard import guarded_environment

FloatArray = NDArray[np.float64]
CASE = "nine-disk/distortion"
ARMS = ("radius", "overlap", "torque-overlap-disks")
"""Lever arms of the case, each a separate problem: no engine has them all."""
FAITHFUL = (SupportLevel.EXACT, SupportLevel.EQUIVALENT)
LAST = ", last state only"
APART = 1e-5
"""Of the largest displacement: engines turn shear forces to first order (1e-7 in 5,500 steps), other conventions show in the
second or third digit."""
EVERY, ALONE = "dem, every step recorded", "dem, its own process"
PROGRAM = """
from ninedisk.harness.api.registry import get_case
from ninedisk.core.simulate import simulate
case = get_case({case!r})
setup = case.build({params!r})
history = simulate(setup.scene, setup.numerics, setup.watch)
print(repr(float(history.fn[-1, 0])))
"""
DIVISIONS = (1, 2, 4)
"""Contact steps in a cycle of the case."""
FINE, FINER = 64, 128
"""Of the runs from which the limit is extrapolated, as the converged tables of the case are made."""
ORDERS: Mapping[SlipAt, int] = {"middle": 2, "end": 1}
"""Of forces at a given time in the step, by where in the step slip is measured (see `ninedisk.core.law.ContactLaw.slip_at`)."""
MARGIN = 2.0
"""Factor on the error that the extrapolation predicts, as in the case's own checks: where contacts begin to slip depends on the step."""


def parameters(arm: str) -> dict[str, Any]:
    """Parameters of the case's default variant with this lever arm."""
    from ninedisk.harness.api.params import resolve

    return dict(resolve(get_case(CASE), {"lever_arm": arm}).params)


def built_variant(params: Mapping[str, Any]) -> Any:
    """Scene, numerics and watched contacts of a variant."""
    return get_case(CASE).build(params)


def can_express(engine: Engine, params: Mapping[str, Any]) -> bool:
    """Whether an engine has contact springs and the variant's physics."""
    setup = built_variant(params)
    return engine.info().contact == "spring" and engine.supports(setup.scene, setup.numerics).level in FAITHFUL


def problem_name(arm: str) -> str:
    """Name of the problem with this lever arm."""
    return f"nine-disks-{arm}"


def run(
    arm: str, engines: Mapping[str, Engine], *, repeats: int, time_limit: float, notify: Reporter
) -> Iterator[list[Row]]:
    """Rows of the nine disks with one lever arm, on the core and every engine with springs that expresses the variant.

    Each is run twice: as the case asks, forces read at every step of the distortion; and with the last state as the only
    sample, so that an engine with a costly way out of its stepping loop is not judged by that.
    """
    for last_only in (False, True):
        yield _run_sampled(arm, engines, last_only, repeats=repeats, time_limit=time_limit, notify=notify)


def _run_sampled(
    arm: str, engines: Mapping[str, Engine], last_only: bool, *, repeats: int, time_limit: float, notify: Reporter
) -> list[Row]:
    params = parameters(arm)
    able = [name for name, engine in engines.items() if can_express(engine, params)]
    if last_only:
        contenders = [Contender(name="dem", run=partial(_run_last, get_engine("dem"), params))]
        contenders += [Contender(name=name, run=partial(_run_last, engines[name], params)) for name in able]
    else:
        contenders = [
            Contender(name="dem", run=partial(_run_case, "dem", arm)),
            Contender(name=EVERY, run=partial(_run_every, params)),
            Contender(name=ALONE, run=partial(_run_alone, params)),
        ]
        contenders += [Contender(name=name, run=partial(_run_case, name, arm)) for name in able]
    measured = interleave(contenders, repeats=repeats, time_limit=time_limit, notify=notify)
    problem = problem_name(arm) + (LAST if last_only else "")
    base = measured["dem"]
    return [new_row(**_row(problem, params, name, one, base)) for name, one in measured.items()]


def _row(problem: str, params: Mapping[str, Any], name: str, measured: Measured, base: Measured) -> Row:
    numerics = built_variant(params).numerics
    row: Row = {
        "suite": "dem",
        "problem": problem,
        "engine": name,
        "threads": 1,
        "disks": 9,
        "steps": numerics.n_steps,
        **timings(measured, base, "dem"),
    }
    if not measured.samples:
        return row
    facts = measured.samples[0].facts
    row |= {
        "engine_version": facts["version"],
        "status": "pass",
        "check": facts["check"],
        "rate": 1e6 * row["median_s"] / numerics.n_steps,
        "rate_unit": "us/step",
    }
    return row


def _run_case(engine: str, arm: str, limit: float) -> Sample:  # noqa: ARG001
    """The case through the harness: its checks come first, and only a cell that passes them has a time.

    What the harness itself spends on observing and judging is no part of an engine's time.
    """
    from ninedisk.harness.run.runner import run_case

    result = run_case(CASE, engine=engine, params={"lever_arm": arm})
    if result.status == "not-installed":
        raise EngineNotInstalledError(result.reason)
    if result.status == "timeout":
        raise EngineTimeoutError(result.reason)
    if result.status not in ("pass", "known-gap", "gap-closed", "known-difference"):
        raise EngineError(f"the case's checks do not pass ({result.status}): {result.reason}")
    cell = result.cell
    parts = [float(cell[name]) for name in ("setup_s", "warm_up_s", "advance_s")]
    if not parts[2] > 0.0:
        raise EngineError("the case's checks do not pass: it was not timed")
    check = f"{len(result.rows)} checks of {CASE}: {result.status}"
    return Sample(seconds=parts[2], whole=sum(parts), facts={"check": check, "version": str(cell["engine_version"])})


def _run_last(engine: Engine, params: Mapping[str, Any], limit: float) -> Sample:  # noqa: ARG001
    """All steps as one sampling interval, held against the last positions of the core with the engine's place of the slip."""
    info = installed(engine.info())
    setup = built_variant(params)
    step, count = setup.numerics.contact_dt, setup.numerics.n_steps
    numerics = setup.numerics.replace(dt=step * count, n_steps=1, sample_from=0)
    expected = core_history(setup, info)
    done = engine.run(setup.scene, numerics, setup.watch)
    moved = float(np.abs(expected.x[-1] - expected.x[0]).max())
    apart = float(np.abs(done.history.x[-1] - expected.x[-1]).max()) / moved
    if not apart <= APART:
        raise EngineError(
            f"the last positions differ by {apart:.3g} of the largest displacement, allowed {APART:g}: not timed"
        )
    timings = done.timings
    check = f"last positions within {APART:g} of the largest displacement: {apart:.2g}"
    whole = timings.setup + timings.warm_up + timings.advance
    return Sample(seconds=timings.advance, whole=whole, facts={"check": check, "version": info.version})


def _run_every(params: Mapping[str, Any], limit: float) -> Sample:  # noqa: ARG001
    """The core with all its samples taken: forces, positions, energies of every step."""
    import ninedisk
    from ninedisk.core.dem.session import DemSession

    setup = built_variant(params)
    numerics = setup.numerics.replace(sample_every=1, sample_from=0)
    begin = time.perf_counter()
    session = DemSession(setup.scene, numerics, setup.watch)
    set_up = time.perf_counter() - begin
    session.warm_up()
    begin = time.perf_counter()
    history = session.run()
    seconds = time.perf_counter() - begin
    plain = DemSession(setup.scene, setup.numerics, setup.watch).run()
    if not (history.x[-1] == plain.x[-1]).all() or len(history.step) != numerics.n_steps + 1:
        raise EngineError("recording every step changed the result: not timed")
    facts = {
        "check": "final positions equal to the last bit to those without recording",
        "version": ninedisk.__version__,
    }
    return Sample(seconds=seconds, whole=set_up + seconds, facts=facts)


def _run_alone(params: Mapping[str, Any], limit: float) -> Sample:
    """A Python that starts, imports, loads or compiles the kernels, runs and ends; the wall-clock time of all that."""
    import ninedisk
    from ninedisk.core.simulate import simulate

    setup = built_variant(params)
    expected = float(simulate(setup.scene, setup.numerics, setup.watch).fn[-1, 0])
    program = PROGRAM.format(case=CASE, params=dict(params))
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            timeout=limit,
            env=guarded_environment(),
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise EngineError(f"a Python of its own failed: {error}") from error
    seconds = time.perf_counter() - begin
    if float(done.stdout.split()[-1]) != expected:
        raise EngineError("a process of its own gives another force: not timed")
    facts = {"check": "last force equal to the last bit to that of this process", "version": ninedisk.__version__}
    return Sample(seconds=seconds, whole=seconds, facts=facts)


def accuracy_name(arm: str) -> str:
    """Name of the problem with this lever arm."""
    return f"accuracy-nine-disks-{arm}"


@dataclass(frozen=True)
class Limit:
    """Forces at the centre disk after the last cycle for a vanishing contact step.

    With slip of the middle of the step errors fall by four with half the step: ``f`` of k contact steps in a cycle gives the limit
    ``f(128) + (f(128) - f(64))/3``, which is trusted to its last term. What a step explains is the in-house DEM's own error by the
    extrapolation from that step and its half, ``|f(k) - f(2k)| 2^p/(2^p - 1)`` with the order p, 1 with slip of the step's end.

    Attributes
    ----------
    forces : ndarray, shape (4,)
        Normal and shear forces of both watched contacts [N].
    scale : float
        The largest of them [N].
    trust : float
        Error of the limit, over ``scale``.
    explained : mapping
        Error of the force that is farthest off, over ``scale``, by the place of the slip and the contact steps in a cycle.
    """

    forces: FloatArray
    scale: float
    trust: float
    explained: Mapping[tuple[SlipAt, int], float]

    def error(self, forces: FloatArray) -> float:
        """Largest difference, over the largest force; inf for what is no number."""
        error = float(np.abs(forces - self.forces).max()) / self.scale
        return error if np.isfinite(error) else float("inf")

    def bound(self, slip_at: SlipAt, divisions: int) -> float:
        """Error that ``divisions`` contact steps in a cycle explain."""
        return MARGIN * self.explained[slip_at, divisions] + self.trust


def limit_of(arm: str) -> Limit:
    """The limit with this lever arm, from runs of the core."""

    def apart(slip_at: SlipAt, divisions: int) -> FloatArray:
        """What half the step takes off the error."""
        step, half = (_forces(get_engine("dem"), arm, many, slip_at)[0] for many in (divisions, 2 * divisions))
        return half - step

    finer = _forces(get_engine("dem"), arm, FINER)[0]
    scale, last = float(np.abs(finer).max()), apart("middle", FINE) / 3.0
    explained = {
        (slip_at, divisions): float(np.abs(apart(slip_at, divisions)).max()) / scale * 2.0**order / (2.0**order - 1.0)
        for slip_at, order in ORDERS.items()
        for divisions in DIVISIONS
    }
    return Limit(finer + last, scale, float(np.abs(last).max()) / scale, explained)


def run_accuracy(
    arm: str, engines: Mapping[str, Engine], *, repeats: int, time_limit: float, notify: Reporter
) -> Iterator[list[Row]]:
    """Rows with one lever arm and each of `DIVISIONS`, on the core and every engine with springs that expresses the variant."""
    notify("converged forces")
    limit = limit_of(arm)
    params = parameters(arm)
    able = {"dem": get_engine("dem")} | {name: each for name, each in engines.items() if can_express(each, params)}
    cells = {f"{name}, {divisions} steps a cycle": (name, divisions) for divisions in DIVISIONS for name in able}
    contenders = [
        Contender(name=label, run=partial(_run_divided, able[name], arm, divisions))
        for label, (name, divisions) in cells.items()
    ]
    measured = interleave(contenders, repeats=repeats, time_limit=time_limit, notify=notify)
    yield [
        new_row(
            **_accuracy_row(arm, (name, able[name]), n, measured[label], measured[f"dem, {n} steps a cycle"], limit)
        )
        for label, (name, n) in cells.items()
    ]


def _accuracy_row(
    arm: str, who: tuple[str, Engine], divisions: int, measured: Measured, base: Measured, limit: Limit
) -> Row:
    name, engine = who
    setup = built_variant(parameters(arm))
    numerics, slip_at = setup.numerics, slip_of(setup.scene.disk_disk.slip_at, engine.info())
    steps = numerics.n_steps * divisions
    row: Row = {
        "suite": "dem",
        "problem": accuracy_name(arm),
        "engine": name,
        "threads": 1,
        "disks": 9,
        "steps": steps,
    }
    if not measured.samples:
        return row | timings(measured, None, "")
    facts = measured.samples[0].facts
    error, bound = (
        max(limit.error(sample.facts["forces"]) for sample in measured.samples),
        limit.bound(slip_at, divisions),
    )
    row |= {
        "engine_version": facts["version"],
        "check": "forces at the centre disk at the end against their limit for a vanishing contact step, over the largest "
        f"(at most twice what the step explains, by extrapolation of the in-house DEM with slip of the step's {slip_at})",
        "check_value": error,
        "check_bound": bound,
        "settings": json.dumps({"contact_dt [s]": numerics.dt / divisions, "steps a cycle": divisions}),
    }
    if not error <= bound:
        return row | {"status": "fail", "reason": f"the forces are off by {error:.3g} of the largest: not timed"}
    row |= {"status": "pass", **timings(measured, base, "dem")}
    return row | {"rate": 1e6 * row["median_s"] / steps, "rate_unit": "us/step"}


def _run_divided(engine: Engine, arm: str, divisions: int, limit: float) -> Sample:  # noqa: ARG001
    info = installed(engine.info())
    forces, spent = _forces(engine, arm, divisions)
    return Sample(seconds=spent[0], whole=sum(spent), facts={"forces": forces, "version": str(info.version)})


def _forces(
    engine: Engine, arm: str, divisions: int, slip_at: SlipAt = "middle"
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Forces of the watched contacts at the end, and seconds of advance, set-up and warm-up; the last state is the only sample."""
    setup = built_variant({**parameters(arm), "substeps": divisions, "slip_at": slip_at})
    numerics = setup.numerics
    whole = numerics.replace(dt=numerics.dt * numerics.n_steps, n_steps=1, sample_from=0)
    done = engine.run(setup.scene, whole, setup.watch)
    forces = np.concatenate([done.history.fn[-1], done.history.fs[-1]])
    if forces.shape != (2 * len(setup.watch),):
        raise EngineError(f"{CASE}: the forces of the watched contacts are missing")
    return forces, (done.timings.advance, done.timings.setup, done.timings.warm_up)
