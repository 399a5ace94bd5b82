"""Formats of other programs: the same run passes in each, the same fault is named in each, and silent traps are asked about or refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from ninedisk_tests_written import (
    DENSE,
    FORMATS,
    PLAIN,
    RADIUS,
    TOML,
    WITH_BODIES,
    Run,
    gsd,
    h5md,
    make_run,
    netcdf,
    yade,
    yaml,
)
from numpy.testing import assert_allclose

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.infer import infer_scene
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene

NEW = ("yaml", "extxyz", "yade", "netcdf", "netcdf-hdf5", "gsd", "h5md", "vtk-pieces", "vtkhdf", "mercury")
TIMED = ("extxyz", "vtkhdf", "mercury")
"""Formats with times and no steps."""
BINARY = ("netcdf", "h5md", "vtkhdf")


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(frames=60)


def record(file: Path, bodies: str = PLAIN) -> dict[str, Any]:
    toml = file.with_name("audit.toml")
    toml.write_text(TOML + (DENSE if file.suffix == ".data" else bodies))
    return audit(file, read_scene(toml), lambda *_: None)


def violated(found: dict[str, Any]) -> list[str]:
    return [check["id"] for check in found["checks"] if check["verdict"] == "violated"]


def frames(file: Path) -> list[Any]:
    return list(read_trajectory(file, {}).frames(lambda *_: None))


@pytest.mark.parametrize("name", NEW)
def test_a_right_run_passes(name: str, run: Run, tmp_path: Path) -> None:
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    found = record(tmp_path / file)
    assert violated(found) == [], found["checks"][0]["said"]
    assert found["frames"] == 60
    decided = {check["id"] for check in found["checks"] if check["verdict"] == "holds"}
    assert {"free", "momentum", "spin", "motion", "overlap", "energy"} <= decided


@pytest.mark.parametrize("name", BINARY)
def test_a_right_run_in_single_precision_passes(name: str, run: Run, tmp_path: Path) -> None:
    file, write = FORMATS[name]
    write(tmp_path / file, run, "f4")
    found = record(tmp_path / file)
    assert violated(found) == [], found["checks"][0]["said"]
    assert found["digits"]["x"] == "single precision"


@pytest.mark.parametrize("name", NEW)
def test_another_gravity_is_named(name: str, tmp_path: Path) -> None:
    file, write = FORMATS[name]
    write(tmp_path / file, make_run(9.8, frames=60))
    assert "free" in violated(record(tmp_path / file))


@pytest.mark.parametrize("name", NEW)
def test_numbers_are_those_of_the_run(name: str, run: Run, tmp_path: Path) -> None:
    """Each component in its place, by position of the bodies in the file."""
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    read = frames(tmp_path / file)
    digits = 1e-5 if name == "yade" else 5e-7
    for k in (0, 17, 59):
        order = np.argsort(read[k].columns.get("id", np.arange(4)))
        for c, column in enumerate(("x", "y", "z", "vx", "vy", "vz", "omegax", "omegay", "omega")):
            assert_allclose(read[k].columns[column][order], run.rows[k, :, c], rtol=digits, atol=digits)
        assert_allclose(read[k].columns["radius"][order], RADIUS, rtol=digits)
        assert read[k].step == run.step[k] or name in TIMED


@pytest.mark.parametrize(("name", "package", "extra"), [
    ("netcdf", "netCDF4", "netcdf"), ("gsd", "gsd.fl", "gsd"), ("h5md", "h5py", "h5md"), ("vtkhdf", "h5py", "h5md"),
])  # fmt: skip
def test_a_missing_package_is_named(
    name: str, package: str, extra: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UsageError, match=rf"{file}.*install ninedisk\[{extra}\]"):
        record(tmp_path / file)


def refused(file: Path, match: str, bodies: str = PLAIN) -> None:
    with pytest.raises(UsageError, match=match) as caught:
        record(file, bodies)
    assert file.name in str(caught.value)


def edited_netcdf(path: Path, run: Run, kind: str = "f8") -> Any:
    import netCDF4

    netcdf(path, run, kind)
    data = netCDF4.Dataset(path, "a")
    data.set_auto_maskandscale(False)
    return data


def test_netcdf_scaled_coordinates_are_refused(run: Run, tmp_path: Path) -> None:
    with edited_netcdf(tmp_path / "run.nc", run) as data:
        data.renameVariable("coordinates", "scaled_coordinates")
    refused(tmp_path / "run.nc", r"scaled_coordinates alone.*x y z or xu yu zu")


def test_netcdf_units_of_amber_are_refused(run: Run, tmp_path: Path) -> None:
    with edited_netcdf(tmp_path / "run.nc", run) as data:
        data.variables["velocities"].scale_factor = 20.455
    refused(tmp_path / "run.nc", r"velocities has the scale_factor 20\.455")


def test_netcdf_steps_beyond_single_precision_are_refused(run: Run, tmp_path: Path) -> None:
    with edited_netcdf(tmp_path / "run.nc", run, "f4") as data:
        data.variables["time"][:] = np.array(run.step) + 2**25
    refused(tmp_path / "run.nc", r"frame 1: the step .* single precision.*double yes")


def test_netcdf_steps_count_and_not_times_in_single_precision(run: Run, tmp_path: Path) -> None:
    netcdf(tmp_path / "run.nc", run)
    trajectory = read_trajectory(tmp_path / "run.nc", {})
    assert trajectory.clock == "step"
    assert any("scale_factor" in each for each in trajectory.remarks)
    assert any("time.dt" in each for each in infer_scene(tmp_path / "run.nc").lacking)


def test_netcdf_a_body_that_is_no_longer_written_is_lost(run: Run, tmp_path: Path) -> None:
    with edited_netcdf(tmp_path / "run.nc", run) as data:
        data.variables["id"][30, 3] = -2147483647
    found = record(tmp_path / "run.nc")
    assert violated(found) == ["particles"]
    assert "frame 31" in found["checks"][0]["said"]


def test_netcdf_cut_by_one_byte_is_refused(run: Run, tmp_path: Path) -> None:
    """The library fills what is missing with zeros and says nothing."""
    netcdf(tmp_path / "run.nc", run)
    whole = (tmp_path / "run.nc").read_bytes()
    (tmp_path / "run.nc").write_bytes(whole[:-1])
    refused(tmp_path / "run.nc", rf"has {len(whole) - 1} bytes, and its header says {len(whole)} for 60 frames")


@pytest.mark.parametrize("chunk", ["diameter", "mass"])
def test_gsd_defaults_are_no_measured_numbers(chunk: str, run: Run, tmp_path: Path) -> None:
    gsd(tmp_path / "run.gsd", run, leave_out=(chunk,))
    refused(tmp_path / "run.gsd", f"no column {'radius' if chunk == 'diameter' else 'mass'}")
    found = record(tmp_path / "run.gsd", WITH_BODIES)
    assert violated(found) == []
    assert any(f"{chunk} is not stored" in each for each in found["remarks"])


def test_gsd_velocities_of_the_first_frame_alone_are_not_those_of_all(run: Run, tmp_path: Path) -> None:
    """By the schema every later frame has the velocities of the first; HOOMD writes such files by default."""
    gsd(tmp_path / "run.gsd", run, once=("velocity", "angmom"))
    found = record(tmp_path / "run.gsd")
    assert violated(found) == []
    assert any("velocity is stored with the first frame alone" in each for each in found["remarks"])
    assert next(check for check in found["checks"] if check["id"] == "spin")["verdict"] == "not decidable"


def test_gsd_spins_that_are_half_as_large_are_named(run: Run, tmp_path: Path) -> None:
    """As who takes HOOMD's conjugate quaternion, 2 q S, for S."""
    rows = run.rows.copy()
    rows[:, :, 6:] *= 0.5
    gsd(tmp_path / "run.gsd", Run(run.step, run.t, rows))
    assert "spin" in violated(record(tmp_path / "run.gsd"))


