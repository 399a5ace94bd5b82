"""Files that other programs leave: packed and cut, with other ends of lines, other encodings, of no bytes, or folders; ids twice."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from ninedisk_tests_written import DENSE, FORMATS, PLAIN, TOML, Run, make_run
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app

FOLDERS = ("yade", "vtk-raw", "vtk-inline", "vtk-text", "vtk-pieces")
FILES = tuple(name for name in FORMATS if name not in FOLDERS)
TEXTS = ("dump", "csv", "yaml", "extxyz", "mercury")


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(frames=8)


def written(folder: Path, name: str, run: Run) -> Path:
    file, write = FORMATS[name]
    write(folder / file, run)
    return folder / file


def audited(path: Path) -> tuple[int, str]:
    path.with_name("audit.toml").write_text(TOML + (DENSE if ".data" in path.suffixes else PLAIN))
    done = CliRunner().invoke(app, ["audit", str(path)])
    assert "internal error" not in done.output, done.output
    assert "Traceback" not in done.output
    return done.exit_code, done.output


@pytest.mark.parametrize("share", [0.3, 0.7, 0.98])
@pytest.mark.parametrize("name", ["dump", "csv", "extxyz", "yaml"])
@pytest.mark.parametrize("kind", ["gz", "zst"])
def test_packed_files_that_break_off(kind: str, name: str, share: float, run: Run, tmp_path: Path) -> None:
    path = written(tmp_path, name, run)
    compress = gzip.compress if kind == "gz" else pytest.importorskip("zstandard").compress
    raw = compress(path.read_bytes())
    packed = path.with_name(f"{path.name}.{kind}")
    packed.write_bytes(raw)
    assert audited(packed)[0] == 0
    packed.write_bytes(raw[: int(share * len(raw))])
    code, said = audited(packed)
    assert code == 2, said
    assert packed.name in said
    assert re.search(r"cut off|ended before|ends within", said), said


def test_a_packed_file_that_breaks_off_between_frames(run: Run, tmp_path: Path) -> None:
    """Each part by itself is whole: that the last has no end is seen only by its packing."""
    zstandard = pytest.importorskip("zstandard")
    text = written(tmp_path, "dump", run).read_bytes()
    at = text.rindex(b"ITEM: TIMESTEP")
    packer = zstandard.ZstdCompressor().compressobj()
    raw = packer.compress(text[:at]) + packer.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK)
    packed = tmp_path / "run.dump.zst"
    packed.write_bytes(raw)
    code, said = audited(packed)
    assert code == 2, said
    assert "ends within a frame of zstd" in said
    packed.write_bytes(zstandard.compress(text[:at]) + zstandard.compress(text[at:]))
    assert audited(packed)[0] == 0


PACKED: dict[str, Callable[[bytes], bytes]] = {
    "another sum": lambda raw: raw[:-8] + bytes([raw[-8] ^ 255]) + raw[-7:],
    "more behind": lambda raw: raw + b"garbage",
    "not packed": lambda raw: gzip.decompress(raw),
    "of nothing": lambda _: gzip.compress(b""),
}


@pytest.mark.parametrize("change", PACKED)
def test_packed_files_that_are_damaged(change: str, run: Run, tmp_path: Path) -> None:
    packed = tmp_path / "run.dump.gz"
    packed.write_bytes(PACKED[change](gzip.compress(written(tmp_path, "dump", run).read_bytes())))
    code, said = audited(packed)
    assert code == 2, said
    assert packed.name in said


@pytest.mark.parametrize("name", FILES)
def test_empty_files_and_folders_of_their_name(name: str, tmp_path: Path) -> None:
    path = tmp_path / FORMATS[name][0]
    path.write_bytes(b"")
    code, said = audited(path)
    assert code == 2, said
    assert path.name in said
    assert re.search(r"is empty|is no |0 bytes", said), said
    path.unlink()
    path.mkdir()
    code, said = audited(path)
    assert code == 2, said
    assert f"{path.name} holds no frames" in said


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("change", ["ends of Windows", "byte-order mark", "both"])
def test_texts_of_windows_are_read(change: str, name: str, run: Run, tmp_path: Path) -> None:
    path = written(tmp_path, name, run)
    raw = path.read_bytes()
    raw = raw if change == "byte-order mark" else raw.replace(b"\n", b"\r\n")
    path.write_bytes(raw if change == "ends of Windows" else b"\xef\xbb\xbf" + raw)
    code, said = audited(path)
    assert code == 0, said


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32"])
def test_other_encodings_are_named(encoding: str, name: str, run: Run, tmp_path: Path) -> None:
    path = written(tmp_path, name, run)
    path.write_bytes(path.read_text().encode(encoding))
    code, said = audited(path)
    assert code == 2, said
    assert path.name in said
    assert "line 1" in said


IDS = {
    "all the same": (r"^(\d+) ", "7 ", 1, "doubled: 7"),
    "no whole numbers": (r"^(\d+) ", r"\1.5 ", 2, "frame 1, line 10: the id 1.5 is no whole number"),
    "none": (r"^(\d+) ", "nan ", 1, "doubled: -1"),
}


@pytest.mark.parametrize("change", IDS)
def test_ids_that_name_no_body(change: str, run: Run, tmp_path: Path) -> None:
    pattern, new, code, words = IDS[change]
    path = written(tmp_path, "dump", run)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(re.sub(pattern, new, line) if len(line.split()) > 8 else line for line in lines) + "\n")
    found, said = audited(path)
    assert found == code, said
    assert words in said


HEADS = {
    "half a row": ("ATOMS\n4", "ATOMS\n4.5", "line 4, frame 1: '4.5' is no number of rows"),
    "too many to hold": ("ATOMS\n4", "ATOMS\n999999999999", "ends after 4 of 999999999999 lines"),
    "1e30 rows": ("ATOMS\n4", "ATOMS\n1e30", "ends after 4 of"),
    "no step": ("TIMESTEP\n0", "TIMESTEP\nnan", "line 2, frame 1: 'nan' is no step"),
    "a cell of no size": ("ff ff ff\n-9 9\n-9 9\n-9 9", "pp pp pp\n0 0\n0 0\n0 0", "frame 1, line 10: the periodic box is empty"),
}  # fmt: skip


@pytest.mark.parametrize("change", HEADS)
def test_heads_of_dumps(change: str, run: Run, tmp_path: Path) -> None:
    old, new, words = HEADS[change]
    path = written(tmp_path, "dump", run)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    code, said = audited(path)
    assert code == 2, said
    assert words in said


TABLES: dict[str, tuple[Callable[[str], str], int, str]] = {
    "a head alone": (lambda text: text.split("\n")[0] + "\n", 2, "too few frames"),
    "no head": (lambda text: text.split("\n", 1)[1], 2, "line 1: .* is no line of column names"),
    "the head twice": (lambda text: text + text, 2, r"column 1 \(t\): 't' is no number"),
    "decimal commas": (lambda text: text.replace(".", ","), 2, "line 2: 17 columns, expected 13"),
    "one time": (lambda text: re.sub(r"(?m)^[\d.]+,", "0.0,", text), 2, "too few frames"),
    "a zero byte": (lambda text: text[: len(text) // 2] + "\0" + text[len(text) // 2 :], 2, r"line \d+, column"),
    "columns in another order from the middle on": (
        lambda text: text[: len(text) // 2].rpartition("\n")[0] + "\n"
        + re.sub(r"(?m)^(([^,]*,){4})([^,]*),([^,]*),", r"\1\4,\3,", text[len(text[: len(text) // 2].rpartition("\n")[0]) + 1 :]),
        1, "motion",
    ),
    "five million letters": (lambda _: "x" * 5_000_000, 2, "line 1"),
}  # fmt: skip


@pytest.mark.parametrize("change", TABLES)
def test_tables(change: str, run: Run, tmp_path: Path) -> None:
    make, code, words = TABLES[change]
    path = written(tmp_path, "csv", run)
    path.write_text(make(path.read_text()))
    found, said = audited(path)
    assert found == code, said
    assert re.search(words, said), said[:2000]
    assert len(said) < 20_000
