"""Pieces of VTK files, indices whose times are numbers of frames, VTKHDF: silent traps are asked about or refused."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_written import DENSE, PLAIN, RADIUS, TOML, Run, make_run, vtk_pieces, vtk_raw, vtkhdf

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.infer import infer_scene
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(frames=30)


def record(file: Path, toml: str = TOML + PLAIN) -> dict[str, Any]:
    scene = file.with_name("audit.toml")
    scene.write_text(toml)
    return audit(file, read_scene(scene), lambda *_: None)


def violated(found: dict[str, Any]) -> list[str]:
    return [check["id"] for check in found["checks"] if check["verdict"] == "violated"]


def refused(file: Path, match: str) -> None:
    with pytest.raises(UsageError, match=match):
        record(file)


def index_of(folder: Path, times: list[float], kind: str = "vtp") -> Path:
    files = sorted(folder.glob(f"*.{kind}"))
    rows = [
        f'<DataSet timestep="{t:.15g}" file="{folder.name}/{file.name}"/>' for t, file in zip(times, files, strict=True)
    ]
    path = folder.with_name("run.pvd")
    path.write_text(f"<VTKFile><Collection>{''.join(rows)}</Collection></VTKFile>")
    return path


def test_points_of_other_pieces_are_left_out(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run, ghosts=True)
    assert violated(record(tmp_path / "frames")) == []


def test_points_that_two_pieces_have_unmarked_are_named(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run, ghosts=True)
    for file in (tmp_path / "frames").glob("*.vtp"):
        file.write_text(file.read_text().replace("vtkGhostType", "mark"))
    assert "particles" in violated(record(tmp_path / "frames"))


def test_pieces_without_ids_are_refused(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run, ids=False)
    refused(tmp_path / "frames", r"frame-000000\.pvtp: 2 pieces and no ids")


def test_a_piece_that_is_missing_is_named(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run)
    (tmp_path / "frames" / "frame-000200_1.vtp").unlink()
    refused(tmp_path / "frames", r"frame-000200\.pvtp names the piece 'frame-000200_1\.vtp', which is not there")


def test_one_file_of_pieces_is_no_series(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run)
    refused(tmp_path / "frames" / "frame-000000.pvtp", "a single frame")


def test_an_index_of_pieces_gives_the_times(run: Run, tmp_path: Path) -> None:
    vtk_pieces(tmp_path / "frames", run)
    assert violated(record(index_of(tmp_path / "frames", run.t, "pvtp"))) == []
    late = [t * 1.001 for t in run.t]
    assert "motion" in violated(record(index_of(tmp_path / "frames", late, "pvtp")))


def test_whole_times_of_an_index_are_numbers_and_not_seconds(run: Run, tmp_path: Path) -> None:
    """MercuryDPM's converter numbers frames; taken as seconds, each would last 1000 times too long."""
    vtk_raw(tmp_path / "frames", run)
    index = index_of(tmp_path / "frames", [float(k) for k in range(30)])
    found = record(index)
    assert violated(found) == []
    assert any("whole numbers" in each for each in found["remarks"])
    for clock in ("", "time = {dt = 2e-5}"):
        toml = "\n".join(clock if line.startswith("time") else line for line in TOML.splitlines()) + "\n" + PLAIN
        with pytest.raises(UsageError, match=r"numbers its frames and has no times: give \[time\] interval"):
            record(index, toml)
    assert any("time.interval" in each for each in infer_scene(index).lacking)


def test_uneven_whole_times_are_steps(run: Run, tmp_path: Path) -> None:
    keep = [0, 1, 3, 4, 8, 9, 20]
    vtk_raw(tmp_path / "frames", Run([run.step[k] for k in keep], [run.t[k] for k in keep], run.rows[keep]))
    assert violated(record(index_of(tmp_path / "frames", [float(run.step[k]) for k in keep]))) == []


