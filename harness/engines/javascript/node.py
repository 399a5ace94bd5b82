"""Where Node.js and the packages of the engines in JavaScript are: ``python -m ninedisk.harness.engines.javascript.node`` installs them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

FOLDER = Path(sys.prefix) / "share" / "ninedisk" / "node"
"""Where ``npm install`` runs: part of the environment, so that an installed ninedisk finds it, too."""

LIST = Path(__file__).with_name("package.json")
"""Packages and their versions."""

HOW_TO_INSTALL = "install node and npm, then: python -m ninedisk.harness.engines.javascript.node"


@cache
def npm_version(package: str) -> tuple[str | None, str]:
    """Version of an installed npm package and "", or None and the reason."""
    if shutil.which("node") is None:
        return None, "there is no program node"
    try:
        about = json.loads((FOLDER / "node_modules" / package / "package.json").read_text(encoding="utf-8"))
        return str(about["version"]), ""
    except (OSError, ValueError, KeyError):
        return None, f"there is no npm package {package} in this environment"


def main() -> int:
    """Install the packages into this environment; the status is npm's, or 1 where there is no npm."""
    if shutil.which("npm") is None:
        print("engines in JavaScript need node and npm: install them and run this again", file=sys.stderr)
        return 1
    FOLDER.mkdir(parents=True, exist_ok=True)
    shutil.copy(LIST, FOLDER)
    return subprocess.run(
        ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(FOLDER)], check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
