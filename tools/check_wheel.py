"""Compare a wheel with the tree: every file of the packages must be in it, and nothing else.

A sub-package or a data file that pyproject.toml forgets works in an editable install and is absent from the wheel.
"""

from __future__ import annotations

import sys
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]


def tree_files(root: Path) -> set[str]:
    """Names that the files of the four folders have in the wheel."""
    mapping = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]["package-dir"]
    folders = sorted(mapping.items(), key=lambda item: len(item[1]), reverse=True)  # harness/_root before harness
    files = set()
    for path in listed_files(root, [folder for _, folder in folders]):
        package, folder = next((p, f) for p, f in folders if path.is_relative_to(f))
        files.add(str(PurePosixPath(*package.split("."), path.relative_to(folder))))
    return files


def listed_files(root: Path, folders: list[str]) -> list[PurePosixPath]:
    """Files below ``folders`` without Python's own caches, relative to ``root``."""
    found = {path for folder in folders for path in (root / folder).rglob("*") if path.is_file()}
    return [PurePosixPath(path.relative_to(root).as_posix()) for path in found if "__pycache__" not in path.parts]


def main() -> int:
    """Check the one wheel named on the command line; 1 if it differs from the tree."""
    (name,) = sys.argv[1:]
    with zipfile.ZipFile(name) as wheel:
        packed = {item for item in wheel.namelist() if item.startswith("ninedisk/")}
    expected = tree_files(ROOT)
    for item in sorted(expected - packed):
        print(f"missing from the wheel: {item} (list its package, or its folder as package data, in pyproject.toml)")
    for item in sorted(packed - expected):
        print(f"in the wheel but not in the tree: {item} (a stale build folder?)")
    print(f"{Path(name).name}: {len(packed)} files, {len(expected)} expected")
    return int(packed != expected)


if __name__ == "__main__":
    sys.exit(main())
