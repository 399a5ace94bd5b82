"""Planck.js through the wire protocol: an outside engine in another language, judged like any other."""

from __future__ import annotations

import json
import os
import shlex
import shutil
from pathlib import Path

import pytest

from ninedisk.harness import run_case
from ninedisk.harness.wire.command import CommandEngine

pytestmark = pytest.mark.tree
FOLDER = Path(__file__).resolve().parents[3] / "docs" / "examples" / "planck"
ADAPTER = FOLDER / "planck_engine.mjs"


def planck(adapter: Path = ADAPTER) -> CommandEngine:
    if shutil.which("node") is None:
        pytest.skip("there is no node")
    engine = CommandEngine(f"node {shlex.quote(str(adapter))}")
    if not engine.info().installed:
        pytest.skip(f"Planck.js is not installed: {engine.info().install}")
    return engine


@pytest.mark.skipif(not os.environ.get("CI"), reason="not a run of continuous integration")
def test_it_is_installed_where_it_must_be() -> None:
    assert shutil.which("node"), "node is not installed"
    assert (FOLDER / "node_modules" / "planck" / "package.json").exists(), "npm install in docs/examples/planck"


@pytest.mark.parametrize(
    ("case", "params"),
    [
        ("binary-collision", {"kind": "elastic"}),
        ("binary-collision", {"kind": "plastic", "speed": 0.1, "gap": 0.05}),
        ("binary-collision", {"restitution": 0.5, "gap": 0.5025}),
        ("incline-block", {"mu": 0.36, "dt": 0.005}),
        ("incline-block", {"mu": 0.4}),
        ("slip-to-roll", {"dt": 0.005}),
    ],
)
def test_it_passes(case: str, params: dict[str, object]) -> None:
    result = run_case(case, engine=planck(), params=params)
    assert result.status in ("pass", "known-gap"), result.reason
    assert sum(row["status"] == "pass" for row in result.rows) > 5
    settings = json.loads(str(result.cell["settings"]))
    assert settings["planck.velocity_threshold"] == 0
    assert settings["engine_version"] == json.loads((FOLDER / "package.json").read_text())["dependencies"]["planck"]


def test_contact_springs_are_not_for_it() -> None:
    result = run_case("nine-disk/compression", engine=planck())
    assert result.status == "unsupported"
    assert "linear normal contact of a given stiffness" in result.reason


def test_its_own_threshold_would_make_an_elastic_collision_plastic(tmp_path: Path) -> None:
    """The setting does what it is there for: with Planck's own, 1 m/s, the collision at 1 m/s has no rebound."""
    planck()
    text = ADAPTER.read_text(encoding="utf-8")
    assert text.count("Settings.velocityThreshold = 0;") == 1
    adapter = tmp_path / "adapter.mjs"
    adapter.write_text(text.replace("Settings.velocityThreshold = 0;", "Settings.velocityThreshold = 1;"), "utf-8")
    (tmp_path / "node_modules").symlink_to(FOLDER / "node_modules")
    result = run_case("binary-collision", engine=planck(adapter))
    (row,) = (row for row in result.rows if row["quantity"] == "restitution_effective")
    assert (row["status"], abs(row["value"]) < 1e-12) == ("fail", True)


def test_where_it_is_not_installed_its_cells_say_so(tmp_path: Path) -> None:
    if shutil.which("node") is None:
        pytest.skip("there is no node")
    shutil.copy(ADAPTER, tmp_path)
    result = run_case("binary-collision", engine=CommandEngine(f"node {tmp_path / ADAPTER.name}"))
    assert result.status == "not-installed"
    assert "install it with: npm install in docs/examples/planck" in result.reason
