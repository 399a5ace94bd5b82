"""The in-house DEM on the very scene of another engine: the yardstick of a cross-check, never a truth."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.case import Setup

if TYPE_CHECKING:
    from ninedisk.core.history import History


def core_history(setup: Setup) -> History:
    """History of the in-house DEM on ``setup``, same conventions, same steps; computed once per set-up."""
    key = json.dumps([setup.scene.to_dict(), setup.numerics.to_dict(), setup.watch], sort_keys=True)
    return _run(key)


@lru_cache(maxsize=64)
def _run(key: str) -> History:
    from ninedisk.core.simulate import simulate

    scene, numerics, watch = json.loads(key)
    return simulate(Scene.from_dict(scene), Numerics.from_dict(numerics), [(i, j) for i, j in watch])
