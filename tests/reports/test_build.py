"""The report appears as a whole or not at all, and never in the place of something else."""

from __future__ import annotations

import os

import pytest
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app
from ninedisk.reports import build as site
from ninedisk.reports import folder
from ninedisk.reports.build import build_report
from ninedisk.reports.folder import ReportError


def test_returns_the_index_and_reports_its_progress(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    heard = []
    index = build_report(tmp_path / "store", tmp_path / "new" / "out", lambda *stage: heard.append(stage))
    assert index == tmp_path / "new" / "out" / "index.html"
    assert index.is_file()
    stages = list(dict.fromkeys(stage for stage, _, _ in heard))
    assert stages == ["reading runs", "planning figures", "drawing figures", "writing pages"]
    assert all(0 <= done <= count for _, done, count in heard)


def test_new_report_replaces_the_old_one(tmp_path, write, small):
    write(tmp_path / "store", "a", small(case="demo/old"))
    out = build_report(tmp_path / "store", tmp_path / "out").parent
    write(tmp_path / "other", "a", small(case="demo/new"))
    build_report(tmp_path / "other", out)
    assert [path.name for path in (out / "case").iterdir()] == ["demo-new.html"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "out", "store"]


def test_the_first_page_reports_what_changed_since_the_run_before(tmp_path, write, small):
    store = tmp_path / "store"
    write(store, "20260101T000000Z-aaaaaa", small(), started="2026-01-01T00:00:00+00:00")
    made = CliRunner().invoke(app, ["report", "--store", str(store), "--out", str(tmp_path / "out")])
    assert made.exit_code == 0, made.output
    assert not (tmp_path / "out" / "changes.html").exists()
    assert "First run in this store" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    write(store, "20260102T000000Z-bbbbbb", small(status="fail", abs_error=3.0), started="2026-01-02T00:00:00+00:00")
    made = CliRunner().invoke(app, ["report", "--store", str(store), "--out", str(tmp_path / "out")])
    assert made.exit_code == 0, made.output
    first = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    reported = first[first.index("Since the run before (2026-01-01") :]
    assert "worse" in reported[:200]
    assert "First run" not in first
    assert "0.5 → 3" in reported[:600]
    assert (tmp_path / "out" / "changes.html").is_file()


def test_failure_leaves_the_old_report_untouched(tmp_path, write, small, monkeypatch):
    write(tmp_path / "store", "a", small())
    index = build_report(tmp_path / "store", tmp_path / "out")
    before = index.read_bytes()

    def break_off(*_args):
        raise OSError("no space left")

    monkeypatch.setattr(site, "render", break_off)
    with pytest.raises(ReportError, match="no space left"):
        build_report(tmp_path / "store", tmp_path / "out")
    assert index.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "store"]


def test_failure_of_the_last_step_brings_the_old_report_back(tmp_path, write, small, monkeypatch):
    write(tmp_path / "store", "a", small())
    index = build_report(tmp_path / "store", tmp_path / "out")
    real = os.rename

    def rename(source, target):
        if target == tmp_path / "out" and source.name.startswith(".out-") and source.parent == tmp_path:
            raise OSError("busy")
        real(source, target)

    monkeypatch.setattr(folder.os, "rename", rename)
    with pytest.raises(ReportError, match="busy"):
        build_report(tmp_path / "store", tmp_path / "out")
    assert index.is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "store"]


def test_folders_of_others_are_never_replaced(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("years of work")
    with pytest.raises(ReportError, match="no report of ninedisk"):
        build_report(tmp_path / "store", tmp_path / "home")
    assert (tmp_path / "home" / "thesis.tex").read_text() == "years of work"
    with pytest.raises(ReportError, match="is a file"):
        build_report(tmp_path / "store", tmp_path / "home" / "thesis.tex")


def test_unwritable_place_is_an_error(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    (tmp_path / "file").write_text("")
    with pytest.raises(ReportError, match="cannot be written"):
        build_report(tmp_path / "store", tmp_path / "file" / "out")


def test_empty_store_leaves_no_trace(tmp_path):
    with pytest.raises(ReportError):
        build_report(tmp_path / "store", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_an_empty_folder_may_be_filled(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    (tmp_path / "out").mkdir()
    assert build_report(tmp_path / "store", tmp_path / "out").is_file()
