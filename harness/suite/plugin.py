"""pytest as a way in: one test per case variant, engine and check.

``pytest --pyargs ninedisk.harness.suite --engine ID`` runs the suite as it is; a test module of one's own asks for the fixture
``ninedisk_check`` and calls ``ninedisk_check.verify()``. Either way there is one test for each check of the matrix, plus one
called ``cell`` for each variant and engine, which fails if the engine crashed or if the checks that were measured are not those
that were collected. Collecting runs no engine: the checks are enumerated on a history without numbers
(`ninedisk.harness.run.runner`). A cell is run when its first test needs it and kept for the others; with pytest-xdist use
``--dist loadgroup`` so that a cell's tests stay in one process (without it each process runs the cells that it needs).

pytest loads this module in every run of an environment that has ninedisk, so it imports nothing until its fixture is asked for.
"""

from __future__ import annotations

from argparse import ArgumentError
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ninedisk.harness.suite.items import Plan
TIERS = ("smoke", "core", "full")
"""Markers of `ninedisk.harness.suite.items`."""

_PLAN: pytest.StashKey[Plan] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the suite; the short names give way where another plugin has them."""
    group = parser.getgroup("ninedisk", "verification of granular engines")

    def add(name: str, **how: object) -> None:
        long, destination = f"--ninedisk-{name}", f"ninedisk_{name.replace('-', '_')}"
        try:
            group.addoption(long, f"--{name}", dest=destination, **how)
        except (ValueError, ArgumentError):
            group.addoption(long, dest=destination, **how)

    add("engine", action="append", default=[], metavar="ID", help="engine to verify; repeat for several")
    add("engine-cmd", action="append", default=[], metavar="COMMAND", help="engine by its command; repeat for several")
    add("case", action="append", default=[], metavar="GLOB", help="cases to run; repeat for several")
    add("known-gaps", type=Path, metavar="FILE", help="TOML file of differences that are expected to fail")
    group.addoption(
        "--ninedisk-store",
        type=Path,
        metavar="DIR",
        help="store of results; cells that a run of the same code on this machine left there are judged, not run again",
    )


def pytest_configure(config: pytest.Config) -> None:
    """The markers: tiers, and that by which pytest-xdist keeps a cell's tests together.

    Raises
    ------
    pytest.UsageError
        If an option of the suite names what does not exist, before anything is collected.
    """
    config.addinivalue_line("markers", "xdist_group(name): tests that run in the same process under --dist loadgroup")
    for tier in TIERS:
        config.addinivalue_line("markers", f"{tier}: tier of ninedisk's suite, see ninedisk.harness.suite.items")

    if any(config.getoption(f"ninedisk_{name}") for name in ("case", "engine", "engine_cmd", "known_gaps")):
        _check_options(config)


def _check_options(config: pytest.Config) -> None:
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.registry import check_engine_ids, match_cases
    from ninedisk.harness.run.gaps import read_gaps
    from ninedisk.harness.wire.command import engines_given

    gaps = config.getoption("ninedisk_known_gaps")
    try:
        check_engine_ids(config.getoption("ninedisk_engine"))
        engines = engines_given(config.getoption("ninedisk_engine"), config.getoption("ninedisk_engine_cmd"))
        match_cases(config.getoption("ninedisk_case"))
        if gaps is not None:
            read_gaps(gaps).check(each if isinstance(each, str) else each.id for each in engines)
    except UsageError as error:
        raise pytest.UsageError(str(error)) from error


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test per check for every test function that takes ``ninedisk_check``."""
    if "ninedisk_check" not in metafunc.fixturenames:
        return
    from ninedisk.harness.suite.items import make_plan, parameters

    config = metafunc.config
    if _PLAN not in config.stash:
        names = ("case", "engine", "engine_cmd", "known_gaps", "store")
        config.stash[_PLAN] = make_plan(*(config.getoption(f"ninedisk_{name}") for name in names))
    metafunc.parametrize("ninedisk_check", list(parameters(config.stash[_PLAN])))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[Any]) -> None:
    """Tests have the names that pytest-xdist has just given them for their groups.

    It writes them to ``_nodeid`` (3.8), where pytest looks until 9.1; later versions look at ``_id``, and the groups would be scattered,
    which costs time and no more: where a name stands elsewhere again they are.
    """
    for item in items:
        name = vars(item).get("_nodeid", item.nodeid)
        held: Any = getattr(item, "_id", None)
        if name != item.nodeid and hasattr(held, "parse"):
            item._id = held.parse(name)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """What became of the stored cells, and which known gaps explained nothing."""
    store = config.getoption("ninedisk_store")
    if store is not None:
        from ninedisk.harness.suite.reuse import open_store

        terminalreporter.write_line(open_store(store).message)
    if _PLAN in config.stash:
        for gap in config.stash[_PLAN].idle_gaps():
            terminalreporter.write_line(f"known gap without a check here: {gap.id} {gap.quantity} on {gap.engine}")
