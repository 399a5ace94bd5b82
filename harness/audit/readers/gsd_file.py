"""GSD files of the schema `hoomd`: one frame in memory; what a frame does not store is never taken for a measured number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import found_columns, library, split_vector, vector_names
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, halved, halved_rounding
from ninedisk.harness.audit.readers.rounding import Rounding

PARTS = {
    "position": 3, "velocity": 3, "angmom": 4, "orientation": 4, "moment_inertia": 3, "image": 3, "diameter": 0, "mass": 0, "typeid": 0,
}  # fmt: skip
"""Chunks that are read, and numbers a body in each; 0: one, no vector."""
MOVING = ("position", "velocity", "angmom", "orientation", "image")
"""Chunks that change with time: those of the first frame say nothing about later ones."""
SPINS = ("angmom", "moment_inertia", "orientation")
READ_BITS = 22
"""Bits of a place put together from one within the box and images: both rounded to 24, of lengths up to twice the place."""


@dataclass
class _Chunks:
    """Chunks that can be used, and remarks on others."""

    used: list[str]
    remarks: list[str]


class _File:
    def __init__(self, path: Path) -> None:
        self.path = path
        fl = library("gsd.fl", "gsd", path)
        try:
            self.data = fl.open(name=str(path), mode="r", application="ninedisk", schema="hoomd", schema_version=[1, 0])
        except (OSError, RuntimeError, ValueError) as error:
            raise UsageError(
                f"{path} is no GSD file that can be read ({error}): cut off, damaged or of another program"
            ) from error
        if self.data.schema != "hoomd":
            raise UsageError(f"{path} has the schema {self.data.schema!r}, expected 'hoomd'")
        self.frames = self.data.nframes
        if not self.frames:
            raise UsageError(f"{path} has no frame: the run ended before one was written")

    def has(self, k: int, name: str) -> bool:
        return bool(self.data.chunk_exists(frame=k, name=name))

    def read(self, k: int, name: str) -> NDArray[Any]:
        try:
            return np.asarray(self.data.read_chunk(frame=k, name=name))
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            raise UsageError(
                f"{self.path}, frame {k + 1}: {name} cannot be read ({error}): cut off or damaged"
            ) from error

    def setting(self, k: int, name: str) -> NDArray[Any] | None:
        """What frame ``k`` has, else the first frame."""
        at = next((frame for frame in (k, 0) if self.has(frame, name)), None)
        return None if at is None else self.read(at, name)

    def count(self, k: int) -> int:
        found = self.setting(k, "particles/N")
        return 0 if found is None else int(found.ravel()[0])

    def chunks(self) -> _Chunks:
        """What can be used: chunks that move must be stored with every frame."""
        used, remarks = [], []
        for name in PARTS:
            has = [self.has(k, f"particles/{name}") for k in range(self.frames)]
            if not any(has):
                continue
            stored = [k for k, there in enumerate(has) if there]
            later = [k for k in range(max(stored[0], 1), self.frames) if not has[k]]
            if name not in MOVING or not later:
                used.append(name)
            elif stored == [0] and name in ("velocity", "angmom", "image"):
                remarks.append(
                    f"{name} is stored with the first frame alone and not used: HOOMD writes it with dynamic=['momentum']"
                )
            elif name == "orientation" and stored == [0]:
                remarks.append("orientation is stored with the first frame alone")
            else:
                raise UsageError(
                    f"{self.path}, frame {later[0] + 1}: it stores no {name} although others do: write {name} with every frame (HOOMD: "
                    "dynamic), or cut the file there"
                )
        if not self.has(0, "particles/position"):
            raise UsageError(f"{self.path}, frame 1: it stores no particles/position")
        if "diameter" not in used:
            remarks.append("diameter is not stored; HOOMD's default of 1 is not taken for it")
        if "mass" not in used:
            remarks.append("mass is not stored; HOOMD's default of 1 is not taken for it")
        types = self.setting(0, "particles/types")
        if types is not None and types.ndim == 2 and "typeid" in used:
            names = [bytes(row.astype(np.uint8)).rstrip(b"\0").decode("utf-8", "replace") for row in types]
            remarks.append("type is typeid: " + ", ".join(f"{k} is {name}" for k, name in enumerate(names[:20])))
        return _Chunks(used, remarks)

    def cell(self, k: int) -> FloatArray | None:
        """Edges of the box, which repeats in all directions; None: no box is stored."""
        box = self.setting(k, "configuration/box")
        if box is None:
            return None
        box = box.astype(float).ravel()
        if box.shape != (6,) or not np.isfinite(box).all() or (box[:3] < 0.0).any():
            raise UsageError(
                f"{self.path}, frame {k + 1}: configuration/box is {box}, expected Lx, Ly, Lz >= 0, xy, xz, yz"
            )
        x, y, z, xy, xz, yz = box
        edges = np.array([(x, 0.0, 0.0), (xy * y, y, 0.0), (xz * z, yz * z, z)])
        dimensions = self.setting(k, "configuration/dimensions")
        if z == 0.0 or (dimensions is not None and int(dimensions.ravel()[0]) == 2):
            edges[2] = np.nan
        return edges


def read_gsd(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a file; it stays open while the trajectory is used.

    Raises
    ------
    UsageError
        Naming file, chunk, frame and the way out; while frames are read, too.
    """
    file = _File(path)
    chunks = file.chunks()
    plain = [name for name in chunks.used if name not in (*SPINS, "image")]
    names = [new for name in plain for new in vector_names(name, PARTS[name])]
    aliases = {"type": "typeid"} if "typeid" in names and "type" not in columns else {}
    found = found_columns(names, {**aliases, **columns}, path, needed)
    spins = all(name in chunks.used for name in ("angmom", "moment_inertia"))
    if (
        spins
        and any(file.has(k, "particles/orientation") for k in range(file.frames))
        and "orientation" not in chunks.used
    ):
        spins = False
        chunks.remarks.append("spins need orientations with every frame")
    if "angmom" in chunks.used and "moment_inertia" not in chunks.used:
        chunks.remarks.append("angmom without moment_inertia gives no spins")
    chunks.remarks += _inertia_remark(file, chunks)
    rounding = {
        here: Rounding(bits=24) for here in (*found.values(), *(("omegax", "omegay", "omega") if spins else ()))
    }
    if spins:
        rounding |= {name: Rounding(bits=21) for name in ("omegax", "omegay", "omega")}
    if "image" in chunks.used:
        rounding |= {axis: Rounding(bits=READ_BITS) for axis in "xyz"}
    stepped = any(file.has(k, "configuration/step") for k in range(file.frames))

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(file.frames):
            progress(k, file.frames, "frames")
            yield _frame(file, chunks, found, k, spins=spins)

    kept = {"radius" if name == "diameter" else name for name in found.values()} | (
        {"omega", "omegax", "omegay"} if spins else set()
    )
    if "diameter" in found.values():
        chunks.remarks.append("radius is half of the chunk diameter")
    return Trajectory(
        path,
        "GSD",
        frames,
        halved_rounding(rounding),
        "step" if stepped else "index",
        frozenset(kept),
        tuple(chunks.remarks),
    )


