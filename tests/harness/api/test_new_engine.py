"""`ninedisk new-engine` writes a package that is found by its entry point and passes its own tests as it is."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app
from ninedisk.harness.new_engine.write import FILES, LANGUAGES, OF_SPHERES
from ninedisk.harness.run.gaps import read_gaps


def ninedisk(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("new") / "ninedisk-acme-dem"
    done = ninedisk("new-engine", "acme-dem", "--out", str(folder))
    assert done.exit_code == 0, done.output
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]
    return folder


@pytest.fixture(scope="module")
def installed(package: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs Python modules where the package is installed: its folder on the path, its metadata as an installer writes them."""
    project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    about = package / "ninedisk_acme_dem-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    lines = [f"[{group}]\n" + "".join(f"{name} = {where}\n" for name, where in each.items()) for group, each in groups]
    (about / "entry_points.txt").write_text("\n".join(lines))
    path = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", *arguments]
        return subprocess.run(command, cwd=package, env=environment, capture_output=True, text=True, timeout=300)

    return run


@pytest.mark.long
def test_it_is_listed_with_its_origin(installed: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    done = installed("ninedisk", "list", "engines")
    (row,) = (line for line in done.stdout.splitlines() if line.split()[:1] == ["acme-dem"])
    assert "ninedisk-acme-dem" in row


@pytest.mark.long
def test_it_passes_check_engine(installed: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    done = installed("ninedisk", "check-engine", "acme-dem")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^acme-dem \S+: nothing wrong was found, 16 checks pass$", done.stdout, re.MULTILINE)
    assert "not declared, so not tested" in done.stdout


@pytest.mark.long
def test_it_passes_its_own_tests(installed: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    cases = [f"--ninedisk-case={name}" for name in ("binary-collision", "motion/*", "impact/*", "slip-to-roll")]
    chosen = ("-m", "not full or smoke", "-p", "ninedisk.harness.suite.plugin", "-p", "no:cacheprovider", *cases)
    done = installed("pytest", "-q", *chosen)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = {word: int(count) for count, word in re.findall(r"(\d+) (\w+)", done.stdout.splitlines()[-1])}
    assert counts["passed"] > 10  # the adapter, and the elastic collision against every truth
    assert "failed" not in counts


@pytest.mark.long
def test_a_defect_in_it_is_found(installed: Callable[..., subprocess.CompletedProcess[str]], package: Path) -> None:
    solver = package / "ninedisk_acme_dem" / "solver.py"
    sound = solver.read_text()
    solver.write_text(sound.replace("-law.kn * gap", "-0.5 * law.kn * gap"))
    try:
        done = installed("ninedisk", "check-engine", "acme-dem", "--check", "supports: LINEAR_CONTACT")
    finally:
        solver.write_text(sound)
    assert solver.read_text() != sound.replace("-law.kn * gap", "-0.5 * law.kn * gap")
    assert done.returncode == 1
    assert "overlap is" in " ".join(done.stdout.split())


def test_its_files(package: Path) -> None:
    names = {path.relative_to(package).as_posix() for path in package.rglob("*") if path.is_file()}
    wanted = {name.replace("$package", "ninedisk_acme_dem") for name in FILES}
    assert wanted <= names
    text = "\n".join((package / name).read_text() for name in wanted)
    assert "$name" not in text
    assert "$package" not in text
    assert "://" not in text  # no address of any registry
    assert read_gaps(package / "known_gaps.toml").gaps == ()
    assert os.access(package / "ci.sh", os.X_OK)
    subprocess.run(["bash", "-n", str(package / "ci.sh")], check=True)


def test_the_example_in_its_known_gaps_is_one(package: Path, tmp_path: Path) -> None:
    lines = (package / "known_gaps.toml").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line == "# [[gap]]")
    (tmp_path / "gaps.toml").write_text("\n".join(line.removeprefix("# ") for line in lines[first:]))
    found = read_gaps(tmp_path / "gaps.toml")
    found.check(())
    assert found.gaps[0].explains("slip-to-roll", "mu=0.3,dt=0.01", "any", "spin", "analytic")


@pytest.mark.sampled(2)
@pytest.mark.long
@pytest.mark.parametrize(
    ("language", "spheres"),
    [*((each, False) for each in LANGUAGES), *(pytest.param(each, True, id=f"spheres-{each}") for each in OF_SPHERES)],
)
def test_a_skeleton_by_its_command_passes_what_it_declares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, language: str, spheres: bool
) -> None:
    """As its README says, build included; and a defect in its one capability is found."""
    monkeypatch.chdir(tmp_path)
    done = ninedisk("new-engine", "acme", "--language", language, "--out", "an acme", *["--spheres"] * spheres)
    assert done.exit_code == 0, done.output
    file, run, build = LANGUAGES[language]
    if (program := (build or run).split()[0]) and shutil.which(program) is None:
        pytest.skip(f"there is no {program}")
    monkeypatch.chdir("an acme")
    assert sorted(path.name for path in Path().iterdir()) == sorted(["README.md", "ci.sh", "known_gaps.toml", file])
    readme = Path("README.md").read_text()
    assert not re.search(r"\$\w+", readme.replace("$ ", ""))
    for script in (readme, Path("ci.sh").read_text()):
        assert f"{build}\n" in script
        assert f"ninedisk check-engine --engine-cmd '{run}'" in script

    def checked() -> Any:
        if build:
            warnings = ["-std=gnu11", "-Wall", "-Wextra", "-Werror"]
            subprocess.run([*build.split(), *warnings], check=True, timeout=100)
        return ninedisk("check-engine", "--engine-cmd", run, "--json", "findings.json")

    done = checked()
    assert done.exit_code == 0, done.output
    found = {each["check"]: each["status"] for each in json.loads(Path("findings.json").read_text())["findings"]}
    declared = {name for name, status in found.items() if name.startswith("supports: ") and status == "pass"}
    assert declared == ({"supports: SPHERES"} if spheres else {"supports: GRAVITY"})
    refused = {name for name, status in found.items() if status == "refused" and not name.startswith("supports: ")}
    assert "units: weights and pairs" in refused
    assert {name.partition(": ")[0] for name in refused} <= {"units", "pairs", "walls", "unequal spheres"}
    source = Path(file).read_text()
    wrong = re.sub(r"\+= dt \* (\w+(\[\"gravity\"\])?\[k\])", r"+= 0.9 * dt * \1", source, count=1)
    if spheres:
        wrong = re.sub(r"-law(\[\"kn\"\]|\.kn) \* gap", r"-0.9 * law\1 * gap", source)
    assert wrong != source
    Path(file).write_text(wrong)
    assert checked().exit_code == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("Acme",), "small letters and digits"),
        (("-acme",), "No such option"),
        (("ac--me",), "small letters and digits"),
        (("../acme",), "small letters and digits"),
        (("dem",), "there is an engine 'dem' already, of ninedisk"),
        (("acme", "--out", "taken"), "'taken' exists"),
        (("acme", "--language", "cobol"), "--language 'cobol' is not allowed: use javascript, c, python"),
        (("acme", "--spheres"), "--spheres goes with --language javascript or python"),
        (("acme", "--spheres", "--language", "c"), "--spheres goes with --language javascript or python"),
        (("acme", "--out", "no/where"), "cannot be written (No such file or directory)"),
    ],
)
def test_what_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").mkdir()
    done = ninedisk("new-engine", *arguments)
    assert done.exit_code == 2
    assert said in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "rename", full)
    done = ninedisk("new-engine", "acme", "--out", str(tmp_path / "acme"))
    assert done.exit_code == 2
    assert "No space left on device" in done.output
    assert list(tmp_path.iterdir()) == []
