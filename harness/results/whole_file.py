"""Files that a command writes: they appear whole or not at all, and what cannot be written is reported before the work."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from ninedisk.core.archive import destination, whole_file
from ninedisk.core.errors import UnwritableFileError
from ninedisk.harness.api.errors import StoreError, UsageError


def check_writable(flag: str, path: Path) -> None:
    """Refuse a file that cannot be written, before anything runs.

    Raises
    ------
    UsageError
        Naming the option ``flag`` and the path.
    """
    try:
        if path.is_dir():
            raise UsageError(f"{flag} {str(path)!r} is a folder: give a file")
        target, replaced = destination(path)
        if replaced:
            with tempfile.NamedTemporaryFile(prefix=f".{target.name}.", dir=target.parent):
                pass
        elif not os.access(target, os.W_OK):  # to open a FIFO would wait for its reader
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except (OSError, ValueError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{flag} {str(path)!r} cannot be written ({getattr(error, 'strerror', None) or error}): give a file in a "
            f"folder that exists and can be written"
        ) from error


def check_no_input(flag: str, path: Path, inputs: Iterable[Path]) -> None:
    """Refuse to write over a file that a command reads, or over data in a folder that it reads.

    Raises
    ------
    UsageError
        Naming the option ``flag`` and the path.
    """
    if not path.exists():
        return
    data = path.suffix not in (".json", ".toml")
    for given in inputs:
        within = data and given.is_dir() and path.resolve().parent.samefile(given)
        if within or (given.exists() and path.samefile(given)):
            raise UsageError(f"{flag} {str(path)!r} would replace what is read from {str(given)!r}: give another file")


def check_same_text(flag: str, path: Path, text: str) -> None:
    """Refuse to write a text over a file with another one, which may be a user's work.

    Raises
    ------
    UsageError
        Naming the option ``flag`` and the path.
    """
    if path.is_file() and path.read_bytes() not in (b"", text.encode("utf-8", "backslashreplace")):
        raise UsageError(f"{flag}: {str(path)!r} exists, and is not replaced: move it away, or give another place")


def check_folder(flag: str, path: Path) -> None:
    """Refuse a folder that cannot be made or written, before anything runs; one that is missing is not made yet.

    Raises
    ------
    UsageError
        Naming the option ``flag`` and the path.
    """
    above = None
    try:
        if path.exists() and not path.is_dir():
            raise UsageError(f"{flag} {str(path)!r} is a file: give a folder")
        above = next(each for each in (path, *path.absolute().parents) if each.exists())
        if not above.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        with tempfile.TemporaryDirectory(prefix=".ninedisk-", dir=above):  # rights alone say nothing about /proc
            pass
    except (OSError, ValueError) as error:
        if isinstance(error, UsageError):
            raise
        why = getattr(error, "strerror", None) or error
        place = f" in {str(above)!r}" if above is not None and above != path else ""
        raise UsageError(
            f"{flag} {str(path)!r} cannot be written: no file can be made{place} ({why}); give another folder"
        ) from error


@contextmanager
def open_whole(path: Path, remedy: str = "give another file") -> Iterator[IO[bytes]]:
    """The stream of `ninedisk.core.archive.whole_file`, its errors in the words of the command line.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    try:
        with whole_file(path) as stream:
            yield stream
    except UnwritableFileError as error:
        why = getattr(error.__cause__, "strerror", None) or error.__cause__
        raise StoreError(f"{str(path)!r} cannot be written ({why}): {remedy}") from error


def write_whole(flag: str, path: Path, text: str) -> None:
    """Write a text file, whole or not at all; what UTF-8 cannot hold is written as ``\\udcff``.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    with open_whole(path, f"give another {flag} FILE") as stream:
        stream.write(text.encode("utf-8", "backslashreplace"))
