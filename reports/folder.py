"""A folder of pages that is replaced as a whole: a reader meets the old pages or the new ones, never half of them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def fresh_folder(out: Path, marker: str, what: str) -> Iterator[Path]:
    """Yield an empty folder that takes the place of ``out`` if all goes well.

    Parameters
    ----------
    out : Path
        Written beside it and replaced at the end; an existing folder that is neither empty nor holds ``marker`` is left
        alone.
    marker : str
        Name of the file that says: this folder may be replaced.
    what : str
        What the folder is called in messages, for instance ``"report"``.

    Raises
    ------
    ReportError
        If ``out`` is a file or a foreign folder, or cannot be written.
    """
    out = Path(os.path.realpath(out))  # a link stays, and the folder that it names is replaced
    _check_target(out, marker, what)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as problem:
        raise _unwritable(out, what, problem) from problem
    try:
        fresh.chmod(0o755)
        yield fresh
        (fresh / marker).write_text(f"This folder is replaced as a whole by the next {what}.\n", encoding="utf-8")
        _replace(fresh, out)
    except OSError as problem:
        raise _unwritable(out, what, problem) from problem
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _check_target(out: Path, marker: str, what: str) -> None:
    if not out.exists():
        return
    if not out.is_dir():
        raise ReportError(f"{out} is a file: name a folder for the {what}")
    try:
        foreign = not (out / marker).exists() and any(out.iterdir())
    except OSError as problem:
        raise _unwritable(out, what, problem) from problem
    if foreign:
        raise ReportError(f"{out} holds files that are no {what} of ninedisk: name another folder, or empty it")


def _replace(fresh: Path, out: Path) -> None:
    """Put ``fresh`` in the place of ``out``; the old folder comes back if that fails."""
    if not out.exists():
        os.rename(fresh, out)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent)) / out.name
    os.rename(out, old)
    try:
        os.rename(fresh, out)
    except OSError:
        os.rename(old, out)
        raise
    finally:
        shutil.rmtree(old.parent, ignore_errors=True)


def _unwritable(out: Path, what: str, problem: OSError) -> ReportError:
    return ReportError(f"the {what} cannot be written to {out} ({problem}): name a folder that you may write to")


class ReportError(RuntimeError):
    """The report cannot be built; the message names the offending path or value and the way out."""
