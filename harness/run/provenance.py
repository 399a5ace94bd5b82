"""What a result came from: versions, commit and machine. No path, host or user name is recorded."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import ninedisk
from ninedisk.harness.run.process_guard import guarded_environment

PACKAGES = (
    "numpy",
    "numba",
    "llvmlite",
    "scipy",
    "pandas",
    "pyarrow",
    "matplotlib",
    "pymunk",
    "typer",
    "rich",
    "pint",
)
"""Packages whose version can move a number or a page."""

COMPUTING = ("ninedisk.core", "ninedisk.references", "ninedisk.harness")
"""Packages of ours that can move a number."""

_ABSOLUTE = re.compile(r"(^|=)(?:~|/|[A-Za-z]:\\).*")


def provenance(cells: Iterable[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """Facts about this installation and machine; engine versions come from the rows of the cells that ran."""
    engines = {str(cell["engine"]): str(cell["engine_version"]) for cell in cells if cell["engine_version"]}
    return {
        "ninedisk": ninedisk.__version__,
        "commit": source_commit(),
        "source": source_digest(),
        "python": platform.python_version(),
        "implementation": platform.python_implementation(),
        "platform": f"{platform.system()} {platform.machine()}",
        "kernel": platform.release(),
        "cpu": cpu_model(),
        "cores": usable_cores(),
        "packages": package_versions(),
        "engines": engines,
    }


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def source_commit() -> str:
    """Commit of the installed source if that is a git checkout (``-dirty`` behind it if changed), else ``""``."""
    import ninedisk.core

    root = Path(ninedisk.core.__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        found = subprocess.run(
            command, capture_output=True, text=True, timeout=10, env=guarded_environment(), check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return found.stdout.strip()


def package_folder(name: str) -> Path:
    """Folder of a package of ours."""
    return Path(str(import_module(name).__file__)).parent


@cache
def source_digest() -> str:
    """SHA-256 of every file of ours that can move a number: core, references and harness, by relative name and content.

    Distinguishes two states of a changed checkout, which have one commit, and needs no checkout.
    """
    digest = hashlib.sha256()
    for package in COMPUTING:
        folder = package_folder(package)
        for path in sorted(folder.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                digest.update(f"{package}/{path.relative_to(folder).as_posix()} {content}\n".encode())
    return digest.hexdigest()


def cpu_model() -> str:
    """Name of the processor, as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def package_versions() -> dict[str, str]:
    """Versions of those of `PACKAGES` that are installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def command_line(argv: Sequence[str] | None = None) -> list[str]:
    """The arguments of the command, absolute paths cut down to their last part."""
    given = sys.argv[1:] if argv is None else argv
    return ["ninedisk", *(_without_folders(argument) for argument in given)]


def _without_folders(argument: str) -> str:
    match = _ABSOLUTE.search(argument)
    if not match:
        return argument
    path = argument[match.end(1) :]
    return argument[: match.end(1)] + (re.split(r"[/\\]", path.rstrip("/\\"))[-1] or "/")
