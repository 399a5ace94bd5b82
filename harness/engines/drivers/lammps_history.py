"""The samples of a run of LAMMPS as the arrays of the wire format."""

import numpy as np
from history_parts import gaps


def history(run):
    """All samples as the arrays of the wire format."""
    steps, n, m, c = len(run.samples), run.n, len(run.walls), len(run.pairs)
    column = {key: [sample[key] for sample in run.samples] for key in run.samples[0]}
    shaped = {
        key: np.array(column[key], dtype=float).reshape((steps, *shape))
        for key, shape in {
            "x": (n, 2),
            "v": (n, 2),
            "omega": (n,),
            "angle": (n,),
            "forces": (c, 2),
            "wall_point": (m, 2),
            "wall_normal": (m, 2),
            "wall_force": (m, 2),
        }.items()
    }
    x, v, omega, point, normal = (shaped[key] for key in ("x", "v", "omega", "wall_point", "wall_normal"))
    # A blocked spin is prescribed: it exchanges no energy with the scene and is not counted, as in the in-house DEM.
    inertia = np.where(run.rotating, run.inertia, 0.0)
    return {
        "step": column["step"],
        "t": (np.array(column["step"]) * (run.substeps * run.dt)).tolist(),
        "x": x.tolist(),
        "v": v.tolist(),
        "angle": shaped["angle"].tolist(),
        "omega": omega.tolist(),
        "gap": gaps(run, x, run.radius, point, normal).tolist(),
        "fn": shaped["forces"][:, :, 0].tolist(),
        "fs": shaped["forces"][:, :, 1].tolist(),
        "force_meaning": "instantaneous",
        "wall_point": point.tolist(),
        "wall_angle": np.arctan2(normal[:, :, 1], normal[:, :, 0]).tolist(),
        "wall_force": shaped["wall_force"].tolist(),
        "energy": {
            "kinetic": (0.5 * (v**2).sum(axis=2) @ run.mass + 0.5 * omega**2 @ inertia).tolist(),
            "gravity": (-(x @ run.gravity) @ run.mass).tolist(),
            "elastic": column["elastic"],
        },
    }
