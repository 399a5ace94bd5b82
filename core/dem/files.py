"""What a run of the DEM leaves on disk: checkpoints, from which it goes on bit for bit, and frames, which ParaView opens."""

from __future__ import annotations

import base64
import json
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.archive import make_folder, read_arrays, whole_file
from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.state import NeighbourList
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.core.validate import one_of

Kind = TypeVar("Kind", Scene, SphereScene)

FORMAT = 7
NEEDED = ("clock", "samples.pairs", "samples.chosen", "samples.at")
"""Arrays without which a session cannot even be made; the archive itself guards what is in them."""


def write_checkpoint(
    path: str | os.PathLike[str], scene: Scene | SphereScene, numerics: Numerics, arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Write a checkpoint; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Any name; NumPy's ``.npz`` format.
    scene, numerics
        As the run was begun.
    arrays : mapping from name to ndarray
        State of the run.

    Raises
    ------
    UnwritableFileError
        If it cannot be written.
    """
    head = json.dumps({"format": FORMAT, "scene": scene.to_dict(), "numerics": numerics.to_dict()})
    payload: dict[str, Any] = {"head": np.array(head), **arrays}
    with whole_file(path) as stream:
        np.savez(stream, **payload)


def read_checkpoint(path: str | os.PathLike[str], kind: type[Kind]) -> tuple[Kind, Numerics, dict[str, NDArray[Any]]]:
    """Read what `write_checkpoint` wrote of a scene of this kind.

    Raises
    ------
    InvalidSceneError
        If the file is no checkpoint of this format and kind.
    """
    arrays = read_arrays(path, "checkpoint of a DEM run")
    try:
        head = json.loads(str(arrays.pop("head")))
        known = head["format"] == FORMAT
        if lacking := [name for name in NEEDED if name not in arrays]:
            raise ValueError(f"it lacks {', '.join(lacking)}")
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidSceneError(f"{path} is no checkpoint of a DEM run: {error}") from error
    if not known:
        raise InvalidSceneError(f"{path} has the checkpoint format {head['format']}; this version reads {FORMAT}")
    scene = head.get("scene")
    dimension = scene.get("dimension", 2) if isinstance(scene, dict) else kind.dimension
    if dimension != kind.dimension:
        session = "DemSession" if dimension == 2 else "SphereSession"
        raise InvalidSceneError(
            f"{path} is a checkpoint of a scene in {dimension}D, not in {kind.dimension}D: load it by {session}.load"
        )
    return kind.from_dict(head["scene"]), Numerics.from_dict(head["numerics"]), arrays


def state_arrays(single: Mapping[str, NDArray[Any]], groups: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Every array that the next step depends on, and the samples so far, by ``name`` or ``group.field``.

    Parameters
    ----------
    single : mapping from name to ndarray
    groups : mapping from name to named tuple of ndarray
    """
    found = dict(single)
    for name, group in groups.items():
        found |= {f"{name}.{field}": array for field, array in group._asdict().items()}
    return found


def saved_list(arrays: Mapping[str, NDArray[Any]], name: str) -> NeighbourList:
    """A copy of a saved neighbour list."""
    return NeighbourList(*(np.array(arrays[f"{name}.{field}"]) for field in NeighbourList._fields))


def restore(mine: Mapping[str, NDArray[Any]], saved: Mapping[str, NDArray[Any]], rows: int) -> int:
    """Write a saved state into the arrays of a new session.

    Parameters
    ----------
    mine, saved : mapping from name to ndarray
        As `state_arrays` names them; lists are left alone.
    rows : int
        Samples taken so far.

    Returns
    -------
    int
        Rows that belong to the new session, too: a run always samples its last step, which a longer one may not.
    """
    kept = np.isin(saved["samples.at"], mine["samples.at"]) & (np.arange(len(saved["samples.at"])) < rows)
    for name, array in saved.items():
        if name.startswith("samples."):
            if name not in ("samples.at", "samples.chosen", "samples.pairs") and len(array) == len(kept):
                mine[name][: kept.sum()] = array[kept]
        elif not name.startswith(("pairs.", "wall_pairs.")):
            mine[name][...] = array
    return int(kept.sum())


Format = Literal["npz", "vtk"]


class FrameWriter:
    """Writes frames ``frame-000000.npz`` or ``frame-000000.vtp`` with an index ``frames.pvd``.

    Parameters
    ----------
    folder : path-like
        Is made if it does not exist.
    form : {"npz", "vtk"}
        Compressed NumPy archives, or VTK's XML point sets: radius, velocity, angle and spin at each centre, which ParaView draws as
        circles through its glyph filter.

    Raises
    ------
    InvalidNumericsError
        If the form is unknown.
    UnwritableFileError
        If the folder cannot be made.
    """

    def __init__(self, folder: str | os.PathLike[str], form: Format = "npz") -> None:
        one_of("form", form, ("npz", "vtk"), error=InvalidNumericsError)
        self.folder, self.form = make_folder(folder), form
        self._times: list[float] = []

    def write(self, t: float, state: Mapping[str, FloatArray]) -> Path:
        """Write one frame.

        Parameters
        ----------
        t : float
            Time [s].
        state : mapping from name to ndarray
            In the plane ``x, v`` of shape (n, 2), ``angle, omega, radius`` of shape (n,); in space ``x, v, angle, omega`` of shape
            (n, 3), ``radius`` of shape (n,); in the scene's order.

        Returns
        -------
        Path
            The file; it appears whole or not at all.

        Raises
        ------
        UnwritableFileError
            If it cannot be written.
        """
        name = f"frame-{len(self._times):06d}.{'npz' if self.form == 'npz' else 'vtp'}"
        with whole_file(self.folder / name) as stream:
            if self.form == "npz":
                arrays: dict[str, FloatArray] = {"t": np.array(t), **state}
                np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
            else:
                stream.write(_polydata(state).encode("ascii"))
        self._times.append(t)
        if self.form == "vtk":
            self._index()
        return self.folder / name

    def _index(self) -> None:
        rows = "\n".join(f'<DataSet timestep="{t!r}" file="frame-{k:06d}.vtp"/>' for k, t in enumerate(self._times))
        text = f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0">\n<Collection>\n{rows}\n</Collection>\n</VTKFile>\n'
        with whole_file(self.folder / "frames.pvd") as stream:
            stream.write(text.encode("ascii"))


def _polydata(state: Mapping[str, FloatArray]) -> str:
    """Point set in VTK's XML form, binary arrays in base 64 after their length in bytes (64 bits)."""
    n = len(state["x"])

    def array(name: str, values: NDArray[np.float64] | NDArray[np.int64], parts: int) -> str:
        kind = "Int64" if values.dtype.kind == "i" else "Float64"
        raw = np.ascontiguousarray(values).tobytes()
        text = base64.b64encode(struct.pack("<Q", len(raw)) + raw).decode("ascii")
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{parts}" format="binary">{text}</DataArray>'

    def flat(values: FloatArray) -> FloatArray:
        return np.column_stack([values, np.zeros(n)]) if np.shape(values)[1] == 2 else values

    turns = 1 if np.ndim(state["omega"]) == 1 else 3
    data = [array("velocity", flat(state["v"]), 3), array("radius", state["radius"], 1)]
    data += [array(name, state[name], turns) for name in ("angle", "omega")]
    verts = array("connectivity", np.arange(n, dtype=np.int64), 1) + array(
        "offsets", np.arange(1, n + 1, dtype=np.int64), 1
    )
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n<PolyData>\n'
        f'<Piece NumberOfPoints="{n}" NumberOfVerts="{n}" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">\n'
        f"<PointData>{''.join(data)}</PointData>\n<Points>{array('x', flat(state['x']), 3)}</Points>\n"
        f"<Verts>{verts}</Verts>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )
