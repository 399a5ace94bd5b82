"""Which cells a run consists of; every mistake of the user is found here, before anything runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.core.errors import CoreError
from ninedisk.harness.case import Case, ParameterError, Setup, Variant
from ninedisk.harness.engine import Engine
from ninedisk.harness.errors import UsageError
from ninedisk.harness.params import resolve
from ninedisk.harness.registry import BrokenEntryError, get_case, get_engine


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One variant of a case on one engine.

    ``engine`` and ``setup`` hold the exception in place of the object where it could not be had; the cell then becomes
    an error instead of ending the run.
    """

    case: Case
    variant: Variant
    engine_id: str
    engine: Engine | Exception
    setup: Setup | Exception
    user_set: bool

    @property
    def name(self) -> str:
        """``case[variant] on engine``, for progress and messages."""
        return f"{self.case.id}[{self.variant.id}] on {self.engine_id}"


def plan_matrix(case_ids: Sequence[str], engine_ids: Sequence[str], overrides: Mapping[str, Any]) -> list[Cell]:
    """Every (case variant, engine) cell, with the variants of each case's matrix after the overrides.

    An override replaces the matrix values of its parameter; variants that become equal are run once.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown ids, parameters that some case lacks, values out of range, overrides that make no valid scene.
    """
    cases = [get_case(case_id) for case_id in case_ids]
    _refuse_unknown(cases, overrides)
    engines = [(engine_id, _engine(engine_id)) for engine_id in engine_ids]
    cells = []
    for case in cases:
        variants: dict[str, Variant] = {}
        for row in case.matrix():
            variant = resolve(case, {**row, **overrides})
            variants.setdefault(variant.id, variant)
        for variant in variants.values():
            cells += _cells(case, variant, engines, user_set=bool(overrides))
    return cells


def plan_case(case: Case | str, engine: Engine | str, params: Mapping[str, Any] | None) -> Cell:
    """The single cell of one variant: the case's defaults with ``params`` set."""
    found = get_case(case) if isinstance(case, str) else case
    runner = get_engine(engine) if isinstance(engine, str) else engine
    variant = resolve(found, params or {})
    return _cells(found, variant, [(runner.id, runner)], user_set=bool(params))[0]


def _engine(engine_id: str) -> Engine | Exception:
    try:
        return get_engine(engine_id)
    except BrokenEntryError as error:
        return error


def _cells(
    case: Case, variant: Variant, engines: Sequence[tuple[str, Engine | Exception]], *, user_set: bool
) -> list[Cell]:
    setup: Setup | Exception
    try:
        setup = case.build(variant.params)
    except (CoreError, ParameterError) as error:
        if user_set:
            raise type(error)(f"{case.id} [{variant.id}]: {error}") from error
        setup = error
    except Exception as error:
        setup = error
    return [
        Cell(case=case, variant=variant, engine_id=name, engine=engine, setup=setup, user_set=user_set)
        for name, engine in engines
    ]


def _refuse_unknown(cases: Sequence[Case], overrides: Mapping[str, Any]) -> None:
    if len(cases) == 1:
        resolve(cases[0], overrides)
        return
    for name in overrides:
        lacking = [case.id for case in cases if name not in {parameter.name for parameter in case.parameters}]
        if len(lacking) == len(cases):
            raise UsageError(f"none of the cases {', '.join(lacking)} has a parameter {name!r}")
        if lacking:
            having = [case.id for case in cases if case.id not in lacking]
            raise UsageError(
                f"the parameter {name!r} is unknown to {', '.join(lacking)}: run only the cases that have it "
                f"({', '.join(having)})"
            )
