"""The samples of a run of Siconos as the arrays of the wire format."""

import numpy as np
from history_parts import gaps


def history(run):
    """All samples as the arrays of the wire format; what no step has computed yet is null."""
    step, q, v, watched, on_walls = zip(*run.samples)  # noqa: B905
    rows = np.minimum(np.array(step), len(run.path) - 1)
    q, v = np.array(q), np.array(v)
    mass, inertia, radius = (np.array(run.disks[key]) for key in ("mass", "inertia", "radius"))
    turning = np.array(run.disks["rotating"], dtype=bool)
    x, velocity = q[:, :, 0:2], v[:, :, 0:2]
    # A blocked spin is prescribed: it exchanges no energy with the scene and is not counted, as in the in-house DEM.
    omega = np.where(turning, v[:, :, 2], np.array(run.disks["omega"]))
    point, normal = run.path[rows, :, 0:2], run.path[rows, :, 2:4]
    watched, on_walls = np.array(watched), np.array(on_walls)
    return {
        "step": list(step),
        "t": (np.array(step) * run.dt).tolist(),
        "x": x.tolist(),
        "v": velocity.tolist(),
        "angle": q[:, :, 2].tolist(),
        "omega": omega.tolist(),
        "gap": gaps(run, x, radius, point, normal).tolist(),
        "fn": after_start(watched[:, :, 0]),
        "fs": after_start(watched[:, :, 1]),
        "force_meaning": "step-mean",
        "wall_point": point.tolist(),
        "wall_angle": np.arctan2(normal[:, :, 1], normal[:, :, 0]).tolist(),
        "wall_force": after_start(on_walls),
        "energy": {
            "kinetic": (
                0.5 * (velocity**2).sum(axis=2) @ mass + 0.5 * omega**2 @ np.where(turning, inertia, 0.0)
            ).tolist(),
            "gravity": (-(x @ np.array(run.gravity)) @ mass).tolist(),
        },
    }


def after_start(values):
    """Nested lists with null throughout the first row, before any step."""
    rows = values.tolist()
    rows[0] = np.full(values.shape[1:], None).tolist()
    return rows
