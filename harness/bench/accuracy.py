"""Accuracy against cost: the nine-disk distortion with finer and finer contact steps on every engine that expresses it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.law import SlipAt
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench.measure import Contender, Measured, Sample, interleave, timings
from ninedisk.harness.bench.nine_disks import CASE, built, expresses, parameters
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.cases.matched import slip_of
from ninedisk.harness.results.schema import Row

FloatArray = NDArray[np.float64]

DIVISIONS = (1, 2, 4)
"""Contact steps in a cycle of the case."""
FINE, FINER = 64, 128
"""Of the runs from which the limit is extrapolated, as the converged tables of the case are made."""
ORDERS: Mapping[SlipAt, int] = {"middle": 2, "end": 1}
"""Of forces at a given time in the step, by where in the step slip is measured (see `ninedisk.core.law.ContactLaw.slip_at`)."""
MARGIN = 2.0
"""Factor on the error that the extrapolation predicts, as in the case's own checks: where contacts begin to slip depends on the step."""


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


def problem_name(arm: str) -> str:
    """Name of the problem with this lever arm."""
    return f"accuracy-nine-disks-{arm}"


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


def run(
    arms: Sequence[str],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    tell: Callable[[str, str], None],
) -> Iterator[list[Row]]:
    """Rows with each of ``arms`` and each of `DIVISIONS`, on the core and every engine with springs that expresses the variant."""
    for arm in arms:
        told = partial(tell, problem_name(arm))
        told("converged forces")
        limit = limit_of(arm)
        able = {"dem": get_engine("dem")} | {
            name: engine
            for name, engine in engines.items()
            if engine.info().contact == "spring" and expresses(engine, parameters(arm))
        }
        cells = {f"{name}, {divisions} steps a cycle": (name, divisions) for divisions in DIVISIONS for name in able}
        contenders = [
            Contender(name=label, run=partial(_run, able[name], arm, divisions))
            for label, (name, divisions) in cells.items()
        ]
        measured = interleave(contenders, repeats=repeats, time_limit=time_limit, tell=told)
        yield [
            new_row(**_row(arm, (name, able[name]), n, measured[label], measured[f"dem, {n} steps a cycle"], limit))
            for label, (name, n) in cells.items()
        ]


def _row(arm: str, who: tuple[str, Engine], divisions: int, measured: Measured, base: Measured, limit: Limit) -> Row:
    name, engine = who
    setup = built(parameters(arm))
    numerics, slip_at = setup.numerics, slip_of(setup.scene.disk_disk.slip_at, engine.info())
    steps = numerics.n_steps * divisions
    row: Row = {
        "suite": "dem",
        "problem": problem_name(arm),
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


def _run(engine: Engine, arm: str, divisions: int, limit: float) -> Sample:  # noqa: ARG001
    info = engine.info()
    if not info.installed:
        raise EngineNotInstalledError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    forces, spent = _forces(engine, arm, divisions)
    return Sample(seconds=spent[0], whole=sum(spent), facts={"forces": forces, "version": str(info.version)})


def _forces(
    engine: Engine, arm: str, divisions: int, slip_at: SlipAt = "middle"
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Forces of the watched contacts at the end, and seconds of advance, set-up and warm-up; the last state is the only sample."""
    setup = built({**parameters(arm), "substeps": divisions, "slip_at": slip_at})
    numerics = setup.numerics
    whole = numerics.replace(dt=numerics.dt * numerics.n_steps, n_steps=1, sample_from=0)
    done = engine.run(setup.scene, whole, setup.watch)
    forces = np.concatenate([done.history.fn[-1], done.history.fs[-1]])
    if forces.shape != (2 * len(setup.watch),):
        raise EngineError(f"{CASE}: the forces of the watched contacts are missing")
    return forces, (done.timings.advance, done.timings.setup, done.timings.warm_up)
