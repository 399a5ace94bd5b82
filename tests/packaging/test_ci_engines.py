"""Where continuous integration runs, the engines that it is to run are there: an empty cell of theirs is a failure."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from ninedisk.harness.api.registry import get_engine

pytestmark = pytest.mark.tree  # against the wheel there are no external engines in the environment
REQUIRED = (
    "pymunk",
    "yade",
    "siconos",
    "liggghts",
    "lammps",
    "kratos",
    "mujoco",
    "box2d",
    "bullet",
    "dart",
    "drake",
    "jolt",
    "sapien",
)
NOT_ON_DEBIAN_13 = ("siconos", "bullet")
"""Debian 13 has no package of Siconos, and PyBullet no wheel for its Python."""
ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(not os.environ.get("CI"), reason="not a run of continuous integration")
@pytest.mark.parametrize("engine_id", REQUIRED)
def test_required_engines_are_installed(engine_id: str) -> None:
    if engine_id in NOT_ON_DEBIAN_13 and sys.version_info >= (3, 13):
        pytest.skip(f"{engine_id} is not to be had here")
    info = get_engine(engine_id).info()
    assert info.installed, f"{info.name} is not installed ({info.not_installed_because}): {info.install}"


def test_make_and_the_extra_know_the_same_packages() -> None:
    import tomllib

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (line,) = re.findall(r"^PYTHON_ENGINES \?= (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    plain = {re.split(r"[<>=]", name)[0] for name in extras["engines"]}
    assert plain - {"pymunk"} == set(line.split())  # pymunk comes with ninedisk itself
    single = {
        name
        for extra in ("box2d", "bullet", "dart", "drake", "kratos", "lammps", "mujoco", "sapien")
        for name in extras[extra]
    }
    assert single == set(line.split())


def fake_python(folder: Path, *, fails: str = "", said: str = "") -> Path:
    """An interpreter whose pip cannot install the package ``fails``, and says why."""
    script = folder / "python"
    script.write_text(
        f"#!{sys.executable}\nimport sys\n"
        f"if sys.argv[-1] == {fails!r}:\n    print({said!r}, file=sys.stderr)\n    sys.exit(1)\n"
        f"open({str(folder / 'log')!r}, 'a').write(sys.argv[-1] + chr(10))\n"
    )
    script.chmod(0o755)
    return script


def install(python: Path, debian: str, packages: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", str(ROOT / "tools" / "install_engines.sh"), str(python), debian, packages],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, **environment},
    )


def test_a_platform_without_a_wheel_gets_all_others(tmp_path: Path) -> None:
    python = fake_python(tmp_path, fails="two", said="ERROR: No matching distribution found for two")
    done = install(python, "", "one two three")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "log").read_text().split() == ["one", "three"]
    assert "two: no wheel for this Python and platform" in done.stdout


def test_an_installation_that_breaks_is_an_error(tmp_path: Path) -> None:
    done = install(fake_python(tmp_path, fails="two", said="ERROR: disk full"), "", "one two three")
    assert done.returncode == 1
    assert "disk full" in done.stderr


def test_a_machine_without_apt_gets_the_python_packages(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("bash", "env", "grep", "id", "python3"):
        found = subprocess.run(["which", name], capture_output=True, text=True).stdout.strip()
        (tools / name).symlink_to(found)
    done = install(fake_python(tmp_path), "yade", "one", PATH=str(tools))
    assert done.returncode == 0, done.stderr
    assert "yade: there is no apt-get here" in done.stdout
    assert (tmp_path / "log").read_text().split() == ["one"]