def test_h5md_units_that_do_not_fit_are_refused(run: Run, tmp_path: Path) -> None:
    def change(group: Any) -> None:
        group["position/value"].attrs["unit"] = "nm"
        group["velocity/value"].attrs["unit"] = "m s-1"
        group["position/time"].attrs["unit"] = "ps"

    h5md(tmp_path / "run.h5", run, change=change)
    refused(tmp_path / "run.h5", "velocity is in 'm s-1', position in 'nm'")


def test_h5md_elements_at_other_steps_are_refused(run: Run, tmp_path: Path) -> None:
    def change(group: Any) -> None:
        group["velocity/step"][5] += 1

    h5md(tmp_path / "run.h5", run, change=change)
    refused(tmp_path / "run.h5", "velocity is stored at other steps than position")


def test_h5md_of_several_groups_is_refused(run: Run, tmp_path: Path) -> None:
    h5md(tmp_path / "run.h5", run)
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file["particles"].create_group("walls")
    refused(tmp_path / "run.h5", r"2 groups in particles \(all, walls\)")


def test_h5md_images_continue_across_the_edges(tmp_path: Path) -> None:
    run = make_run(frames=60)
    box = np.array([0.3, 0.25, 5.0])
    image = np.floor(run.x / box)
    wrapped = run.rows.copy()
    wrapped[:, :, :3] -= image * box

    def change(group: Any) -> None:
        group["box"].attrs["boundary"] = [b"periodic", b"periodic", b"none"]
        group["box/edges"] = box
        image[..., 2] = 0
        group.create_group("image")
        group["image/value"], group["image/step"], group["image/time"] = image.astype(int), run.step, run.t

    wrapped[:, :, 2] = run.x[:, :, 2]
    h5md(tmp_path / "run.h5", Run(run.step, run.t, wrapped), change=change)
    read = frames(tmp_path / "run.h5")
    assert_allclose(read[59].columns["x"], run.x[59, :, 0], rtol=1e-12, atol=1e-14)
    assert np.isnan(read[0].cell[2]).all()


