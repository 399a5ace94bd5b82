"""Every case variant on every engine against every truth: the suite as outsiders run it, on the tree at hand."""

from __future__ import annotations

from ninedisk.harness.suite.test_cases import test_check

__all__ = ["test_check"]
