"""The nine-disk distortion on every engine with contact springs: microseconds a step, without and with start-up."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.registry import get_case, get_engine
from ninedisk.harness.bench.measure import Contender, Measured, Sample, Tell, interleave, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.cases.matched import core_history
from ninedisk.harness.results.schema import Row
from ninedisk.harness.run.warden import owned

CASE = "nine-disk/distortion"
ARMS = ("radius", "overlap", "torque-overlap-disks")
"""Lever arms of the case, each a problem of its own: no engine has them all."""
FAITHFUL = (SupportLevel.EXACT, SupportLevel.EQUIVALENT)
LAST = ", last state only"
APART = 1e-5
"""Of the largest displacement: engines turn shear forces to first order (1e-7 in 5,500 steps), other conventions show in the
second or third digit."""
EVERY, ALONE = "dem, every step recorded", "dem, process of its own"

PROGRAM = """
from ninedisk.harness.api.registry import get_case
from ninedisk.core.simulate import simulate
case = get_case({case!r})
setup = case.build({params!r})
history = simulate(setup.scene, setup.numerics, setup.watch)
print(repr(float(history.fn[-1, 0])))
"""


def problem_name(arm: str) -> str:
    """Name of the problem with this lever arm."""
    return f"nine-disks-{arm}"


def run(
    arms: Sequence[str],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    tell: Callable[[str, str], None],
) -> Iterator[list[Row]]:
    """Rows of the nine disks with each of ``arms``, on the core and every engine with springs that expresses the variant.

    Each is run twice: as the case asks, forces read at every step of the distortion; and with the last state as the only
    sample, so that an engine with a costly way out of its stepping loop is not judged by that.
    """
    for arm in arms:
        told = partial(tell, problem_name(arm))
        for last_only in (False, True):
            yield _run_arm(arm, engines, last_only, repeats=repeats, time_limit=time_limit, tell=told)


def _run_arm(
    arm: str, engines: Mapping[str, Engine], last_only: bool, *, repeats: int, time_limit: float, tell: Tell
) -> list[Row]:
    params = parameters(arm)
    able = [name for name, engine in engines.items() if engine.info().contact == "spring" and expresses(engine, params)]
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
    measured = interleave(contenders, repeats=repeats, time_limit=time_limit, tell=tell)
    problem = problem_name(arm) + (LAST if last_only else "")
    base = measured["dem"]
    return [new_row(**_row(problem, params, name, one, base)) for name, one in measured.items()]


def _row(problem: str, params: Mapping[str, Any], name: str, measured: Measured, base: Measured) -> Row:
    numerics = built(params).numerics
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
    if result.status not in ("pass", "known-gap", "gap-closed"):
        raise EngineError(f"the case's checks do not pass ({result.status}): {result.reason}")
    cell = result.cell
    parts = [float(cell[name]) for name in ("setup_s", "warm_up_s", "advance_s")]
    if not parts[2] > 0.0:
        raise EngineError("the case's checks do not pass: it was not timed")
    check = f"{len(result.rows)} checks of {CASE}: {result.status}"
    return Sample(seconds=parts[2], whole=sum(parts), facts={"check": check, "version": str(cell["engine_version"])})


def _run_last(engine: Engine, params: Mapping[str, Any], limit: float) -> Sample:  # noqa: ARG001
    """All steps as one sampling interval, held against the last positions of the core with the engine's place of the slip."""
    info = engine.info()
    if not info.installed:
        raise EngineNotInstalledError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    setup = built(params)
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

    setup = built(params)
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

    setup = built(params)
    expected = float(simulate(setup.scene, setup.numerics, setup.watch).fn[-1, 0])
    program = PROGRAM.format(case=CASE, params=dict(params))
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, timeout=limit, env=owned(), check=True
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise EngineError(f"a Python of its own failed: {error}") from error
    seconds = time.perf_counter() - begin
    if float(done.stdout.split()[-1]) != expected:
        raise EngineError("a process of its own gives another force: not timed")
    facts = {"check": "last force equal to the last bit to that of this process", "version": ninedisk.__version__}
    return Sample(seconds=seconds, whole=seconds, facts=facts)


def parameters(arm: str) -> dict[str, Any]:
    """Parameters of the case's default variant with this lever arm."""
    from ninedisk.harness.api.params import resolve

    return dict(resolve(get_case(CASE), {"lever_arm": arm}).params)


def built(params: Mapping[str, Any]) -> Any:
    """Scene, numerics and watched contacts of a variant."""
    return get_case(CASE).build(params)


def expresses(engine: Engine, params: Mapping[str, Any]) -> bool:
    """Whether an engine has the variant's physics."""
    setup = built(params)
    return engine.supports(setup.scene, setup.numerics).level in FAITHFUL