def _inertia_remark(file: _File, chunks: _Chunks) -> list[str]:
    """I/(m R^2) of the first frame, which the TOML has to give."""
    if not {"moment_inertia", "diameter", "mass"} <= set(chunks.used):
        return []
    inertia, diameter, mass = (file.setting(0, f"particles/{name}") for name in ("moment_inertia", "diameter", "mass"))
    if inertia is None or diameter is None or mass is None or inertia.ndim != 2 or len(inertia) != len(mass):
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = inertia.astype(float)[:, 2] / (mass.astype(float) * (0.5 * diameter.astype(float)) ** 2)
    low, high = float(np.nanmin(ratio, initial=np.inf)), float(np.nanmax(ratio, initial=0.0))
    return [f"moment_inertia of the file is {low:.4g} to {high:.4g} m R^2: inertia of the TOML must agree"]


def _frame(file: _File, chunks: _Chunks, found: Mapping[str, str], k: int, *, spins: bool) -> Frame:
    """Frame ``k``."""
    n = file.count(k)
    data: dict[str, FloatArray] = {}
    for name in chunks.used:
        stored = file.setting(k, f"particles/{name}")
        values = np.zeros((n, PARTS[name]) if PARTS[name] else n) if stored is None else stored.astype(float)
        if values.shape != ((n, PARTS[name]) if PARTS[name] else (n,)):
            raise UsageError(
                f"{file.path}, frame {k + 1}: {name} has the shape {values.shape}, and there are {n} particles"
            )
        data[name] = values
    cell = file.cell(k)
    if "image" in data:
        if cell is None:
            raise UsageError(f"{file.path}, frame {k + 1}: images without configuration/box")
        data["position"] = data["position"] + data["image"] @ np.nan_to_num(cell)
    parts: dict[str, Any] = {}
    for name, values in data.items():
        parts |= split_vector(name, values)
    part = {here: parts[name] for name, here in found.items()}
    if spins:
        part |= dict(zip(("omegax", "omegay", "omega"), spins_of(data).T, strict=True))
    step = file.setting(k, "configuration/step")
    number = k if step is None else int(step.ravel()[0])
    return Frame(number, np.nan, halved(part), f"frame {k + 1}", cell)


def spins_of(data: Mapping[str, FloatArray]) -> FloatArray:
    """Angular velocities in space: HOOMD's conjugate quaternion is 2 q S, with S the angular momentum in the body's frame.

    An axis without a moment of inertia does not turn.
    """
    p = data["angmom"]
    q = data["orientation"] if "orientation" in data else np.broadcast_to([1.0, 0.0, 0.0, 0.0], p.shape)
    inertia = data["moment_inertia"]
    w, v = q[:, :1], q[:, 1:]
    body = 0.5 * (w * p[:, 1:] - p[:, :1] * v - np.cross(v, p[:, 1:]))
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = np.where(inertia > 0.0, body / inertia, 0.0)
    across = 2.0 * np.cross(v, turning)
    return np.asarray(turning + w * across + np.cross(v, across))
