"""The packages and data files that pyproject.toml lists are those of the tree."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="module")
def setuptools(root: Path) -> dict[str, Any]:
    return tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]


def packages_of_the_tree(root: Path, package_dir: dict[str, str]) -> dict[str, Path]:
    """Every folder with an ``__init__.py`` below the mapped folders, by its dotted name."""
    found = {}
    for package, folder in package_dir.items():
        top = root / folder
        for init in top.rglob("__init__.py"):
            parts = init.parent.relative_to(top).parts
            if "_root" not in parts:
                found[".".join([package, *parts])] = init.parent
    return found


@pytest.mark.tree
def test_every_package_of_the_tree_is_listed(root: Path, setuptools: dict[str, Any]) -> None:
    assert sorted(setuptools["packages"]) == sorted(packages_of_the_tree(root, setuptools["package-dir"]))


@pytest.mark.tree
def test_every_other_file_of_a_package_is_listed_as_data(root: Path, setuptools: dict[str, Any]) -> None:
    packages = packages_of_the_tree(root, setuptools["package-dir"])
    packed = {path for folder in packages.values() for path in folder.glob("*.py")}
    for package, patterns in setuptools["package-data"].items():
        packed.update(path for pattern in patterns for path in packages[package].glob(pattern))
    tree = {path for folder in packages.values() for path in folder.rglob("*") if path.is_file()}
    missing = [str(path.relative_to(root)) for path in tree - packed if "__pycache__" not in path.parts]
    assert not missing, "neither a module of a listed package nor package data"


def test_types_are_announced() -> None:
    assert resources.files("ninedisk").joinpath("py.typed").is_file()
