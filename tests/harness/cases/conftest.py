"""Run one variant of a case on an engine, without store or command line, and hold it against its checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest

from ninedisk.core.history import History
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import Case, Check, Observed, Setup
from ninedisk.harness.api.engine import Engine, EngineInfo
from ninedisk.harness.api.params import resolve
from ninedisk.harness.run.judge import blank_history, check_history, compare, judge
from ninedisk.harness.selftest.setups import with_laws


@dataclass(frozen=True)
class Cell:
    """A finished cell: everything that went into its verdict."""

    params: Mapping[str, Any]
    setup: Setup
    history: History
    observed: Observed
    checks: tuple[Check, ...]

    @property
    def failures(self) -> list[str]:
        """Quantity, truth, error and tolerance of every check that neither passes nor errs as a declared difference does."""
        found = []
        for check in self.checks:
            comparison = compare(check, self.observed)
            status, reason = judge(check, comparison)
            if status not in ("pass", "known-difference"):
                found.append(f"{check.quantity} ({check.truth}): {status} {reason}")
        return found

    @property
    def known(self) -> dict[str, str]:
        """Finding by quantity of every check that errs as a declared difference does."""
        return {
            check.quantity: check.known.finding
            for check in self.checks
            if check.known and judge(check, compare(check, self.observed))[0] == "known-difference"
        }

    @property
    def seen(self) -> set[str]:
        """Quantities of `failures`."""
        return {text.split()[0] for text in self.failures}

    def margin(self, quantity: str, truth: str) -> float:
        """Error over tolerance."""
        check = next(c for c in self.checks if (c.quantity, c.truth) == (quantity, truth))
        comparison = compare(check, self.observed)
        return comparison.abs_error / comparison.tolerance


def judge_history(
    case: Case, info: EngineInfo, params: Mapping[str, Any], history: History | None, setup: Setup | None = None
) -> Cell:
    """The checks of a case on a history; None represents a blank one, and for the setup that the case builds."""
    full = resolve(case, params).params
    setup = case.build(full) if setup is None else setup
    given = blank_history(setup) if history is None else history
    observed = case.observe(full, setup, given)
    return Cell(full, setup, given, observed, tuple(case.checks(full, setup, observed, info)))


def run_cell(
    case: Case,
    engine: Engine,
    params: Mapping[str, Any],
    spoil: Callable[[History], object] | None = None,
    *,
    scene: Callable[[Scene], Scene] = lambda scene: scene,
    law: Mapping[str, Any] | None = None,
) -> Cell:
    """Run a variant.

    ``spoil`` alters the history in place, as a defect of the engine would; ``scene`` and ``law`` give the engine another scene, or
    other values of all contact laws, than the variant has.
    """
    setup = case.build(resolve(case, params).params)
    changed = with_laws(scene(setup.scene), lambda own: replace(own, **(law or {})))
    history = engine.run(changed, setup.numerics, setup.watch).history
    check_history(history, setup)
    if spoil is not None:
        spoil(history)
    return judge_history(case, engine.info(), params, history, setup)


@pytest.fixture(name="run_cell")
def _run_cell() -> Callable[..., Cell]:
    return run_cell


@pytest.fixture(name="judge_history")
def _judge_history() -> Callable[..., Cell]:
    return judge_history


@pytest.fixture
def scheme_info() -> Callable[[str, str], EngineInfo]:
    """Facts about an imaginary engine of a given scheme and kind of contact."""

    def make(scheme: str, contact: str) -> EngineInfo:
        return EngineInfo(
            id="imaginary",
            name="imaginary",
            version=None,
            scheme=scheme,
            contact=contact,
            licence="-",
            how_it_runs="-",
            precision="float64",
            threads=1,
            install="-",
            capabilities=frozenset(),
        )

    return make
