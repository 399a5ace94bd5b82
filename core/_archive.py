"""Reading of NumPy's ``.npz`` files that may be damaged or something else altogether."""

from __future__ import annotations

import os
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidSceneError


def read_arrays(path: str | os.PathLike[str], what: str) -> dict[str, NDArray[Any]]:
    """All arrays of a file, by name.

    Raises
    ------
    InvalidSceneError
        If the file is missing, damaged or no ``.npz`` file; the message says that it is not ``what`` was asked for.
    """
    try:
        data = np.load(path, allow_pickle=False)
        if not isinstance(data, np.lib.npyio.NpzFile):
            raise ValueError("it holds a single array")
        with data:
            return {name: data[name] for name in data.files}
    except (
        OSError, ValueError, KeyError, TypeError, EOFError, MemoryError, OverflowError, SyntaxError,
        RuntimeError, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        raise InvalidSceneError(f"{path} is no {what}, or damaged: {error}") from error
