"""Options and fixtures for the whole test tree."""

from __future__ import annotations

import gc
import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import hypothesis
import pytest
import typer.testing

pytest_plugins = ["ninedisk.harness.suite.plugin", "pytester"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--whole", action="store_true", help="run all rows and all random inputs of tests that are sampled"
    )


PART = 4
"""Of the random inputs of a test a fourth, always the same ones, is enough for each change; `make slow` draws all, anew each time."""


def sample_rows(items: Sequence[pytest.Item]) -> None:
    """Of a test function marked ``sampled(n)`` keep n rows, drawn by a fixed seed; the others are ``slow``.

    A row's draw depends on its own name alone: a new row, or two workers that collect in another order, change no other's.
    """
    functions: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("sampled"):
            functions.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for rows in functions.values():
        mark = rows[0].get_closest_marker("sampled")
        assert mark is not None
        drawn = sorted(rows, key=lambda row: hashlib.sha256(row.nodeid.encode()).digest())
        for item in drawn[mark.args[0] :]:
            item.add_marker(pytest.mark.slow)


def fewer_inputs(item: pytest.Item) -> hypothesis.settings | None:
    """Settings under which Hypothesis draws a `PART` of a test's random inputs, by a fixed seed; None where they are few anyway."""
    given = getattr(getattr(item, "obj", None), "_hypothesis_internal_use_settings", None)
    if given is None or given.max_examples < 15 * PART:
        return None
    return hypothesis.settings(given, max_examples=given.max_examples // PART, derandomize=True, database=None)


@pytest.fixture
def part(request: pytest.FixtureRequest) -> Callable[[int], int]:
    """How many of so many random inputs a test takes: a `PART` of them, all with ``--whole``."""
    return (lambda count: count) if request.config.getoption("--whole") else (lambda count: count // PART)


MADE_ONCE = ("panel_report", "browser", "built", "measured")
"""Fixtures that take seconds to make: a report, a browser, the documentation, a store."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[object]:
    """What collecting makes stays to the end: the garbage collector, which would look through a million objects again and again, leaves
    it out. That took a fifth of the time of tests in this process, and a quarter of the collecting.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests that share one of these run in one worker, so that it is made once; else all rows of one test function do.

    What pytest-xdist does at the end of a test grows with the number of groups, and ungrouped tests are a group each: ten thousand of
    them keep its own process as busy as a worker.
    """
    if config.getoption("--whole"):
        for item in items:
            if "part" in getattr(item, "fixturenames", ()) or fewer_inputs(item) is not None:
                item.add_marker(pytest.mark.sampled)
    else:
        sample_rows(items)
        for item in items:
            if (fewer := fewer_inputs(item)) is not None:
                cast(Any, item).obj._hypothesis_internal_use_settings = fewer
    for item in items:
        if item.get_closest_marker("xdist_group") is None:
            function = getattr(item, "originalname", item.name)
            shared = (name for name in MADE_ONCE if name in getattr(item, "fixturenames", ()))
            item.add_marker(pytest.mark.xdist_group(next(shared, function)))


@pytest.fixture(scope="session", autouse=True)
def one_tree_of_commands() -> Iterator[None]:
    """Command lines that tests call in this process share the tree of commands, which typer makes anew for each: most of their time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.testing, "_get_command", cache(typer.testing._get_command))
        yield


WARM = {"cases", "engines", "kinds", "verification"}
"""Folders whose tests run other programs' engines many times."""


class ForkServers(dict[tuple[str, ...], Any]):
    """Fork servers by their commands and environments, in which pytest has the name of the test."""

    def pop(self, key: Any, default: Any = None) -> Any:
        return super().pop(self.shared(key), default)

    def __setitem__(self, key: tuple[str, ...], fork_server: Any) -> None:
        super().__setitem__(self.shared(key), fork_server)

    @staticmethod
    def shared(key: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(part for part in key if not part.startswith("PYTEST_CURRENT_TEST="))


FORK_SERVERS = ForkServers()


@pytest.fixture(autouse=True)
def engines_start_once(request: pytest.FixtureRequest) -> Iterator[None]:
    """Other programs are started once for all tests of a worker, as `ninedisk run` does; tests with `cold_starts` start them anew."""
    if request.path.parent.name not in WARM or "cold_starts" in request.fixturenames:
        yield
        return
    from ninedisk.harness.run import isolation

    before, isolation._fork_servers = isolation._fork_servers, FORK_SERVERS
    yield
    isolation._fork_servers = before


@pytest.fixture
def cold_starts() -> None:
    """Has each run of an engine start its program, see `engines_start_once`."""


@pytest.fixture
def cells_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """`ninedisk run` runs its cells in this process, which has its kernels, and not in its own worker, which has to load them."""
    from ninedisk.harness.run import workers

    def run_here(cells: Any, progress: Any = None, *, published: Any = None, **_: object) -> Any:
        return workers.run_cells(cells, progress, published=published)

    monkeypatch.setattr(workers, "run_in_workers", run_here)


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """The module that makes stores with many runs; importlib mode puts no test folder on the path."""
    name = "ninedisk_tests_synthetic_history"
    path = Path(__file__).parent / "harness" / "synthetic_history.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)  # dataclasses look their module up there
    spec.loader.exec_module(module)
    return module
