"""Checkpoints of a DEM run: everything that it takes to go on bit for bit."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

FORMAT = 1


def write_checkpoint(
    path: str | os.PathLike[str], scene: Scene, numerics: Numerics, arrays: Mapping[str, np.ndarray[Any, Any]]
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
    """
    target = Path(path)
    head = json.dumps({"format": FORMAT, "scene": scene.to_dict(), "numerics": numerics.to_dict()})
    payload: dict[str, Any] = {"head": np.array(head), **arrays}
    handle, name = tempfile.mkstemp(dir=target.parent or Path("."), prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, **payload)
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def read_checkpoint(path: str | os.PathLike[str]) -> tuple[Scene, Numerics, dict[str, np.ndarray[Any, Any]]]:
    """Read what `write_checkpoint` wrote.

    Raises
    ------
    InvalidSceneError
        If the file is no checkpoint of this format.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        head = json.loads(str(arrays.pop("head")))
        known = head["format"] == FORMAT
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidSceneError(f"{os.fspath(path)} is no checkpoint of a DEM run: {error}") from error
    if not known:
        raise InvalidSceneError(
            f"{os.fspath(path)} has the checkpoint format {head['format']}; this version reads {FORMAT}"
        )
    return Scene.from_dict(head["scene"]), Numerics.from_dict(head["numerics"]), arrays
