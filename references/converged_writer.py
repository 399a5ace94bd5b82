"""Writer of the tables that `ninedisk.references.converged_tables` reads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.references.converged_tables import (
    CONVERGED_FOLDER,
    FORMAT,
    INDEX,
    ConvergedCurve,
    equal_params,
    read_index,
)


def write_converged(
    curve: ConvergedCurve, *, file: str, folder: Path | str = CONVERGED_FOLDER, ignored: tuple[str, ...] = ()
) -> Path:
    """Write a curve and its entry in the index; an entry of the same case and parameters is replaced.

    Parameters
    ----------
    curve : ConvergedCurve
        What to write.
    file : str
        Name of the CSV file, unique in the folder.
    folder : Path or str
        Folder of the tables; made if it does not exist.
    ignored : tuple of str
        Parameters of the case on which no curve of it depends; added to those of the index.

    Returns
    -------
    Path
        The CSV file.

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, a quantity lacks unit or uncertainty, or the file belongs to another
        entry.
    """
    base = Path(folder)
    _check(curve)
    listed, entries = read_index(base) if (base / INDEX).exists() else ({}, [])
    known = {case: list(names) for case, names in listed.items()}
    kept = [dict(e) for e in entries if e["case"] != curve.case or not equal_params(e["params"], curve.params)]
    if any(entry["file"] == file for entry in kept):
        raise ValueError(f"file = {file!r} belongs to another entry of {base / INDEX}: choose another name")
    known[curve.case] = sorted({*known.get(curve.case, ()), *ignored})
    kept.append(
        {
            "case": curve.case,
            "file": file,
            "method": curve.method,
            "params": dict(curve.params),
            "units": dict(curve.units),
            "uncertainty": dict(curve.uncertainty),
            "scalars": {name: vars(scalar) for name, scalar in curve.scalars.items()},
        }
    )
    text = f"format = {FORMAT}\n\n[ignored]\n"
    text += "".join(f"{_key(case)} = {_toml(names)}\n" for case, names in sorted(known.items()))
    for entry in sorted(kept, key=lambda e: (e["case"], e["file"])):
        text += "\n[[curve]]\n" + "".join(f"{key} = {_toml(value)}\n" for key, value in entry.items())
    base.mkdir(parents=True, exist_ok=True)
    names = list(curve.units)
    lines = [",".join(["step", "t", *names])]
    for row, (step, t) in enumerate(zip(curve.step, curve.t, strict=True)):
        cells = [str(int(step)), repr(float(t)), *(repr(float(curve.quantities[name][row])) for name in names)]
        lines.append(",".join(cells))
    (base / file).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (base / INDEX).write_text(text, encoding="utf-8")
    return base / file


def _check(curve: ConvergedCurve) -> None:
    names = set(curve.quantities)
    if names != set(curve.units) or names != set(curve.uncertainty):
        raise ValueError(
            f"quantities {sorted(names)}, units {sorted(curve.units)} and uncertainty {sorted(curve.uncertainty)} "
            "must have the same names"
        )
    for name, values in {"t": curve.t, **curve.quantities}.items():
        if np.shape(values) != np.shape(curve.step):
            raise ValueError(f"{name} has shape {np.shape(values)}; step has {np.shape(curve.step)}: they must agree")
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{name} holds a value that is not finite: a reference must be complete")


def _toml(value: Any) -> str:
    """TOML of a plain value; strings as JSON, whose escapes are TOML's too."""
    if value is None:
        return '"none"'
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(item)}" for key, item in value.items()) + " }"
    return "[" + ", ".join(_toml(item) for item in value) + "]"


def _key(name: str) -> str:
    return json.dumps(name)
