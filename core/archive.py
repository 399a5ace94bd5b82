"""Files of the core: written whole or not at all, and read although they may be damaged or something else altogether."""

from __future__ import annotations

import errno
import io
import os
import shutil
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidSceneError, UnwritableFileError
from ninedisk.core.validate import short_repr


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """A stream whose content becomes the file at the end of the block; an exception in it leaves the file as it was.

    Links are followed and stay. A device, a FIFO or a descriptor such as ``/dev/stdout`` is never replaced: the content is
    written into it.

    Raises
    ------
    UnwritableFileError
        If the file cannot be written: its folder is missing or closed, it is a folder itself, the disk is full, ...
    """
    try:
        target, replaced = destination(path)
        partial = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        stream: IO[bytes] = open(partial, "wb") if replaced else io.BytesIO()  # noqa: SIM115 - what fails here is the path's fault, what fails below may be the content's
    except (OSError, TypeError, ValueError) as error:  # a path may be of another type, empty, or hold a zero byte
        raise _unwritable(path, error) from error
    try:
        with stream:
            yield stream
            if isinstance(stream, io.BytesIO):
                number = _descriptor(target)
                with open(target if number is None else os.dup(number), "wb") as into:
                    into.write(stream.getbuffer())
        if replaced:
            if target.exists():
                shutil.copymode(target, partial)
            os.replace(partial, target)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        if replaced:
            partial.unlink(missing_ok=True)


def destination(path: str | os.PathLike[str]) -> tuple[Path, bool]:
    """The file that is written under a path, links followed, and whether a new file replaces it.

    Raises
    ------
    OSError
        If what is there takes no file: a folder, a socket, a block device; or if links form a cycle.
    """
    target = Path(path)
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return Path(os.path.realpath(target)), True
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if stat.S_ISBLK(mode) or stat.S_ISSOCK(mode):
        raise OSError(errno.EINVAL, "a block device or a socket takes no file")
    if stat.S_ISREG(mode) and _descriptor(target) is None:
        return Path(os.path.realpath(target)), True
    return target, False


def _descriptor(path: Path) -> int | None:
    """Number of the open file that a path such as ``/dev/stdout`` or ``/dev/fd/63`` names."""
    for _ in range(40):  # links that form a cycle have been refused by then
        folder = os.path.realpath(path.parent)
        if path.name.isdecimal() and folder in (f"/proc/{os.getpid()}/fd", "/dev/fd"):
            return int(path.name)
        if not path.is_symlink():
            return None
        path = Path(folder, path.readlink())
    return None


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made where it does not exist.

    Raises
    ------
    UnwritableFileError
        If it cannot be made.
    """
    try:
        folder = Path(path)
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, TypeError, ValueError) as error:
        raise _unwritable(path, error) from error
    return folder


def _unwritable(path: object, error: Exception) -> UnwritableFileError:
    why = getattr(error, "strerror", None) or error
    return UnwritableFileError(
        f"{short_repr(path)} cannot be written ({why}): give a path in a folder that exists and can be written"
    )


def read_arrays(path: str | os.PathLike[str], what: str) -> dict[str, NDArray[Any]]:
    """All arrays of a file, by name.

    Raises
    ------
    InvalidSceneError
        If the file is missing, damaged or no ``.npz`` file; the message says that it is not ``what`` was asked for.
    """
    try:
        data = np.load(path, allow_pickle=False)
        if not isinstance(data, np.lib.npyio.NpzFile):
            raise ValueError("it holds a single array")
        with data:
            return {name: data[name] for name in data.files}
    except (
        OSError, ValueError, KeyError, TypeError, EOFError, MemoryError, OverflowError, SyntaxError,
        RuntimeError, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        raise InvalidSceneError(f"{path} is no {what}, or damaged: {error}") from error
