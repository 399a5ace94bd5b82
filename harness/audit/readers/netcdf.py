"""NetCDF trajectories of the AMBER convention, as `dump netcdf` of LAMMPS writes them: one frame in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import (
    found_columns,
    library,
    oblique_edges,
    precision,
    split_vector,
    unread,
    vector_names,
)
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, halved, halved_rounding
from ninedisk.harness.audit.readers.netcdf_size import check_whole
from ninedisk.harness.audit.readers.rounding import Rounding

FILLED = 9e36
"""Numbers above are the mark of netCDF for what was never written."""
EXACT_IN_SINGLE = 1 << 24
"""Steps beyond are rounded in single precision."""
LABELS = ("time", "cell_origin", "cell_lengths", "cell_angles", "spatial", "cell_spatial", "cell_angular")


class _File:
    """An open file: its variables of bodies, times and boxes, by frame."""

    def __init__(self, path: Path) -> None:
        self.path = path
        netcdf = library("netCDF4", "netcdf", path)
        check_whole(path)
        try:
            self.data = netcdf.Dataset(path, "r")
        except (OSError, RuntimeError, ValueError) as error:
            raise UsageError(f"{path} is no netCDF file that can be read ({error})") from error
        self.data.set_auto_maskandscale(False)
        for name in ("frame", "atom"):
            if name not in self.data.dimensions:
                raise UsageError(
                    f"{path} has no dimension {name!r}: expected a trajectory of the AMBER convention, as `dump netcdf` of LAMMPS writes it"
                )
        self.frames = len(self.data.dimensions["frame"])
        self.bodies = {name: each for name, each in self.data.variables.items() if "atom" in each.dimensions}
        for name, each in self.bodies.items():
            if each.dimensions[:2] != ("frame", "atom") and each.dimensions[:1] != ("atom",):
                raise UsageError(f"{path}: {name} has the dimensions {each.dimensions}, expected frame, atom")
            if np.dtype(each.dtype).kind not in "fiu":
                raise UsageError(f"{path}: {name} holds {each.dtype}, expected numbers")
            scale = getattr(each, "scale_factor", 1.0)
            if scale != 1.0:
                raise UsageError(
                    f"{path}: {name} has the scale_factor {scale:g}, units of AMBER that do not fit the rest: write it without"
                )
        self.names = [new for name, each in self.bodies.items() for new in vector_names(name, self._parts(each))]

    @staticmethod
    def _parts(variable: Any) -> int:
        given = [
            size
            for name, size in zip(variable.dimensions, variable.shape, strict=True)
            if name not in ("frame", "atom")
        ]
        return int(given[0]) if given else 0

    def columns(self, k: int) -> dict[str, NDArray[Any]]:
        """Columns of frame ``k``; what was never written is NaN."""
        found: dict[str, NDArray[Any]] = {}
        for name, each in self.bodies.items():
            values = np.asarray(self.read(each, k) if each.dimensions[0] == "frame" else self.read(each, slice(None)))
            found |= split_vector(name, np.where(np.abs(values) > FILLED, np.nan, values.astype(float)))
        return found

    def read(self, variable: Any, k: Any) -> Any:
        try:
            return variable[k]
        except (OSError, RuntimeError, IndexError) as error:
            raise UsageError(
                f"{self.path}, frame {k}: {variable.name} cannot be read ({error}): cut off or damaged"
            ) from error

    def step(self, k: int) -> tuple[int, float]:
        """Step and time [the file's units] of frame ``k``."""
        time = self.data.variables["time"]
        value = float(np.asarray(self.read(time, k)))
        if not abs(value) < FILLED:
            return -1, np.nan
        if value > EXACT_IN_SINGLE and np.dtype(time.dtype) == np.float32:
            raise UsageError(
                f"{self.path}, frame {k + 1}: the step {value:.0f} is rounded in single precision: write the file with "
                "`dump_modify double yes`"
            )
        return int(value), value * float(getattr(time, "scale_factor", 1.0))

    def cell(self, k: int) -> FloatArray | None:
        """Edges, NaN where nothing repeats, which have no length."""
        if not {"cell_lengths", "cell_angles"} <= set(self.data.variables):
            return None
        lengths, angles = (
            np.asarray(self.read(self.data.variables[name], k), dtype=float) for name in ("cell_lengths", "cell_angles")
        )
        if lengths.shape != (3,) or angles.shape != (3,) or not ((lengths >= 0.0) & (lengths < FILLED)).all():
            raise UsageError(f"{self.path}, frame {k + 1}: cell_lengths {lengths} are no three lengths >= 0")
        if not (lengths > 0.0).any():
            return None
        if (angles != 90.0).any() and not (lengths > 0.0).all():
            raise UsageError(
                f"{self.path}, frame {k + 1}: an oblique box with an edge of no length cannot be put together: use a text dump"
            )
        return np.asarray(np.where((lengths > 0.0)[:, None], oblique_edges(lengths, angles), np.nan))


def read_netcdf(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a file; it stays open while the trajectory is used.

    Raises
    ------
    UsageError
        Naming file, variable, frame and the way out; while frames are read, too.
    """
    file = _File(path)
    names = [name for name in file.names if not name.startswith("scaled_coordinates")]
    if (
        needed
        and "scaled_coordinates:0" in file.names
        and not {"coordinates:0", "unwrapped_coordinates:0"} & set(names)
    ):
        raise UsageError(
            f"{path} has scaled_coordinates alone, fractions of a box whose open edges it does not give: dump x y z or xu yu zu"
        )
    found = found_columns(names, columns, path, needed)
    time = file.data.variables.get("time")
    steps = time is not None and getattr(file.data, "program", "") == "LAMMPS"
    if time is None:
        raise UsageError(f"{path} has no variable time: expected a trajectory of the AMBER convention")
    by_name = {name: each for own, each in file.bodies.items() for name in vector_names(own, file._parts(each))}
    rounding = {here: precision(by_name[name]) for name, here in found.items()}
    cell = file.cell(0) if file.frames else None
    if cell is not None:
        # A place that goes on across an edge has the rounding of the edge as well.
        worst = max(float(precision(file.data.variables["cell_lengths"]).error(np.nan_to_num(cell)).max()), 0.0)
        for axis in "xyz":
            if axis in rounding:
                rounding[axis] = Rounding(bits=rounding[axis].bits, absolute=worst)
    rounding["t"] = precision(time)

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(file.frames):
            progress(k, file.frames, "frames")
            values = file.columns(k)
            step, t = file.step(k)
            part = {here: values[name] for name, here in found.items()}
            if "id" in part:
                written = part["id"] > 0.0  # LAMMPS counts from 1; rows of lost bodies were never written
                part = {name: column[written] for name, column in part.items()}
            yield Frame(step if steps else k, t, halved(part), f"frame {k + 1}", file.cell(k))

    remarks = [
        f"numbers of {name} are in {each.units}" for name, each in file.bodies.items() if getattr(each, "units", "")
    ][:1]
    if "diameter" in found.values():
        remarks.append("radius is half of the variable diameter")
    if steps:
        scale = float(getattr(time, "scale_factor", np.nan))
        remarks.append(
            f"times are steps; their scale_factor, {scale:.6g} in single precision, is not used: time.dt counts"
        )
    remarks += unread(names, found)
    return Trajectory(
        path, "netCDF", frames, halved_rounding(rounding), "step" if steps else "t",
        frozenset({"radius" if name == "diameter" else name for name in found.values()}), tuple(remarks),
    )  # fmt: skip
