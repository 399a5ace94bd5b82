"""Files that engines themselves write: right runs pass in each form of their files, and faults in its input are named."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).parents[3] / "tools" / "write_audit_files.py"
INPUT_FAULTS = (
    "lammps-3d-gravity",
    "lammps-3d-friction",
    "lammps-3d-frozen-spins",
    "lammps-3d-restart-lost-history",
    "lammps-3d-diameter-for-radius",
    "lammps-3d-radius-for-diameter",
    "lammps-3d-mass",
    "lammps-3d-no-floor",
    "lammps-3d-stiffness-in-newton-per-millimetre",
    "lammps-3d-viscous",
    "lammps-3d-dashpot",
    "lammps-3d-stale-lists",
    "lammps-3d-floor-shakes",
    "lammps-3d-step-20-times-too-long",
    "lammps-3d-poured-gravity",
    "lammps-2d-disc-update",
)
"""Faults in what the engine itself was given, not in the TOML or the file."""
CHOSEN = (
    *INPUT_FAULTS,
    "lammps-3d-times",
    "lammps-3d-triclinic-scaled",
    "lammps-2d-periodic",
    "lammps-3d-wall-missing",
    "lammps-3d-radius-of-diameter",
    "lammps-3d-yaml",
    "lammps-3d-yaml-triclinic-scaled",
    "lammps-3d-yaml-gravity",
    "lammps-3d-extxyz",
    "lammps-3d-extxyz-gravity",
    "lammps-3d-data-file",
    "lammps-3d-data-file-hybrid",
    "lammps-3d-data-file-gravity",
    "lammps-3d-restart",
    "lammps-3d-radii-of-the-toml",
    "lammps-3d-elastic",
    "lammps-3d-step-right",
    "lammps-3d-poured",
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


def test_twelve_faults_of_inputs_are_planted(tool: ModuleType) -> None:
    assert len(INPUT_FAULTS) >= 12
    for name in INPUT_FAULTS:
        assert tool.LAMMPS[name][4], name
        assert tool.LAMMPS[name][2] or name in tool.RESTARTS, f"{name}: the input is that of the right run"


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


CORE = (
    "core-2d-npz",
    "core-2d-vtk",
    "core-2d-gravity",
    "core-2d-friction",
    "core-3d-npz",
    "core-3d-vtk",
    "core-3d-gravity",
    "core-3d-lever-arms",
    "core-3d-spheres-of-another-density",
)


@pytest.mark.parametrize("name", CORE)
def test_frames_of_the_own_dem(tool: ModuleType, tmp_path: Path, name: str) -> None:
    """Its velocities are those of half a step before the positions, but for the first frame's."""
    assert set(tool.CORE) == set(CORE)
    assert tool.judge(tmp_path, tool.write_core(tmp_path, [name])) == 0


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("KratosMultiphysics") is None, reason="needs Kratos")
@pytest.mark.parametrize(
    "name", ["kratos-3d", "kratos-3d-gravity", "kratos-3d-friction", "kratos-3d-vtu", "kratos-3d-vtu-gravity"]
)
def test_files_of_kratos(tool: ModuleType, tmp_path: Path, name: str) -> None:
    """Its general VTK output, and that of its DEM, which needs pyevtk."""
    if name.startswith("kratos-3d-vtu"):
        pytest.importorskip("pyevtk")
    expected = tool.write_kratos(tmp_path, [name])
    assert len(expected) == 1
    assert tool.judge(tmp_path, expected) == 0
