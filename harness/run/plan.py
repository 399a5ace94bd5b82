"""Which cells a run consists of; every mistake of the user is found here, before anything runs.

`run_command` and `request_command` are the commands that do one cell again, to be pasted into a shell in the same folder.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from ninedisk.core.errors import CoreError
from ninedisk.harness.api.case import Case, Parameter, ParameterError, Setup, Variant
from ninedisk.harness.api.engine import Engine, EngineError, facts_of
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.params import format_value, parse, resolve
from ninedisk.harness.api.registry import BrokenEntryError, get_case, get_engine

FEW = 5
"""Ids that a message names."""

MOST_CONTACT_STEPS = 10**7
"""Contact steps of a run: fifty times what the longest variant of a matrix takes, a minute for a few disks."""

MOST_STEPS = 10**6
"""Steps ``dt`` of a run: contact dynamics and the exact solutions of schemes take some 0.1 ms for each, minutes in all."""

MOST_NUMBERS = 10**8
"""Numbers of a history, 0.8 GB."""


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


def plan_matrix(
    case_ids: Sequence[str],
    engine_ids: Sequence[str | Engine],
    overrides: Mapping[str, Any],
    options: Mapping[str, Any] | None = None,
) -> list[Cell]:
    """Every (case variant, engine) cell, with the variants of each case's matrix after the overrides.

    An override replaces the matrix values of its parameter; variants that become equal are run once. An option
    ``ENGINE.NAME`` is a setting of that engine alone; where it differs from the engine's default it is part of the cells'
    variant ids, so that their results are not taken for those of the default. An engine may be given itself in place of its id.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown ids, parameters that some case lacks, options that no engine of the run has, values out of range, overrides
        that make no valid scene.
    """
    cases = [get_case(case_ids[0])] if len(case_ids) == 1 else [_case(case_id) for case_id in case_ids]
    _refuse_unknown(cases, overrides)
    engines = [(each, _engine(each)) if isinstance(each, str) else (each.id, each) for each in engine_ids]
    chosen = check_options(dict(engines), options or {})
    cells = []
    for case in cases:
        variants: dict[str, Variant] = {}
        for row in case.matrix():
            variant = resolve(case, {**row, **overrides})
            variants.setdefault(variant.id, variant)
        for variant in variants.values():
            cells += _cells(case, variant, engines, chosen, user_set=bool(overrides))
    return cells


def plan_case(
    case: Case | str,
    engine: Engine | str,
    params: Mapping[str, Any] | None,
    options: Mapping[str, Any] | None = None,
) -> Cell:
    """The single cell of one variant: the case's defaults with ``params`` set, the engine's with ``options``."""
    found = get_case(case) if isinstance(case, str) else case
    runner = get_engine(engine) if isinstance(engine, str) else engine
    variant = resolve(found, params or {})
    chosen = check_options({runner.id: runner}, options or {})
    return _cells(found, variant, [(runner.id, runner)], chosen, user_set=bool(params))[0]


def check_options(engines: Mapping[str, Engine | Exception], options: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Options by the engine that has them, checked, full names kept; texts become numbers where numbers are meant.

    Raises
    ------
    UsageError
        If a name is none of an engine's that runs; the message lists what there is.
    InvalidNumericsError
        If a value is not allowed.
    """
    found: dict[str, dict[str, Any]] = {}
    for full, value in options.items():
        engine_id, _, name = full.partition(".")
        if not name:
            having = _known_options(engines)
            near = close_matches(full, having, having)
            raise UsageError(
                f"the option {full!r} names no engine: write ENGINE.NAME, for instance siconos.theta.{near} "
                "`ninedisk list engines ENGINE` shows those of an engine"
            )
        engine = engines.get(engine_id)
        if engine is None:
            get_engine(engine_id)
            raise UsageError(f"the option {full!r} belongs to an engine that is not run: add --engine {engine_id}")
        if isinstance(engine, Exception):
            raise UsageError(f"the option {full!r} cannot be checked: {engine}") from engine
        try:
            known = facts_of(engine).options
        except EngineError as error:
            raise UsageError(f"the option {full!r} cannot be checked: {error}") from error
        if name not in known:
            names = ", ".join(f"{engine_id}.{each}" for each in known) or "none"
            raise UsageError(
                f"the engine {engine_id!r} has no option {name!r}.{close_matches(name, known)} Its options: {names}; "
                "`ninedisk list engines ENGINE` explains them"
            )
        option = known[name]
        checked = option.parsed(full, value) if isinstance(value, str) else option.checked(full, value)
        found.setdefault(engine_id, {})[full] = checked
    return found


