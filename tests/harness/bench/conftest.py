"""Small scenes for the benchmarks' tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from ninedisk.core import packings
from ninedisk.harness.bench import dem
from ninedisk.harness.bench.dem import DemProblem, problem_makers


@pytest.fixture
def packing_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of packings."""
    folder = tmp_path / "packings"
    monkeypatch.setattr(dem, "packing_folder", lambda: folder)
    return folder


@pytest.fixture(scope="session")
def settled() -> DemProblem:
    """60 disks, without a word about any cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dem, "packing", packings.settled_packing)
        (problem,) = problem_makers([60], lambda name: name.endswith("-short"))["settled-60-short"]()
    return problem
