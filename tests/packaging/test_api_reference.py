"""The API reference shows all that is public, from docstrings whose form the parser of the reference understands."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.run.api_record import MODULES, api_record, object_record, public_objects
from ninedisk.reports.docs import write_docs

OBJECTS = [(module, name) for module in MODULES for name in public_objects(module)]
NUMBERS = re.compile(r"float(?!, int)|d floats|\(float|tuple of float|(?:ndarray|array_like)(?! of (?:int|bool))")
"""Types of numbers that have a unit."""


@pytest.fixture(scope="module")
def record() -> dict[tuple[str, str], dict[str, Any]]:
    return {(module["name"], each["name"]): each for module in api_record() for each in module["objects"]}


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Pages of the reference by module."""
    out = tmp_path_factory.mktemp("api") / "html"
    write_docs([], [("a.md", "# A\n\n`ninedisk.core.Scene`, `Scene`\n")], out, None, api_record())
    assert (
        '<a href="reference/api/ninedisk-core.html#Scene"><code>ninedisk.core.Scene</code></a>, <code>Scene</code>'
        in (out / "a.html").read_text(encoding="utf-8")
    )
    folder = out / "reference" / "api"
    found = {
        module: (folder / f"{re.sub('[^a-z]', '-', module)}.html").read_text(encoding="utf-8") for module in MODULES
    }
    assert {path.name for path in folder.iterdir()} == {
        "index.html",
        *(f"{re.sub('[^a-z]', '-', m)}.html" for m in MODULES),
    }
    return {"index": (folder / "index.html").read_text(encoding="utf-8"), **found}


@pytest.mark.parametrize(("module", "name"), OBJECTS, ids=lambda part: part.removeprefix("ninedisk."))
def test_every_public_object_has_its_entry(
    module: str, name: str, record: dict[tuple[str, str], dict[str, Any]], pages: dict[str, str]
) -> None:
    each = record[module, name]
    found = re.search(rf'<section>\s*<h2 id="{name}">.*?</section>', pages[module], re.DOTALL)
    assert found, "no entry"
    entry = unescape(found[0])
    assert each["signature"] in entry
    assert each["place"] in entry
    assert f"#{name}" in pages["index"]
    if each["alias"]:
        assert f'<a href="ninedisk-core.html#{each["alias"]}">' in found[0]
        return
    assert ">>> " in entry
    assert "<h3>Example</h3>" in entry
    for section in each["sections"]:
        for item in section.get("items", ()):
            assert section["title"] not in ("Parameters", "Attributes") or f'id="{name}.{item["name"]}"' in entry


@pytest.mark.parametrize(("module", "name"), OBJECTS, ids=lambda part: part.removeprefix("ninedisk."))
def test_docstrings_are_parsed_without_a_warning(
    module: str, name: str, record: dict[tuple[str, str], dict[str, Any]]
) -> None:
    """Each parameter has a text, and each number its unit."""
    each = record[module, name]
    assert each["warnings"] == []
    titles = [section.get("title") for section in each["sections"]]
    returns = each["kind"] == "function" and not each["signature"].endswith("-> None")
    assert not returns or "Returns" in titles, f"{name} lacks a section Returns"
    for section in each["sections"]:
        for item in section["items"] if section.get("title") in ("Parameters", "Attributes", "Returns") else ():
            assert not NUMBERS.match(item["type"]) or re.search(
                r"\[|\bunit", item["text"].replace("``unit``", "unit")
            ), f"{name}: {item['name'] or 'what it returns'} has no unit"


def test_no_markup_is_left_in_the_pages(pages: dict[str, str]) -> None:
    """Ticks and lines of dashes would be text that Markdown does not understand; nothing loads from the net."""
    for module, page in pages.items():
        prose = re.sub(r"<(pre|code)\b.*?</\1>", "", page, flags=re.DOTALL)
        assert "`" not in prose, module
        assert not re.search(r"-{3,}|<(em|strong|blockquote|hr)\b", prose), module
        assert "://" not in re.sub(r"<p>.*?</p>", "", page), module
        assert 'name="viewport"' in page
        assert '../../style.css"' in page


def wrong(speed: float, mass: float = 1.0) -> float:
    """Return the kinetic energy [J].

    Parameters
    ----------
    velocity : float
        [m/s].

    Returns
    -------
    float
        [J].
    """
    return 0.5 * mass * speed**2


def test_a_parameter_that_is_not_there_and_one_without_a_text_are_noticed() -> None:
    warnings = object_record("wrong", wrong)["warnings"]
    assert any("'velocity' does not appear in the function signature" in warning for warning in warnings)
    assert {warning.rpartition(" ")[2] for warning in warnings if "no text" in warning} == {"'speed'", "'mass'"}


def test_what_a_base_documents_is_shown(record: dict[tuple[str, str], dict[str, Any]]) -> None:
    given = {
        item["name"]: item
        for section in record["ninedisk.core", "Disks"]["sections"]
        for item in section.get("items", ())
    }
    assert given["radius"]["text"].startswith("Radii [m]")
    assert given["held"]["default"] == "False"
    names = {member["name"] for member in record["ninedisk.core", "Scene"]["members"]}
    assert {"to_dict", "from_dict", "wall_index", "n_bodies"} <= names


def test_the_guide_names_every_module(root: Path) -> None:
    guide = (root / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    assert set(MODULES) <= set(re.findall(r"`([\w.]+)`", guide))
    assert "(docs/reference/api.md)" in (root / "README.md").read_text(encoding="utf-8")
