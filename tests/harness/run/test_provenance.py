"""What a run says about where it came from, and what it must not say."""

from __future__ import annotations

import getpass
import json
import socket
from pathlib import Path

import numpy
import pytest

import ninedisk
from ninedisk.harness.run import provenance as module
from ninedisk.harness.run.provenance import command_line, provenance, source_commit

FOLDER = Path("/", "somewhere", "deep")


def test_facts() -> None:
    facts = provenance([{"engine": "dem", "engine_version": "1"}, {"engine": "yade", "engine_version": ""}])
    assert facts["ninedisk"] == ninedisk.__version__
    assert facts["packages"]["numpy"] == numpy.__version__
    assert facts["engines"] == {"dem": "1"}
    assert facts["cores"] >= 1
    assert facts["cpu"]


def test_nothing_private() -> None:
    text = json.dumps(provenance())
    assert str(Path.home()) not in text
    assert str(Path(__file__).parents[3]) not in text
    for name in (socket.gethostname(), getpass.getuser()):
        assert len(name) < 5 or name not in text


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (f"--store={FOLDER}/results", "--store=results"),
        (f"{FOLDER}/rows.json", "rows.json"),
        ("~/results/", "results"),
        ("C:\\some where\\rows.json", "rows.json"),
        ("nine-disk/*", "nine-disk/*"),
        ("ks_over_kn=2/3", "ks_over_kn=2/3"),
        ("xi=3 1/s", "xi=3 1/s"),
        ("/", "/"),
    ],
)
def test_arguments_lose_their_folders(given: str, kept: str) -> None:
    assert command_line(["run", given]) == ["ninedisk", "run", kept]


def test_commit_never_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(source_commit(), str)

    def missing(*_: object, **__: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(module.subprocess, "run", missing)
    assert source_commit() == ""
