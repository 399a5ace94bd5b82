"""Where Node.js and the packages of the engines in JavaScript are."""

from __future__ import annotations

import json
import shutil
import sys
from functools import cache
from pathlib import Path

FOLDER = Path(sys.prefix) / "share" / "ninedisk" / "node"
"""Where ``npm install`` is run: part of the environment, so that an installed ninedisk finds it, too."""

LIST = Path(__file__).with_name("package.json")
"""Packages and their versions."""


def how_to_install() -> str:
    """Commands that install the packages."""
    return f"install node and npm, then: mkdir -p {FOLDER}; cp {LIST} {FOLDER}; npm install --prefix {FOLDER}"


@cache
def npm_version(package: str) -> tuple[str | None, str]:
    """Version of an installed npm package and "", or None and the reason."""
    if shutil.which("node") is None:
        return None, "there is no program node"
    try:
        about = json.loads((FOLDER / "node_modules" / package / "package.json").read_text(encoding="utf-8"))
        return str(about["version"]), ""
    except (OSError, ValueError, KeyError):
        return None, f"there is no npm package {package} in {FOLDER}"
