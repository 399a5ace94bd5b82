"""The form of the scripts of the folder findings; none of them is run here, since they install other programs."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "findings"
SCRIPTS = sorted(FOLDER.glob("*.sh")) if FOLDER.is_dir() else []

pytestmark = pytest.mark.tree


def test_there_are_scripts_and_all_are_listed() -> None:
    assert len(SCRIPTS) >= 6
    listed = re.findall(r"^\| `(\S+\.sh)` \|", (FOLDER / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == [path.name for path in SCRIPTS]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_says_what_it_shows_and_runs_without_us(script: Path) -> None:
    text = script.read_text(encoding="utf-8")
    head = text.partition("set -euo pipefail")[0]
    for word in ("What", "Versions", "Why a good guess misses", "Documentation"):
        assert re.search(rf"^# {word}: \S", head, re.MULTILINE), f"no line '# {word}: ...'"
    assert "ninedisk" not in text
    assert "://" not in text
    assert "folder=$(mktemp -d)\ntrap 'rm -rf \"$folder\"' EXIT\n" in text
    installs = [line for line in text.splitlines() if re.search(r"\b(npm|pip\"?) .*install ", line)]
    assert installs
    for line in installs:
        assert re.search(r"(?<=[\w\]])(==|@)\d+\.\d+\.\d+", line), f"no pinned version: {line}"
    assert re.search(r"sys\.exit\(0 if|process\.exit\(as_described \? 0 : 1\)", text)
    subprocess.run(["bash", "-n", str(script)], check=True)
