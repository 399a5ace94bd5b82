"""Text dumps of LAMMPS and LIGGGHTS, `dump custom` and `dump local`: one frame in memory, columns in any order, boxes of any shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import (
    Frame,
    Progress,
    Trajectory,
    column_names,
    halved,
    halved_rounding,
    open_file,
    require,
    sample_roundings,
)
from ninedisk.harness.audit.readers.lines import BrokenRowsError, Lines, broken_rows
from ninedisk.harness.audit.readers.rounding import Rounding

MIXED_UNITS = {
    "real": "kcal/mol, Angstrom and fs", "metal": "eV, Angstrom and ps", "electron": "Hartree, Bohr and fs"
}  # fmt: skip
"""Styles whose units of mass, length and time do not make that of energy or force."""
HEAD = 400
"""Lines in which the first frame's columns must appear."""


class Box:
    """The box of one frame: origin and edges (rows), and along which of them everything repeats."""

    def __init__(self, head: str, rows: Sequence[str], where: str) -> None:
        words = head.split()[3:]
        self.repeats = [word == "pp" for word in words[-3:]] if len(words) >= 3 else [False] * 3
        try:
            table = [[float(word) for word in row.split()] for row in rows]
        except ValueError as error:
            raise UsageError(f"{where}: the bounds of the box should be numbers ({error})") from error
        width = {len(row) for row in table}
        if len(table) < 3 or width not in ({2}, {3}, {4}) or not np.isfinite(table).all():
            raise UsageError(f"{where}: expected three lines of two or three numbers, the bounds of the box")
        bounds = np.array(table)
        if width == {4}:
            self.edges, self.origin = bounds[:, :3], bounds[:, 3]
            return
        low, high = bounds[:, 0].copy(), bounds[:, 1].copy()
        self.edges = np.zeros((3, 3))
        if width == {3}:
            # A dump has the bounds of the box that encloses the oblique one.
            xy, xz, yz = bounds[:, 2]
            low[0] -= min(0.0, xy, xz, xy + xz)
            high[0] -= max(0.0, xy, xz, xy + xz)
            low[1] -= min(0.0, yz)
            high[1] -= max(0.0, yz)
            self.edges[1, 0], self.edges[2, 0], self.edges[2, 1] = xy, xz, yz
        self.origin = low
        self.edges[np.diag_indices(3)] = high - low

    def cell(self) -> FloatArray:
        """Edges, NaN where nothing repeats."""
        return np.where(np.array(self.repeats)[:, None], self.edges, np.nan)


