"""The same cases on several versions of one engine: an environment for each, a run in each, what changed from one to the next.

A version of a Python package is installed into a separate folder, once, with what it needs; NumPy stays the version that is here. The
run finds that folder before everything else. Of an engine behind a command the version is a part of the command.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path

from ninedisk.core.archive import make_folder
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.results.reader import run_ids

VERSION = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+_-]*")
PLACE = "{version}"
"""Where the version goes in the command of an engine."""
CACHE_VARIABLE = "XDG_CACHE_HOME"
LISTED = 12
"""Versions that a message names, the newest ones."""


def check_versions(versions: Sequence[str]) -> None:
    """Refuse what is no list of at least two different versions.

    Raises
    ------
    UsageError
        Naming the word at fault.

    Examples
    --------
    >>> check_versions(["3.2.7", "4.0.0"])
    """
    for version in versions:
        if not VERSION.fullmatch(version):
            raise UsageError(f"{version!r} is no version: letters, digits and . + - _, as in 3.2.7")
    if len(set(versions)) < 2:
        raise UsageError("give two different versions at least: ninedisk versions mujoco 3.2.7 4.0.0")


def cache() -> Path:
    """Folder of the environments."""
    base = os.environ.get(CACHE_VARIABLE)
    return (Path(base) if base else Path.home() / ".cache") / "ninedisk" / "versions"


def installed(distribution: str, version: str, folder: Path, note: Callable[[str], None]) -> Path:
    """Folder with one version of a package; it is installed where it is not there yet.

    Parameters
    ----------
    distribution, version : str
    folder : Path
        Where environments are kept.
    note : callable
        Called with a line before anything is installed.

    Raises
    ------
    UsageError
        If pip cannot install it: the message has pip's last lines, or the versions that there are.
    UnwritableFileError
        If the folder cannot be made.
    """
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    place = folder / f"{distribution}-{version}-python{python}"
    if place.is_dir():
        return place
    note(f"installing {distribution} {version}")
    make_folder(folder)
    with tempfile.TemporaryDirectory(dir=folder) as fresh:
        constraints = Path(fresh) / "constraints.txt"
        constraints.write_text(f"numpy=={metadata.version('numpy')}\n", encoding="utf-8")
        target = Path(fresh) / "packages"
        words = ["--quiet", "--disable-pip-version-check", "install", "--target", str(target), "-c", str(constraints)]
        done = subprocess.run(
            [sys.executable, "-m", "pip", *words, f"{distribution}=={version}"],
            check=False,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise UsageError(f"{distribution} {version} cannot be installed: {_why(done.stderr)}")
        for name in ("numpy", "numpy.libs", f"numpy-{metadata.version('numpy')}.dist-info"):
            shutil.rmtree(target / name, ignore_errors=True)
        target.rename(place)
    return place


def _why(said: str) -> str:
    """What pip says, or which versions there are."""
    known = re.search(r"\(from versions: ([^)]*)\)", said)
    if known:
        versions = known[1].split(", ")
        more = "" if len(versions) <= LISTED else f"the newest {LISTED} of {len(versions)}: "
        return f"there is no such version for this Python; there are {more}{', '.join(versions[-LISTED:])}"
    lines = [line for line in said.splitlines() if line.strip() and not line.startswith("WARNING")]
    return "; ".join(lines[-3:]) or "pip does not say why"


def environment_of(place: Path | None) -> dict[str, str]:
    """Environment of a run that finds a folder's packages first."""
    kept = dict(os.environ)
    if place is not None:
        kept["PYTHONPATH"] = os.pathsep.join([str(place), *filter(None, [kept.get("PYTHONPATH")])])
    return kept


def run_with(environment: Mapping[str, str], words: Sequence[str], store: Path) -> tuple[str, int, str]:
    """Run ``ninedisk run`` in an environment: id of the stored run ("" if there is none), exit code, what it said last.

    Its progress goes to standard error as always.
    """
    before = set(run_ids(store)) if store.is_dir() else set()
    command = [sys.executable, "-m", "ninedisk", "run", *words, "--store", str(store)]
    done = subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True, env=dict(environment))
    fresh = sorted((set(run_ids(store)) if store.is_dir() else set()) - before)
    return (fresh[-1] if fresh else ""), done.returncode, done.stdout
