"""Where the tree and the installed sources are."""

from __future__ import annotations

from pathlib import Path

import pytest

import ninedisk
import ninedisk.core
import ninedisk.harness
import ninedisk.references
import ninedisk.reports


@pytest.fixture(scope="session")
def root() -> Path:
    """Top of the source tree; tests that need more than ``pyproject.toml`` of it carry the mark ``tree``."""
    return Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def sources() -> dict[str, Path]:
    """Every installed module of ours by its dotted name, as the interpreter finds them: in the tree or in a wheel."""
    top = Path(ninedisk.__file__).parent
    found = {"ninedisk": top / "__init__.py", "ninedisk.__main__": top / "__main__.py"}
    for package in (ninedisk.core, ninedisk.harness, ninedisk.references, ninedisk.reports):
        folder = Path(package.__file__).parent
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if "_root" not in parts:
                found[".".join([package.__name__, *(part for part in parts if part != "__init__")])] = path
    return found
