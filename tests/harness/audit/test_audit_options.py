"""Options of ``ninedisk audit`` and ``ninedisk law-test``: bad values are named, nothing that is there is lost, --json is strict JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.audit.example import write_example
from ninedisk.harness.audit.law_test import MOTIONS, write_law_test
from ninedisk.harness.cli.app import app


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sample")
    write_example(folder)
    return folder


@pytest.fixture
def place(sample: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A trajectory, its TOML and contacts, a law test, a file, a folder and frames, in the folder of work."""
    monkeypatch.chdir(tmp_path)
    table = pd.read_csv(sample / "trajectory.csv")
    table[table.t < 0.01].to_csv("run.csv", index=False, float_format="%.9g")
    Path("run.toml").write_bytes((sample / "trajectory.toml").read_bytes())
    Path("contacts.csv").write_bytes((sample / "contacts.csv").read_bytes())
    write_law_test(Path("law"))
    write_law_test(Path("foreign"))
    Path("foreign/README.md").write_text("Mine\n")
    Path("plain").write_text("")
    Path("empty").mkdir()
    Path("mine").mkdir()
    Path("mine/trajectory.csv").write_text("t,x,y\n")
    Path("broken.toml").write_text("[x")
    Path("latin.toml").write_bytes(b"\xff\xfe")
    return tmp_path


def stored(folder: Path) -> dict[str, bytes]:
    return {str(each.relative_to(folder)): each.read_bytes() for each in folder.rglob("*") if each.is_file()}


BAD = {
    "audit": "give a trajectory to audit, or --example DIR",
    "audit nothing.csv": "there is no 'nothing.csv'",
    "audit empty": "empty holds no frames",
    "audit run.csv --example new": "one of the two",
    "audit --example plain": "--example 'plain' is a file: give a folder",
    "audit --example plain/new": "--example 'plain/new' cannot be written",
    "audit --example mine": "'mine/trajectory.csv' exists, and is not replaced",
    "audit --example new --json a.json": "--example audits nothing: take --json 'a.json' away",
    "audit --example new --out page": "take --out 'page' away",
    "audit --example new --scene run.toml": "take --scene 'run.toml' away",
    "audit --example new --write-scene a.toml": "take --write-scene 'a.toml' away",
    "audit run.csv --scene nothing.toml": "'nothing.toml' cannot be read",
    "audit run.csv --scene empty": "'empty' cannot be read (Is a directory)",
    "audit run.csv --scene broken.toml": "broken.toml is no TOML",
    "audit run.csv --scene latin.toml": "it is no UTF-8 text",
    "audit run.csv --json empty": "--json 'empty' is a folder: give a file",
    "audit run.csv --json nothing/a.json": "--json 'nothing/a.json' cannot be written",
    "audit run.csv --json run.csv": "--json 'run.csv' would replace what is read from 'run.csv'",
    "audit run.csv --json run.toml": "would replace what is read from 'run.toml'",
    "audit run.csv --json ./contacts.csv": "would replace what is read from 'contacts.csv'",
    "audit law --json law/spin.csv": "would replace what is read from 'law'",
    "audit run.csv --out plain": "--out 'plain' is a file: give a folder",
    "audit run.csv --out mine": "mine",
    "audit run.csv --write-scene empty": "--write-scene 'empty' is a folder: give a file",
    "audit run.csv --write-scene nothing/a.toml": "--write-scene 'nothing/a.toml' cannot be written",
    "audit run.csv --write-scene run.csv": "--write-scene 'run.csv' would replace what is read",
    "audit run.csv --write-scene run.toml": "'run.toml' exists, and is not replaced",
    "audit run.csv --write-scene a.json --json a.json": "--write-scene and --json both name 'a.json'",
    "law-test write plain": "DIR 'plain' is a file: give a folder",
    "law-test write plain/new": "DIR 'plain/new' cannot be written",
    "law-test write foreign": "'foreign/README.md' exists, and is not replaced",
    "law-test judge nothing": "there is no folder 'nothing'",
    "law-test judge plain": "there is no folder 'plain'",
    "law-test judge law": "has no forces",
    "law-test judge law --only spni": "Did you mean 'spin'?",
    "law-test judge law --only=": "there is no motion ''",
    "law-test judge law --json law/law.toml": "would replace what is read from 'law/law.toml'",
    "law-test judge law --json law/spin.csv": "would replace what is read from 'law/spin.csv'",
    "law-test judge law --json empty": "--json 'empty' is a folder: give a file",
    "law-test judge law --out plain": "--out 'plain' is a file: give a folder",
}


@pytest.mark.parametrize("command", BAD)
def test_bad_values_are_named_and_no_file_changes(place: Path, command: str) -> None:
    before = stored(place)
    done = ninedisk(*command.split())
    assert done.exit_code == 2, done.output
    assert BAD[command] in done.output.replace("\n", " ")
    assert "Traceback" not in done.output
    assert stored(place) == before


@pytest.mark.usefixtures("place")
def test_this_folder_is_no_internal_error() -> None:
    for name in ("", "."):
        done = ninedisk("audit", name)
        assert done.exit_code == 2, done.output
        assert "internal" not in done.output


def strict(path: Path) -> dict[str, object]:
    """JSON without NaN and Infinity, which other programs refuse."""
    found = json.loads(path.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert isinstance(found, dict)
    return found


def documented(command: str) -> set[str]:
    return set(re.findall(r"\w+", ninedisk(*command.split(), "--help").output))


@pytest.mark.usefixtures("place")
def test_json_of_an_audit_is_strict_and_in_the_help() -> None:
    table = pd.read_csv("run.csv")
    table.loc[12, "x"] = np.nan
    table.loc[20, "vx"] = np.inf
    table.to_csv("run.csv", index=False)
    for _ in range(2):
        assert ninedisk("audit", "run.csv", "--json", "a.json").exit_code == 1
    record = strict(Path("a.json"))
    words = documented("audit")
    assert {"dimension", "checks", "totals", "digits"} <= words & set(record)
    for check in record["checks"]:
        assert set(check) - words - {"title", "unit", "beyond", "why_not"} == set()


@pytest.mark.usefixtures("place")
def test_json_of_a_law_test_is_strict_and_in_the_help() -> None:
    rows = pd.read_csv(f"law/{MOTIONS[0]}.csv")[["t"]].assign(fx=0.0, fy=0.0, fz=0.0)
    rows.to_csv(f"law/{MOTIONS[0]}.forces.csv", index=False)
    assert ninedisk("law-test", "judge", "law", "--json", "a.json", "--only", MOTIONS[0]).exit_code == 1
    record = strict(Path("a.json"))
    words = documented("law-test judge")
    assert set(record) <= words | {"format"}
    for check in record["checks"]:
        assert set(check) <= words
    for convention in record["conventions"].values():
        assert set(convention) <= words