def test_extended_xyz_of_lammps_goes_by_its_steps(run: Run, tmp_path: Path) -> None:
    """LAMMPS prints Time with six decimals, so that small steps do not show."""
    file, write = FORMATS["extxyz"]
    write(tmp_path / file, run)
    text = (tmp_path / file).read_text().split("\n")
    number = iter(run.step)
    rows = [f"Timestep={next(number)} Time=0.000000 {row.partition(' ')[2]}" if "Time=" in row else row for row in text]
    (tmp_path / file).write_text("\n".join(rows))
    found = record(tmp_path / file)
    assert violated(found) == []
    assert any("six decimals" in each for each in found["remarks"])


def test_plain_xyz_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.xyz").write_text("1\nAtoms. Timestep: 0\nC 0 0 0\n")
    refused(tmp_path / "run.xyz", r"line 2: no Properties=")


def test_yade_columns_without_names_are_refused(run: Run, tmp_path: Path) -> None:
    yade(tmp_path / "frames", run)
    for file in (tmp_path / "frames").iterdir():
        rows = file.read_text().split("\n")
        file.write_text("\n".join([rows[0], *rows[2:]]))
    refused(tmp_path / "frames", r"line 2: columns of x_y_z_r_attrs have no names.*comment=")


def test_yade_rows_are_bodies_and_one_file_is_no_series(run: Run, tmp_path: Path) -> None:
    yade(tmp_path / "frames", run)
    assert any("there are no ids" in each for each in record(tmp_path / "frames")["remarks"])
    with pytest.raises(UsageError, match="a single frame of YADE"):
        read_trajectory(tmp_path / "frames" / "0.txt", {})


def test_yaml_of_other_programs_and_mixed_units_are_refused(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("---\nkind: Pod\n")
    refused(tmp_path / "a.yaml", "creator: LAMMPS")
    yaml(tmp_path / "b.yaml", run)
    text = (tmp_path / "b.yaml").read_text()
    (tmp_path / "b.yaml").write_text(text.replace("units: si", "units: metal"))
    refused(tmp_path / "b.yaml", "units metal mix")


def test_yaml_diameters_are_halved_and_said_so(run: Run, tmp_path: Path) -> None:
    yaml(tmp_path / "a.yaml", run)
    text = (tmp_path / "a.yaml").read_text()
    (tmp_path / "a.yaml").write_text(text.replace("radius", "diameter"))
    read = read_trajectory(tmp_path / "a.yaml", {})
    assert read.remarks == ("radius is half of the column diameter",)
    assert_allclose(next(read.frames(lambda *_: None)).columns["radius"], 0.5 * RADIUS)


def test_yaml_without_its_last_line_is_cut_off(run: Run, tmp_path: Path) -> None:
    yaml(tmp_path / "a.yaml", run)
    lines = (tmp_path / "a.yaml").read_text().splitlines()
    (tmp_path / "a.yaml").write_text("\n".join(lines[:-1]) + "\n")
    refused(tmp_path / "a.yaml", rf"line {len(lines) - 1}: the file ends within frame 60, before its '\.\.\.'")