def _known_options(engines: Mapping[str, Engine | Exception]) -> dict[str, str]:
    """``ENGINE.NAME`` by name, of each option of the engines that can say so; of engines that share a name, the first."""
    found: dict[str, str] = {}
    for engine_id, engine in engines.items():
        if not isinstance(engine, Exception):
            with suppress(Exception):
                for name in facts_of(engine).options:
                    found.setdefault(name, f"{engine_id}.{name}")
    return found


class _BrokenCase:
    """Represents a case that cannot be loaded, so that the others of a run do not go down with it."""

    version = 0
    title = source = requirement = "cannot be loaded"
    parameters: tuple[Parameter, ...] = ()

    def __init__(self, case_id: str, error: BrokenEntryError) -> None:
        self.id, self._error = case_id, error

    def matrix(self) -> Sequence[Mapping[str, Any]]:
        """One cell an engine, to show the error."""
        return [{}]

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise self._error

    build = observe = checks = _refuse


def _case(case_id: str) -> Case:
    try:
        return get_case(case_id)
    except BrokenEntryError as error:
        return _BrokenCase(case_id, error)


def _engine(engine_id: str) -> Engine | Exception:
    try:
        return get_engine(engine_id)
    except BrokenEntryError as error:
        return error


def _cells(
    case: Case,
    variant: Variant,
    engines: Sequence[tuple[str, Engine | Exception]],
    options: Mapping[str, Mapping[str, Any]],
    *,
    user_set: bool,
) -> list[Cell]:
    setup: Setup | Exception
    try:
        setup = case.build(variant.params)
        refuse_oversized(setup, variant)
    except (CoreError, ParameterError) as error:
        if user_set:
            raise type(error)(f"{case.id} [{variant.id}]: {error}") from error
        setup = error
    except Exception as error:
        setup = error
    cells = []
    for name, engine in engines:
        own = options.get(name, {})
        cells.append(
            Cell(
                case=case,
                variant=_with_options(variant, engine, own),
                engine_id=name,
                engine=engine,
                setup=_setup_with(setup, own),
                user_set=user_set,
            )
        )
    return cells


def refuse_oversized(setup: Setup, variant: Variant) -> None:
    """Refuse a run that no machine finishes or holds, before anything of its size is made.

    Raises
    ------
    ParameterError
        Naming what it asks for, the limit, and the parameters that set it.
    """
    numerics, scene = setup.numerics, setup.scene
    way_out = (
        f"the parameters [{variant.id}] set it: move them towards their defaults, or use a longer step or a shorter run"
    )
    if numerics.n_steps > MOST_STEPS:
        raise ParameterError(
            f"the run would take {numerics.n_steps:.3g} steps dt, at most {MOST_STEPS:.0e} are allowed; {way_out}"
        )
    steps = numerics.n_steps * (1 if numerics.contact_dt is None else numerics.substeps(numerics.contact_dt))
    if steps > MOST_CONTACT_STEPS:
        raise ParameterError(
            f"the run would take {steps:.3g} contact steps, at most {MOST_CONTACT_STEPS:.0e} are allowed; {way_out}"
        )
    last = numerics.n_steps if numerics.sample_until is None else min(numerics.sample_until, numerics.n_steps)
    samples = 2 + max(0, last - numerics.sample_from) // numerics.sample_every
    numbers = samples * (7 * len(scene.bodies) + 5 * len(scene.walls) + 3 * len(setup.watch))
    if numbers > MOST_NUMBERS:
        raise ParameterError(
            f"the run would record {samples:.3g} samples, {numbers:.3g} numbers, at most {MOST_NUMBERS:.0e} are allowed; "
            f"{way_out}"
        )