def test_parts_of_a_frame_as_files_of_an_index_are_refused(run: Run, tmp_path: Path) -> None:
    vtk_raw(tmp_path / "frames", run)
    refused(index_of(tmp_path / "frames", [run.t[k // 2] for k in range(30)]), "a timestep that another file has")


def test_offsets_of_vtk_with_one_entry_more_are_read(run: Run, tmp_path: Path) -> None:
    """As VTK 9.7 writes them; the specification has one for each step."""

    def change(group: Any) -> None:
        for name in ("id", "mass"):
            values = group["Steps/PointDataOffsets"][name][()]
            del group["Steps/PointDataOffsets"][name]
            group["Steps/PointDataOffsets"][name] = np.append(values, 8)

    vtkhdf(tmp_path / "run.vtkhdf", run, change=change)
    assert violated(record(tmp_path / "run.vtkhdf")) == []


def without(name: str) -> Any:
    def change(group: Any) -> None:
        del group[name]

    return change


def attribute(name: str, value: Any) -> Any:
    def change(group: Any) -> None:
        (group["Steps"] if name == "NSteps" else group).attrs[name] = value

    return change


def number(name: str, k: int, value: int) -> Any:
    def change(group: Any) -> None:
        group[name][k] = value

    return change


@pytest.mark.parametrize(("change", "match"), [
    (without("Steps"), "a single frame of VTKHDF"),
    (without("PointData/id"), "frame 1: 2 parts and no ids"),
    (without("Steps/PartOffsets"), "PartOffsets"),
    (attribute("Type", np.bytes_("ImageData")), "type 'ImageData'"),
    (attribute("Version", (3, 0)), r"version \[3, 0\]"),
    (attribute("NSteps", 29), "NSteps is 29, and Steps/Values has 30"),
    (number("Steps/PartOffsets", 4, 59), "frame 5: parts 59 to 61 of 60"),
    (number("Steps/PointOffsets", 6, 118), "frame 7: rows 118 to 122"),
])  # fmt: skip
def test_vtkhdf_traps_are_refused(change: Any, match: str, run: Run, tmp_path: Path) -> None:
    vtkhdf(tmp_path / "run.vtkhdf", run, change=change)
    with pytest.raises(UsageError, match=match) as caught:
        record(tmp_path / "run.vtkhdf")
    assert "run.vtkhdf" in str(caught.value)


def test_vtkhdf_parts_may_be_left_unnumbered_if_all_steps_have_as_many(run: Run, tmp_path: Path) -> None:
    vtkhdf(tmp_path / "run.vtkhdf", run, change=without("Steps/NumberOfParts"))
    assert violated(record(tmp_path / "run.vtkhdf")) == []


def test_vtkhdf_arrays_of_another_step_are_named(run: Run, tmp_path: Path) -> None:
    """Velocities that start a step late."""

    def change(group: Any) -> None:
        group["Steps/PointDataOffsets/velocity"] = 4 * np.minimum(np.arange(30) + 2, 29)

    vtkhdf(tmp_path / "run.vtkhdf", run, change=change)
    assert "motion" in violated(record(tmp_path / "run.vtkhdf"))


def kratos(folder: Path, run: Run, **change: Any) -> None:
    """As Kratos 10.4 writes bodies, by pyevtk: raw numbers behind a line break, sizes of eight bytes, no ids."""
    folder.mkdir()
    for k in range(len(run.t)):
        arrays = {
            "points": run.x[k],
            "radius": RADIUS,
            "velocity": run.v[k],
            "angular_velocity": run.omega[k],
            **change,
        }
        head, body = "", b""
        for name, values in arrays.items():
            raw = np.ascontiguousarray(values).tobytes()
            width = 3 if values.ndim == 2 else 1
            head += f'<DataArray Name="{name}" NumberOfComponents="{width}" type="Float64" format="appended" offset="{len(body)}"/>\n'
            head += "</Points>\n<PointData>" if name == "points" else ""
            body += struct.pack("<Q", len(raw)) + raw
        text = (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="UInt64">\n'
        )
        text += f'<UnstructuredGrid>\n<Piece NumberOfPoints="4" NumberOfCells="4">\n<Points>\n{head}</PointData>\n</Piece>\n'
        text += '</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
        (folder / f"scene_Particles_{k}.vtu").write_bytes(text.encode() + body + b"\n</AppendedData>\n</VTKFile>\n")


def test_a_folder_as_of_kratos_passes_by_its_bodies(run: Run, tmp_path: Path) -> None:
    kratos(tmp_path / "post", run)
    found = record(tmp_path / "post", TOML + DENSE)
    assert violated(found) == []
    assert any("there are no ids" in each for each in found["remarks"])
    for k in range(30):
        (tmp_path / "post" / f"scene_Walls_{k}.vtu").write_text("")
    found = record(tmp_path / "post", TOML + DENSE)
    assert violated(found) == []
    assert "scene_Particles_#.vtu (# a number) are the bodies: scene_Walls_#.vtu" in found["remarks"][0]


NAMES = {
    "MercuryDPM": {b"velocity": b"Velocity", b"omega": b"AngularVelocity", b'"id"': b'"Id"', b'"radius"': b'"Radius"'},
    "ESyS-Particle": {b"omega": b"angular velocity", b'"id"': b'"Id"', b'"mass"': b'"particleMass"'},
}
"""Of `ParticleVtkWriter` and of `dump2vtk`."""


@pytest.mark.parametrize("program", NAMES)
def test_names_of_other_programs_are_understood(program: str, run: Run, tmp_path: Path) -> None:
    vtk_raw(tmp_path / "frames", run)
    for file in (tmp_path / "frames").iterdir():
        text = file.read_bytes()
        for old, new in NAMES[program].items():
            assert old in text
            text = text.replace(old, new)
        file.write_bytes(text)
    assert violated(record(tmp_path / "frames")) == []
    first = next(read_trajectory(tmp_path / "frames", {}).frames(lambda *_: None))
    assert {"vx", "omega", "omegax", "id", "radius", "mass"} <= set(first.columns)
