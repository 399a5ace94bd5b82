"""Find words that the glossary lists as not used, and long sentences.

    python tools/check_words.py [ROOT]

The list is the table "Words that we do not use" of ``docs/reference/glossary.md``. Words are sought in names of modules, classes, functions
and arguments, in docstrings and comments, in texts of the harness and of the pages, and in the documentation. At most 3 % of the
sentences of the documentation and of ``--help`` may have more than 30 words. The exit status is 1 if anything is found.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

GLOSSARY = "docs/reference/glossary.md"
HEADING = "## Words that we do not use"
SOURCES = ("core", "harness", "references", "reports", "tools", "tests")
TEXTS = ("reports", "harness")
"""Folders whose string literals are read by users: messages, reasons, notes, findings, help."""
HELP = "harness/cli"
PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**/*.md", "paper/*.md")
TEMPLATES = "reports/templates/**/*.html"
MOST_WORDS = 30
"""Words of a sentence that is not long."""
MOST_LONG = 0.03
"""Share of sentences that may be long."""

CODE = re.compile(r"^ *```.*?^ *```[^\n]*$|``[^`]+``|`[^`\n]+`|(?<=\])\([^)\s]*\)|<!--.*?-->", re.DOTALL | re.MULTILINE)
MARKUP = re.compile(r"\{%.*?%\}|\{\{.*?\}\}|\{#.*?#\}|<[^>]*>", re.DOTALL)
TEMPLATE_TEXT = re.compile(r"""(?<=[\s(,|~])"([^"\n]* [^"\n]*)"|(?<=[\s(,|~])'([^'\n]* [^'\n]*)'""")
COMMENT = re.compile(r"""^(?:[^'"#\n]|'[^'\n]*'|"[^"\n]*")*#(.*)$""")
LONG_STRING = re.compile(r'''"""[\s\S]*?"""''')
PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
SENTENCE_END = re.compile(r"(?<=[.!?])[*_)\"]*\s+(?=[^a-z\s])")
EXAMPLES = re.compile(r"^\x08$.*?(?:^\s*$|\Z)", re.DOTALL | re.MULTILINE)
BLOCK_START = re.compile(r"^ *(?:[-*+] |\d+\. |>|#)")


class Rule(NamedTuple):
    """One row of the table: what is not written, and what is written instead."""

    words: tuple[str, ...]
    text: re.Pattern[str] | None
    name: re.Pattern[str] | None
    function: frozenset[str]
    instead: str


class Piece(NamedTuple):
    """A piece of text or a name, and the line where it begins."""

    line: int
    text: str
    kind: str


class Hit(NamedTuple):
    """A word that is not used, and where it is."""

    line: int
    word: str
    instead: str


def _pattern(phrases: Iterable[str]) -> re.Pattern[str] | None:
    """Whole words in any case; a blank is any white space. A phrase with a full stop counts where no word follows."""
    parts = [
        "".join(r"\s+" if c == " " else re.escape(c) for c in phrase.rstrip(".")) + r"(?!\s+\w)" * phrase.endswith(".")
        for phrase in phrases
    ]
    return re.compile(r"(?<![\w-])(?:" + "|".join(parts) + r")(?![\w-])", re.IGNORECASE) if parts else None


def read_rules(glossary: str) -> list[Rule]:
    """Rules of the table.

    Parameters
    ----------
    glossary
        Text of the page. A word in plain type counts in texts and names, one in code type in names, and one with brackets as the whole
        name of a function.
    """
    rules = []
    for line in glossary.partition(HEADING)[2].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|") or cells[0] in ("word", "---"):
            continue
        words = [word.strip() for word in cells[0].split(",")]
        code = [word.strip("`") for word in words if word.startswith("`")]
        plain = [word for word in words if not word.startswith("`")]
        whole = frozenset(word[:-2] for word in code if word.endswith("()"))
        named = [word for word in code if not word.endswith("()")]
        rules.append(
            Rule(
                (*plain, *named, *(f"def {word}" for word in whole), *(f"def _{word}" for word in whole)),
                _pattern(plain),
                _pattern([*plain, *named]),
                whole,
                cells[1],
            )
        )
    return rules


def may_have(rules: Sequence[Rule], source: str) -> bool:
    """Whether a file may have a word of the rules: a fast look that spares most files the parser."""
    words = [re.split(r"\W+", word.rstrip(".")) for rule in rules for word in rule.words]
    low = source.lower()
    likely = [parts for parts in words if all(part in low for part in parts)]
    gap = r"[\W_]*"
    phrases = "|".join(gap.join(map(re.escape, parts)) for parts in likely)
    return (
        bool(likely) and re.search(rf"(?:(?<![A-Za-z])|(?<=[a-z])(?=[A-Z]))(?i:{phrases})(?![a-z])", source) is not None
    )


def blanked(pattern: re.Pattern[str], text: str) -> str:
    """The text with matches replaced by blanks, line by line as before."""
    return pattern.sub(lambda found: re.sub(r"\S", " ", found[0]), text)


def _statements(body: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All statements, without a look into expressions."""
    for node in body:
        yield node
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from _statements(getattr(node, field, ()))


def python_pieces(source: str, literals: bool) -> Iterator[Piece]:
    """Names, docstrings and comments of a module, and its other strings if ``literals``."""
    tree = ast.parse(source)
    documented: set[int] = set()
    for node in _statements(tree.body):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield Piece(node.lineno, node.name, "function")
            arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            yield from (Piece(each.lineno, each.arg, "name") for each in arguments)
        elif isinstance(node, ast.ClassDef):
            yield Piece(node.lineno, node.name, "name")
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            documented.add(id(node.value))
            yield Piece(node.lineno, blanked(CODE, node.value.value), "text")
    for node in ast.walk(tree) if literals else ():
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            yield Piece(node.lineno, node.value if " " in node.value else "", "text")
    yield from _comments(blanked(LONG_STRING, source))


def template_pieces(source: str) -> Iterator[Piece]:
    """Texts with a blank in the expressions of a template."""
    for part in re.finditer(r"\{\{.*?\}\}|\{%.*?%\}", source, re.DOTALL):
        for found in TEMPLATE_TEXT.finditer(part[0]):
            line = 1 + source.count("\n", 0, part.start() + found.start())
            yield Piece(line, found[1] or found[2], "text")


def _comments(source: str) -> Iterator[Piece]:
    """Comments, those of consecutive lines together."""
    block: list[str] = []
    for number, line in enumerate([*source.split("\n"), ""], start=1):
        found = COMMENT.match(line) if "#" in line else None
        if found:
            block.append(found[1])
        elif block:
            yield Piece(number - len(block), blanked(CODE, "\n".join(block)), "text")
            block = []


def hits_in(pieces: Iterable[Piece], rules: Sequence[Rule]) -> Iterator[Hit]:
    """Words of the rules in pieces of text and names."""
    for piece in pieces:
        named = piece.kind != "text"
        text = " ".join(PART.findall(piece.text)).lower() if named else piece.text
        for rule in rules:
            pattern = rule.name if named else rule.text
            found = list(pattern.finditer(text)) if pattern else []
            for match in found:
                line = piece.line + text.count("\n", 0, match.start())
                yield Hit(line, piece.text if named else " ".join(match[0].split()), rule.instead)
            if piece.kind == "function" and not found and piece.text.lstrip("_") in rule.function:
                yield Hit(piece.line, piece.text, rule.instead)


def sentences(markdown: str) -> Iterator[tuple[int, str]]:
    """Sentences of a page with their lines, without code blocks, tables and headings."""
    text = re.sub(r"`[^`\n]+`", "code", blanked(re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE), markdown))
    start, block = 0, list[str]()
    for number, line in enumerate([*text.split("\n"), ""], start=1):
        if block and (not line.strip() or BLOCK_START.match(line) or line.startswith("|")):
            yield from ((start, each) for each in SENTENCE_END.split(" ".join(block)))
            block = []
        if line.strip() and not line.lstrip().startswith(("|", "#")):
            start = start if block else number
            block.append(line.strip(" >"))


def help_texts(source: str) -> Iterator[tuple[int, str]]:
    """Texts of ``--help`` in a module of the command line: docstrings of its commands without examples, and what options say."""
    tree = ast.parse(source)
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Call)]
    commands = {each.id for call in calls for each in call.args if isinstance(each, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name in commands:
            yield node.lineno, EXAMPLES.sub("", ast.get_docstring(node) or "")
        elif (
            isinstance(node, ast.keyword)
            and node.arg in ("help", "short_help")
            and isinstance(node.value, ast.Constant)
        ):
            yield node.value.lineno, str(node.value.value)


def files_of(root: Path) -> Iterator[Path]:
    """Every file that is read."""
    for folder in SOURCES:
        yield from sorted((root / folder).rglob("*.py"))
    for pattern in (*PAGES, TEMPLATES):
        yield from (path for path in sorted(root.glob(pattern)) if "node_modules" not in path.parts)


class Found(NamedTuple):
    """What one file has."""

    hits: list[str]
    long: list[str]
    sentences: int


def check_file(root: Path, rules: Sequence[Rule], path: Path) -> Found:
    """Words that are not used and long sentences of one file."""
    name, source = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
    measured: list[tuple[int, str]] = []
    pieces: list[Piece] = []
    if path.suffix == ".py":
        if may_have(rules, f"{path.stem}\n{source}"):
            pieces = [Piece(1, path.stem, "name"), *python_pieces(source, name.startswith(TEXTS))]
        if name.startswith(HELP):
            measured = [(line, each) for line, text in help_texts(source) for _, each in sentences(text)]
    elif path.suffix == ".html":
        pieces = [Piece(1, blanked(MARKUP, source), "text"), *template_pieces(source)]
    else:
        own = source.partition(HEADING)[0]
        pieces, measured = [Piece(1, blanked(CODE, own), "text")], list(sentences(own))
    long = [(line, each) for line, each in measured if len(each.split()) > MOST_WORDS]
    return Found(
        [f"{name}:{hit.line}: {hit.word!r}: write {hit.instead}" for hit in hits_in(pieces, rules)],
        [f"{name}:{line}: {len(each.split())} words: {each[:60]} ..." for line, each in long],
        len(measured),
    )


def check(root: Path) -> list[str]:
    """Lines that say what is wrong in a tree."""
    rules = read_rules((root / GLOSSARY).read_text(encoding="utf-8"))
    files = [check_file(root, rules, path) for path in files_of(root)]
    hits = [line for each in files for line in each.hits]
    long = [line for each in files for line in each.long]
    count = sum(each.sentences for each in files)
    if len(long) > MOST_LONG * count:
        long.append(f"{len(long)} of {count} sentences have more than {MOST_WORDS} words: at most {MOST_LONG:.0%} may")
        hits += long
    return hits


def main() -> int:
    """Print what is found; 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?", type=Path, default=Path(__file__).resolve().parents[1], help="source tree")
    found = check(parser.parse_args().root)
    print("\n".join(found) or "no word that the glossary excludes")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
