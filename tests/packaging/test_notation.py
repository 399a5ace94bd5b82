"""Every name in the code that the notation page gives exists."""

from __future__ import annotations

import importlib
import re
from dataclasses import fields
from pathlib import Path

import pytest

from ninedisk.core import history, law, numerics, scene

pytestmark = pytest.mark.tree
CLASSES = {
    cls.__name__: cls
    for cls in (
        scene.ContactLaw,
        scene.Disks,
        scene.Scene,
        scene.Wall,
        scene.WallSegment,
        scene.SphereScene,
        scene.Spheres,
        scene.PlaneWall,
        scene.PlaneSegment,
        law.Elastic,
        numerics.Numerics,
        history.History,
    )
}
# What the page may leave out: bookkeeping that is no symbol of the field.
NOT_SYMBOLS = {
    "Numerics": {"n_steps", "sample_every", "sample_from", "sample_until", "allow_unstable", "options"},
    "Scene": {"disks", "walls", "disk_disk"},
    "Wall": {"name", "point", "law", "motion"},
    "ContactLaw": {"regularised"},
    "Disks": {"rotating"},
    "SphereScene": {"spheres", "walls", "sphere_sphere"},
    "PlaneWall": {"name", "point", "law", "motion"},
    "Spheres": {"rotating"},
}


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs" / "reference" / "notation.md").read_text(encoding="utf-8")


def named(page: str) -> dict[str, set[str]]:
    """Attributes that the page gives, by class."""
    found: dict[str, set[str]] = {}
    for cls, name in re.findall(rf"`({'|'.join(CLASSES)})\.(\w+)`", page):
        found.setdefault(cls, set()).add(name)
    return found


def test_attributes_exist(page: str) -> None:
    for cls, names in named(page).items():
        assert names <= {field.name for field in fields(CLASSES[cls])}, cls


def test_modules_exist(page: str) -> None:
    modules = set(re.findall(r"`(ninedisk(?:\.\w+)+)`", page))
    assert modules
    for module in modules:
        importlib.import_module(module)


@pytest.mark.parametrize("cls", [name for name in CLASSES if name != "History"])
def test_no_field_is_left_out(page: str, cls: str) -> None:
    declared = {field.name for field in fields(CLASSES[cls])}
    assert declared - named(page)[cls] == NOT_SYMBOLS.get(cls, set())
