"""Threads that run a kernel side by side."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from typing import Any

from ninedisk.core.validate import whole

MOST_THREADS = 64


def check_threads(threads: int) -> int:
    """The number itself.

    Raises
    ------
    InvalidNumericsError
        If it is no whole number 1..`MOST_THREADS`.
    """
    return whole("threads", threads, 1, MOST_THREADS)


def run_in_threads(kernel: Callable[..., int], threads: int, shared: tuple[Any, ...]) -> int:
    """Call ``kernel(thread, threads, *shared)`` in ``threads`` threads, this one being ``thread = 0``, and return its answer to this one.

    The kernel releases the interpreter and meets its fellows at barriers, so that all of them end together.
    """
    others = [Thread(target=kernel, args=(number, threads, *shared)) for number in range(1, threads)]
    for thread in others:
        thread.start()
    code = kernel(0, threads, *shared)
    for thread in others:
        thread.join()
    return code
