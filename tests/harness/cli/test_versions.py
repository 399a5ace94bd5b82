"""``ninedisk versions``: each version runs in its environment, and what got worse is named."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cli.app import app
from ninedisk.harness.run.versions import environment_of, installed

ENGINE = Path(__file__).parents[3] / "docs" / "examples" / "spring_dem.py"

PLANTED = 'law["kn"] * gap'


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("mujoco", "4.0.0"), "give two different versions at least"),
        (("mujoco", "4.0.0", "4.0.0"), "give two different versions at least"),
        (("mujoco", "3.2.7", "../4"), "'../4' is no version"),
        (("mujocco", "3.2.7", "4.0.0"), "Did you mean 'mujoco'"),
        (("dem", "1", "2"), "dem is no Python package whose versions can be installed; engines that are: pymunk"),
        (("mujoco", "3.2.7", "4.0.0", "-c", "inclin"), "no case matches 'inclin'"),
    ],
)
def test_a_mistake_is_named_before_anything_is_installed(words: tuple[str, ...], says: str, tmp_path: Path) -> None:
    result = ninedisk("versions", *words, "--store", str(tmp_path / "store"))
    assert result.exit_code == 2
    assert says in " ".join(result.output.split())
    assert not (tmp_path / "store").exists()


def test_a_version_that_does_not_exist_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PIP_FIND_LINKS", "PIP_EXTRA_INDEX_URL", "PIP_CONFIG_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    lines: list[str] = []
    with pytest.raises(UsageError, match=r"pymunk 99\.1 cannot be installed: there is no such version"):
        installed("pymunk", "99.1", tmp_path / "kept", lines.append)
    assert lines == ["installing pymunk 99.1"]
    assert not list((tmp_path / "kept").iterdir())


def test_a_version_that_is_kept_comes_before_what_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    place = tmp_path / f"pymunk-99.1-python{python}"
    place.mkdir()
    assert installed("pymunk", "99.1", tmp_path, lambda _: pytest.fail("it is there")) == place
    monkeypatch.setenv("PYTHONPATH", "mine")
    assert environment_of(place)["PYTHONPATH"].split(":") == [str(place), "mine"]
    assert environment_of(None)["PYTHONPATH"] == "mine"


def test_what_got_worse_in_a_new_version_is_named(tmp_path: Path) -> None:
    text = ENGINE.read_text(encoding="utf-8")
    (tmp_path / "engine-1.py").write_text(text, encoding="utf-8")
    assert text.count(PLANTED) == 1
    (tmp_path / "engine-2.py").write_text(text.replace(PLANTED, f"1.5 * {PLANTED}"), encoding="utf-8")
    command = f"{sys.executable} {tmp_path}/engine-{{version}}.py"
    store = str(tmp_path / "store")
    result: Any = ninedisk("versions", command, "1", "2", "-c", "impact/two-disks", "--store", store)
    assert result.exit_code == 1, result.output
    assert "1 to 2:" in result.output
    assert "worse" in result.output
    assert result.output.count("ninedisk compare ") == 1
    again: Any = ninedisk("versions", command, "1", "1.0", "-c", "impact/two-disks", "--store", store)
    assert again.exit_code == 2
    assert "1.0" in again.output
