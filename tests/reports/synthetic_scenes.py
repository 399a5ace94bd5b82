"""Set-ups and configurations of the synthetic stores, as the JSON that a run stores."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]


def box_setup() -> Row:
    """Nine disks between four moving walls, as a scene's JSON."""
    grid = [[50.0 + 100.0 * i, 50.0 + 100.0 * j] for j in range(3) for i in range(3)]
    law = {"kn": 1.35e9}
    sides = (("left", 0, 0, 1, 0), ("right", 300, 0, -1, 0), ("bottom", 0, 0, 0, 1), ("top", 0, 300, 0, -1))
    walls = [
        {
            "name": name,
            "point": [px, py],
            "normal": [nx, ny],
            "law": law,
            "motion": [{"duration": 0.61, "velocity": [0.12 * nx, 0.12 * ny]}]
            + ([{"duration": 7.6, "angular_velocity": -0.0175, "pivot": [px, 150.0]}] if nx else []),
        }
        for name, px, py, nx, ny in sides
    ]
    disks = {
        "x": grid,
        "v": [[0.0, 0.0]] * 9,
        "omega": [0.0] * 9,
        "radius": [50.0] * 9,
        "mass": [7.8e6] * 9,
        "inertia": [9.8e9] * 9,
        "rotating": [True] * 9,
    }
    scene = {"disks": disks, "disk_disk": law, "walls": walls, "gravity": [0.0, 0.0], "xi": 3.0, "initial_shear": []}
    labels = {
        "fn_disk_disk_centre": [3, 4],
        "fn_disk_disk_edge": [0, 1],
        "fn_wall_mid": [3, 9],
        "fn_wall_corner": [0, 9],
    }
    return {"scene": scene, "numerics": {"dt": 0.01525}, "watch": list(labels.values()), "labels": labels}


def small_setup(n: int, *, gravity: Sequence[float] = (0.0, 0.0), wall: bool = False) -> Row:
    """One or two disks, perhaps on a plane."""
    disks = {
        "x": [[2.5 * i, 0.5] for i in range(n)],
        "v": [[1.0, 0.0]] + [[0.0, 0.0]] * (n - 1),
        "omega": [0.0] * n,
        "radius": [0.5] * n,
        "mass": [1.0] * n,
        "inertia": [1.0] * n,
        "rotating": [not wall] * n,
    }
    walls = (
        [{"name": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "law": {"kn": 1e8}, "motion": []}] if wall else []
    )
    scene = {
        "disks": disks,
        "disk_disk": {"kn": 1e8},
        "walls": walls,
        "gravity": list(gravity),
        "xi": 0.0,
        "initial_shear": [],
    }
    return {"scene": scene, "numerics": {"dt": 0.01}, "watch": [[0, 1]], "labels": {"contact": [0, 1]}}


def box_frames(engine: int) -> Row:
    """The assembly at the start, before and after a shear."""
    x = np.array(box_setup()["scene"]["disks"]["x"])
    sheared = x + np.outer(x[:, 1] - 150.0, [0.13 + 0.003 * engine, 0.0])
    points = [[0.0, 150.0], [300.0, 150.0], [0.0, 0.0], [0.0, 300.0]]
    normals = np.array([0.0, math.pi, math.pi / 2, -math.pi / 2])
    turned = normals - np.array([0.1334, 0.1334, 0.0, 0.0])
    return {
        "step": [0, 5000, 5500],
        "x": [x.tolist(), x.tolist(), sheared.tolist()],
        "angle": [[0.0] * 9, [0.0] * 9, [0.06 * (-1) ** k for k in range(9)]],
        "wall_point": [points, points, points],
        "wall_angle": [normals.tolist(), normals.tolist(), turned.tolist()],
    }
