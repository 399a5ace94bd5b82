"""H5MD files (version 1): one frame in memory, elements that are sampled alike."""

from __future__ import annotations

import re
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
    precision,
    readable,
    split_vector,
    unread,
    vector_names,
)
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, halved, halved_rounding
from ninedisk.harness.audit.readers.netcdf import read_netcdf
from ninedisk.harness.audit.readers.rounding import Rounding
from ninedisk.harness.audit.readers.vtkhdf import read_vtkhdf


class _Element:
    """A quantity of bodies: fixed, or with values by frame."""

    def __init__(self, name: str, node: Any, path: Path, bodies: int | None, frames: int | None) -> None:
        self.name, self.path = name, path
        self.moves = not hasattr(node, "dtype")
        if self.moves and "value" not in node:
            raise UsageError(f"{path}: {node.name} has no dataset value: this is no element of H5MD")
        self.values = node["value"] if self.moves else node
        self.unit = str(self.values.attrs.get("unit", ""))
        shape = self.values.shape[self.moves :]
        if (
            self.values.dtype.kind not in "fiu"
            or len(shape) not in (1, 2)
            or (bodies is not None and shape[0] != bodies)
        ):
            raise UsageError(
                f"{path}: {self.values.name} is {self.values.dtype} of shape {self.values.shape}, expected numbers of "
                f"{'frames, ' if self.moves else ''}{bodies or ''} bodies and components"
            )
        if self.moves and frames is not None and self.values.shape[0] != frames:
            raise UsageError(
                f"{path}: {self.values.name} has {self.values.shape[0]} frames, and position has {frames}: cut off or sampled otherwise"
            )
        self.parts = int(shape[1]) if len(shape) == 2 else 0
        self.steps = _samples(node, "step", path) if self.moves else None
        self.times = _samples(node, "time", path) if self.moves and "time" in node else None

    def at(self, k: int) -> NDArray[Any]:
        with readable(self.path, f"file whose {self.name} of frame {k + 1}"):
            return np.asarray(self.values[k] if self.moves else self.values[()])


def _samples(node: Any, name: str, path: Path) -> FloatArray:
    """Steps or times of an element: listed, or an increment with an offset."""
    frames = node["value"].shape[0]
    if name not in node:
        raise UsageError(f"{path}: {node.name} has no {name}: an element of H5MD that varies needs one")
    data = node[name]
    if data.shape == ():
        return np.asarray(float(data.attrs.get("offset", 0.0)) + float(data[()]) * np.arange(frames))
    if data.shape != (frames,):
        raise UsageError(
            f"{path}: {data.name} has the shape {data.shape}, and there are {frames} frames: cut off or damaged"
        )
    return np.asarray(data[()], dtype=float)


class _File:
    def __init__(self, path: Path) -> None:
        self.path = path
        h5py = library("h5py", "h5md", path)
        self.data = h5py.File(path, "r")
        if "h5md" not in self.data or "particles" not in self.data:
            raise UsageError(f"{path} is HDF5 without the groups h5md and particles: of HDF5, H5MD and VTKHDF are read")
        groups = list(self.data["particles"])
        if len(groups) != 1:
            raise UsageError(
                f"{path} has {len(groups)} groups in particles ({', '.join(groups)}): an audit takes a file with one"
            )
        self.group = self.data["particles"][groups[0]]
        if "position" not in self.group:
            raise UsageError(f"{path}: {self.group.name} has no position")
        position = _Element("position", self.group["position"], path, None, None)
        if not position.moves or position.parts not in (2, 3):
            raise UsageError(
                f"{path}: {self.group.name}/position has the shape {position.values.shape}, expected frames, bodies, 2 or 3"
            )
        self.frames, self.bodies = position.values.shape[:2]
        self.position = position
        self.elements = {"position": position}
        for name, node in self.group.items():
            if name in ("position", "box"):
                continue
            self.elements[name] = each = _Element(name, node, path, self.bodies, self.frames)
            if each.steps is not None and position.steps is not None and not np.array_equal(each.steps, position.steps):
                raise UsageError(f"{path}: {name} is stored at other steps than position: store both at the same")
        self.repeats, self.edges = self._box()

    def _box(self) -> tuple[NDArray[np.bool_], Any]:
        """Along which edges everything repeats, and what holds their lengths."""
        if "box" not in self.group:
            return np.zeros(3, dtype=bool), None
        box = self.group["box"]
        words = [
            each.decode() if isinstance(each, bytes) else str(each)
            for each in np.atleast_1d(box.attrs.get("boundary", []))
        ]
        repeats = np.array([word == "periodic" for word in words])
        if len(repeats) != self.position.parts:
            raise UsageError(
                f"{self.path}: box has the boundary {words}, and position {self.position.parts} components"
            )
        if repeats.any() and "edges" not in box:
            raise UsageError(f"{self.path}: the box is periodic and has no edges")
        return repeats, box.get("edges")

    def cell(self, k: int) -> FloatArray | None:
        """Edges, NaN where nothing repeats."""
        if self.edges is None or not self.repeats.any():
            return None
        d = len(self.repeats)
        moves = not hasattr(self.edges, "dtype")
        values = np.asarray(self.edges["value"][k] if moves else self.edges[()], dtype=float)
        if values.shape not in ((d,), (d, d)) or not np.isfinite(values).all():
            raise UsageError(
                f"{self.path}, frame {k + 1}: the edges of the box are {values}, expected {d} lengths or {d} vectors"
            )
        edges = np.full((3, 3), np.nan)
        edges[:d] = 0.0
        edges[:d, :d] = np.diag(values) if values.ndim == 1 else values
        edges[:d][~self.repeats] = np.nan
        return edges

    def check_units(self) -> list[str]:
        """A remark on units; those that do not fit together are refused."""
        length = self.position.unit
        times = self.group["position"].get("time")
        time = "" if times is None else str(times.attrs.get("unit", ""))
        velocity = self.elements["velocity"].unit if "velocity" in self.elements else ""
        if not (length or time or velocity):
            return []
        words = re.split(r"[ */]+", velocity)
        if length and time and velocity and (length not in words or not {f"{time}-1", f"{time}^-1", time} & set(words)):
            raise UsageError(
                f"{self.path}: velocity is in {velocity!r}, position in {length!r} and time in {time!r}: units must fit together"
            )
        return [f"units of the file: position {length or '?'}, time {time or '?'}; write the TOML in the same"]


