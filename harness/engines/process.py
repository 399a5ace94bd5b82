"""Engines in their own process, driven by a file in their folder: whether they are installed, how they start."""

from __future__ import annotations

import os
import subprocess
import sys
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import metadata
from pathlib import Path

from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.run.process_guard import guarded_environment
from ninedisk.harness.wire.external import ExternalEngine

SYSTEM_PYTHON = "/usr/bin/python3"


class ProcessEngine(ExternalEngine):
    """Adapter of an engine whose driver runs under this Python; a subclass gives `id`, `facts`, `installed` and `driver`."""

    facts: EngineInfo
    """Everything but the version, which is looked up when it is asked for."""
    driver: Path

    @property
    def copied(self) -> Path | None:  # type: ignore[override]
        """The driver."""
        return self.driver

    @abstractmethod
    def installed(self) -> tuple[str | None, str]:
        """Version of the installed engine and "", or None and the reason; imports nothing of it."""

    def info(self) -> EngineInfo:
        """Facts about the engine as it is installed."""
        version, reason = self.installed()
        return replace(self.facts, version=version, not_installed_because=reason)

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(self.driver)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread."""
        return {**super().environment(folder), "OMP_NUM_THREADS": "1"}


@cache
def package_version(distribution: str) -> tuple[str | None, str]:
    """Version of an installed distribution and "", or None and the reason; imports nothing of it."""
    try:
        return metadata.version(distribution), ""
    except metadata.PackageNotFoundError:
        return None, f"there is no Python package {distribution} in this environment"


def clean_environment() -> dict[str, str]:
    """Environment without what belongs to another Python; one thread."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    return {**kept, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def without_mpi(environment: Mapping[str, str]) -> dict[str, str]:
    """An environment without traces of a surrounding MPI run."""
    return {key: value for key, value in environment.items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_"))}


def system_python(*arguments: str) -> list[str]:
    """Command that runs the system's Python without user site and ``PYTHON...`` variables."""
    return [SYSTEM_PYTHON, "-E", "-s", *arguments]


@cache
def system_version(command: tuple[str, ...]) -> tuple[str | None, str]:
    """Version that a command of the system's Python prints, or None and the reason."""
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=30,
            env=guarded_environment(clean_environment()),
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return None, f"{command[0]} cannot be run: {error}"
    version = done.stdout.strip()
    if done.returncode or not version:
        said = (done.stderr.strip().splitlines() or ["it prints no version"])[-1]
        return None, f"{command[0]} cannot import it: {said}"
    return version, ""
