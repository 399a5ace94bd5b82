"""What a command writes goes where its path leads: links stay, devices and FIFOs are written into and never replaced."""

from __future__ import annotations

import json
import os
import pty
import socket
import stat
import subprocess
import sys
import threading
import tty
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.core.archive import whole_file
from ninedisk.core.errors import UnwritableFileError
from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.audit.example import write_example
from ninedisk.harness.audit.law_test import write_law_test
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.export import write_export
from ninedisk.harness.results.whole_file import check_writable, write_whole
from ninedisk.reports.folder import fresh_folder


def write(path: Path, text: str = "new\n") -> None:
    check_writable("--json", path)
    write_whole("--json", path, text)


def read_of_fifo(path: Path, found: list[str]) -> threading.Thread:
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: found.append(path.read_text()), daemon=True)
    reader.start()
    return reader


def test_a_fifo_gets_the_text_and_stays(tmp_path: Path) -> None:
    found: list[str] = []
    reader = read_of_fifo(tmp_path / "fifo", found)
    write(tmp_path / "fifo")
    reader.join(10.0)
    assert found == ["new\n"]
    assert stat.S_ISFIFO((tmp_path / "fifo").stat().st_mode)
    assert os.listdir(tmp_path) == ["fifo"]


def test_a_table_goes_into_a_fifo(tmp_path: Path) -> None:
    """Parquet and archives of arrays seek in their file, which a FIFO cannot."""
    found: list[bytes] = []
    os.mkfifo(tmp_path / "all.parquet")
    reader = threading.Thread(target=lambda: found.append((tmp_path / "all.parquet").read_bytes()), daemon=True)
    reader.start()
    write_export([], tmp_path / "all.parquet")
    reader.join(10.0)
    assert found[0][:4] == found[0][-4:] == b"PAR1"


