"""Names, arguments and variables that are not UTF-8: a command works with them, or says what is wrong."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

NAME = os.fsdecode(b"n\xffx")
SHOWN = "n\\udcffx"


def ninedisk(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """A command as a shell starts it: its arguments are bytes."""
    return subprocess.run(
        [sys.executable, "-m", "ninedisk", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONUTF8": "1", **variables},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    try:
        (tmp_path / NAME).mkdir()
    except OSError:
        pytest.skip("this file system takes no such name")
    return tmp_path / NAME


@pytest.mark.long
def test_a_run_is_stored_read_and_shown(folder: Path, fake_folder: Path) -> None:
    path = os.pathsep.join((str(fake_folder), os.environ.get("PYTHONPATH", "")))
    for arguments, code in (
        (("run", "fake/fall", "-e", "fake-wrong", "--json", f"{NAME}.json", "--write-known-gaps", f"{NAME}.toml"), 1),
        (("run", "fake/fall", "-e", "fake-wrong", "--known-gaps", f"{NAME}.toml"), 0),
        (("runs",), 0),
        (("show",), 0),
        (("findings", "--json", f"{NAME}.findings.json"), 0),
        (("export", "--csv", f"{NAME}.csv", "--json", f"{NAME}.rows.json", "--parquet", f"{NAME}.parquet"), 0),
        (("compare", f"{NAME}.csv", f"{NAME}.parquet", "--markdown", f"{NAME}.md", "--junit", f"{NAME}.xml"), 0),
        (("compare", "latest", "latest", "--html", f"{NAME}.html"), 0),
        (("report", "--out", NAME), 0),
        (("dashboard", "--out", f"{NAME}-lines"), 0),
    ):
        done = ninedisk(folder, *arguments, "--store", f"{NAME}-store", PYTHONPATH=path)
        assert done.returncode == code, (arguments, done.stdout, done.stderr)
        assert "internal error" not in done.stderr
    assert (folder / NAME / "index.html").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("list", "cases", NAME), f"there is no case '{SHOWN}'"),
        (("run", NAME), f"no case matches '{SHOWN}'"),
        (("run", "slip-to-roll", "--set", f"mu={NAME}", "-e", "dem"), SHOWN),
        (("check-engine", "--engine-cmd", NAME), SHOWN),
        (("findings", NAME), SHOWN),
        (("schema", NAME), SHOWN),
        (("audit", f"{NAME}.csv"), f"there is no '{SHOWN}.csv'"),
        (("solve", f"{NAME}.dat"), f"'{SHOWN}.dat' cannot be read"),
        (("new-engine", NAME), SHOWN),
        (("merge", NAME), "holds no finished run"),
    ],
)
def test_what_is_wrong_is_said(folder: Path, arguments: tuple[str, ...], said: str) -> None:
    done = ninedisk(folder, *arguments)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert said in done.stderr
    assert done.stderr.startswith("error: ")
    assert "internal error" not in done.stderr
