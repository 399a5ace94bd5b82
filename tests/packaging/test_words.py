"""Words that the glossary does not use, and long sentences, are found where people read."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = pytest.mark.tree

GLOSSARY = """# Glossary

## Words that we do not use

| word | write instead |
|---|---|
| gizmo, red herring | device |
| `room` | capacity |
| `left()` | what it computes |
"""
MODULE = '''"""The gizmo of a module."""

# A red
# herring in a comment, and room is a word of texts.
LIMIT = 1
"""It is ``gizmo`` in code type."""


def left(gizmo: int) -> str:
    return "a gizmo that only programs read"


class RoomOfState:
    left = 1
'''


@pytest.fixture
def tool(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_words", root / "tools" / "check_words.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "docs" / "reference").mkdir(parents=True)
    (tmp_path / "docs" / "reference" / "glossary.md").write_text(GLOSSARY)
    (tmp_path / "README.md").write_text("# A gizmo\n\nShort. `gizmo`\n\n```\ngizmo\n```\n")
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "a.py").write_text(MODULE)
    return tmp_path


def found(tool: ModuleType, tree: Path) -> list[str]:
    files = [tool.check_file(tree, tool.read_rules(GLOSSARY), path) for path in tool.files_of(tree)]
    return [line.partition(": write")[0] for each in files for line in each.hits]


def test_words_are_found_in_names_docstrings_comments_and_pages(tool: ModuleType, tree: Path) -> None:
    assert found(tool, tree) == [
        "core/a.py:1: 'gizmo'",
        "core/a.py:9: 'left'",
        "core/a.py:9: 'gizmo'",
        "core/a.py:13: 'RoomOfState'",
        "core/a.py:3: 'red herring'",
        "README.md:1: 'gizmo'",
    ]


@pytest.mark.parametrize("folder", ["cli", "audit", "engines/acme", "run"])
def test_texts_of_the_harness_and_of_pages_are_read(tool: ModuleType, tree: Path, folder: str) -> None:
    (tree / "harness" / folder).mkdir(parents=True)
    (tree / "harness" / folder / "b.py").write_text('TEXT = "a gizmo"\nKEY = "gizmo"\n')
    (tree / "reports" / "templates").mkdir(parents=True)
    (tree / "reports" / "templates" / "c.html").write_text(
        '<p class="gizmo">{{ gizmo }}\nA gizmo.</p>\n{{ "no gizmo" if gizmo else x["gizmo"] }}\n'
    )
    hits = [hit for hit in found(tool, tree) if not hit.startswith(("core", "README"))]
    assert sorted(hits) == [
        f"harness/{folder}/b.py:1: 'gizmo'", "reports/templates/c.html:2: 'gizmo'", "reports/templates/c.html:3: 'gizmo'",
    ]  # fmt: skip


def test_more_than_three_percent_of_long_sentences_are_found(tool: ModuleType, tree: Path) -> None:
    (tree / "CHANGELOG.md").write_text("Short one. " * 40 + "\n\n" + "word " * 31 + "end.\n")
    assert not any("words" in line for line in tool.check(tree))
    (tree / "CHANGELOG.md").write_text("Short one. " * 20 + "\n\n" + "word " * 31 + "end.\n\n| " + "cell " * 40 + "|\n")
    *_, long, share = tool.check(tree)
    assert long.startswith("CHANGELOG.md:3: 32 words: word word")
    assert share == "1 of 22 sentences have more than 30 words: at most 3% may"


def test_help_is_measured_without_its_examples(tool: ModuleType) -> None:
    source = '''
app.command("a")(a)


def a(b: Annotated[int, typer.Option("--b", help="What b is.")]) -> None:
    """Do a thing.

    \\b
    Examples:
      ninedisk a --b 1
    """
'''
    assert [text.strip() for _, text in tool.help_texts(source)] == ["Do a thing.", "What b is."]
