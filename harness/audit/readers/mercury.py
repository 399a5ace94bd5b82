"""MercuryDPM's text files: `.data`, bodies in rows behind a header for each time, and `.fstat`, contacts behind three lines of comment.

Source: MercuryDPM, Documentation/Pages/Analysing.dox; as written by Kernel/DPMBase.cc (outputXBallsData, writeFstatHeader),
Kernel/DPMBaseXBalls.icc and Kernel/Interactions/BaseInteraction.cc (writeToFStat).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import found_columns
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, numbers_of, open_file, sample_tokens
from ninedisk.harness.audit.readers.lines import BrokenRowsError, Lines, broken_rows
from ninedisk.harness.audit.readers.rounding import VARIED, Rounding, significant_digits

PLACES = {2: ("x", "y"), 3: ("x", "y", "z")}
REST = {
    2: ("vx", "vy", "radius", "rotation_z", "omegaz", "info"),
    3: ("vx", "vy", "vz", "radius", "alpha", "beta", "gamma", "omegax", "omegay", "omegaz", "info"),
}
"""Columns after the places, by dimension."""
ROWS = {d: (*PLACES[d], *REST[d]) for d in (2, 3)}
HEADS = {2: 6, 3: 8}
"""Words of a header: number of bodies, time, two corners of the domain."""
CONTACT = (
    "time",
    "i",
    "j",
    "cx",
    "cy",
    "cz",
    "delta",
    "deltat",
    "fn",
    "ft",
    "nx",
    "ny",
    "nz",
    *(f"tangent_{axis}" for axis in "xyz"),
)
MERCURY_CONTACTS = "MercuryDPM contacts"
SAME = 1e-6
"""Share by which forces may differ that are listed for both bodies of a contact."""
DIGITS = 10
"""Significant digits that MercuryDPM prints unless its user asks for others; of places it prints 15."""


def is_mercury_data(head: str, second: str) -> bool:
    """Whether the first two lines of a text are a header and a row, or two headers, of `.data`."""
    words = _numbers(head)
    d = next((d for d, size in HEADS.items() if size == len(words)), 0)
    if not d or words[0] < 0.0 or words[0] != round(words[0]):
        return False
    after = len(second.split())
    return after == len(ROWS[d]) if words[0] else after in (0, HEADS[d])


def is_mercury_contacts(head: str, second: str) -> bool:
    """Whether the first two lines of a text are those of `.fstat`."""
    return len(_comment(head)) == 2 and len(_comment(second)) == 6


def single_file(path: Path) -> str:
    """What to do with one of many files that MercuryDPM wrote, a frame each; empty: it is none by its name."""
    found = re.search(r"\.(data|fstat)\.\d+$", path.name)
    whole = path.name[: found.end(1)] if found else ""
    return f"{path} is one frame of MercuryDPM: join all, `cat $(ls -v {whole}.*) > {whole}`" if found else ""


def _numbers(line: str) -> list[float]:
    try:
        values = [float(word) for word in line.split()]
    except ValueError:
        return []
    return values if np.isfinite(values).all() else []


def _comment(line: str) -> list[float]:
    return _numbers(line[1:]) if line.startswith("#") else []


def read_mercury_data(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a `.data` file.

    Raises
    ------
    UsageError
        Naming file, frame, line and the way out; while frames are read, too.
    """
    with open_file(path) as stream:
        d = 2 if len(stream.readline().split()) == HEADS[2] else 3
    names = ROWS[d]
    found = found_columns(names, columns, path, needed)
    rounding = _roundings(path, d, found)
    species = _info_is_a_kind(path, names)
    if species and "type" not in found.values():
        found["info"] = "type"

    def frames(progress: Progress) -> Iterator[Frame]:
        yield from _frames(path, d, found, rounding, progress)

    remarks = ["MercuryDPM has no ids: rows are numbered from 0, as in its .fstat"]
    if d == 2:
        remarks.append("MercuryDPM writes spins in the plane with the other sign: turned back")
    remarks.append("not used: angles" + ("" if species else "; info, which is no number of a species"))
    kept = frozenset({*found.values(), "id"})
    return Trajectory(path, "MercuryDPM data", frames, rounding, "t", kept, tuple(remarks))