class DumpColumns:
    """What the head of a dump shows: columns, units, whether times are printed."""

    def __init__(self, path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> None:
        self.path = path
        self.names: list[str] = []
        self.units = ""
        self.timed = False
        self.read_head()
        if self.units in MIXED_UNITS:
            raise UsageError(
                f"{path}: units {self.units} mix {MIXED_UNITS[self.units]}: an audit needs units that fit together: si, cgs, micro, nano "
                "or lj"
            )
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise UsageError(f"{path}: the column {twice!r} appears twice: dump each once")
        self.scaled = self._scaled(columns)
        self.found = column_names([name for name in self.names if name not in self.scaled], columns, path)
        for axis in "xyz":
            # What goes on across an edge says more than what is put back into the box.
            if axis not in columns and f"{axis}u" in self.names and self.found.get(axis) == axis:
                del self.found[axis]
                self.found[f"{axis}u"] = axis
        if "x" in needed:
            known = {**self.found, **self.scaled}
            require(known, self.names, path, needed)
        else:
            require(self.found, self.names, path, needed)

    def read_head(self) -> None:
        """Names of columns, units and whether there are times, of the first frame."""
        with open_file(self.path) as stream:
            for line in islice(stream, HEAD):
                if line.startswith("ITEM: UNITS"):
                    self.units = next(stream, "").strip()
                elif line.startswith("ITEM: TIME") and not line.startswith("ITEM: TIMESTEP"):
                    self.timed = True
                elif line.startswith(("ITEM: ATOMS", "ITEM: ENTRIES")):
                    self.names = line.split()[2:]
                    break
        if not self.names:
            raise UsageError(
                f"{self.path}: no line 'ITEM: ATOMS ...' among the first {HEAD}: this is no text dump of LAMMPS (`dump custom`), or its "
                "first frame is cut off"
            )

    def _scaled(self, columns: Mapping[str, str]) -> dict[str, str]:
        """Columns that are fractions of the box -> axis, where no other has the place."""
        found = {}
        for axis in "xyz":
            if axis in columns or axis in self.names or f"{axis}u" in self.names:
                continue
            if name := next((name for name in (f"{axis}su", f"{axis}s") if name in self.names), None):
                found[name] = axis
        return found

    def rounding(self) -> dict[str, Rounding]:
        """Roundings of the columns, and of fractions of the box as ``scaled x``."""
        wanted = dict(self.found) | {name: f"scaled {axis}" for name, axis in self.scaled.items()}
        return self.sample(wanted)

    def sample(self, wanted: Mapping[str, str]) -> dict[str, Rounding]:
        """Roundings by printed numbers."""
        return sample_roundings(self.path, self.names, None, wanted)


def read_dump(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a text dump.

    Raises
    ------
    UsageError
        Naming file, line, frame and the way out; while frames are read, too.
    """
    return opened_dump(DumpColumns(path, columns, needed), _frames, "LAMMPS dump")


def opened_dump(
    dump: DumpColumns, frames_of: Callable[[DumpColumns, Progress, bool], Iterator[Frame]], form: str
) -> Trajectory:
    """The trajectory of a dump whose frames ``frames_of`` reads; its last argument asks for all edges of the box."""
    rules = dump.rounding()
    shares = {axis: rules.pop(f"scaled {axis}") for axis in dump.scaled.values()}

    def frames(progress: Progress) -> Iterator[Frame]:
        yield from frames_of(dump, progress, False)

    rounding = halved_rounding(rules)
    if shares:
        box = next((frame.cell for frame in frames_of(dump, lambda *_: None, True)), None)
        edges = np.zeros((3, 3)) if box is None else np.nan_to_num(box)
        error = {axis: float(rule.error(np.array([1.0]))[0]) for axis, rule in shares.items()}
        for k, axis in enumerate("xyz"):
            if axis in dump.scaled.values():
                size = sum(error.get(other, 0.0) * abs(edges[row, k]) for row, other in enumerate("xyz"))
                rounding[axis] = replace(Rounding(), absolute=size)
    names = {*dump.found.values(), *dump.scaled.values()}
    remarks = []
    if "diameter" in names:
        names = names - {"diameter"} | {"radius"}
        remarks.append("radius is half of the column diameter")
    if dump.scaled:
        remarks.append(f"{', '.join(dump.scaled)} are fractions of the box, turned into lengths")
    if dump.units and dump.units != "si":
        remarks.append(f"numbers are in units {dump.units} of LAMMPS: write the TOML in the same")
    return Trajectory(
        dump.path, form, frames, rounding, "t" if dump.timed else "step", frozenset(names), tuple(remarks)
    )


def _frames(dump: DumpColumns, progress: Progress, boxes: bool) -> Iterator[Frame]:
    """Frames one after the other; ``boxes``: their edges instead of the periodic ones."""
    path, names = dump.path, dump.names
    size = path.stat().st_size
    wanted = [*dump.found, *dump.scaled]
    number = 0
    step: int | None = None
    count: int | None = None
    t = np.nan
    box: Box | None = None
    with Lines(path) as lines:

        def one() -> str:
            text = lines.readline()
            if not text:
                raise UsageError(
                    f"{path}, line {lines.number + 1}: the file ends within the head of frame {number + 1}: cut off; cut the file before "
                    "that frame"
                )
            return text

        def whole(what: str) -> int:
            text = one().strip()
            try:
                value = float(text)
                if value == int(value):
                    return int(value)
            except (ValueError, OverflowError):
                pass
            raise UsageError(
                f"{path}, line {lines.number}, frame {number + 1}: {text[:40]!r} is no {what}, a whole number"
            )

        while text := lines.readline():
            line = lines.number
            if text.startswith("ITEM: TIMESTEP"):
                step = whole("step")
            elif text.startswith("ITEM: TIME"):
                given = one().strip()
                try:
                    t = float(given)
                except ValueError as error:
                    raise UsageError(
                        f"{path}, line {line + 1}, frame {number + 1}: {given[:40]!r} is no time"
                    ) from error
            elif text.startswith("ITEM: NUMBER OF"):
                count = whole("number of rows")
                if count < 0:
                    raise UsageError(f"{path}, line {line + 1}, frame {number + 1}: {count} rows: it must be >= 0")
            elif text.startswith("ITEM: BOX BOUNDS"):
                head, where = text, f"{path}, line {line + 1}, frame {number + 1}"
                box = Box(head, [one() for _ in range(3)], where)
            elif text.startswith("ITEM: UNITS"):
                one()
            elif text.startswith(("ITEM: ATOMS", "ITEM: ENTRIES")):
                if text.split()[2:] != names:
                    raise UsageError(
                        f"{path}, line {line}, frame {number + 1}: columns {' '.join(text.split()[2:])}, expected {' '.join(names)}"
                    )
                if count is None or step is None:
                    lacking = "NUMBER OF ..." if count is None else "TIMESTEP"
                    raise UsageError(
                        f"{path}, line {line}, frame {number + 1}: rows without 'ITEM: {lacking}' before them: the frame's head is cut off"
                    )
                begin = line + 1
                try:
                    values = lines.rows(count, names, wanted)
                except BrokenRowsError as error:
                    raise broken_rows(path, error, f"frame {number + 1} (step {step})", begin, count) from error
                progress(lines.done >> 10, size >> 10, f"kB read, step {step}")
                number += 1
                found = {here: values[name] for name, here in dump.found.items()}
                place = f"frame {number}, line {begin}"
                if dump.scaled:
                    if box is None:
                        raise UsageError(f"{path}, {place}: fractions of a box, and no 'ITEM: BOX BOUNDS' before them")
                    found |= lengths_of_shares(dump, values, box)
                cell = None if box is None else box.edges if boxes else box.cell()
                yield Frame(step, t, halved(found), place, cell)
                del values, found  # or two frames would be in memory
                step, count, t, box = None, None, np.nan, None
            elif text.startswith("ITEM:"):
                raise UsageError(f"{path}, line {line}: {text.strip()[:60]!r} is no item that is known here")
            elif text.strip():
                raise UsageError(
                    f"{path}, line {line}: {text.strip()[:60]!r} where 'ITEM: ...' should stand: frame {number + 1} has more rows than its "
                    "'ITEM: NUMBER OF' says, or the file is damaged there; cut it before this line"
                )
    if count is not None or step is not None:
        raise UsageError(
            f"{path}, line {lines.number}: the file ends within the head of frame {number + 1}: cut off; cut the file before that frame"
        )


def lengths_of_shares(dump: DumpColumns, values: Mapping[str, FloatArray], box: Box) -> dict[str, FloatArray]:
    """Places out of fractions of the box, of the axes that are given so."""
    share = {axis: values[name] for name, axis in dump.scaled.items()}
    found = {}
    for k, axis in enumerate("xyz"):
        if axis in share:
            found[axis] = box.origin[k] + sum(
                share[other] * box.edges[row, k] for row, other in enumerate("xyz") if other in share
            )
    return found
