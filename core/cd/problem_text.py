"""Siconos' text files of contact problems in 2D and 3D: what they say, and the same text again.

``fc2d`` and ``fc3d`` files hold ``u = W r + q`` (reduced), ``gfc2d`` and ``gfc3d`` files ``M v = q + H r, u = H' v + b`` (of bodies)::

    dimension (2 or 3), contacts, [matrix], [matrix], q, [b,] mu

A matrix begins with its storage: 0 dense by columns, 1 sparse blocks, 2 sparse as CSparse prints it, to six digits. What comes after mu
Siconos does not read; there the forces and velocities of a solution stand, in their own lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError

DENSE, BLOCKS, SPARSE = 0, 1, 2
TRIPLET, COLUMNS, ROWS = 1, 2, 3
"""Where a sparse matrix of Siconos comes from."""
MOST = 20_000
"""Rows of a dense matrix, at most: 3 GB."""
_COMPRESSED = re.compile(r"(csr: )?(\d+)-by-(\d+), nzmax: (\d+) nnz: (\d+), 1-norm: (\S+)")
_CUT = re.compile(r"[\d.][eE][+-]?\d?\Z")
"""A last number whose exponent has less than the two figures that are always printed, without an end of line."""
_TRIPLETS = re.compile(r"triplet: (\d+)-by-(\d+), nzmax: (\d+) nnz: (\d+)")


@dataclass(frozen=True)
class TextMatrix:
    """A matrix as a file stores it: its lines but for the numbers of entries can be distinguished from these.

    Attributes
    ----------
    storage : {0, 1, 2}
    matrix : csr_array
        What it is, whatever the storage.
    body : tuple
        Dense: the array. Blocks: row and column ends, pointers, columns, values of each block. Sparse: origin, version line, nzmax, norm,
        and triplets or pointers, indices, with their values, in the file's order.
    """

    storage: int
    matrix: sp.csr_array
    body: tuple[Any, ...]


@dataclass(frozen=True)
class TextProblem:
    """Numbers of a file of dimension d; ``h`` and ``b`` are None in a reduced problem, ``r`` and ``u``, shape (d c,), where it has no
    solution. ``flag`` is the single figure that some releases print after mu and none reads.
    """

    dimension: int
    m: TextMatrix
    h: TextMatrix | None
    q: FloatArray
    b: FloatArray | None
    mu: FloatArray
    flag: str | None = None
    r: FloatArray | None = None
    u: FloatArray | None = None


class _Lines:
    """The lines of a text one by one; every mistake names its line."""

    def __init__(self, text: str) -> None:
        self._lines, self.at = text.splitlines(), 0

    @property
    def ended(self) -> bool:
        return not any(line.strip() for line in self._lines[self.at :])

    def next(self, what: str) -> str:
        while self.at < len(self._lines):
            self.at += 1
            if self._lines[self.at - 1].strip():
                return self._lines[self.at - 1]
        raise InvalidSceneError(f"it ends after line {self.at}, where {what} must be")

    def flag(self) -> str | None:
        """A line of one figure without a point, if it comes next."""
        rest = (line.strip() for line in self._lines[self.at :])
        following = next((line for line in rest if line), "")
        if not re.fullmatch(r"\d", following):
            return None
        self.next("a flag")
        return following

    def wrong(self, what: str) -> InvalidSceneError:
        line = self._lines[self.at - 1] if 0 < self.at <= len(self._lines) else ""
        return InvalidSceneError(f"line {self.at} must be {what}, not {line.strip()[:80]!r}")

    def whole(self, what: str, low: int = 0, high: int = 2**31 - 1) -> int:
        line = self.next(what).strip()
        if not (line.isascii() and line.isdigit() and len(line) < 12 and low <= int(line) <= high):
            raise self.wrong(f"{what}, a whole number {low} .. {high}")
        return int(line)

    def wholes(self, what: str, count: int) -> list[int]:
        """``count`` whole numbers, over as many lines as they take."""
        words: list[str] = []
        while len(words) < count:
            words += self.next(what).split()
        if len(words) != count or not all(w.isascii() and w.isdigit() and len(w) < 12 for w in words):
            raise self.wrong(f"{what}, {count} whole numbers")
        return [int(w) for w in words]

    def numbers(self, what: str, count: int) -> FloatArray:
        """``count`` numbers, over as many lines as they take."""
        found: list[float] = []
        while len(found) < count:
            words = self.next(what).split()
            try:
                found += [float(word) for word in words]
                if "_" in "".join(words):
                    raise ValueError
            except ValueError:
                raise self.wrong(f"{what}, {count} numbers") from None
        if len(found) != count:
            raise InvalidSceneError(f"{what} has {len(found)} numbers up to line {self.at}; it must have {count}")
        return np.array(found)


def parse(text: str) -> TextProblem:
    """The problem of a text.

    Raises
    ------
    InvalidSceneError
        Naming the line that is wrong, and what it must be.
    """
    if _CUT.search(text):
        raise InvalidSceneError(f"it ends inside a number, {text.split()[-1]!r}: the end of the file is missing")
    lines = _Lines(text)
    dimension = lines.whole("the dimension", 2, 3)
    c = lines.whole("the number of contacts")
    m = _read_matrix(lines, "M")
    n = m.matrix.shape[0]
    if m.matrix.shape != (n, n):
        raise InvalidSceneError(f"M has shape {m.matrix.shape}; it must be square")
    h = None
    at = lines.at
    following = [] if lines.ended else lines.next("q").split()
    lines.at = at
    if len(following) == 1 and following[0].isdigit():  # a storage; numbers of a vector are printed with points
        h = _read_matrix(lines, "H")
    if (n if h is None else h.matrix.shape[1]) != dimension * c or (h is not None and h.matrix.shape[0] != n):
        shape = m.matrix.shape if h is None else h.matrix.shape
        raise InvalidSceneError(f"a matrix of shape {shape} does not go with {c} contacts and {n} unknowns")
    b = None
    if h is None:
        q = lines.numbers("q", n)
    else:  # some releases print both vectors in one line
        q, b = np.split(lines.numbers("q and b", n + dimension * c), [n])
    mu = lines.numbers("mu", c)
    flag = lines.flag()
    r = u = None
    if not lines.ended:
        r, u = (lines.numbers(name, dimension * c) for name in ("r", "u"))
        if not lines.ended:
            lines.next("")
            raise lines.wrong("the end")
    return TextProblem(dimension, m, h, q, b, mu, flag, r, u)


def text_of(problem: TextProblem) -> str:
    """The problem as Siconos prints it, and its solution, if it has one."""
    lines = [str(problem.dimension), str(len(problem.mu)), *_matrix_lines(problem.m)]
    if problem.h is not None:
        lines += _matrix_lines(problem.h)
    given, found = (problem.q, problem.b, problem.mu), (problem.r, problem.u)
    lines += [_line(vector) for vector in given if vector is not None]
    if problem.flag is not None:
        lines.append(problem.flag)
    return "\n".join([*lines, *(_line(vector) for vector in found if vector is not None), ""])


def reduced_text(w: sp.csr_array, q: FloatArray, mu: FloatArray) -> TextProblem:
    """A problem in the storage that loses no digit and skips zeros, blocks."""
    c = len(mu)
    if not c:
        return TextProblem(2, TextMatrix(DENSE, sp.csr_array((0, 0)), (np.zeros((0, 0)),)), None, q.ravel(), None, mu)
    dimension = w.shape[0] // c
    blocks = sp.bsr_array(w, blocksize=(dimension, dimension))
    blocks.sort_indices()
    ends = [dimension * (k + 1) for k in range(c)]
    body = (ends, ends, blocks.indptr.tolist(), blocks.indices.tolist(), [block.T.ravel() for block in blocks.data])
    return TextProblem(dimension, TextMatrix(BLOCKS, w, body), None, q.ravel(), None, mu)


def _line(values: NDArray[np.float64]) -> str:
    return "".join(f"{value:32.24e} " for value in values.tolist())


def _read_matrix(lines: _Lines, name: str) -> TextMatrix:
    storage = lines.whole(f"the storage of {name}", DENSE, SPARSE)
    rows, columns = lines.whole(f"the rows of {name}"), lines.whole(f"the columns of {name}")
    read = (_read_dense, _read_blocks, _read_sparse)[storage]
    matrix, body = read(lines, name, (rows, columns))
    return TextMatrix(storage, matrix, body)


def _matrix_lines(text: TextMatrix) -> list[str]:
    lines = [str(text.storage), *(str(size) for size in text.matrix.shape)]
    return lines + (_dense_lines, _block_lines, _sparse_lines)[text.storage](*text.body)


def _read_dense(lines: _Lines, name: str, shape: tuple[int, int]) -> tuple[sp.csr_array, tuple[Any, ...]]:
    if tuple(lines.wholes(f"the sizes of {name}", 2)) != shape or max(shape) > MOST:
        raise lines.wrong(f"the sizes of {name} again, {shape[0]} and {shape[1]}, at most {MOST}")
    size = shape[0] * shape[1]
    values = lines.numbers(name, size) if size else np.zeros(0)
    dense = values.reshape(shape, order="F")
    return sp.csr_array(dense), (dense,)


def _dense_lines(dense: FloatArray) -> list[str]:
    rows = dense.ravel(order="F").reshape(dense.shape)
    return [f"{dense.shape[0]}\t{dense.shape[1]}", *(_line(row) for row in rows if dense.size)]


def _read_blocks(lines: _Lines, name: str, shape: tuple[int, int]) -> tuple[sp.csr_array, tuple[Any, ...]]:
    count = lines.whole(f"the blocks of {name}", 1)
    high, wide = lines.whole(f"the block rows of {name}", 1), lines.whole(f"the block columns of {name}", 1)
    ends = [lines.wholes(f"ends of blocks of {name}", each) for each in (high, wide)]
    filled = lines.whole(f"the pointers of {name}", 1), lines.whole(f"the blocks of {name}", count, count)
    pointers = lines.wholes(f"pointers of {name}", filled[0])
    columns = lines.wholes(f"columns of {name}", filled[1])
    sizes = [np.diff([0, *each]) for each in ends]
    steps = np.diff(pointers)
    if (
        (ends[0][-1], ends[1][-1]) != shape
        or min(each.min() for each in sizes) < 1
        or (filled[0], pointers[0], pointers[-1]) != (high + 1, 0, count)
        or steps.min() < 0
        or max(columns) >= wide
    ):
        raise lines.wrong(f"blocks of {name} that fit into {shape[0]} x {shape[1]}")
    row_of = np.repeat(np.arange(high), steps)
    blocks, at = [], []
    for k, (row, column) in enumerate(zip(row_of.tolist(), columns, strict=True)):
        if lines.whole(f"the number of a block of {name}") != k:
            raise lines.wrong(f"the number of the block, {k}")
        tall, broad = int(sizes[0][row]), int(sizes[1][column])
        blocks.append(lines.numbers(f"block {k} of {name}", tall * broad))
        i, j = np.meshgrid(np.arange(tall), np.arange(broad))
        at.append((ends[0][row] - tall + i.ravel(), ends[1][column] - broad + j.ravel()))
    rows, places = (np.concatenate([each[side] for each in at]) for side in (0, 1))
    return sp.csr_array((np.concatenate(blocks), (rows, places)), shape=shape), (*ends, pointers, columns, blocks)


def _block_lines(
    high: list[int], wide: list[int], pointers: list[int], columns: list[int], blocks: list[FloatArray]
) -> list[str]:
    def tabbed(values: list[int]) -> str:
        return "".join(f"{value}\t" for value in values)

    lines = [str(len(blocks)), str(len(high)), str(len(wide)), tabbed(high), tabbed(wide)]
    lines += [str(len(pointers)), str(len(columns)), tabbed(pointers), tabbed(columns)]
    for k, block in enumerate(blocks):
        lines += [str(k), *(f"{value:32.24e}" for value in block.tolist())]
    return lines


def _read_sparse(lines: _Lines, name: str, shape: tuple[int, int]) -> tuple[sp.csr_array, tuple[Any, ...]]:
    origin = lines.whole(f"the origin of {name}", TRIPLET, ROWS)
    version = lines.next("the version of CSparse")
    head = lines.next(f"the sizes of {name}")
    found = (_TRIPLETS if origin == TRIPLET else _COMPRESSED).fullmatch(head)
    if found is None or (origin != TRIPLET and (found[1] is not None) != (origin == ROWS)):
        raise lines.wrong(f"the head of {name} as CSparse prints it")
    words = found.groups() if origin == TRIPLET else found.groups()[1:]
    if any(len(word) > 11 for word in words[:4]) or (int(words[0]), int(words[1])) != shape:
        raise lines.wrong(f"the sizes of {name}, {shape[0]}-by-{shape[1]}")
    nnz, norm = int(words[3]), None if origin == TRIPLET else words[4]
    if origin == TRIPLET:
        at = [_entry(lines, name, r" *(\d{1,11}) (\d{1,11}) : (\S+)", 2) for _ in range(nnz)]
        i, j, x = [int(each[0]) for each in at], [int(each[1]) for each in at], [each[2] for each in at]
    else:
        i, j, x, pointers = [], [], [], [0]
        for k in range(shape[1] if origin == COLUMNS else shape[0]):
            word = "col" if origin == COLUMNS else "row"
            first = re.fullmatch(rf" *{word} (\d+) : locations (\d+) to (-?\d+)", lines.next(f"{word} {k} of {name}"))
            if first is None or first[1] != str(k) or first[2] != str(len(x)) or not -1 <= int(first[3]) < nnz:
                raise lines.wrong(f"{word} {k} of {name}, from location {len(x)}, before {nnz}")
            for _ in range(int(first[3]) + 1 - len(x)):
                index, value = _entry(lines, name, r" *(\d{1,11}) : (\S+)", 1)
                i.append(int(index))
                j.append(k)
                x.append(value)
            pointers.append(len(x))
        if len(x) != nnz:
            raise lines.wrong(f"the end of {name}, which has {len(x)} entries, not {nnz}")
    rows, columns = (j, i) if origin == ROWS else (i, j)
    if nnz and not (max(rows) < shape[0] and max(columns) < shape[1]):
        raise lines.wrong(f"an entry of {name} inside {shape[0]} x {shape[1]}")
    matrix = sp.csr_array(
        (np.array(x), (np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64))), shape=shape
    )
    return matrix, (origin, version, shape, words[2], norm, i, j, x)


def _shortest(value: float) -> str:
    """As CSparse prints it, to six digits, unless the number has more."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _entry(lines: _Lines, name: str, pattern: str, places: int) -> tuple[Any, ...]:
    found = re.fullmatch(pattern, lines.next(f"an entry of {name}"))
    if found is None:
        raise lines.wrong(f"an entry of {name}")
    try:
        return *found.groups()[:places], float(found[places + 1])
    except ValueError:
        raise lines.wrong(f"an entry of {name}") from None


def _sparse_lines(
    origin: int, version: str, shape: tuple[int, int], nzmax: str, norm: str | None, i: list[int], j: list[int], x: list[float]
) -> list[str]:  # fmt: skip
    size = f"{shape[0]}-by-{shape[1]}, nzmax: {nzmax} nnz: {len(x)}"
    if origin == TRIPLET:
        entries = [f"    {a} {b} : {_shortest(value)}" for a, b, value in zip(i, j, x, strict=True)]
        return [str(origin), version, f"triplet: {size}", *entries]
    word, head = ("col", "") if origin == COLUMNS else ("row", "csr: ")
    ends = np.searchsorted(j, np.arange(shape[1] if origin == COLUMNS else shape[0]), side="right").tolist()
    lines, begin = [str(origin), version, f"{head}{size}, 1-norm: {norm}"], 0
    for k, end in enumerate(ends):
        lines.append(f"    {word} {k} : locations {begin} to {end - 1}")
        lines += [
            f"      {index} : {_shortest(value)}" for index, value in zip(i[begin:end], x[begin:end], strict=True)
        ]
        begin = end
    return lines
