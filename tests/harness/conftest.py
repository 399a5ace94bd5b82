"""A package of fake cases and engines, found by its entry points like anyone's."""

from __future__ import annotations

import importlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from ninedisk.harness import registry

SOURCE = Path(__file__).parent / "data" / "ninedisk_fakes.py"


@pytest.fixture(scope="session")
def fake_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on which Python finds the package ``ninedisk-fakes`` with its entry points."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(SOURCE, folder)
    about = folder / "ninedisk_fakes-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: ninedisk-fakes\nVersion: 1.0\n")
    behaviours = SOURCE.read_text().partition("BEHAVIOURS = (")[2].partition(")")[0]
    engines = [f"fake-{name.strip().strip(chr(34))}" for name in behaviours.split(",") if name.strip()]
    lines = [
        "[ninedisk.cases]",
        "fake/fall = ninedisk_fakes:CASE",
        "fake/spin = ninedisk_fakes:CASES",
        "[ninedisk.engines]",
    ]
    lines += [f"{name} = ninedisk_fakes:ENGINES" for name in engines]
    lines += ["fake-broken = ninedisk_fakes:NOWHERE"]
    (about / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture
def fakes(fake_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module of the fakes, registered in this process."""
    monkeypatch.syspath_prepend(str(fake_folder))
    registry.case_table.cache_clear()
    registry.engine_table.cache_clear()
    yield importlib.import_module("ninedisk_fakes")
    registry.case_table.cache_clear()
    registry.engine_table.cache_clear()


@pytest.fixture
def fake_environment(fake_folder: Path) -> dict[str, str]:
    """Environment in which a child process finds the fakes."""
    return {**os.environ, "PYTHONPATH": str(fake_folder)}