def _frames(
    path: Path, d: int, found: Mapping[str, str], rounding: Mapping[str, Rounding], progress: Progress
) -> Iterator[Frame]:
    names, size = ROWS[d], path.stat().st_size
    wanted = list(dict.fromkeys([*found, "radius"]))
    number, first = 0, None
    with Lines(path) as lines:
        while text := lines.readline():
            if not text.strip():
                continue
            number += 1
            begin, words = lines.number, _numbers(text)
            where = f"{path}, line {begin}, frame {number}"
            if len(words) != HEADS[d] or words[0] < 0.0 or words[0] != round(words[0]) or not text.endswith("\n"):
                raise UsageError(
                    f"{where}: {text.strip()[:60]!r} is no header, {HEADS[d]} numbers, N and t first: the frame before has more rows than "
                    "its header says, or the file is cut off or damaged; cut it before this line"
                )
            count = int(words[0])
            if count == 0 and first is None:
                continue  # nothing has been inserted yet
            if first is not None and count != len(first):
                raise UsageError(
                    f"{where}: {count} bodies, and {len(first)} in the first frame: MercuryDPM has no ids, and where a body is deleted the "
                    "last one takes its row; audit a stretch with the same bodies"
                )
            try:
                values = lines.rows(count, names, wanted)
            except BrokenRowsError as error:
                raise broken_rows(path, error, f"frame {number}", begin + 1, count) from error
            progress(lines.done >> 10, size >> 10, f"kB read, t = {words[1]:g}")
            radius = values["radius"].copy()
            if first is None:
                first = radius
            _check_radii(where, radius, first, rounding["radius"])
            if d == 2 and "omegaz" in values:
                values["omegaz"] = -values["omegaz"]
            part = {here: values[name] for name, here in found.items()} | {"id": np.arange(count, dtype=float)}
            corners = np.array(words[2:]).reshape(2, d)
            domain = np.diag(np.append(corners[1] - corners[0], np.zeros(3 - d)))
            yield Frame(number - 1, words[1], part, f"frame {number}, line {begin}", domain=domain)
            del values, part  # or two frames would be in memory


def _check_radii(where: str, radius: FloatArray, first: FloatArray, rule: Rounding) -> None:
    if (zero := np.flatnonzero(radius == 0.0)).size:
        raise UsageError(
            f"{where}: the radius of row {zero[0]} is 0, as of MercuryDPM's clumps: an audit takes no clumps"
        )
    with np.errstate(invalid="ignore"):
        other = np.flatnonzero(np.abs(radius - first) > 2.0 * rule.error(first))
    if other.size:
        k = int(other[0])
        raise UsageError(
            f"{where}: row {k} has the radius {radius[k]:g}, and {first[k]:g} in the first frame: MercuryDPM has no ids, and where a body "
            "is deleted the last one takes its row; audit a stretch with the same bodies"
        )


def _roundings(path: Path, d: int, found: Mapping[str, str]) -> dict[str, Rounding]:
    """Fifteen digits of places, the stream's own of all else: columns of few numbers show fewer than they have."""
    rules: dict[str, Rounding] = {}
    for names, least in ((PLACES[d], 15), (REST[d][:-1], DIGITS)):
        wanted = {name: name for name in names}
        seen = {token for each in sample_tokens(path, ROWS[d], None, wanted).values() for token in each.seen}
        digits = max((significant_digits(token) for token in seen), default=least)
        digits = digits if len(seen) >= VARIED else max(digits, least)
        rules |= {found[name]: Rounding(significant=digits) for name in names if name in found}
        rules["t"] = Rounding(significant=digits)
    return {"radius": rules["t"], **rules}


def _info_is_a_kind(path: Path, names: Sequence[str]) -> bool:
    tokens = sample_tokens(path, names, None, {"info": "info"})["info"].seen
    return all(float(token) == round(float(token)) >= 0 for token in tokens)


