"""Fine-step limits of the core's own runs: loader of the tables in ``converged/``.

A folder holds one ``index.toml`` and one CSV file per variant::

    format = 1
    [ignored]                               # parameters on which a case's limit does not depend
    "nine-disk/distortion" = ["contact_dt"]
    [[curve]]
    case = "nine-disk/distortion"
    file = "distortion-mid-pivot-15-1.csv"  # columns: step, t, then the quantities of `units`
    method = "..."                          # how the limit and its uncertainty were computed
    params = { phi_deg = 15.0, walls = "mid-pivot" }
    units = { fn_up = "N" }
    uncertainty = { fn_up = 1.2e3 }         # half-width, in the quantity's unit
    [curve.scalars.first_slip_cycle]        # optional single numbers
    value = 140.0
    unit = "-"
    uncertainty = 1.0

Floats are written with ``repr``, so that they are read back to the last bit.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._data import ReferenceDataError, check_keys, check_type, read_toml, same

FloatArray = NDArray[np.float64]
CONVERGED_FOLDER = Path(__file__).parent / "converged"
INDEX = "index.toml"
FORMAT = 1
_REQUIRED: dict[str, type] = {
    "case": str,
    "file": str,
    "method": str,
    "params": dict,
    "units": dict,
    "uncertainty": dict,
}


@dataclass(frozen=True, kw_only=True)
class ConvergedScalar:
    """A single number with its unit and the half-width of its uncertainty."""

    value: float
    unit: str
    uncertainty: float


@dataclass(frozen=True, kw_only=True)
class ConvergedCurve:
    """Converged reference of one variant.

    Parameters
    ----------
    case : str
        Case id.
    params : mapping
        Parameters that it was computed for.
    method : str
        How the limit and its uncertainty were obtained.
    step : ndarray of int, shape (s,)
        Steps of the case.
    t : ndarray, shape (s,)
        Times [s].
    quantities : mapping from name to ndarray, shape (s,)
        Values in the unit of ``units``.
    units : mapping from name to str
        SI units.
    uncertainty : mapping from name to float
        Half-width of each quantity's uncertainty, in its unit.
    scalars : mapping from name to ConvergedScalar
        Single numbers of the variant.
    """

    case: str
    params: Mapping[str, Any]
    method: str
    step: NDArray[np.int64]
    t: FloatArray
    quantities: Mapping[str, FloatArray]
    units: Mapping[str, str]
    uncertainty: Mapping[str, float]
    scalars: Mapping[str, ConvergedScalar] = field(default_factory=dict)


def load_converged(
    case: str, params: Mapping[str, Any], *, folder: Path | str = CONVERGED_FOLDER
) -> ConvergedCurve | None:
    """Converged reference of a variant; None if there is none.

    A variant fits if its parameters, less those that the index ignores for the case and those that are None, are
    exactly the entry's, names and values (1 equals 1.0; no tolerance). A parameter that the entry does not know thus
    means None, not a reference for something else.

    Parameters
    ----------
    case : str
        Case id.
    params : mapping
        The variant's complete parameters.
    folder : Path or str
        Folder of the tables.

    Raises
    ------
    ReferenceDataError
        If the index or a table is not valid, or two entries fit.
    """
    base = Path(folder)
    ignored, entries = read_index(base)
    wanted = _relevant(params, ignored.get(case, ()))
    fitting = [entry for entry in entries if entry["case"] == case and equal_params(entry["params"], wanted)]
    if len(fitting) > 1:
        raise ReferenceDataError(
            f"{base / INDEX}: {fitting[0]['file']} and {fitting[1]['file']} are both for {case} with {wanted}; "
            "remove one"
        )
    return _load(base, fitting[0]) if fitting else None


def read_index(folder: Path) -> tuple[Mapping[str, list[str]], Sequence[Mapping[str, Any]]]:
    """Ignored parameters by case, and the entries, checked; raises `ReferenceDataError`.

    The result is kept until the file changes: an index of all variants takes longer to parse than a table.
    """
    path = folder / INDEX
    try:
        state = path.stat()
    except OSError:
        raise ReferenceDataError(f"{path} does not exist") from None
    return _read_index(path, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=4)
def _read_index(path: Path, _: tuple[int, int]) -> tuple[dict[str, list[str]], list[dict[str, Any]]]:
    data = check_keys(
        read_toml(path), required={"format": int}, optional={"ignored": dict, "curve": list}, where=str(path)
    )
    if data["format"] != FORMAT:
        raise ReferenceDataError(f"{path}: format {data['format']} is unknown; this version reads format {FORMAT}")
    ignored = data.get("ignored", {})
    for case, names in ignored.items():
        check_type(names, list, where=f"{path}: ignored.{case}")
        for name in names:
            check_type(name, str, where=f"{path}: ignored.{case}")
    entries = data.get("curve", [])
    for number, entry in enumerate(entries, start=1):
        _check_entry(entry, f"{path}: curve {number}")
    return ignored, entries


def equal_params(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Exact equality of two sets of parameters, "none" and None counting as absent."""
    first, second = _relevant(a, ()), _relevant(b, ())
    return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)