def _setup_with(setup: Setup | Exception, options: Mapping[str, Any]) -> Setup | Exception:
    if isinstance(setup, Exception) or not options:
        return setup
    numerics = setup.numerics
    return replace(setup, numerics=numerics.replace(options={**numerics.options, **options}))


def _with_options(variant: Variant, engine: Engine | Exception, options: Mapping[str, Any]) -> Variant:
    """The variant, its id extended by the options that differ from the engine's defaults."""
    if isinstance(engine, Exception) or not options:
        return variant
    known = engine.info().options
    shown = [
        f"{full}={format_value(value)}"
        for full, value in options.items()
        if value != known[full.partition(".")[2]].default
    ]
    if not shown:
        return variant
    return replace(variant, id=",".join([*([] if variant.id == "default" else [variant.id]), *shown]))


def _refuse_unknown(cases: Sequence[Case], overrides: Mapping[str, Any]) -> None:
    if len(cases) == 1:
        resolve(cases[0], overrides)
        return
    for name in overrides:
        lacking = [case.id for case in cases if name not in {parameter.name for parameter in case.parameters}]
        if len(lacking) == len(cases):
            near = close_matches(name, {parameter.name for case in cases for parameter in case.parameters})
            some = f"{', '.join(lacking[:FEW])}{', ...' if len(lacking) > FEW else ''}"
            raise UsageError(
                f"none of the {len(lacking)} cases ({some}) has a parameter {name!r}.{near} "
                "`ninedisk list cases CASE` shows those of a case"
            )
        if lacking:
            having = [case.id for case in cases if case.id not in lacking]
            raise UsageError(
                f"the parameter {name!r} is unknown to {', '.join(lacking)}: run only the cases that have it "
                f"({', '.join(having)})"
            )


def run_command(cell: Cell) -> str:
    """The command that runs this cell and no other."""
    command = command_line(cell)
    engine = ["--engine-cmd", command] if command else ["--engine", cell.engine_id]
    return shlex.join(["ninedisk", "run", cell.case.id, *engine, *_settings(cell), *_options(cell)])


def request_command(cell: Cell) -> str:
    """The commands that print what the cell's engine is asked, and let it answer; ``""`` where it is no engine behind a command."""
    command = command_line(cell)
    if not command:
        return ""
    words = ["ninedisk", "request", cell.case.id, "--engine-cmd", command, *_settings(cell), *_options(cell)]
    return f"{shlex.join(words)} | {command} run"


def command_line(cell: Cell) -> str:
    """What ``--engine-cmd`` gave; ``""`` for an engine that is known by its id."""
    return str(getattr(cell.engine, "command_line", ""))


def _settings(cell: Cell) -> list[str]:
    """Every parameter that is not its default, and those that the case's matrix varies, so that one variant is left of it."""
    varied = {name for row in cell.case.matrix() for name in row}
    words = []
    for parameter in cell.case.parameters:
        value = cell.variant.params[parameter.name]
        if parameter.name in varied or value != parse(parameter, parameter.default):
            words += ["--set", f"{parameter.name}={value if isinstance(value, str) else format_value(value)}"]
    return words


def _options(cell: Cell) -> list[str]:
    given = {} if isinstance(cell.setup, Exception) else cell.setup.numerics.options
    own = {name: value for name, value in given.items() if name.startswith(f"{cell.engine_id}.")}
    texts = {name: value if isinstance(value, str) else format_value(value) for name, value in own.items()}
    return [word for name, text in texts.items() for word in ("--option", f"{name}={text}")]