def read_mercury_contacts(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a `.fstat` file: each contact once, its normal from the partner to body i, of walls as well.

    Raises
    ------
    UsageError
        Naming file, frame, line and the way out; while frames are read, too.
    """
    if "x" in needed:
        raise UsageError(
            f'{path} holds contacts of MercuryDPM: give its .data, and this file by [contacts] file = "{path.name}"'
        )
    aliases = {"fs": "ft"} if "fs" not in columns else {}
    found = found_columns(CONTACT, {**aliases, **columns}, path, needed)
    tokens = sample_tokens(path, CONTACT, None, {name: name for name in ("fn", "ft")})
    seen = {token for each in tokens.values() for token in each.seen}
    digits = max((significant_digits(token) for token in seen), default=DIGITS)
    rule = Rounding(significant=digits if len(seen) >= VARIED else max(digits, DIGITS))

    def frames(progress: Progress) -> Iterator[Frame]:
        size, done = path.stat().st_size, 0
        for number, (line, head, rows) in enumerate(_blocks(path), 1):
            done += sum(map(len, rows))
            progress(done >> 10, size >> 10, f"kB of contacts read, t = {head[0]:g}")
            where = f"{path}, line {line}, frame {number}"
            values = (
                numbers_of(rows, CONTACT, None, path, line + 3) if rows else {name: np.empty(0) for name in CONTACT}
            )
            if (odd := np.flatnonzero(values["time"] != head[0])).size:
                k = int(odd[0])
                raise UsageError(
                    f"{path}, line {line + 3 + k}, frame {number}: a contact of t = {values['time'][k]:.10g} behind the header of "
                    f"t = {head[0]:.10g}: the file is damaged"
                )
            kept = _once(values, where)
            values = {name: column[kept] for name, column in values.items()}
            wall = values["j"] < 0.0
            for axis in "xyz":
                values[f"n{axis}"] = np.where(wall, -values[f"n{axis}"], values[f"n{axis}"])
            part = {here: values[name] for name, here in found.items() if here != "t"}
            yield Frame(number - 1, head[0], part, f"frame {number}, line {line}")

    names = frozenset(found.values())
    return Trajectory(path, MERCURY_CONTACTS, frames, dict.fromkeys(found.values(), rule), "t", names)


def _blocks(path: Path) -> Iterator[tuple[int, list[float], list[str]]]:
    """Line of the header, its numbers, and rows of contacts, of each frame."""
    with open_file(path) as stream:
        line, text = 1, stream.readline()
        while text:
            begin = line
            heads: list[list[float]] = []
            for length in (2, 6, 6):
                # Where there are no bodies, the third line has nan for their radii.
                heads.append(_comment(text.replace("nan", "0") if len(heads) == 2 else text))
                if len(heads[-1]) != length:
                    raise UsageError(
                        f"{path}, line {line}: {text.strip()[:60]!r} is not line {len(heads)} of a frame's head, '#' and {length} numbers: "
                        "cut off or damaged"
                    )
                line, text = line + 1, stream.readline()
            rows = []
            while text and not text.startswith("#"):
                if not text.endswith("\n"):
                    raise UsageError(f"{path}, line {line}: the last line has no end: cut off; cut the file before it")
                rows.append(text)
                line, text = line + 1, stream.readline()
            yield begin, heads[0], rows


def _once(values: Mapping[str, FloatArray], where: str) -> NDArray[np.int64]:
    """Rows without the second one of two bodies, which repeats the first with a turned normal."""
    i, j = values["i"], values["j"]
    both = np.flatnonzero(j >= 0.0)
    low, high = np.minimum(i, j)[both], np.maximum(i, j)[both]
    turned = (i > j)[both]
    rank = np.zeros(len(both), dtype=np.int64)
    order = np.lexsort((both, turned, low, high))
    a, b = order[1:], order[:-1]
    same = (low[a] == low[b]) & (high[a] == high[b]) & (turned[a] == turned[b])
    for at in np.flatnonzero(same).tolist():  # two bodies that touch twice
        rank[order[at + 1]] = rank[order[at]] + 1
    order = np.lexsort((both, rank, low, high))
    a, b = order[1:], order[:-1]
    again = (low[a] == low[b]) & (high[a] == high[b]) & (rank[a] == rank[b])
    second, first = both[a[again]], both[b[again]]
    # Across a periodic edge each of the two is computed for itself: 6e-13 apart in MercuryDPM's own chute_periodic.fstat.
    size = SAME * (np.abs(values["fn"][first]) + values["ft"][first])
    wrong = np.zeros(len(second), dtype=bool)
    for name in ("fn", "ft"):
        wrong |= ~(np.abs(values[name][second] - values[name][first]) <= size)
    if wrong.any():
        k, other = int(second[wrong][0]), int(first[wrong][0])
        raise UsageError(
            f"{where}: the contact of {i[k]:.0f} and {j[k]:.0f} is listed twice, with fn {values['fn'][other]:g} and "
            f"{values['fn'][k]:g}, ft {values['ft'][other]:g} and {values['ft'][k]:g}: the file is damaged"
        )
    return np.delete(np.arange(len(i)), second)