def _relevant(params: Mapping[str, Any], ignored: Any) -> dict[str, Any]:
    return {key: value for key, value in params.items() if key not in ignored and value not in (None, "none")}


def _check_entry(entry: object, where: str) -> None:
    data = check_keys(entry, required=_REQUIRED, optional={"scalars": dict}, where=where)
    if Path(data["file"]).name != data["file"]:
        raise ReferenceDataError(f"{where}: file = {data['file']!r} must be a plain name beside the index")
    if data["units"].keys() != data["uncertainty"].keys():
        odd = sorted(data["units"].keys() ^ data["uncertainty"].keys())
        raise ReferenceDataError(f"{where}: {odd[0]!r} has a unit or an uncertainty but not both")
    for name, unit in data["units"].items():
        check_type(unit, str, where=f"{where}: units.{name}")
        _check_uncertainty(data["uncertainty"][name], f"{where}: uncertainty.{name}")
    for name, scalar in data.get("scalars", {}).items():
        at = f"{where}: scalars.{name}"
        check_keys(scalar, required={"value": float, "unit": str, "uncertainty": float}, optional={}, where=at)
        _check_uncertainty(scalar["uncertainty"], at)


def _check_uncertainty(value: Any, where: str) -> None:
    check_type(value, float, where=where)
    if value < 0.0:
        raise ReferenceDataError(f"{where} = {value!r} must be >= 0")


def _load(base: Path, entry: Mapping[str, Any]) -> ConvergedCurve:
    path = base / entry["file"]
    names = list(entry["units"])
    columns = _read_table(path, ["step", "t", *names])
    step = columns["step"].astype(np.int64)
    if not np.array_equal(step, columns["step"]) or np.any(np.diff(step) <= 0):
        raise ReferenceDataError(f"{path}: the column step must hold ascending whole numbers")
    return ConvergedCurve(
        case=entry["case"],
        params=dict(entry["params"]),
        method=entry["method"],
        step=step,
        t=columns["t"],
        quantities={name: columns[name] for name in names},
        units=dict(entry["units"]),
        uncertainty={name: float(value) for name, value in entry["uncertainty"].items()},
        scalars={
            name: ConvergedScalar(
                value=float(scalar["value"]), unit=scalar["unit"], uncertainty=float(scalar["uncertainty"])
            )
            for name, scalar in entry.get("scalars", {}).items()
        },
    )


def _read_table(path: Path, names: list[str]) -> dict[str, FloatArray]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            if len(header) != len(names) or set(header) != set(names):
                raise ReferenceDataError(f"{path}: the columns are {header}; the index asks for {names}")
            rows = []
            for row in reader:
                try:
                    values = [float(cell) for cell in row]
                except ValueError as error:
                    raise ReferenceDataError(f"{path}, line {reader.line_num}: {error}") from None
                if len(values) != len(names) or not all(map(math.isfinite, values)):
                    raise ReferenceDataError(
                        f"{path}, line {reader.line_num}: {row} is not {len(names)} finite numbers"
                    )
                rows.append(values)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ReferenceDataError(f"{path}, named by {INDEX}, cannot be read: {error}") from error
    table = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    return {name: table[:, column].copy() for column, name in enumerate(header)}
