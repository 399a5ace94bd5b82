"""Whether a classic netCDF file is whole: the library fills what was cut off with zeros and says nothing."""

from __future__ import annotations

import struct
from pathlib import Path

from ninedisk.harness.api.errors import UsageError

SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
"""Bytes of a number by its kind."""
MOST = 1 << 24
"""Bytes of a header, and entries of a list in it."""


class _Header:
    """The header of a classic file, by its published layout: lists of dimensions, attributes and variables."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 4
        self.version = data[3]
        self.wide = self.version == 5
        self.records = self._count()
        dimensions = [self._dimension() for _ in range(self._list())]
        self._attributes()
        self.end = 0
        kept: list[tuple[int, int]] = []
        for _ in range(self._list()):
            self._name()
            sizes = [dimensions[self._count()] for _ in range(self._count())]
            self._attributes()
            size = SIZES[self._number(4)]
            self._count()
            begin = self._number(4 if self.version == 1 else 8)
            by_record = bool(sizes) and sizes[0] == 0
            for each in sizes[by_record:]:
                size *= each
            if by_record:
                kept.append((begin, size))
            else:
                self.end = max(self.end, begin + size)
        padded = [size if len(kept) == 1 else -(-size // 4) * 4 for _, size in kept]
        for begin, size in kept:
            if self.records:
                self.end = max(self.end, begin + (self.records - 1) * sum(padded) + size)

    def _number(self, width: int) -> int:
        found: int = struct.unpack_from(">Q" if width == 8 else ">I", self.data, self.at)[0]
        self.at += width
        return found

    def _count(self) -> int:
        return self._number(8 if self.wide else 4)

    def _list(self) -> int:
        """Entries of a list, after its tag."""
        self._number(4)
        count = self._count()
        if count > MOST:
            raise ValueError(f"a list of {count} entries")
        return count

    def _skip(self, size: int) -> None:
        """Bytes up to the next multiple of four."""
        self.at += -(-size // 4) * 4

    def _name(self) -> None:
        self._skip(self._count())

    def _dimension(self) -> int:
        self._name()
        return self._count()

    def _attributes(self) -> None:
        for _ in range(self._list()):
            self._name()
            size = SIZES[self._number(4)]
            self._skip(size * self._count())


def check_whole(path: Path) -> None:
    """Refuse a classic file that is shorter than its header says; others are left to the library.

    Raises
    ------
    UsageError
        Naming both sizes.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(MOST)
        if data[:3] != b"CDF" or data[3:4] not in (b"\x01", b"\x02", b"\x05"):
            return
        header = _Header(data)
    except OSError as error:
        raise UsageError(f"{str(path)!r} cannot be read ({error.strerror or error})") from error
    except (struct.error, KeyError, IndexError, ValueError) as error:
        raise UsageError(f"{path}: the header of this netCDF file is cut off or damaged ({error})") from error
    size = path.stat().st_size
    if size < header.end:
        raise UsageError(
            f"{path} has {size} bytes, and its header says {header.end} for {header.records} frames: cut off; write it anew, or set "
            "fewer frames (ncks -d frame,0,N)"
        )
