"""What a DEM run gives back."""

from __future__ import annotations

from typing import Any

from ninedisk.core.dem.arrays import ENERGIES
from ninedisk.core.dem.state import Samples
from ninedisk.core.history import History, Pair


def history_of(samples: Samples, rows: int, substeps: int, contact_dt: float, pairs: tuple[Pair, ...]) -> History:
    """The first ``rows`` samples, taken in steps of ``substeps`` contact steps [s]."""
    data: dict[str, Any] = {name: array[:rows] for name, array in samples._asdict().items()}
    energy = {name: data["energy"][:, k] for k, name in enumerate(ENERGIES)}
    energy["kinetic"] = energy["translation"] + energy["rotation"]
    energy["elastic"] = energy["elastic_normal"] + energy["elastic_shear"]
    energy["wall_work"] = data["wall_work"]
    # Times are products of the step number and the contact step, as the kernels form them.
    fields = ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force")
    return History(
        step=data["at"] // substeps,
        t=data["at"] * contact_dt,
        pairs=pairs,
        particles=tuple(int(i) for i in samples.chosen),
        force_meaning="instantaneous",
        energy=energy,
        **{name: data[name] for name in fields},
    )
