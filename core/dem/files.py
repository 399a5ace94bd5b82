"""Checkpoints of a DEM run: everything that it takes to go on bit for bit."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.archive import read_arrays, whole_file
from ninedisk.core.dem.neighbour_kernels import NeighbourList
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

FORMAT = 3
NEEDED = ("clock", "samples.pairs", "samples.chosen", "samples.at")
"""Arrays without which a session cannot even be made; the archive itself guards what is in them."""


def write_checkpoint(
    path: str | os.PathLike[str], scene: Scene, numerics: Numerics, arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Write a checkpoint; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Any name; NumPy's ``.npz`` format.
    scene, numerics : Scene, Numerics
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


def read_checkpoint(path: str | os.PathLike[str]) -> tuple[Scene, Numerics, dict[str, NDArray[Any]]]:
    """Read what `write_checkpoint` wrote.

    Raises
    ------
    InvalidSceneError
        If the file is no checkpoint of this format.
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
    return Scene.from_dict(head["scene"]), Numerics.from_dict(head["numerics"]), arrays


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
            if name not in ("samples.at", "samples.chosen", "samples.pairs"):
                mine[name][: kept.sum()] = array[kept]
        elif not name.startswith(("pairs.", "wall_pairs.")):
            mine[name][...] = array
    return int(kept.sum())
