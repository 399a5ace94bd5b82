"""Every public class and function has an example that runs, as the API reference shows it."""

from __future__ import annotations

import doctest
import importlib
from typing import Any

import numpy as np
import pytest

import ninedisk.core
from ninedisk.harness.run.api_record import MODULES, public_objects

OBJECTS = [(module, name) for module in MODULES for name in public_objects(module)]


def run_examples(value: Any, name: str, names: dict[str, Any]) -> tuple[int, str]:
    """How many examples a docstring has, and what of them fails.

    They see numpy as ``np``, the public names of the core and those of their module.
    """
    core = {each: getattr(ninedisk.core, each) for each in ninedisk.core.__all__}
    finder = doctest.DocTestFinder(recurse=False, exclude_empty=False)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    said: list[str] = []
    count = 0
    for test in finder.find(value, name, module=False, globs={"np": np, **core, **names}):
        count += len(test.examples)
        runner.run(test, out=said.append)
    return count, "".join(said)


@pytest.mark.parametrize(("module", "name"), OBJECTS, ids=lambda part: part.removeprefix("ninedisk."))
def test_the_example_of_a_public_object_runs(module: str, name: str) -> None:
    names = public_objects(module)
    count, said = run_examples(names[name], name, names)
    assert count, f"{module}.{name} has no example: add a section Examples to its docstring"
    assert not said, said


def test_nothing_public_is_left_out() -> None:
    assert len(OBJECTS) >= 120
    assert {module for module, _ in OBJECTS} == set(MODULES)


def sound() -> None:
    """Return nothing.

    Examples
    --------
    >>> 0.5 * 2.0 * 3.0**2
    9.0
    """


def wrong() -> None:
    """Return nothing.

    Examples
    --------
    >>> 0.5 * 2.0 * 3.0**2
    18.0
    """


def silent() -> None:
    """Return nothing."""


def test_an_object_without_an_example_and_one_with_a_wrong_number_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run_examples(sound, "sound", {}) == (1, "")
    count, said = run_examples(wrong, "wrong", {})
    assert count == 1
    assert "Expected:\n    18.0\nGot:\n    9.0" in said
    module = importlib.import_module("ninedisk.harness.api.text")
    silent.__module__ = module.__name__
    monkeypatch.setattr(module, "silent", silent, raising=False)
    with pytest.raises(AssertionError, match=r"ninedisk\.harness\.api\.text\.silent has no example"):
        test_the_example_of_a_public_object_runs(module.__name__, "silent")
