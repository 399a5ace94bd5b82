"""The in-house DEM on the very scene of another engine: the yardstick of a cross-check, never a truth."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from ninedisk.core.law import SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import SLIP_AT
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo

if TYPE_CHECKING:
    from ninedisk.core.history import History


def core_history(setup: Setup, engine: EngineInfo) -> History:
    """History of the in-house DEM on ``setup``, same steps, slip where in the step ``engine`` has it; computed once per set-up."""
    scene = setup.scene
    if (slip_at := slip_of(scene.disk_disk.slip_at, engine)) != scene.disk_disk.slip_at:
        scene = with_slip_at(scene, slip_at)
    return _run(json.dumps([scene.to_dict(), setup.numerics.to_dict(), setup.watch], sort_keys=True))


def slip_of(asked: SlipAt, engine: EngineInfo) -> SlipAt:
    """Where in the step ``engine`` measures slip: where the scene asks for it, if it can."""
    if SLIP_AT[asked] in engine.capabilities:
        return asked
    return "end" if SLIP_AT["end"] in engine.capabilities else "middle"


def with_slip_at(scene: Scene, slip_at: SlipAt) -> Scene:
    """The scene with all slips measured there in the step."""
    walls = [replace(wall, law=replace(wall.law, slip_at=slip_at)) for wall in scene.walls]
    return scene.replace(disk_disk=replace(scene.disk_disk, slip_at=slip_at), walls=tuple(walls))


@lru_cache(maxsize=64)
def _run(key: str) -> History:
    from ninedisk.core.simulate import simulate

    scene, numerics, watch = json.loads(key)
    return simulate(Scene.from_dict(scene), Numerics.from_dict(numerics), [(i, j) for i, j in watch])
