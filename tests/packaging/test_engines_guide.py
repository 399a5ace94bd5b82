"""The guide to adapters shows what works, and names what there is."""

from __future__ import annotations

import inspect
import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.api.engine import Difference, Engine, EngineInfo, Session, SupportLevel
from ninedisk.harness.check_engine.check import check_engine
from ninedisk.harness.engines.dem.adapter import DemEngine
from ninedisk.harness.run.gaps import read_gaps

pytestmark = pytest.mark.tree
GUIDE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "engines.md"


GAPS = GUIDE.parents[1] / "how-to" / "continuous-integration.md"


def blocks(language: str, path: Path = GUIDE) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def rows(header: str) -> list[str]:
    """First cells of the table whose first column is called ``header``."""
    lines = GUIDE.read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(f"| {header} |"))
    found = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        found.append(line.split("|")[1].strip())
    return found


def test_the_examples_run() -> None:
    namespace: dict[str, Any] = {"__name__": "guide"}
    for code in blocks("python"):
        exec(compile(code, "engines.md", "exec"), namespace)
    assert isinstance(namespace["ENGINE"], Engine)
    assert namespace["findings"]["units: flight"].status == "pass"


def test_the_tables_are_complete() -> None:
    methods = {re.match(r"`(\w+)", cell)[1] for cell in rows("method")}  # type: ignore[index]
    assert methods == {name for name, _ in inspect.getmembers(Engine, inspect.isfunction) if not name.startswith("_")}
    session = {re.match(r"`(\w+)", cell)[1] for cell in rows("of a session")}  # type: ignore[index]
    public = {name for name, _ in inspect.getmembers(Session, inspect.isfunction) if not name.startswith("_")}
    assert session == public | {"__init__", "settings"}
    assert {cell.strip("`").lower() for cell in rows("level")} == {str(level) for level in SupportLevel}


def test_every_check_is_explained() -> None:
    named = {name for cell in rows("check") for name in re.findall(r"`([^`]+)`", cell)}
    checks = {each.check for each in check_engine(DemEngine())}
    assert {name for name in checks if not name.startswith("supports: ")} == named - {"supports: ..."}


def test_facts_and_gaps_exist(tmp_path: Path) -> None:
    told = re.search(r"which truths bind the engine: (.*?)\n\n", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    differences = re.search(
        r"the members of `Difference`: (.*?)\. A check", GUIDE.read_text(encoding="utf-8"), re.DOTALL
    )
    assert told is not None
    assert differences is not None
    assert set(re.findall(r"`(\w+)`", differences[1])) == set(Difference.__members__)
    assert set(re.findall(r"`(\w+)`", told[1])) <= {field.name for field in fields(EngineInfo)}
    (entries,) = blocks("toml")
    assert "ninedisk.engines" in tomllib.loads(entries)["project"]["entry-points"]
    (gaps,) = blocks("toml", GAPS)
    (tmp_path / "gaps.toml").write_text(gaps)
    read_gaps(tmp_path / "gaps.toml").check(["acme"])


def test_links_exist() -> None:
    for link in re.findall(r"\]\(([^)#]+)", GUIDE.read_text(encoding="utf-8")):
        assert (GUIDE.parent / link).exists(), link
