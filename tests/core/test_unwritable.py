"""Files that cannot be written: an error of ours that names the path, and what stood there before is unchanged."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, CoreError, Disks, Numerics, Scene, UnwritableFileError
from ninedisk.core.archive import whole_file
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.dem.files import FrameWriter, write_checkpoint

ONE_DISK = Scene(disks=Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1e4))
STATE = {"x": np.zeros((1, 2)), "v": np.zeros((1, 2)), "angle": np.zeros(1), "omega": np.zeros(1), "radius": np.ones(1)}


def save_problem(path: Any) -> None:
    ContactProblem(
        mass=np.ones((2, 3)), force=np.zeros((2, 3)), bodies=np.array([[0, 1]]), normal=np.array([[1.0, 0.0]]),
        arms=np.zeros((1, 4)), offset=np.zeros((1, 2)), mu=np.ones(1),
    ).save(path)  # fmt: skip


def save_checkpoint(path: Any) -> None:
    write_checkpoint(path, ONE_DISK, Numerics(dt=1e-3, n_steps=1), {"clock": np.zeros(3)})


@pytest.mark.parametrize("save", [save_problem, save_checkpoint])
@pytest.mark.parametrize("place", ["missing/file.npz", "folder", "file/below.npz", "a\x00b", "", "9" * 400, None, 42])
def test_paths_that_cannot_be_written(save: Callable[[Any], None], place: Any, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("before")
    given = tmp_path / place if isinstance(place, str) and place else place
    with pytest.raises(UnwritableFileError, match=r"cannot be written .*give a path in a folder that exists") as caught:
        save(given)
    named = Path(given).name[:20].replace("\x00", "\\x00") if isinstance(given, Path) else repr(place)
    assert named in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "before"


def test_folders_of_frames_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("before")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "a\x00b", None):
        with pytest.raises(UnwritableFileError, match="cannot be written"):
            FrameWriter(folder)  # type: ignore[arg-type]
    assert (tmp_path / "file").read_text() == "before"


@pytest.mark.parametrize("form", ["npz", "vtk"])
def test_a_folder_of_frames_that_vanishes(form: Any, tmp_path: Path) -> None:
    writer = FrameWriter(tmp_path / "frames", form)
    (tmp_path / "frames").rmdir()
    with pytest.raises(UnwritableFileError, match="frame-000000"):
        writer.write(0.0, STATE)


def half_written(target: Path, failure: Exception) -> None:
    with whole_file(target) as stream:
        stream.write(b"half")
        raise failure


def test_a_failure_on_the_way_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    target = tmp_path / "run.npz"
    target.write_bytes(b"before")
    for failure, seen in (
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), UnwritableFileError),
        (CoreError("the content's own"), CoreError),
    ):
        with pytest.raises(seen, match=r"No space left|the content's own"):
            half_written(target, failure)
    assert target.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["run.npz"]
