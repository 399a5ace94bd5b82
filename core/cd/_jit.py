"""The kernel decorators as this package uses them."""

from ninedisk.core._cache import inline_kernel, kernel

__all__ = ["inline_kernel", "kernel"]
