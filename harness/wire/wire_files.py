"""Histories in files: NPZ, for those that are large as text.

The file holds the arrays of the history by their names, ``step`` included, and energies as ``energy.NAME``; an array that
it does not hold was not observed. Positions and velocities are checked like any others.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.harness.wire.wire_fields import WireError, text_field

HISTORY_FILE_KEYS = ("file", "force_meaning")
ENERGY = "energy."


def read_history_file(name: Any, folder: Path | None, arrays: Iterable[str]) -> dict[str, Any]:
    """The arrays of an NPZ file, None for those of ``arrays`` that it lacks, and its energies.

    Parameters
    ----------
    name : str
        Path as the engine gave it; relative ones begin at ``folder``.
    folder : Path or None
        The only folder in which the file may lie.
    arrays : iterable of str
        What a history may hold besides ``step`` and energies.

    Raises
    ------
    WireError
        If the file lies elsewhere, is none of this form, or holds arrays of other names or of objects.
    """
    told = text_field(name, "history.file")
    if folder is None:
        raise WireError(f"history.file is {told!r}, but this run has no folder for files: write the arrays themselves")
    path = (folder / told).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        raise WireError(
            f"history.file is {told!r}; expected a file in the folder of the request's answer_file, which is removed after "
            f"the run"
        )
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, TypeError, AttributeError, zlib.error, zipfile.BadZipFile) as error:
        raise WireError(f"history.file {told!r} is no NPZ file of plain arrays ({error})") from error
    allowed = ("step", *arrays)
    unknown = [key for key in found if key not in allowed and not key.startswith(ENERGY)]
    if unknown or "step" not in found:
        fault = f"has the unknown array(s) {', '.join(unknown)}" if unknown else "lacks the array step"
        raise WireError(f"history.file {told!r} {fault}; expected {', '.join(allowed)} and {ENERGY}NAME")
    energy = {key.removeprefix(ENERGY): array for key, array in found.items() if key.startswith(ENERGY)}
    return {"energy": energy} | {key: found.get(key) for key in allowed}
