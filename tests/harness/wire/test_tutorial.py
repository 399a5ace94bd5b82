"""The tutorial, followed to the letter in an empty folder: files saved, commands run, shown output found."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.tree
DOCS = Path(__file__).resolve().parents[3] / "docs"
TUTORIAL = DOCS / "tutorials" / "your-own-engine.md"
EXAMPLES = [DOCS / "examples" / name for name in ("spring_dem.py", "sphere_dem.py")]
"""Engines that the tutorial has its reader copy."""
BLOCK = re.compile(r"^```(\w+)(?: ([\w.]+))?\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Step(NamedTuple):
    """A file to save, or a command and the lines that its output must hold."""

    file: str
    text: str
    expected: tuple[str, ...] = ()


def steps(text: str) -> list[Step]:
    found = []
    for language, name, body in BLOCK.findall(text):
        if language != "console":
            if language == "text":  # lines of an example, quoted
                assert any(body.rstrip() in path.read_text(encoding="utf-8") for path in EXAMPLES), body
                continue
            assert name, f"a block of {language} without the name of its file"
            found.append(Step(name, body))
            continue
        lines = body.splitlines()
        assert lines[0].startswith("$ ")
        for line in lines:
            if line.startswith("$ "):
                found.append(Step("", line.removeprefix("$ ")))
            else:
                found[-1] = found[-1]._replace(expected=(*found[-1].expected, line))
    return found


def follow(text: str, folder: Path, commands: Path) -> None:
    """Do what the text says; AssertionError where something else happens than it shows."""
    environment = {**os.environ, "PATH": f"{commands}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "200"}
    for step in steps(text):
        if step.file:
            (folder / step.file).write_text(step.text, encoding="utf-8")
            continue
        done = subprocess.run(
            ["bash", "-c", step.text], capture_output=True, text=True, cwd=folder, env=environment, timeout=300
        )
        said = " ".join((done.stdout + done.stderr).split())
        assert done.returncode == 0, f"{step.text}\n{done.stdout}{done.stderr}"
        assert "Traceback" not in said, said
        for line in step.expected:
            assert " ".join(line.split()) in said, f"{step.text}\ndoes not say: {line}\nbut: {done.stdout}{done.stderr}"


@pytest.fixture
def commands(tmp_path: Path) -> Path:
    """A folder for PATH in which ``ninedisk`` and ``pytest`` are those of this interpreter."""
    folder = tmp_path / "commands"
    folder.mkdir()
    for module in ("ninedisk", "pytest"):
        script = folder / module
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
        script.chmod(0o755)
    return folder


@pytest.mark.slow
def test_it_can_be_followed(tmp_path: Path, commands: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for path in EXAMPLES:
        shutil.copy(path, folder)
    follow(TUTORIAL.read_text(encoding="utf-8"), folder, commands)
    assert (folder / "report" / "index.html").exists()
    assert sorted(path.name for path in folder.iterdir() if path.suffix in (".py", ".json")) == [
        *(
            "answer.json",
            "my_engine.py",
            "request.json",
            "rude.py",
            "sphere_dem.py",
            "spring_dem.py",
            "test_engine.py",
            "vague.py",
        )
    ]


def test_it_quotes_its_examples() -> None:
    text = TUTORIAL.read_text(encoding="utf-8")
    assert steps(text)
    for path in EXAMPLES:
        assert f"](../examples/{path.name})" in text


def test_files_that_it_links_to_exist() -> None:
    links = re.findall(r"\]\(([^)#]+)", TUTORIAL.read_text(encoding="utf-8"))
    assert links
    assert [link for link in links if not (TUTORIAL.parent / link).exists()] == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```console\n$ false\n```\n", "false"),
        ("```console\n$ echo one\ntwo\n```\n", "does not say: two"),
        ("```python\n1\n```\n", "without the name"),
    ],
)
def test_a_text_that_is_not_true_is_found(text: str, message: str, tmp_path: Path, commands: Path) -> None:
    with pytest.raises(AssertionError, match=message):
        follow(text, tmp_path, commands)
