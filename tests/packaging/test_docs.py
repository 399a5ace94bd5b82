"""The documentation is built without a warning, and every command and program that it shows runs unchanged."""

from __future__ import annotations

import re
import shlex
import warnings
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import BUILTIN_CASES, get_case
from ninedisk.harness.api.support import support_of
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.docs import guides_in, read_guides
from ninedisk.harness.results.statuses import TABLE
from ninedisk.harness.run import case_record as case_records
from ninedisk.harness.run import workers
from ninedisk.harness.run.api_record import MODULES
from ninedisk.harness.run.plan import Cell
from ninedisk.reports.docs import write_docs
from ninedisk.reports.folder import ReportError

pytestmark = pytest.mark.tree
ROOT = Path(__file__).resolve().parents[2]
GUIDES = sorted((ROOT / "docs").glob("*/*.md"))
KINDS = ("tutorials", "how-to", "reference", "explanation")
FOLLOWED = ("your-own-engine.md", "engines.md")
"""Guides whose steps build on each other: their own tests follow them from the first to the last."""
ALONE = [path for path in GUIDES if path.name not in FOLLOWED]


def blocks(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def console_blocks() -> list[tuple[str, ...]]:
    """Commands of ours that a guide shows together."""
    shown = [block.splitlines() for path in ALONE for block in blocks(path, "console")]
    return [tuple(line.removeprefix("$ ") for line in lines if line.startswith("$ ")) for lines in shown]


def invoke(line: str) -> tuple[int, str]:
    words = shlex.split(line)
    assert words[0] == "ninedisk", line
    result = CliRunner().invoke(app, words[1:])
    assert result.exception is None or isinstance(result.exception, SystemExit), (line, result.exception)
    return result.exit_code, result.output


make_record = case_records.case_record


@cache
def record(case_id: str) -> dict[str, Any]:
    return make_record(get_case(case_id))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs") / "html"
    with warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(case_records, "case_record", lambda case: record(case.id))  # made once for pages and tests
        warnings.simplefilter("error")
        code, output = invoke(f"ninedisk docs --guides {ROOT / 'docs'} --out {out}")
    assert code == 0, output
    return out


def test_every_case_and_guide_has_its_page(built: Path) -> None:
    index = (built / "index.html").read_text(encoding="utf-8")
    for case_id in BUILTIN_CASES:
        assert f">{case_id}</a>" in index
    assert {path.parent.name for path in GUIDES} == set(KINDS)
    assert [index.index(f'href="{kind}/') for kind in KINDS] == sorted(index.index(f'href="{kind}/') for kind in KINDS)
    for path in GUIDES:
        assert f'href="{path.parent.name}/{path.stem}.html"' in index
    pages = {path.relative_to(built).as_posix() for path in built.rglob("*.html")}
    api = {f"reference/api/{name}.html" for name in ("index", *(re.sub("[^a-z]", "-", module) for module in MODULES))}
    assert api <= pages
    assert 'href="reference/api/index.html"' in index
    assert len(pages) == 1 + len(BUILTIN_CASES) + len(GUIDES) + len(api)


def test_links_lead_somewhere_and_never_to_the_net(built: Path) -> None:
    for page in built.rglob("*.html"):
        html = page.read_text(encoding="utf-8")
        for target in re.findall(r'(?:href|src)="([^"]*)"', html):
            name, _, place = target.partition("#")
            assert "://" not in target, (page.name, target)
            assert not name or (page.parent / name).exists(), (page.name, target)
            there = (page.parent / name).read_text(encoding="utf-8") if name and place else html
            assert not place or f'id="{place}"' in there, (page.name, target)


def test_pages_report_what_the_cases_say(built: Path) -> None:
    texts = [unescape(path.read_text(encoding="utf-8")) for path in (built / "cases").glob("*.html")]
    for case_id in BUILTIN_CASES:
        case, told = get_case(case_id), record(case_id)
        page = next(text for text in texts if f"<code>{case_id}</code>" in text and case.title in text)
        for text in (case.title, case.source, case.requirement, "<svg", "Why this tolerance", *told["commands"]):
            assert text in page, case_id
        for parameter in case.parameters:
            assert f'<td class="id">{parameter.name}</td>' in page
            assert parameter.help in page
        assert {"dem", "cd"} & {engine for row in told["truths"] for engine in row["engines"]}, case_id
        assert all(row["why"] and row["tolerance"] >= 0.0 for row in told["truths"]), case_id


@pytest.mark.usefixtures("cells_here")
def test_commands_of_a_case_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in record(next(iter(BUILTIN_CASES)))["commands"]:
        code, output = invoke(line)
        assert code == 0, (line, output[-2000:])


class Begun(BaseException):
    """The cells of a run would be run now."""


@pytest.mark.usefixtures("built")
def test_commands_of_every_case_page_come_to_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their words are understood, and name cells that an engine can run: the matrix runs these. The last has all words of the second."""

    def interrupt(cells: list[Cell], *_: object, **__: object) -> None:
        raise Begun(cells)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "run_in_workers", interrupt)
    for case_id in BUILTIN_CASES:
        _, fewer, line = record(case_id)["commands"]
        assert set(shlex.split(fewer)) < set(shlex.split(line))
        with pytest.raises(Begun) as begun:
            invoke(line)
        first, *_ = begun.value.args[0]
        assert first.case.id == case_id
        assert support_of(first.engine, first.setup.scene, first.setup.numerics).level is not SupportLevel.NO, line


@pytest.mark.usefixtures("cells_here")
@pytest.mark.parametrize("lines", console_blocks(), ids=lambda lines: lines[0])
def test_commands_of_the_guides_run(lines: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in lines:
        code, output = invoke(line)
        assert code == 0, output[-2000:]


@pytest.mark.parametrize("path", ALONE, ids=lambda path: path.name)
def test_programs_of_the_guides_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "guide"}  # a page's programs go on from each other
    for code in blocks(path, "python"):
        exec(compile(code, path.name, "exec"), names)
    assert list(tmp_path.iterdir()) == [], "an example leaves files behind"


def test_the_guide_has_the_table_of_statuses() -> None:
    guide = (ROOT / "docs" / "reference" / "command-line.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z-]+)` \| (.+) \| (\d) \|$", guide.partition("## Statuses")[2], re.MULTILINE)
    assert rows == [(each.id, each.meaning, str(each.exit_code)) for each in TABLE.values()]


def test_the_guides_show_something_to_run() -> None:
    assert sum(map(len, console_blocks())) >= 8
    assert any(blocks(path, "python") for path in GUIDES)


def commands(group: Any, path: tuple[str, ...] = ()) -> dict[str, Any]:
    """Every command of the command line by its words."""
    found = {}
    for name, command in group.commands.items():
        words = (*path, name)
        found |= commands(command, words) if hasattr(command, "commands") else {" ".join(words): command}
    return found


TREE = commands(typer.main.get_command(app))


@pytest.mark.parametrize("name", TREE)
def test_examples_of_the_help_are_understood(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The examples of ``--help`` name commands, options and values that exist; they are parsed, not run."""
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"^ +(ninedisk .+)$", TREE[name].help or "", re.MULTILINE)
    assert lines, f"{name} has no example"
    for line in (part.strip() for each in lines for part in each.split("&&")):
        words = shlex.split(re.split(" [>|] ", line)[0], comments=True)[1:]
        chosen = max((each for each in TREE if words[: len(each.split())] == each.split()), key=len)
        TREE[chosen].make_context(chosen, words[len(chosen.split()) :])


