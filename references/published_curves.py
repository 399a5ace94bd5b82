"""Digitised curves of a user: a TOML file with the provenance beside a CSV file with the points."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._data import ReferenceDataError, check_keys, check_selector, read_toml, selects

FloatArray = NDArray[np.float64]
PUBLISHED_FOLDER = Path(__file__).parent / "published"
ABSCISSAE = ("step", "t")
NOT_A_CURVE = frozenset({"source.toml"})
_REQUIRED: dict[str, type] = {
    "case": str,
    "quantity": str,
    "abscissa": str,
    "unit": str,
    "uncertainty": float,
    "title": str,
    "source": str,
}
_OPTIONAL: dict[str, type] = {"params": dict, "file": str}


@dataclass(frozen=True, kw_only=True)
class PublishedCurve:
    """A curve read off a published figure.

    Parameters
    ----------
    case, quantity, unit : str
        Case, its quantity and the unit of ``y`` and ``uncertainty``.
    params : mapping
        Parameters of the variants that the curve belongs to; a list means any of its values.
    abscissa : {"step", "t"}
        Whether ``x`` holds step numbers (not necessarily whole) or times [s].
    x, y : ndarray, shape (n,)
        Points, x ascending.
    uncertainty : float
        Half-width of the reading error of y.
    title, source : str
        Name in legends; where the figure is published.
    """

    case: str
    quantity: str
    unit: str
    params: Mapping[str, Any] = field(default_factory=dict)
    abscissa: Literal["step", "t"]
    x: FloatArray
    y: FloatArray
    uncertainty: float
    title: str
    source: str

    def applies_to(self, case: str, params: Mapping[str, Any]) -> bool:
        """Whether the curve belongs to a variant."""
        return self.case == case and selects(self.params, params)

    def at(self, x: FloatArray) -> FloatArray:
        """Linear interpolation at steps or times; NaN outside the digitised range."""
        return np.interp(x, self.x, self.y, left=math.nan, right=math.nan)


def load_curves(folder: Path | str = PUBLISHED_FOLDER) -> list[PublishedCurve]:
    """Curves of every ``*.toml`` in a folder, in the order of the file names.

    ``name.toml`` has the keys case, quantity, abscissa ("step" or "t"), unit, uncertainty, title, source and, if
    wanted, params (a table) and file. Its CSV file is ``name.csv`` unless ``file`` names another: a header and two
    columns, abscissa and value.

    Parameters
    ----------
    folder : Path or str
        Where to look; sub-folders are not searched.

    Raises
    ------
    ReferenceDataError
        For a missing folder or file, a wrong key or type, or a CSV file that is not two ascending columns of numbers;
        the message names the file and the line.
    """
    base = Path(folder)
    if not base.is_dir():
        raise ReferenceDataError(
            f"{base} is no folder; give the folder that holds the TOML and CSV files of the curves"
        )
    return [_load(path) for path in sorted(base.glob("*.toml")) if path.name not in NOT_A_CURVE]


def _load(path: Path) -> PublishedCurve:
    data = dict(check_keys(read_toml(path), required=_REQUIRED, optional=_OPTIONAL, where=str(path)))
    if data["abscissa"] not in ABSCISSAE:
        raise ReferenceDataError(f"{path}: abscissa = {data['abscissa']!r} is unknown; use 'step' or 't' (seconds)")
    if data["uncertainty"] < 0:
        raise ReferenceDataError(f"{path}: uncertainty = {data['uncertainty']!r} must be >= 0")
    params = data.pop("params", {})
    check_selector(params, where=str(path))
    x, y = _read_points(path.with_name(data.pop("file", path.stem + ".csv")), path)
    return PublishedCurve(**{**data, "uncertainty": float(data["uncertainty"])}, params=params, x=x, y=y)


def _read_points(path: Path, owner: Path) -> tuple[FloatArray, FloatArray]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except FileNotFoundError:
        raise ReferenceDataError(f"{owner}: its points {path.name} do not exist beside it") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ReferenceDataError(f"{path} cannot be read as CSV: {error}") from error
    if len(rows) < 3:
        raise ReferenceDataError(f"{path}: a header and at least two points are needed, found {len(rows)} lines")
    if all(_number(cell) is not None for cell in rows[0][1]):
        raise ReferenceDataError(f"{path}, line {rows[0][0]}: the first line must be a header, not numbers")
    points = np.empty((len(rows) - 1, 2))
    for index, (line, row) in enumerate(rows[1:]):
        if len(row) != 2:
            raise ReferenceDataError(f"{path}, line {line}: {len(row)} columns; exactly two are needed")
        for column, cell in enumerate(row):
            value = _number(cell)
            if value is None:
                raise ReferenceDataError(f"{path}, line {line}: {cell!r} is not a finite number")
            points[index, column] = value
        if index and points[index, 0] <= points[index - 1, 0]:
            raise ReferenceDataError(
                f"{path}, line {line}: abscissa {points[index, 0]:g} does not exceed the one before, "
                f"{points[index - 1, 0]:g}; sort the points"
            )
    return points[:, 0].copy(), points[:, 1].copy()


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
