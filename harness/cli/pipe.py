"""Output into a pipe whose reader has left, ``ninedisk run | head``: the rest is dropped, and the command goes on to its verdict."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import Any, TextIO


class Pipe:
    """A text stream that drops what a closed pipe no longer takes, in place of raising `BrokenPipeError`.

    Whoever writes, click or rich, would end the process with its own code otherwise, and what follows, files to be written for
    instance, would be lost.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or drop."""
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            self._drop()
            return len(text)

    def writelines(self, lines: Any) -> None:
        """Write each, or drop."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Flush, or drop."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._drop()

    def _drop(self) -> None:
        """From now on all goes to the null device, what is buffered still included."""
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self._stream.fileno())
        os.close(null)
        with suppress(OSError):
            self._stream.flush()


def guard_output() -> None:
    """Let standard output and error outlive their readers."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, Pipe):
            setattr(sys, name, Pipe(stream))
