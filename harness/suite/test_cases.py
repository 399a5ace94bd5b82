"""Every case variant on every engine against every truth; see `ninedisk.harness.suite.plugin` for ids and options."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ninedisk.harness.suite.items import CellCheck


def test_check(ninedisk_check: CellCheck) -> None:
    """Pass, skip, xfail or fail as the check's status says."""
    ninedisk_check.verify()