def test_a_character_device_gets_the_text_and_stays(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    try:
        tty.setraw(slave)
        name = Path(os.ttyname(slave))
        (tmp_path / "link").symlink_to(name)
        for path in (name, tmp_path / "link"):
            write(path)
            assert os.read(master, 100) == b"new\n"
            assert stat.S_ISCHR(path.stat().st_mode)
        assert (tmp_path / "link").readlink() == name
    finally:
        os.close(master)
        os.close(slave)


def test_a_node_such_as_dev_null_stays(tmp_path: Path) -> None:
    node = tmp_path / "null"
    try:
        os.mknod(node, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        node.write_text("")
    except OSError:
        pytest.skip("only root makes device nodes, and not on every file system")
    write(node)
    with whole_file(node) as stream:
        stream.write(b"content")
    assert stat.S_ISCHR(node.stat().st_mode)


@pytest.mark.parametrize("before", ["old\n", None])
@pytest.mark.parametrize("links", [1, 2])
def test_a_link_stays_and_its_file_is_replaced(before: str | None, links: int, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "file", tmp_path / "link"
    if before is not None:
        target.write_text(before)
        target.chmod(0o640)
    if links == 2:
        (tmp_path / "middle").symlink_to(Path("there", "file"))
    link.symlink_to("middle" if links == 2 else Path("there", "file"))
    write(link)
    assert link.is_symlink()
    assert target.read_text() == "new\n"
    assert not target.is_symlink()
    assert os.listdir(target.parent) == ["file"]
    if before is not None:
        assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_a_failure_leaves_the_file_behind_a_link_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to("file")
    with pytest.raises(TypeError), whole_file(tmp_path / "link") as stream:
        stream.writelines((b"half", None))  # type: ignore[arg-type]
    assert (tmp_path / "file").read_text() == "old"
    assert sorted(os.listdir(tmp_path)) == ["file", "link"]


def test_what_takes_no_file_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "cycle").symlink_to("cycle")
    (tmp_path / "nowhere").symlink_to(Path("no", "folder", "file"))
    with socket.socket(socket.AF_UNIX) as bound:
        here = Path.cwd()
        os.chdir(tmp_path)  # the path of a socket may have 107 bytes
        try:
            bound.bind("socket")
        finally:
            os.chdir(here)
        for name in ("cycle", "nowhere", "socket"):
            with pytest.raises(UsageError, match=f"--json '.*{name}' cannot be written"):
                check_writable("--json", tmp_path / name)
            with pytest.raises(StoreError, match=f"{name}' cannot be written .* give another --json FILE"):
                write_whole("--json", tmp_path / name, "")
            with pytest.raises(UnwritableFileError), whole_file(tmp_path / name):
                pass
    assert sorted(os.listdir(tmp_path)) == ["cycle", "nowhere", "socket"]


def test_standard_output_in_a_file_is_continued(tmp_path: Path) -> None:
    """What the shell has opened is neither replaced nor cut off. The link is one like /dev/stdout, and not that one."""
    if not os.path.exists("/proc/self/fd/1"):
        pytest.skip("no /proc here")
    (tmp_path / "stdout").symlink_to("/proc/self/fd/1")
    script = (
        "import sys; from pathlib import Path; from ninedisk.harness.results.whole_file import check_writable, write_whole\n"
        "path = Path(sys.argv[1]); print('before', flush=True); check_writable('--json', path)\n"
        "write_whole('--json', path, 'new\\n'); print('after')"
    )
    with (tmp_path / "out").open("w") as out:
        subprocess.run([sys.executable, "-c", script, str(tmp_path / "stdout")], stdout=out, check=True)
    assert (tmp_path / "out").read_text() == "before\nnew\nafter\n"


@pytest.mark.parametrize(
    "words",
    [
        "audit --example",
        "law-test write",
        "docs --out",
        "cd-problems make --out",
        "bench cd --out",
        "schema --all --out",
        "new-engine acme --out",
    ],
)
@pytest.mark.parametrize("place", ["/proc/x", "/proc/x/y", "/dev/null/x"])
def test_a_folder_where_none_can_be_made_is_named(words: str, place: str) -> None:
    """Rights alone do not show it: /proc grants root all of them and holds no new folder."""
    if not os.path.exists("/proc/self"):
        pytest.skip("no /proc here")
    done = CliRunner().invoke(app, [*words.split(), place])
    assert done.exit_code == 2, done.output
    assert repr(place) in done.output
    assert "give a" in done.output
    assert "internal error" not in done.output


@pytest.mark.parametrize("make", [write_example, write_law_test])
def test_a_folder_that_cannot_be_made_is_named_in_python(make: Callable[[Path], list[Path]]) -> None:
    with pytest.raises(UnwritableFileError, match="/dev/null/x"):
        make(Path("/dev/null/x"))


@pytest.mark.usefixtures("fakes")
def test_a_command_writes_into_a_fifo_and_through_a_link(tmp_path: Path) -> None:
    found: list[str] = []
    reader = read_of_fifo(tmp_path / "fifo", found)
    (tmp_path / "link").symlink_to("file")
    for path in (tmp_path / "fifo", tmp_path / "link"):
        result = CliRunner().invoke(
            app, ["run", "fake/fall", "-e", "fake-good", "--store", str(tmp_path / "store"), "--json", str(path)]
        )
        assert result.exit_code == 0, result.output
    reader.join(10.0)
    assert json.loads(found[0])
    assert json.loads((tmp_path / "file").read_text())
    assert (tmp_path / "link").is_symlink()


@pytest.mark.parametrize("before", [True, False])
def test_a_link_to_a_folder_of_pages_stays(before: bool, tmp_path: Path) -> None:
    (tmp_path / "pages").symlink_to("there")
    if before:
        (tmp_path / "there").mkdir()
    for text in ("one", "two"):
        with fresh_folder(tmp_path / "pages", ".marker", "report") as folder:
            (folder / "index.html").write_text(text)
    assert (tmp_path / "pages").is_symlink()
    assert (tmp_path / "there" / "index.html").read_text() == "two"
    assert sorted(os.listdir(tmp_path)) == ["pages", "there"]
