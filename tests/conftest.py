"""Options and fixtures for the whole test tree."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

pytest_plugins = ["ninedisk.harness.suite.plugin", "pytester"]


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
