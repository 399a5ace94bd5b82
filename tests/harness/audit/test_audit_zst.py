"""Files packed by zstd: the same verdicts as unpacked ones; one that breaks off, and a missing package, are named."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.example import write_example
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene


def test_the_same_record_as_unpacked_and_a_broken_file_is_named(tmp_path: Path) -> None:
    zstandard = pytest.importorskip("zstandard")
    table, toml, _ = write_example(tmp_path)
    packed = tmp_path / "packed.csv.zst"
    packed.write_bytes(zstandard.ZstdCompressor().compress(table.read_bytes()))
    records = [audit(file, read_scene(toml), lambda *_: None) for file in (table, packed)]
    assert records[0]["checks"] == records[1]["checks"]
    for spoilt in (packed.read_bytes()[:300], b"\x28\xb5\x2f\xfd" + b"x" * 100, table.read_bytes()):
        packed.write_bytes(spoilt)
        with pytest.raises(UsageError, match=r"packed\.csv\.zst"):
            audit(packed, read_scene(toml), lambda *_: None)


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zstandard", None)
    _, toml, _ = write_example(tmp_path)
    (tmp_path / "run.dump.zst").write_bytes(b"\x28\xb5\x2f\xfd")
    with pytest.raises(UsageError, match=r"install ninedisk\[zst\]"):
        audit(tmp_path / "run.dump.zst", read_scene(toml), lambda *_: None)