def test_a_guide_that_links_nowhere_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"links to 'b\.md'"):
        write_docs([], [("a.md", "# A\n\nSee [b](b.md).\n")], tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_guides_in_folders_link_to_each_other_and_show_pictures(tmp_path: Path) -> None:
    guides = {
        "a/x.md": "# X\n\n[y](../b/x.md#two-words) ![p](../p.png)\n",
        "b/x.md": "# Y\n\n## Two `words`\n\n[top](../top.md)\n",
    }
    guides |= {"top.md": "# Top\n\n[x](a/x.md)\n", "index.md": "# Index\n", "cases/x.md": "# Z\n"}
    (tmp_path / "p.png").write_bytes(b"picture")
    out = write_docs([], list(guides.items()), tmp_path / "out", tmp_path).parent
    assert 'href="../b/x.html#two-words"' in (out / "a" / "x.html").read_text(encoding="utf-8")
    assert 'src="../p.png"' in (out / "a" / "x.html").read_text(encoding="utf-8")
    assert (out / "p.png").read_bytes() == b"picture"
    below = (out / "b" / "x.html").read_text(encoding="utf-8")
    assert 'id="two-words"' in below
    assert 'href="../top.html"' in below
    assert 'href="../index.html"' in below
    assert 'href="a/x.html"' in (out / "top.html").read_text(encoding="utf-8")
    assert "ninedisk: documentation" in (out / "index.html").read_text(encoding="utf-8")
    assert len(list(out.rglob("*.html"))) == len(guides) + 1


def test_guides_are_read_one_folder_deep(tmp_path: Path) -> None:
    for name in ("b.md", "a/x.md", "a/node_modules/README.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("# T\n")
    found = guides_in(tmp_path)
    assert [name for name, _ in read_guides(tmp_path, found)] == ["a/x.md", "b.md"]


def test_no_markup_comes_through_a_guide(tmp_path: Path) -> None:
    write_docs([], [("a.md", "# A\n\n<script>alert(1)</script>\n")], tmp_path / "out")
    assert "<script>" not in (tmp_path / "out" / "a.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("folder", ["nowhere", "empty"])
def test_a_folder_without_guides_is_refused(folder: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    code, output = invoke(f"ninedisk docs --guides {tmp_path / folder} --out {tmp_path / 'out'}")
    assert code == 2
    assert "holds no Markdown file" in output


@pytest.mark.parametrize(
    "name", ["docs/explanation/architecture.md", "docs/how-to/add-a-contact-law.md", "CONTRIBUTING.md"]
)
def test_guides_name_files_that_are_there(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"`((?:core|references|harness|reports|tests|tools|docs)/[\w./-]+)`", text)
    assert len(named) >= 3
    assert [path for path in named if not (ROOT / path).exists()] == []
