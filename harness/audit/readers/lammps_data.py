"""Data files of LAMMPS (`write_data`): radii and masses of spheres by their ids, for dumps that have none."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import numbers_of, open_file
from ninedisk.harness.audit.readers.lammps import MIXED_UNITS
from ninedisk.harness.audit.readers.rounding import Tokens, roundings_of

PLACE = ("x", "y", "z")
STYLES: dict[str, tuple[str, ...]] = {
    "sphere": ("id", "type", "diameter", "density", *PLACE), "granular": ("id", "type", "diameter", "density", *PLACE),
    "bpm/sphere": ("id", "molecule", "type", "diameter", "density", *PLACE),
}  # fmt: skip
"""Styles with radii, and their columns."""
PARTS: dict[str, tuple[str, ...]] = {
    "sphere": ("diameter", "density"), "granular": ("diameter", "density"), "bpm/sphere": ("molecule", "diameter", "density"), "atomic": (),
    "charge": ("q",), "dipole": ("q", "mux", "muy", "muz"), "bond": ("molecule",), "angle": ("molecule",), "molecular": ("molecule",),
    "full": ("molecule", "q"), "ellipsoid": ("ellipsoidflag", "density"),
}  # fmt: skip
"""What a part of a hybrid style adds behind ``id type x y z``; no column twice."""
IMAGES = ("ix", "iy", "iz")


@dataclass(frozen=True)
class BodyData:
    """Radii [length] and masses of bodies by ids, which grow, and how far each may be from the number meant."""

    id: NDArray[np.int64]
    radius: FloatArray
    mass: FloatArray
    radius_error: FloatArray
    mass_error: FloatArray


def read_data_file(path: Path, style: str | None = None) -> BodyData:
    """Read the section Atoms; a density is that of a sphere, in the plane as well.

    Parameters
    ----------
    path : Path
    style : str, optional
        The atom style; needed where the section does not name it, or names it ``hybrid``.

    Raises
    ------
    UsageError
        Naming file, line and the way out.
    """
    with open_file(path) as stream:
        lines = stream.readlines()
    units = re.search(r"units = (\w+)", lines[0] if lines else "")
    if units and units[1] in MIXED_UNITS:
        raise UsageError(
            f"{path}, line 1: units {units[1]} mix {MIXED_UNITS[units[1]]}: an audit needs units that fit together"
        )
    at = [k for k, line in enumerate(lines) if line.split("#")[0].strip() == "Atoms"]
    count = next(
        (int(found[1]) for line in lines[: at[0] if at else 0] if (found := re.match(r"\s*(\d+)\s+atoms\b", line))),
        None,
    )
    if len(at) != 1 or count is None:
        lacking = "one section 'Atoms'" if len(at) != 1 else "'N atoms' before 'Atoms'"
        raise UsageError(f"{path} is no data file of LAMMPS: it has not {lacking}; write one by `write_data`")
    names = _columns(path, at[0] + 1, lines[at[0]].partition("#")[2].split(), style)
    first = at[0] + 2
    rows = lines[first : first + count]
    if len(rows) < count or not all(row.strip() for row in rows) or (rows and not rows[-1].endswith("\n")):
        have = next((k for k, row in enumerate(rows) if not row.strip()), len(rows))
        raise UsageError(
            f"{path}, line {first + have}: the section Atoms ends within or before row {have + 1} of {count}: cut off"
        )
    after = lines[first + count : first + count + 1]
    if lines[at[0] + 1].strip() or (after and after[0].strip()):
        raise UsageError(
            f"{path}, line {first + count + 1}: the section Atoms has more than its {count} rows, or no blank lines around it"
        )
    rows = [row.partition("#")[0] + "\n" for row in rows]
    if rows and len(rows[0].split()) == len(names) + 3:
        names = [*names, *IMAGES]
    values = numbers_of(rows, names, None, path, first + 1)
    return _bodies(path, first + 1, names, rows, values)


def _columns(path: Path, line: int, written: Sequence[str], given: str | None) -> list[str]:
    """Names of the columns of a style, without images."""
    words = given.split() if given else list(written)
    where = f"{path}, line {line}"
    if not words:
        raise UsageError(
            f'{where}: the style of the atoms is not named: give [data] style = "sphere", or what atom_style says'
        )
    if given and written and words[0] != written[0]:
        raise UsageError(f"{where}: the file has the style {written[0]!r}, and [data] style is {given!r}")
    if words[0] != "hybrid":
        if (len(words) > 1 and not words[1].isdigit()) or words[0] not in STYLES:
            raise UsageError(
                f"{where}: style {' '.join(words)!r} has no radii that are known here: {', '.join(STYLES)} or hybrid have"
            )
        return list(STYLES[words[0]])
    parts = [word for word in words[1:] if not word.isdigit()]
    if not parts:
        raise UsageError(
            f"{where}: LAMMPS writes 'hybrid' alone, and the order of columns is that of its parts: give [data] style as atom_style says, "
            'e.g. "hybrid sphere bond"'
        )
    if unknown := [word for word in parts if word not in PARTS]:
        raise UsageError(
            f"{where}: part {unknown[0]!r} of a hybrid style is not known here: known are {', '.join(PARTS)}"
        )
    names = list(dict.fromkeys(["id", "type", *PLACE, *(name for part in parts for name in PARTS[part])]))
    if "diameter" not in names:
        raise UsageError(f"{where}: style {' '.join(words)!r} has no radii: one of its parts must be sphere")
    return names


def _bodies(
    path: Path, first: int, names: Sequence[str], rows: Sequence[str], values: dict[str, FloatArray]
) -> BodyData:
    for name, words, least in (
        ("id", "a whole number > 0", 1.0),
        ("diameter", "a number > 0", 0.0),
        ("density", "a number > 0", 0.0),
    ):
        column = values[name]
        wrong = ~(np.isfinite(column) & (column >= least) & (column > 0.0))
        wrong |= (column != np.round(column)) if name == "id" else False
        if wrong.any():
            k = int(np.flatnonzero(wrong)[0])
            raise UsageError(
                f"{path}, line {first + k}: the {name} is {column[k]:g}; it must be {words} (columns read: {' '.join(names)})"
            )
    for name in ("molecule", *IMAGES):
        if name in values and (odd := np.flatnonzero(values[name] != np.round(values[name]))).size:
            raise UsageError(
                f"{path}, line {first + odd[0]}: {name} is {values[name][odd[0]]:g}, no whole number: columns are not {' '.join(names)}; "
                "check [data] style"
            )
    ids = values["id"].astype(np.int64)
    order = np.argsort(ids, kind="stable")
    if (twice := np.flatnonzero(np.diff(ids[order]) == 0)).size:
        k = int(order[twice[0] + 1])
        raise UsageError(f"{path}, line {first + k}: the id {ids[k]} appears twice")
    tokens = {name: Tokens() for name in ("diameter", "density")}
    for row in rows[:1000]:
        words_of_row = row.split()
        for name, each in tokens.items():
            each.seen.add(words_of_row[names.index(name)])
    rules = roundings_of(tokens)
    # write_data prints all digits, and few numbers of few digits show none.
    size, density = values["diameter"][order], values["density"][order]
    volume = np.pi / 6.0 * size**3
    exact = {name: len(each.seen) < 20 for name, each in tokens.items()}
    ed, ep = (
        np.ldexp(np.abs(column), -53) if exact[name] else rules[name].error(column)
        for name, column in (("diameter", size), ("density", density))
    )
    return BodyData(ids[order], 0.5 * size, density * volume, 0.5 * ed, volume * (ep + 3.0 * density * ed / size))
