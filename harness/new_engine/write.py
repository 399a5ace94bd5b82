"""Writes the package of a new engine from the files in ``template``."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from importlib import resources
from pathlib import Path
from string import Template

import ninedisk
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.registry import engine_table

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
LONGEST = 40

FILES = {
    "pyproject.toml": "pyproject.toml.in",
    "README.md": "README.md.in",
    "known_gaps.toml": "known_gaps.toml.in",
    "ci.sh": "ci.sh.in",
    "$package/__init__.py": "__init__.py.in",
    "$package/adapter.py": "adapter.py.in",
    "$package/solver.py": "solver.py.in",
    "tests/test_adapter.py": "test_adapter.py.in",
    "tests/test_suite.py": "test_suite.py.in",
}
"""Files of the package, and the templates that they are made of."""

LANGUAGES = {
    "javascript": ("engine.mjs", "node engine.mjs", ""),
    "c": ("engine.c", "./engine", "cc -O2 -o engine engine.c"),
    "python": ("engine.py", "python3 engine.py", ""),
}
"""Languages of engines behind a command: the file of the engine, its command, and the one that builds it."""

OF_SPHERES = ("javascript", "python")
"""Languages that have a skeleton of an engine of spheres."""


def files_of(language: str | None, *, spheres: bool = False) -> dict[str, str]:
    """Files that are written, and their templates.

    Raises
    ------
    UsageError
        If there is no skeleton in this language, or none for spheres.
    """
    if spheres and language not in OF_SPHERES:
        raise UsageError(
            f"--spheres goes with --language {' or '.join(OF_SPHERES)}; a Python package, without --language, takes scenes of both "
            "dimensions in its `supports` and `run`, see docs/reference/engines.md"
        )
    if language is None:
        return FILES
    if language not in LANGUAGES:
        hint = close_matches(language, LANGUAGES)
        raise UsageError(
            f"--language {language!r} is not allowed: use {', '.join(LANGUAGES)}, or leave it out for a package that is imported; "
            f"in any other language the protocol is the same: docs/reference/wire-protocol.md{hint and '.'}{hint}"
        )
    file = LANGUAGES[language][0]
    return {
        file: f"{'sphere_' if spheres else ''}{file}.in",
        "README.md": "command_README.md.in",
        "known_gaps.toml": "known_gaps.toml.in",
        "ci.sh": "command_ci.sh.in",
    }


def write_package(name: str, out: Path, language: str | None = None, *, spheres: bool = False) -> Path:
    """Write the package, or the skeleton of an engine behind a command; the folder appears whole or not at all.

    Parameters
    ----------
    name : str
        Id of the engine.
    out : Path
        Folder that does not exist yet.
    language : str, optional
        One of `LANGUAGES`: an engine by its command. None: a package whose engine is imported.
    spheres : bool
        Whether the engine is one of spheres in space.

    Raises
    ------
    UsageError
        If the name is no id or is taken, there is no skeleton in this language, or the folder exists or cannot be written.
    """
    if not NAME.fullmatch(name) or len(name) > LONGEST:
        raise UsageError(
            f"{name!r} is not allowed as the id of an engine: use small letters and digits, words joined by single dashes, a "
            f"letter first, at most {LONGEST} characters, for instance 'acme' or 'acme-dem'"
        )
    if name in engine_table():
        raise UsageError(f"there is an engine {name!r} already, of {engine_table()[name].origin}: choose another name")
    if out.exists():
        raise UsageError(f"{str(out)!r} exists: give another folder with --out DIR")
    files = files_of(language, spheres=spheres)
    file, run, build = LANGUAGES.get(language or "", ("", "", ""))
    words = {
        "file": file,
        "run": run,
        "bodies": "smooth spheres on springs" if spheres else "disks that meet nothing",
        "asked": "spheres/thornton" if spheres else "slip-to-roll",
        "converged": "spheres/thornton" if spheres else "incline-block",
        "build_line": f"$ {build}\n" if build else "",
        "build_script": f"{build}\n" if build else "",
        "name": name,
        "package": f"ninedisk_{name.replace('-', '_')}",
        "version": ninedisk.__version__,
    }
    folder = resources.files("ninedisk.harness.new_engine") / "template"
    temporary: Path | None = None
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
        for target, source in files.items():
            path = temporary / Template(target).substitute(words)
            path.parent.mkdir(exist_ok=True)
            path.write_text(Template((folder / source).read_text(encoding="utf-8")).substitute(words), encoding="utf-8")
        (temporary / "ci.sh").chmod(0o755)
        temporary.chmod(0o755)
        os.rename(temporary, out)
    except OSError as error:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
        raise UsageError(
            f"{str(out)!r} cannot be written ({error.strerror or error}): give a folder in one that exists and can be written"
        ) from error
    return out
