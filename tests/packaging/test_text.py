"""No file of the tree depends on one machine: no absolute path of it, no address of a package registry."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import pytest

pytestmark = pytest.mark.tree

# A path counts where it begins a word, so that `docs/tmp` and `.../home` in a longer path do not.
MACHINE_PATH = re.compile(r"(?<![\w.~/)}\]*-])/(?:root|home|tmp|work|Users|mnt|var/tmp)(?![\w-])")
REGISTRY = re.compile(
    r"p[y]pi\.|p[y]thonhosted|anacond[a]\.org|npm[j]s\.|crates\.i[o]|--(?:extra-)?inde[x]-url|PIP_INDE[X]_URL"
    r"|https?://\S*/simpl[e]\b|inde[x]-url\s*=",
    re.IGNORECASE,
)
THIRD_PARTY_BUNDLES = "reports/assets/*.js"


def text_files(root: Path) -> Iterator[tuple[str, str]]:
    """Name and text of every file of the tree, without what .gitignore leaves out."""
    lines = (root / ".gitignore").read_text().splitlines()
    ignored = [line.strip("/") for line in lines if line and not line.startswith("#")]
    for folder, folders, names in os.walk(root):
        folders[:] = [
            name
            for name in folders
            if name != ".git"
            and not any(fnmatch(name, pattern) for pattern in ignored)
            and not (Path(folder) / name / "pyvenv.cfg").exists()
        ]
        for name in names:
            path = Path(folder) / name
            relative = path.relative_to(root).as_posix()
            if any(fnmatch(name, pattern) for pattern in ignored) or fnmatch(relative, THIRD_PARTY_BUNDLES):
                continue
            try:
                yield relative, path.read_text(encoding="utf-8")
            except UnicodeDecodeError:
                continue


def hits(root: Path, pattern: re.Pattern[str]) -> list[str]:
    return [
        f"{name}:{number}: {line.strip()}"
        for name, text in text_files(root)
        for number, line in enumerate(text.splitlines(), start=1)
        if pattern.search(line)
    ]


def test_the_walk_sees_the_tree(root: Path) -> None:
    names = {name for name, _ in text_files(root)}
    assert {"README.md", "Makefile", ".ci/run", "core/scene/walls.py", "tests/packaging/test_text.py"} <= names
    assert not any(name.startswith((".git/", ".venv/")) for name in names)


def test_no_path_of_a_machine(root: Path) -> None:
    assert hits(root, MACHINE_PATH) == []


def test_no_address_of_a_package_registry(root: Path) -> None:
    assert hits(root, REGISTRY) == []


# The samples carry an @ in the middle, so that this file does not trip over itself.
@pytest.mark.parametrize("line", ["open('/t@mp/x')", "cd /ro@ot", "=/ho@me/me/a", "`/wo@rk/main`"])
def test_paths_of_a_machine_are_recognised(line: str) -> None:
    assert MACHINE_PATH.search(line.replace("@", ""))


@pytest.mark.parametrize("line", ["the work/energy ratio", "$(HOME)/tmp", "docs/home.md", "/usr/bin/env", "a/tmp/b"])
def test_other_text_is_left_alone(line: str) -> None:
    assert not MACHINE_PATH.search(line)


@pytest.mark.parametrize("line", ["https://py@pi.org/x", "pip --index@-url x", "http://host/sim@ple/"])
def test_registries_are_recognised(line: str) -> None:
    assert REGISTRY.search(line.replace("@", ""))
