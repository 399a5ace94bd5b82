"""Files that a command writes: they appear whole or not at all, and what cannot be written is told before the work."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

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
        with tempfile.NamedTemporaryFile(prefix=f".{path.name}.", dir=path.parent):
            pass
    except (OSError, ValueError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{flag} {str(path)!r} cannot be written ({getattr(error, 'strerror', None) or error}): give a file in a "
            f"folder that exists and can be written"
        ) from error


def check_folder(flag: str, path: Path) -> None:
    """Refuse a folder that cannot be made or written, before anything runs; one that is missing is not made yet.

    Raises
    ------
    UsageError
        Naming the option ``flag`` and the path.
    """
    try:
        if path.exists() and not path.is_dir():
            raise UsageError(f"{flag} {str(path)!r} is a file: give a folder")
        above = next(each for each in (path, *path.absolute().parents) if each.exists())
        if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
            raise UsageError(
                f"{flag} {str(path)!r} cannot be written: {str(above)!r} is no folder that you may write to; give another one"
            )
    except (OSError, ValueError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{flag} {str(path)!r} cannot be written ({getattr(error, 'strerror', None) or error})"
        ) from error


def write_whole(flag: str, path: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        try:
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(
            f"{str(path)!r} cannot be written ({error.strerror or error}): give another {flag} FILE"
        ) from error
