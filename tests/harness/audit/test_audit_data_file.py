"""Radii and masses out of LAMMPS data files: the right ones pass, those of another run or another order of columns are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_written import MASS, PLAIN, RADIUS, TOML, Run, dump, make_run
from numpy.testing import assert_allclose

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.readers.lammps_data import read_data_file
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import scene_of_text

HEAD = """LAMMPS data file via write_data, version 22 Jul 2025, timestep = 2005, units = {units}

4 atoms
1 atom types

-9 9 xlo xhi
-9 9 ylo yhi
-9 9 zlo zhi

{masses}Atoms # {style}

"""
ROWS = {
    "sphere": "{id} 1 {d:.16g} {rho:.16g} 0.1 0.2 0.3 0 0 0",
    "bpm/sphere": "{id} 7 1 {d:.16g} {rho:.16g} 0.1 0.2 0.3",
    "hybrid sphere bond": "{id} 1 0.1 0.2 0.3 {d:.16g} {rho:.16g} 7 0 0 0",
    "hybrid bond sphere": "{id} 1 0.1 0.2 0.3 7 {d:.16g} {rho:.16g} 0 0 0",
    "hybrid dipole sphere": "{id} 1 0.1 0.2 0.3 0.5 1 0 0 {d:.16g} {rho:.16g}",
}
"""Rows as LAMMPS of 22 July 2025 writes them; it names a hybrid style `hybrid` alone."""


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(frames=60)


def data(
    folder: Path, style: str = "sphere", *, units: str = "si", named: str | None = None, factor: float = 1.0
) -> Path:
    masses = "" if style in ("sphere", "bpm/sphere") else "Masses\n\n1 3\n\n"
    text = HEAD.format(units=units, style=named if named is not None else style.split()[0], masses=masses)
    density = MASS / (4.0 / 3.0 * np.pi * RADIUS**3)
    for i in (2, 0, 3, 1):
        text += ROWS[style].format(id=i + 1, d=2.0 * factor * RADIUS[i], rho=density[i]) + "\n"
    text += "\nVelocities\n\n" + "".join(f"{i + 1} 0 0 0 0 0 0\n" for i in range(4))
    path = folder / "run.data"
    path.write_text(text)
    return path


def bare(folder: Path, run: Run) -> Path:
    """A dump without radii and masses."""
    dump(folder / "run.dump", run)
    lines = []
    for line in (folder / "run.dump").read_text().splitlines():
        words = line.split()
        if line.startswith("ITEM: ATOMS"):
            line = line.replace(" radius mass", "")
        elif len(words) == 12:
            line = " ".join([words[0], *words[3:]])
        lines.append(line)
    (folder / "run.dump").write_text("\n".join(lines) + "\n")
    return folder / "run.dump"


def record(file: Path, more: str) -> dict[str, Any]:
    scene = scene_of_text(TOML + PLAIN + more, str(file.with_name("audit.toml")))
    return audit(file, scene, lambda *_: None)


def violated(found: dict[str, Any]) -> list[str]:
    return [check["id"] for check in found["checks"] if check["verdict"] == "violated"]


def refused(file: Path, more: str, match: str) -> None:
    with pytest.raises(UsageError, match=match) as caught:
        record(file, more)
    assert "run.data" in str(caught.value)


FILE = '[data]\nfile = "run.data"\n'


@pytest.mark.parametrize("style", ROWS)
def test_radii_and_masses_are_those_of_the_run(style: str, tmp_path: Path) -> None:
    found = read_data_file(data(tmp_path, style), style)
    assert found.id.tolist() == [1, 2, 3, 4]
    assert_allclose(found.radius, RADIUS, rtol=1e-15)
    assert_allclose(found.mass, MASS, rtol=1e-15)
    assert (found.mass_error <= 1e-14 * MASS).all()


@pytest.mark.parametrize("style", ["sphere", "hybrid bond sphere"])
def test_a_dump_without_radii_passes_with_its_data_file(style: str, run: Run, tmp_path: Path) -> None:
    data(tmp_path, style)
    found = record(bare(tmp_path, run), FILE + (f'style = "{style}"\n' if "hybrid" in style else ""))
    assert violated(found) == []
    decided = {check["id"] for check in found["checks"] if check["verdict"] == "holds"}
    assert {"free", "momentum", "spin", "overlap", "energy"} <= decided


def test_masses_of_another_run_are_named(tmp_path: Path) -> None:
    """Two bodies that meet change momentum by other shares."""
    path = data(tmp_path)
    lines = path.read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("2 1 "))
    words = lines[at].split()
    words[3] = "1500"
    lines[at] = " ".join(words)
    path.write_text("\n".join(lines) + "\n")
    assert violated(record(bare(tmp_path, make_run(frames=120)), FILE))[0] == "momentum"


def test_without_the_file_radii_are_asked_for(run: Run, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no column radius.*\[data\] file"):
        record(bare(tmp_path, run), "")


def test_radii_that_are_not_those_of_the_dump_are_refused(run: Run, tmp_path: Path) -> None:
    data(tmp_path, factor=2.0)
    dump(tmp_path / "run.dump", run)
    refused(tmp_path / "run.dump", FILE, "radius of atom 1 is 0.2, and 0.1")


def test_numbers_of_the_toml_replace_those_of_the_file(run: Run, tmp_path: Path) -> None:
    data(tmp_path, factor=2.0)
    given = PLAIN.replace("}", f", radius = {RADIUS.tolist()}, mass = {MASS.tolist()}}}")
    scene = scene_of_text(TOML + given + FILE, str(tmp_path / "audit.toml"))
    assert violated(audit(bare(tmp_path, run), scene, lambda *_: None)) == []


def changed(old: str, new: str) -> Any:
    def change(path: Path) -> None:
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


@pytest.mark.parametrize(("style", "given", "change", "match"), [
    ("sphere", "", changed("# sphere", ""), "line 10: the style of the atoms is not named"),
    ("sphere", "", changed("# sphere", "# charge"), "style 'charge' has no radii"),
    ("sphere", "hybrid sphere bond", None, "the file has the style 'sphere'"),
    ("sphere", "", changed("\n2 1 0.16 ", "\n5 1 0.16 "), "has no atom 2"),
    ("sphere", "", changed("\n2 1 0.16 ", "\n1 1 0.16 "), "line 15: the id 1 appears twice"),
    ("sphere", "", changed("\n2 1 0.16 ", "\n2 1 0 "), "line 15: the diameter is 0"),
    ("sphere", "", changed("\n2 1 0.16 ", "\n2 1 word "), "line 15, column 3 .diameter.: 'word' is no number"),
    ("sphere", "", changed("\n2 1 0.16 ", "\n2 1 0.16 8 "), "line 15: 11 columns, expected 10"),
    ("sphere", "", changed("4 atoms", "5 atoms"), "row 5 of 5: cut off"),
    ("sphere", "", changed("4 atoms", "3 atoms"), "more than its 3 rows"),
    ("sphere", "", changed("Atoms #", "Points #"), "no data file of LAMMPS"),
    ("sphere", "", changed("units = si", "units = metal"), "line 1: units metal mix"),
    ("hybrid bond sphere", "", None, "LAMMPS writes 'hybrid' alone"),
    ("hybrid bond sphere", "hybrid sphere bond", changed(" 7 ", " 0 "), "the diameter is 0;.*read: id type x y z diameter density"),
    ("hybrid bond sphere", "hybrid sphere bond", changed(" 2000", " 2000.5"), "molecule is 2000.5, no whole number"),
    ("hybrid bond sphere", "hybrid bond charge", None, "has no radii"),
    ("hybrid bond sphere", "hybrid sphere line", None, "'line' of a hybrid style is not known"),
])  # fmt: skip
def test_traps_are_refused(style: str, given: str, change: Any, match: str, run: Run, tmp_path: Path) -> None:
    path = data(tmp_path, style)
    if change is not None:
        change(path)
    refused(bare(tmp_path, run), FILE + (f'style = "{given}"\n' if given else ""), match)


def test_columns_in_another_order_than_stated_never_pass(run: Run, tmp_path: Path) -> None:
    """Molecules of whole numbers, read as diameters of 7."""
    data(tmp_path, "hybrid bond sphere")
    assert "overlap" in violated(record(bare(tmp_path, run), FILE + 'style = "hybrid sphere bond"\n'))


def test_a_data_file_is_no_trajectory(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"run\.data is a data file of LAMMPS.*\[data\] file"):
        read_trajectory(data(tmp_path), {})
