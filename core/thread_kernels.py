"""What threads that run kernels side by side wait for each other with, built from atomic loads and stores."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel

PAD = 16
"""Entries between two threads' flags: two cache lines, so that no two threads write to the same one."""

SPINS = 4_000
"""Polls of a flag, a few microseconds, before a waiting thread offers its core to another one."""

sched_yield = types.ExternalFunction("sched_yield", types.int32())


def _pointer(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [index])


@intrinsic
def _load(typingctx: Any, array: Any, index: Any) -> Any:  # noqa: ARG001
    """``array[index]`` as an acquiring atomic load: what the storing thread wrote before is visible afterwards."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        return builder.load_atomic(pointer, "acquire", 8)

    return types.int64(array, types.int64), build


@intrinsic
def _store(typingctx: Any, array: Any, index: Any, value: Any) -> Any:  # noqa: ARG001
    """``array[index] = value`` as a releasing atomic store."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        builder.store_atomic(args[2], pointer, "release", 8)
        return ir.Constant(ir.IntType(64), 0)

    return types.int64(array, types.int64, types.int64), build


@inline_kernel
def signal(progress: NDArray[np.int64], at: int, value: int) -> None:
    """Set ``progress[at]``: a thread that sees the value also sees what this one wrote before."""
    _store(progress, at, value)  # type: ignore[call-arg]


@inline_kernel
def wait_until(progress: NDArray[np.int64], at: int, value: int) -> None:
    """Return when ``progress[at]`` is ``value`` or more."""
    polls = 0
    while _load(progress, at) < value:  # type: ignore[call-arg]
        polls += 1
        if polls == SPINS:
            polls = 0
            sched_yield()


@inline_kernel
def wait_for_all(flags: NDArray[np.int64], thread: int, threads: int) -> None:
    """Barrier: returns when all ``threads`` threads have reached it.

    Parameters
    ----------
    flags : ndarray of int64, shape (threads * PAD,)
        Number of barriers that each thread has reached, a thread every `PAD` entries.
    thread : int
        This thread, 0 .. threads-1.
    threads : int
        Number of threads; one thread never waits.
    """
    if threads == 1:
        return
    phase = flags[thread * PAD] + 1
    signal(flags, thread * PAD, phase)
    for other in range(threads):
        wait_until(flags, other * PAD, phase)
