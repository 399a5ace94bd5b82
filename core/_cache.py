"""The one decorator of every kernel, and where compiled kernels are kept.

Numba recompiles a cached function when its own file changes, but not when a jitted function that it calls from another
file changes: a stale number with a cache hit. The cache folder is therefore keyed by a hash of all sources of the core.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True, "_nrt": False}
"""Options of every kernel. ``error_model="numpy"`` removes the branch on every division, ``nogil`` lets threads run kernels side
by side. Without Numba's runtime (``_nrt=False``) there is no reference counting: the kernels pass tuples of a dozen arrays, and two
atomic counts for each array at each call were four fifths of a step of nine disks. It also makes an allocation in a kernel a
compilation error, which is the rule here anyway. ``forceinline`` spares the copies of those tuples."""

FUSED: dict[str, Any] = {"fastmath": {"contract"}}
"""Further option of kernels that are bound by arithmetic: a product and the sum that it goes into are rounded once where the
processor can. Nothing is reordered; the result is as good, its last bits are those of this kind of processor."""


def source_hash(root: Path) -> str:
    """Hash of every Python source below ``root`` (relative name and content), 16 hex digits."""
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _base_folder() -> Path:
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    cache_home = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache_home) if cache_home else Path.home() / ".cache") / "ninedisk" / "numba"


@cache
def cache_folder() -> str:
    """Folder of the compiled kernels of this very source; a temporary one where the cache cannot be written."""
    folder = _base_folder() / source_hash(Path(__file__).parent)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return str(folder)
    except (OSError, RuntimeError):
        pass
    return tempfile.mkdtemp(prefix="ninedisk-numba-")


def kernel(function: Function) -> Function:
    """Compile ``function`` with `OPTIONS` and keep the machine code in `cache_folder`; it must not allocate."""
    return _kept(function, OPTIONS)


def fused_kernel(function: Function) -> Function:
    """Like `kernel`, with `FUSED` arithmetic in the function's own lines (not in those of the kernels that it calls)."""
    return _kept(function, OPTIONS | FUSED)


def _kept(function: Function, options: dict[str, Any]) -> Function:
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = cache_folder()
    try:
        compiled: Any = numba.njit(cache=True, **options)(function)
    finally:
        settings.CACHE_DIR = before
    return cast(Function, compiled)


def inline_kernel(function: Function) -> Function:
    """Like `kernel`, for small functions that are only called by kernels: LLVM inlines them, no cache of their own."""
    compiled: Any = numba.njit(**OPTIONS)(function)
    return cast(Function, compiled)


def fused_inline_kernel(function: Function) -> Function:
    """Like `inline_kernel`, with `FUSED` arithmetic."""
    compiled: Any = numba.njit(**OPTIONS, **FUSED)(function)
    return cast(Function, compiled)
