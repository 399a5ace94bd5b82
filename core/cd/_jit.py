"""The kernel decorators as this package uses them."""

from ninedisk.core.compile import inline_kernel, kernel

__all__ = ["inline_kernel", "kernel"]
