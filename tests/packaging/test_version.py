"""The version has one source, ``ninedisk.__version__``."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import ninedisk


def test_metadata_carry_the_version() -> None:
    assert metadata.version("ninedisk") == ninedisk.__version__


def test_command_line_prints_the_version() -> None:
    done = subprocess.run([sys.executable, "-m", "ninedisk", "--version"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert ninedisk.__version__ in done.stdout.split()


@pytest.mark.tree
def test_citations_carry_the_version(root: Path) -> None:
    cff = re.search(r"^version: (.+)$", (root / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert cff is not None
    assert cff[1] == ninedisk.__version__
    assert json.loads((root / "codemeta.json").read_text(encoding="utf-8"))["version"] == ninedisk.__version__


@pytest.mark.tree
def test_changelog_begins_with_the_version(root: Path) -> None:
    first = re.search(r"^## \[(.+?)\]", (root / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert first is not None
    assert first[1] == ninedisk.__version__
