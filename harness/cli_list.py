"""``ninedisk list``: tables of cases and engines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ninedisk.harness.cli_tables import console, table
from ninedisk.harness.engine import Engine
from ninedisk.harness.params import allowed, format_value
from ninedisk.harness.registry import BrokenEntryError, case_table, engine_table, get_case, get_engine

if TYPE_CHECKING:
    from rich.table import Table


def show_cases() -> None:
    """Every case with its title, source and number of variants."""
    shown = table("case", "what it is", "source", "variants")
    for case_id in case_table():
        try:
            case = get_case(case_id)
        except BrokenEntryError as error:
            shown.add_row(case_id, f"broken: {error}", "", "")
            continue
        shown.add_row(case_id, case.title, case.source, str(len(case.matrix())))
    console().print(shown)
    console().print("Parameters of one case: ninedisk list cases CASE", markup=False, highlight=False)


def show_case(case_id: str) -> None:
    """One case: what it requires, its parameters, and the variants of its matrix."""
    case = get_case(case_id)
    out = console()
    for line in (f"{case.id} (version {case.version}): {case.title}", f"source: {case.source}", case.requirement, ""):
        out.print(line, markup=False, highlight=False)
    shown = table("parameter", "default", "unit", "allowed", "meaning")
    for p in case.parameters:
        shown.add_row(p.name, format_value(p.default), p.unit or "-", allowed(p), p.help)
    out.print(shown)
    first = case.parameters[0] if case.parameters else None
    variants = case.matrix()
    out.print(f"{len(variants)} variants run by default:", markup=False, highlight=False)
    for row in variants:
        text = ", ".join(f"{name}={format_value(value)}" for name, value in row.items()) or "the defaults"
        out.print(f"  {text}", markup=False, highlight=False)
    if first is not None:
        example = f"ninedisk run {case.id} --engine dem --set {first.name}={format_value(first.default)}"
        out.print(f"example: {example}", markup=False, highlight=False)


def show_engines() -> None:
    """Every engine: whether it is installed, its version and licence, how it runs, what installs it."""
    shown = table("engine", "name", "version", "licence", "how it runs", "install")
    missing: list[str] = []
    for engine_id in engine_table():
        try:
            _engine_row(shown, missing, get_engine(engine_id))
        except Exception as error:  # an outsider's adapter must not hide the others
            shown.add_row(engine_id, f"broken: {error}", "", "", "", "")
    out = console()
    out.print(shown)
    for line in missing:
        out.print(line, markup=False, highlight=False)


def _engine_row(shown: Table, missing: list[str], engine: Engine) -> None:
    info = engine.info()
    version = info.version if info.version is not None else "not installed"
    shown.add_row(info.id, info.name, version, info.licence, info.how_it_runs, info.install)
    if not info.installed and info.not_installed_because:
        missing.append(f"{info.id}: {info.not_installed_because}")
