"""Every case variant on every engine against every truth; see `ninedisk.harness.pytest_plugin` for ids and options."""

from __future__ import annotations

from ninedisk.harness.pytest_plugin import CellCheck


def test_check(ninedisk_check: CellCheck) -> None:
    ninedisk_check.verify()
