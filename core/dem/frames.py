"""Frames of a run on disk: compressed NumPy archives, or files that ParaView opens."""

from __future__ import annotations

import base64
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.archive import made_folder, whole_file
from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.validate import one_of

FloatArray = NDArray[np.float64]
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
        self.folder, self.form = made_folder(folder), form
        self._times: list[float] = []

    def write(self, t: float, state: Mapping[str, FloatArray]) -> Path:
        """Write one frame.

        Parameters
        ----------
        t : float
            Time [s].
        state : mapping from name to ndarray
            ``x, v`` of shape (n, 2), ``angle, omega, radius`` of shape (n,), in the scene's order.

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
        return np.column_stack([values, np.zeros(n)])

    data = [array("velocity", flat(state["v"]), 3)]
    data += [array(name, state[name], 1) for name in ("radius", "angle", "omega")]
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
