"""Lines of a text, packed or not: heads as words, rows of numbers straight into columns, of a file of any size a block in memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, cast

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import numbers_of, open_file

BLOCK = 1 << 22
"""Bytes read at once."""
ROWS = 1 << 16
"""Rows for which there is memory before any is read: what the head says may be wrong."""
ODD = 1000
"""Rows that are read word by word after one that is not of plain decimals."""


class BrokenRowsError(Exception):
    """Rows end after ``read`` of them: at another item or the end (``unended`` False), or their last line has no end."""

    def __init__(self, read: int, *, unended: bool = False) -> None:
        super().__init__()
        self.read, self.unended = read, unended


def broken_rows(path: Path, error: BrokenRowsError, frame: str, begin: int, count: int) -> UsageError:
    """In words: rows of a frame that are not all there."""
    line = begin + error.read
    if error.unended:
        return UsageError(
            f"{path}, line {line - 1}: the last line of {frame} has no end: cut off; cut the file before line {begin - 1}, or end the "
            "line if it is whole"
        )
    return UsageError(
        f"{path}, line {line}: {frame} ends after {error.read} of {count} lines: cut off; cut the file before line {begin - 1}"
    )


class Lines:
    """Lines of a file as `open` gives them in text mode.

    Attributes
    ----------
    number : int
        Lines read.
    done : int
        Bytes read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number = self.done = 0
        self._text = cast(Any, open_file(path))
        self._stream = self._text.buffer
        self._bytes = bytearray(BLOCK)
        self._begin = self._end = 0
        self._most = ROWS

    def __enter__(self) -> Lines:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._text.close()

    def _fill(self) -> bool:
        """Read on; False at the end."""
        kept = self._end - self._begin
        if kept == len(self._bytes):
            self._bytes = self._bytes + bytearray(kept)
        elif self._begin:
            self._bytes[:kept] = self._bytes[self._begin : self._end]
        self._begin, self._end = 0, kept
        with memoryview(self._bytes) as whole, whole[kept:] as rest:
            got = self._stream.readinto(rest)
        if not got:
            return False
        self._end += got
        if self._bytes.find(b"\r", kept, self._end) >= 0:
            block = bytes(self._bytes[kept : self._end])
            if block.endswith(b"\r"):
                block += self._stream.read(1)
            block = block.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            self._end = kept + len(block)
            self._bytes[kept : self._end] = block
        return True

    def readline(self) -> str:
        """The next line with its end; empty at the end of the file."""
        looked = self._begin
        while (end := self._bytes.find(b"\n", looked, self._end)) < 0:
            looked = self._end - self._begin
            if not self._fill():
                end = self._end - 1
                break
        line = self._bytes[self._begin : end + 1].decode("utf-8", "replace")
        self.done += end + 1 - self._begin
        self._begin = end + 1
        self.number += bool(line)
        return line

    def rows(self, count: int, names: Sequence[str], wanted: Sequence[str]) -> dict[str, FloatArray]:
        """So many rows of numbers; the columns ``wanted`` of those with ``names``.

        Raises
        ------
        BrokenRowsError
            If there are fewer.
        UsageError
            Naming file, line and column.
        """
        from ninedisk.harness.audit.readers.decimals import FIVES, TENS, parse_rows

        places = np.array([wanted.index(name) if name in wanted else -1 for name in names], dtype=np.int64)
        out = np.empty((len(wanted), min(count, self._most)))
        counts = np.zeros(3, dtype=np.int64)
        done = 0
        while done < count:
            if done == out.shape[1]:
                out, small = np.empty((len(wanted), min(count, 2 * done))), out
                out[:, :done] = small
            raw = np.frombuffer(self._bytes, dtype=np.uint8)
            parse_rows(
                raw, self._begin, self._end, out.shape[1] - done, len(names), places, out, out.view(np.uint64), done, FIVES,
                TENS, counts,
            )  # fmt: skip
            del raw
            read, end, odd = counts.tolist()
            self.number, self.done = self.number + read, self.done + end - self._begin
            done, self._begin = done + read, end
            if odd:
                values = self._odd_rows(names, done, count, min(ODD, out.shape[1] - done))
                size = len(values[names[0]])
                for place, name in enumerate(wanted):
                    out[place, done : done + size] = values[name]
                done += size
            elif done < out.shape[1] and not self._fill():
                partial = bool(self.readline())
                raise BrokenRowsError(done + partial, unended=done + partial == count)
        self._most = max(ROWS, count)
        return {name: out[place, :count] for place, name in enumerate(wanted)}

    def _odd_rows(self, names: Sequence[str], done: int, count: int, most: int) -> dict[str, FloatArray]:
        """The next rows, word by word; that rows are missing is said before that one is no number."""
        first = self.number + 1
        lines = self._some_lines(done, count, most)
        try:
            return numbers_of(lines, names, None, self.path, first)
        except UsageError:
            done += len(lines)
            while done < count:
                done += len(self._some_lines(done, count, ODD))
            raise

    def _some_lines(self, done: int, count: int, most: int) -> list[str]:
        lines: list[str] = []
        for _ in range(min(most, count - done)):
            line = self.readline()
            if not line or line.startswith("ITEM:"):
                raise BrokenRowsError(done + len(lines))
            lines.append(line)
            if not line.endswith("\n"):
                raise BrokenRowsError(done + len(lines), unended=done + len(lines) == count)
        return lines
