"""VTKHDF files with steps (version 1 and 2): one frame in memory.

Source: VTK, Documentation/docs/vtk_file_formats/vtkhdf_file_format/vtkhdf_specifications.md, "Temporal Data".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import (
    found_columns,
    library,
    precision,
    readable,
    split_vector,
    unread,
    vector_names,
)
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, halved, halved_rounding
from ninedisk.harness.audit.readers.vtk import NO_IDS, WHOLE_TIMES, number_clock, whole_numbers
from ninedisk.harness.audit.readers.vtk_xml import GHOSTS, without_ghosts

TYPES = ("PolyData", "UnstructuredGrid")


class _File:
    """Where the numbers of each step are: first row and count of points, and the first row of each array."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.data = library("h5py", "h5md", path).File(path, "r")
        group = self.group = self.data["VTKHDF"]
        kind = group.attrs.get("Type", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if kind not in TYPES:
            raise UsageError(f"{path} is VTKHDF of type {kind[:40]!r}: an audit takes {' or '.join(TYPES)}")
        version = np.atleast_1d(group.attrs.get("Version", ()))
        if version.shape != (2,) or version.dtype.kind not in "iu" or version[0] not in (1, 2):
            raise UsageError(f"{path} is VTKHDF of version {version.tolist()}: 1.x and 2.x are read")
        if "Steps" not in group:
            raise UsageError(f"{path} is a single frame of VTKHDF: it has no group Steps; write a temporal file")
        self.steps = group["Steps"]
        self.times = np.asarray(self._numbers(self.steps, "Values", None), dtype=float)
        self.frames = len(self.times)
        stated = self.steps.attrs.get("NSteps", self.frames)
        if np.ndim(stated) or int(stated) != self.frames:
            raise UsageError(
                f"{path}: NSteps is {stated}, and Steps/Values has {self.frames} times: cut off or damaged"
            )
        counts = self._numbers(group, "NumberOfPoints", None)
        if "NumberOfParts" in self.steps:
            parts = self._numbers(self.steps, "NumberOfParts", self.frames)
        elif self.frames and len(counts) % self.frames == 0:
            parts = np.full(self.frames, len(counts) // self.frames)
        else:
            raise UsageError(
                f"{path}: NumberOfPoints has {len(counts)} parts for {self.frames} steps, and there is no Steps/NumberOfParts"
            )
        first = self._numbers(self.steps, "PartOffsets", self.frames)
        for k in range(self.frames):
            if not 0 <= first[k] <= first[k] + parts[k] <= len(counts):
                raise UsageError(
                    f"{path}, frame {k + 1}: parts {first[k]} to {first[k] + parts[k]} of {len(counts)} in NumberOfPoints: cut off"
                )
        each = [counts[a : a + n] for a, n in zip(first.tolist(), parts.tolist(), strict=True)]
        self.counts = [int(part.sum()) for part in each]
        self.parts = [int((part > 0).sum()) for part in each]
        self.begin = self._numbers(self.steps, "PointOffsets", self.frames)
        self.arrays: dict[str, Any] = {"Points": group["Points"], **dict(group.get("PointData", {}).items())}
        offsets = self.steps.get("PointDataOffsets", {})
        self.offsets = {
            name: self._numbers(offsets, name, self.frames) if name != "Points" and name in offsets else self.begin
            for name in self.arrays
        }
        for array in self.arrays.values():
            if array.ndim not in (1, 2) or array.dtype.kind not in "fiu":
                raise UsageError(
                    f"{path}: {array.name} is {array.dtype} of shape {array.shape}, expected numbers of points and components"
                )
        if self.arrays["Points"].shape[1:] != (3,):
            raise UsageError(
                f"{path}: Points has the shape {self.arrays['Points'].shape}, expected points and 3 components"
            )

    def _numbers(self, group: Any, name: str, length: int | None) -> NDArray[Any]:
        """A list of numbers; of whole ones >= 0, except times."""
        values = np.asarray(group[name][()])
        if values.ndim == 2 and values.shape[1] == 1:
            values = values[:, 0]
        whole = name == "Values" or (values.dtype.kind in "iu" and (values.size == 0 or values.min() >= 0))
        # VTK's own writer (9.7) ends offsets of arrays with one that begins no step.
        if (
            length is not None
            and values.ndim == 1
            and len(values) == length + 1
            and name in self.group.get("PointData", ())
        ):
            values = values[:length]
        if values.ndim != 1 or not whole or (length is not None and len(values) != length):
            raise UsageError(
                f"{self.path}: {group.name}/{name} is {values.dtype} of shape {values.shape}, expected "
                f"{'' if length is None else f'{length} '}{'times' if name == 'Values' else 'whole numbers >= 0'}"
            )
        return values if name == "Values" else values.astype(np.int64)

    def at(self, k: int) -> dict[str, NDArray[Any]]:
        """Arrays of step k, components as ``name:0`` and so on, without points of another part."""
        found: dict[str, NDArray[Any]] = {}
        for name, array in self.arrays.items():
            begin, count = int(self.offsets[name][k]), self.counts[k]
            if begin + count > len(array):
                raise UsageError(
                    f"{self.path}, frame {k + 1}: rows {begin} to {begin + count} of {array.name}, which has {len(array)}: cut off"
                )
            with readable(self.path, f"file whose {name} of frame {k + 1}"):
                found |= split_vector(name, np.asarray(array[begin : begin + count]))
        return without_ghosts(found, self.path)


def read_vtkhdf(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a file; it stays open while the trajectory is used.

    Raises
    ------
    UsageError
        Naming file, dataset, frame and the way out; while frames are read, too.
    """
    with readable(path, "VTKHDF file"):
        file = _File(path)
    by_name = {
        new: array
        for name, array in file.arrays.items()
        if name not in GHOSTS
        for new in vector_names(name, array.shape[1] if array.ndim == 2 else 0)
    }
    found = found_columns(list(by_name), columns, path, needed)
    rounding = {here: precision(by_name[name]) for name, here in found.items()}
    numbered = whole_numbers(file.times)
    if not numbered:
        rounding["t"] = precision(file.steps["Values"])
    if "id" not in found.values() and max(file.parts, default=0) > 1:
        k = file.parts.index(max(file.parts))
        raise UsageError(f"{path}, frame {k + 1}: {file.parts[k]} parts and no ids: {NO_IDS}")

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(file.frames):
            progress(k, file.frames, "frames")
            data = file.at(k)
            part = halved({here: data[name].astype(float) for name, here in found.items()})
            step, t = (int(file.times[k]), np.nan) if numbered else (k, float(file.times[k]))
            yield Frame(step, t, part, f"frame {k + 1}")

    remarks = [WHOLE_TIMES.format(path.name)] if numbered else []
    if "diameter" in found.values():
        remarks.append("radius is half of the array diameter")
    remarks += unread(list(by_name), found)
    kept = frozenset({"radius" if name == "diameter" else name for name in found.values()})
    clock = number_clock(file.times) if numbered else "t"
    return Trajectory(path, "VTKHDF", frames, halved_rounding(rounding), clock, kept, tuple(remarks))
