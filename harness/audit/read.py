"""Trajectories of many formats as frames of columns, one at a time, and how far each printed number may be from the one meant."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import FORMS, Frame, Progress, Trajectory, open_file
from ninedisk.harness.audit.readers.extxyz import is_extended_xyz, read_extended_xyz
from ninedisk.harness.audit.readers.gsd_file import read_gsd
from ninedisk.harness.audit.readers.h5md import read_hdf5
from ninedisk.harness.audit.readers.lammps import read_dump
from ninedisk.harness.audit.readers.lammps_yaml import read_yaml_dump
from ninedisk.harness.audit.readers.mercury import (
    is_mercury_contacts,
    is_mercury_data,
    read_mercury_contacts,
    read_mercury_data,
    single_file,
)
from ninedisk.harness.audit.readers.netcdf import read_netcdf
from ninedisk.harness.audit.readers.tables import read_arrays, read_parquet, read_text
from ninedisk.harness.audit.readers.vtk import read_series
from ninedisk.harness.audit.readers.yade_text import read_yade_text, yade_files

FLAT = 1e-6
"""Spread of z over that of x and y which is round-off of a motion in the plane; single precision has 6e-8 a step."""
PEEKED = 3
"""Frames that show whether a file is in space where its TOML does not say."""
BINARY: dict[bytes, Callable[[Path, Mapping[str, str], Sequence[str]], Trajectory]] = {
    b"CDF": read_netcdf, b"\x89HDF\r\n\x1a\n": read_hdf5, b"\xdf\x65" * 4: read_gsd,
}  # fmt: skip
"""First bytes of a file -> its reader."""


def read_trajectory(path: Path, columns: Mapping[str, str], needed: Sequence[str] = ("x", "y")) -> Trajectory:
    """Open a trajectory.

    Parameters
    ----------
    path : Path
    columns : mapping
        Name here -> name in the file.
    needed : sequence of str
        Columns that it must have.

    Raises
    ------
    UsageError
        Naming file, line, column, what is allowed and the way out; while frames are read, too.
    """
    if not path.exists():
        raise UsageError(f"there is no {str(path)!r}: give {FORMS}")
    if path.is_dir() and yade_files(path):
        return read_yade_text(path, columns, needed)
    if path.is_dir() or path.suffix == ".pvd":
        return read_series(path, columns)
    if path.suffix in (".parquet", ".pq"):
        return read_parquet(path, columns, needed)
    if path.suffix == ".npz":
        return read_arrays(path)
    for magic, reader in BINARY.items():
        if _begins_with(path, magic):
            return reader(path, columns, needed)
    if path.suffix in (".vtk", ".vtp", ".vtu", ".pvtp", ".pvtu"):
        raise UsageError(f"{str(path)!r} is a single frame: give the folder of the series, or its .pvd")
    with open_file(path) as stream:
        try:
            head = stream.readline(1 << 16)
            second = stream.readline(1 << 16)
        except (OSError, EOFError, zlib.error) as error:
            raise UsageError(f"{path} is no text that can be read ({error}): give {FORMS}") from error
    if way := single_file(path):
        raise UsageError(way)
    if is_mercury_data(head, second):
        return read_mercury_data(path, columns, needed)
    if is_mercury_contacts(head, second):
        return read_mercury_contacts(path, columns, needed)
    if head.startswith("ITEM:"):
        return read_dump(path, columns, needed)
    if head.startswith("---"):
        if "LAMMPS" not in second:
            raise UsageError(
                f"{path}, line 2: {second.strip()[:40]!r} should be 'creator: LAMMPS': of YAML, only `dump yaml` is read"
            )
        return read_yaml_dump(path, columns, needed)
    if is_extended_xyz(head, second):
        return read_extended_xyz(path, columns, needed)
    if head.startswith("LAMMPS data file"):
        raise UsageError(
            f'{path} is a data file of LAMMPS, one state: give a dump, and this for radii and masses by [data] file = "{path.name}"'
        )
    if head.startswith("#format "):
        raise UsageError(f"{str(path)!r} is a single frame of YADE: give the folder of the series")
    if head.strip().isdigit():
        raise UsageError(
            f"{path}, line 2: no Properties=...: of XYZ, the extended form is read (LAMMPS: `dump extxyz`)"
        )
    return read_text(path, columns, needed)


def _begins_with(path: Path, magic: bytes) -> bool:
    try:
        with path.open("rb") as stream:
            return stream.read(len(magic)) == magic
    except OSError as error:
        raise UsageError(f"{str(path)!r} cannot be read ({error.strerror or error})") from error


def dimension_of(trajectory: Trajectory) -> int:
    """3 where the first frames have places or velocities off a plane of constant z, else 2."""
    low, high, size = np.inf, -np.inf, 0.0
    for frame in islice(trajectory.frames(lambda *_: None), PEEKED):
        columns = frame.columns
        if "z" not in columns or not len(columns["z"]):
            return 2
        if np.nanmax(np.abs(columns.get("vz", np.zeros(1))), initial=0.0) > 0.0:
            return 3
        z = columns["z"][np.isfinite(columns["z"])]
        low, high = min(low, float(z.min(initial=low))), max(high, float(z.max(initial=high)))
        size = max(size, *(float(np.ptp(columns[axis])) for axis in "xy"), abs(low))
    return 3 if high - low > FLAT * size else 2


def in_plane(trajectory: Trajectory) -> Trajectory:
    """The same, refused where z varies."""

    def frames(progress: Progress) -> Iterator[Frame]:
        low, high = np.inf, -np.inf
        for frame in trajectory.frames(progress):
            z = frame.columns.get("z", np.empty(0))
            low, high = (float(end(z[np.isfinite(z)], initial=now)) for end, now in ((np.min, low), (np.max, high)))
            sizes = [float(np.ptp(frame.columns[name])) for name in "xy" if len(frame.columns.get(name, ()))]
            if high - low > FLAT * max(*sizes, abs(low), 0.0):
                raise UsageError(
                    f"{trajectory.path}, {frame.place}: z goes from {low:g} to {high:g}, and the TOML is of the plane: write dimension = 3 "
                    "and three numbers for each vector (gravity, point and normal of a wall)"
                )
            yield frame

    return replace(trajectory, frames=frames)
