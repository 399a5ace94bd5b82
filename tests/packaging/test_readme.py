"""What the README and the reference of the command line show works unchanged, and what they list is what there is."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app
from ninedisk.harness.results import schema as records

pytestmark = pytest.mark.tree
ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
COMMAND_LINE = ROOT / "docs" / "reference" / "command-line.md"
MOST_LINES, MOST_WORDS = 100, 700
"""Of the README: it is read on one screen or not at all."""


def blocks(language: str, path: Path = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def table(header: str) -> list[list[str]]:
    """Cells of the rows of the table that begins with ``header``."""
    lines = COMMAND_LINE.read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(f"| {header} |"))
    rows = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_it_is_short() -> None:
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    assert len(text.split()) <= MOST_WORDS


def test_the_first_result_is_had(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands up to "Use it to" run in a clone, from the first to the last, and print what is shown."""
    text = README.read_text(encoding="utf-8").partition("## Use it")[0]
    lines = re.findall(r"^\$ ninedisk (.+?)(?: +#.*)?$", text, re.MULTILINE)
    assert [line.split()[0] for line in lines] == ["check-engine", "audit", "audit"]
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)
    said = ""
    for line in lines:
        done = CliRunner().invoke(app, shlex.split(line))
        assert done.exit_code == 0, done.output
        said += done.output
    (shown,) = re.findall(r"^```text\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert shown in said


def test_the_example_of_a_digitised_curve_is_read(tmp_path: Path) -> None:
    from ninedisk.references.published_curves import load_curves

    (example,) = blocks("toml", ROOT / "docs" / "how-to" / "verify-a-code.md")
    (tmp_path / "name.toml").write_text(example, encoding="utf-8")
    (tmp_path / "name.csv").write_text("step,force\n0,0\n100,4.9e7\n")
    (curve,) = load_curves(tmp_path)
    assert curve.applies_to("nine-disk/compression", {"load_case": "a1", "xi": 3.0})


def test_statuses_are_those_of_the_records() -> None:
    """The exit codes are excused, failed or broken down, as `schema.EXCUSED` has it."""
    rows = {status.strip("`"): int(code) for status, _, code in table("status")}
    assert set(rows) == set(records.STATUSES)
    assert {status for status, code in rows.items() if code == 0} == records.EXCUSED


COMMANDS = ("list", "run", "report", "compare", "dashboard", "check-engine", "new-engine", "converge", "docs")


@pytest.mark.parametrize("command", COMMANDS)
def test_options_exist(command: str) -> None:
    used = [row[0] for row in table("command") if re.match(rf"`ninedisk {command}\b", row[0])]
    options = set(re.findall(r"--[a-z]+", " ".join(used)))
    done = CliRunner().invoke(app, [command, "--help"])
    assert used
    assert done.exit_code == 0, done.output
    assert options <= set(re.findall(r"--[a-z]+", done.output))


def test_make_targets_exist(root: Path) -> None:
    prose = re.sub(r"^```.*?^```", "", README.read_text(), flags=re.DOTALL | re.MULTILINE)
    shown = set(re.findall(r"`make ([a-z]+)", prose))
    shown |= set(re.findall(r"^\$ make ([a-z]+)", "\n".join(blocks("console")), re.MULTILINE))
    targets = set(re.findall(r"^([a-z]+):", (root / "Makefile").read_text(), re.MULTILINE))
    assert {"report", "test", "engines"} <= shown <= targets


def test_files_that_it_links_to_exist(root: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)", README.read_text())
    assert links
    assert [link for link in links if "://" not in link and not (root / link).exists()] == []
