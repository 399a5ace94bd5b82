"""Moving scenes: the stored configurations of every engine, for the player of a case's page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ninedisk.reports.chains import FloatArray, contact_forces, springs
from ninedisk.reports.load import Row
from ninedisk.reports.model import CaseData
from ninedisk.reports.pack import Arrays
from ninedisk.reports.text import decoded

STILL = 1e-3
"""Motion below this share of a disk's radius is not seen, so it is not played."""


@dataclass(frozen=True)
class Frames:
    """Stored configurations of one cell: f frames, n disks, m walls."""

    step: FloatArray
    t: FloatArray
    x: FloatArray
    angle: FloatArray
    wall_point: FloatArray
    wall_angle: FloatArray


def read_frames(cell: Row) -> Frames | None:
    """Frames of a cell; None where it has none, or they are damaged."""
    held = decoded(cell["frames"], dict)
    try:
        step = np.array(held["step"], dtype=np.float64)
        f = len(step)
        x = np.array(held["x"], dtype=np.float64).reshape(f, -1, 2)
        angle = np.array(held["angle"], dtype=np.float64).reshape(f, x.shape[1])
        points = np.array(held.get("wall_point") or np.empty((f, 0, 2)), dtype=np.float64).reshape(f, -1, 2)
        turned = np.array(held.get("wall_angle") or np.empty((f, 0)), dtype=np.float64).reshape(f, points.shape[1])
        t = np.array(held.get("t") or step, dtype=np.float64).reshape(f)
    except (KeyError, TypeError, ValueError):
        return None
    return Frames(step, t, x, angle, points, turned) if f and x.shape[1] and np.isfinite(x).all() else None


def moving_scenes(case: CaseData, arrays: Arrays) -> dict[str, Any]:
    """By variant: radii, and for each engine the numbers of its arrays and its contacts; only what visibly moves."""
    scenes: dict[str, Any] = {}
    for cell in case.cells:
        frames = read_frames(cell)
        setup = decoded(cell["setup"], dict)
        if frames is None or len(frames.step) < 2:
            continue
        try:
            n = frames.x.shape[1]
            radius = np.array(np.broadcast_to(np.asarray(setup["scene"]["disks"]["radius"], dtype=np.float64), (n,)))
        except (KeyError, TypeError, ValueError):
            continue
        turn = np.nan_to_num(frames.angle - frames.angle[0])
        moved = max(float(np.abs(frames.x - frames.x[0]).max() / radius.max()), float(np.abs(turn).max()))
        if moved < STILL:
            continue
        held = springs(setup)
        pairs: list[tuple[int, int]] = []
        forces = np.empty((len(frames.step), 0))
        if held is not None and len(held.walls) == frames.wall_point.shape[1] and len(held.radius) == n:
            pairs, forces = contact_forces(held, frames.x, frames.wall_point, frames.wall_angle)
        scene = scenes.setdefault(cell["variant"], {"radius": arrays(radius), "engines": {}})
        scene["engines"][cell["engine"]] = {
            "step": arrays(frames.step), "t": arrays(frames.t), "x": arrays(frames.x), "angle": arrays(frames.angle),
            "wall_point": arrays(frames.wall_point), "wall_angle": arrays(frames.wall_angle),
            "pairs": pairs, "forces": arrays(forces),
        }  # fmt: skip
    return scenes