def read_hdf5(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open H5MD, VTKHDF, or netCDF in HDF5, which has a dimension ``frame``."""
    h5py = library("h5py", "h5md", path)
    with readable(path, "HDF5 file"), h5py.File(path, "r") as file:
        vtk = "h5md" not in file and "VTKHDF" in file
        netcdf = "h5md" not in file and "frame" in file and "coordinates" in file
    return (read_vtkhdf if vtk else read_netcdf if netcdf else read_h5md)(path, columns, needed)


def read_h5md(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a file; it stays open while the trajectory is used.

    Raises
    ------
    UsageError
        Naming file, dataset, frame and the way out; while frames are read, too.
    """
    with readable(path, "H5MD file"):
        file = _File(path)
    names = [new for name, each in file.elements.items() if name != "image" for new in vector_names(name, each.parts)]
    aliases = {"type": "species"} if "species" in names and not {"type"} & {*names, *columns} else {}
    found = found_columns(names, {**aliases, **columns}, path, needed)
    by_name = {new: each for name, each in file.elements.items() for new in vector_names(name, each.parts)}
    rounding = {here: precision(by_name[name].values) for name, here in found.items()}
    image = file.elements.get("image")
    timed = file.position.times is not None
    if timed:
        rounding["t"] = precision(file.group["position"]["time"])
    if image is not None and any(rounding[axis].bits == 24 for axis in "xy" if axis in rounding):
        rounding |= {axis: Rounding(bits=22) for axis in "xyz" if axis in rounding}
    fill = file.elements["id"].values.fillvalue if "id" in file.elements and file.elements["id"].moves else None

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(file.frames):
            progress(k, file.frames, "frames")
            cell = file.cell(k)
            data = {name: each.at(k).astype(float) for name, each in file.elements.items()}
            if "image" in data:
                if cell is None:
                    raise UsageError(f"{path}, frame {k + 1}: images without a periodic box")
                d = file.position.parts
                data["position"] = data["position"] + data["image"] @ np.nan_to_num(cell[:d, :d])
            parts: dict[str, NDArray[Any]] = {}
            for name, values in data.items():
                parts |= split_vector(name, values)
            part = {here: parts[name] for name, here in found.items()}
            if fill is not None and "id" in part and fill < 0:
                part = {name: column[parts["id"] != fill] for name, column in part.items()}
            assert file.position.steps is not None
            step = file.position.steps[k]
            t = np.nan if file.position.times is None else float(file.position.times[k])
            yield Frame(int(step) if np.isfinite(step) else k, t, halved(part), f"frame {k + 1}", cell)

    remarks = file.check_units()
    if "diameter" in found.values():
        remarks.append("radius is half of the element diameter")
    remarks += unread([name for name in names if name != "image"], found)
    kept = frozenset({"radius" if name == "diameter" else name for name in found.values()})
    return Trajectory(path, "H5MD", frames, halved_rounding(rounding), "t" if timed else "step", kept, tuple(remarks))
