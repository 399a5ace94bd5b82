"""The one decorator of every kernel, and where compiled kernels are kept.

Numba recompiles a cached function when its own file changes, but not when a jitted function that it calls from another
file changes: a stale number with a cache hit. The cache folder is therefore keyed by a hash of all sources of the core, and
within it a kernel has its place by its module alone: clones, copies and installed wheels of the same sources share it.

On a cache miss a kernel is compiled by one process; the others that want it wait and load what it leaves.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import caching
from numba.core.compiler_lock import global_compiler_lock

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True, "_nrt": False, "fastmath": False}
"""Options of every kernel. ``error_model="numpy"`` removes the branch on every division, ``nogil`` lets threads run kernels side
by side. Without Numba's runtime (``_nrt=False``) there is no reference counting: the kernels pass tuples of a dozen arrays, and two
atomic counts for each array at each call were four fifths of a step of nine disks. It also makes an allocation in a kernel a
compilation error, which is the rule here anyway. ``forceinline`` spares the copies of those tuples. ``fastmath`` is said although False is
Numba's default: where nothing is said a function takes it from whatever calls it first, and its bits depend on what was compiled before."""

FUSED: dict[str, Any] = {"fastmath": {"contract"}}
"""Further option of kernels that are bound by arithmetic: a product and the sum that it goes into are rounded once where the
processor can. Nothing is reordered; the result is as good, its last bits are those of this kind of processor."""

INLINE: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Further options of kernels that only kernels call. A wrapper that takes a hundred arrays out of their tuples, compiled and thrown away
again, was a quarter of the time of compilation."""


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
    compiled: Any = numba.njit(**options)(function)
    if settings.DISABLE_JIT:
        return cast(Function, compiled)
    settings.CACHE_DIR = cache_folder()
    try:
        kept = _SharedCache(function)
    finally:
        settings.CACHE_DIR = before
    compiled._cache = kept
    by_numba = compiled.compile

    def compile_once(signature: Any) -> Any:
        with global_compiler_lock:
            try:
                return by_numba(signature)
            finally:
                kept.release()

    compiled.compile = compile_once
    return cast(Function, compiled)


_numba: Any = caching  # its annotations are not those of its code
# Older versions of Numba have the locator under a private name.
_Locator: Any = getattr(_numba, "UserProvidedCacheLocator", None) or _numba._UserProvidedCacheLocator


class _ByModule(_Locator):  # type: ignore[misc]
    """Place of a kernel below the cache folder: that of its module below the core, wherever the core is installed."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        folder, core = Path(py_file).resolve().parent, Path(__file__).resolve().parent
        if folder.is_relative_to(core):
            return Path("core", folder.relative_to(core)).as_posix()
        by_path: str = super().get_suitable_cache_subpath(py_file)  # a kernel of others
        return by_path


class _Compiled(_numba.CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_ByModule,)


class _SharedCache(_numba.FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function, which on a miss is this process's alone until `release`.

    Two processes never wait for each other: while a kernel is compiled only kernels that it calls are, and none calls itself.
    """

    _impl_class = _Compiled

    def __init__(self, py_func: Callable[..., Any]) -> None:
        super().__init__(py_func)
        self._lock: int | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is stored for a signature, or None; then nobody else compiles the function until `release`."""
        found = super().load_overload(sig, target_context)
        if found is not None or self._lock is not None:
            return found
        path = Path(self.cache_path) / f"{self._impl.filename_base}.lock"
        try:
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX)
        except OSError:
            return None  # nothing can be locked here: everybody compiles
        return super().load_overload(sig, target_context)

    def release(self) -> None:
        """Let others compile the function again; the system does so for a process that dies."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def inline_kernel(function: Function) -> Function:
    """Like `kernel`, for small functions that only kernels call: LLVM inlines them, with no cache and no way in from Python."""
    return _inlined(function, OPTIONS | INLINE)


def fused_inline_kernel(function: Function) -> Function:
    """Like `inline_kernel`, with `FUSED` arithmetic."""
    return _inlined(function, OPTIONS | INLINE | FUSED)


def _inlined(function: Function, options: dict[str, Any]) -> Function:
    compiled: Any = numba.njit(**options)(function)
    if not cast(Any, numba.config).DISABLE_JIT:

        def refuse(*args: Any, **kwargs: Any) -> Any:  # noqa: ARG001
            raise TypeError(f"{function.__qualname__} is for kernels to call; from Python call it within a kernel")

        def keep(compiled_here: Any) -> None:
            compiled.overloads[tuple(compiled_here.signature.args)] = compiled_here

        # Numba would jump to the wrapper that is not there.
        compiled._compile_for_args, compiled.add_overload = refuse, keep
    return cast(Function, compiled)
