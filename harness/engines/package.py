"""Engines that are Python packages with native code: each run in a process of its own, so that a crash is a status.

The process runs this very Python and drives the engine's `Session` (see `ninedisk.harness.api.engine`); scene and history go
over the wire format.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.engine import EngineRun
from ninedisk.harness.engines.rigid import without_spring_preload
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).parent / "drivers" / "package_driver.py"


@cache
def package_version(distribution: str) -> tuple[str | None, str]:
    """Version of an installed distribution and "", or None and the reason; imports nothing of it."""
    try:
        return metadata.version(distribution), ""
    except metadata.PackageNotFoundError:
        return None, f"there is no Python package {distribution} in this environment"


class PackageEngine(ExternalEngine):
    """Adapter of an engine whose `Session` lives in this package; a subclass gives `id`, `info`, `session`."""

    @property
    @abstractmethod
    def session(self) -> str:
        """Where the session is, ``"module:Class"``; its module may import the engine."""

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(DRIVER), self.session]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread, and a home of its own for engines that write logs there."""
        home = str(folder)
        return {**super().environment(folder), "HOME": home, "MPLCONFIGDIR": home, "OMP_NUM_THREADS": "1"}

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the engine on the scene without the preload of regularising springs; raises as `ExternalEngine.run`."""
        return super().run(without_spring_preload(scene), numerics, watch)
