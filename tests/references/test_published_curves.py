"""A user's digitised curve joins without code; a broken one is refused with file and line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ninedisk.references._data import ReferenceDataError
from ninedisk.references.published_curves import load_curves

TOML = """case = "nine-disk/distortion"
quantity = "fs_up"
params = { phi_deg = 15, ks_over_kn = [1, 0.6666666666666666] }
abscissa = "step"
unit = "N"
uncertainty = 2e7
title = "1979 paper"
source = "Cundall & Strack (1979), figure 9"
"""
CSV = "cycle,force\n0,0\n100.5,7.7e8\n\n250,1.3e9\n"


def put(folder: Path, toml: str = TOML, csv: str | None = CSV, name: str = "fig") -> Path:
    (folder / f"{name}.toml").write_text(toml)
    if csv is not None:
        (folder / f"{name}.csv").write_text(csv)
    return folder


def test_curve_is_read_and_selected(tmp_path: Path) -> None:
    (curve,) = load_curves(put(tmp_path))
    assert curve.x.tolist() == [0.0, 100.5, 250.0]
    assert curve.y.tolist() == [0.0, 7.7e8, 1.3e9]
    assert (curve.uncertainty, curve.abscissa, curve.unit) == (2e7, "step", "N")
    assert curve.applies_to("nine-disk/distortion", {"phi_deg": 15.0, "ks_over_kn": 2 / 3, "walls": "mid-pivot"})
    assert not curve.applies_to("nine-disk/distortion", {"phi_deg": 30.0, "ks_over_kn": 1.0})
    assert not curve.applies_to("nine-disk/compression", {"phi_deg": 15.0, "ks_over_kn": 1.0})
    assert curve.at(np.array([-1.0, 50.25, 300.0])) == pytest.approx([np.nan, 3.85e8, np.nan], nan_ok=True)


def test_points_may_have_another_name_and_params_may_be_left_out(tmp_path: Path) -> None:
    toml = "\n".join(line for line in TOML.splitlines() if not line.startswith("params"))
    put(tmp_path, 'file = "points.csv"\n' + toml, None)
    (tmp_path / "points.csv").write_text(CSV)
    (curve,) = load_curves(tmp_path)
    assert curve.applies_to("nine-disk/distortion", {"phi_deg": 45.0})


def test_the_project_ships_no_curve_alone() -> None:
    assert load_curves() == []


@pytest.mark.parametrize(
    ("toml", "csv", "words"),
    [
        (TOML, None, r"fig\.toml: its points fig\.csv do not exist"),
        (TOML, "cycle,force\n0,0\n1,x\n", r"fig\.csv, line 3: 'x' is not a finite number"),
        (TOML, "cycle,force\n0,0\n1,nan\n", r"line 3: 'nan' is not a finite number"),
        (TOML, "cycle,force\n0,0\n2,1\n\n1,1\n", r"line 5: abscissa 1 does not exceed the one before, 2"),
        (TOML, "cycle,force\n0,0\n0,1\n", r"line 3: abscissa 0"),
        (TOML, "cycle,force\n0,0,0\n1,1\n", r"line 2: 3 columns"),
        (TOML, "0,0\n1,1\n2,2\n", r"line 1: the first line must be a header"),
        (TOML, "cycle,force\n0,0\n", r"at least two points"),
        (TOML + "colour = 1\n", CSV, "unknown key 'colour'"),
        (TOML.replace('unit = "N"\n', ""), CSV, "the key 'unit' is missing"),
        (TOML.replace('"step"', '"cycle"'), CSV, "abscissa = 'cycle' is unknown"),
        (TOML.replace("2e7", "-1"), CSV, "uncertainty = -1 must be >= 0"),
        (TOML.replace("2e7", '"5 %"'), CSV, "uncertainty = '5 %' is not a finite number"),
        (TOML.replace("phi_deg = 15", "phi_deg = {}"), CSV, r"params.phi_deg = {}"),
        ("case = ", CSV, "cannot be read as TOML"),
    ],
)
def test_broken_curves_are_refused(tmp_path: Path, toml: str, csv: str | None, words: str) -> None:
    with pytest.raises(ReferenceDataError, match=words):
        load_curves(put(tmp_path, toml, csv))


def test_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ReferenceDataError, match="curves is no folder"):
        load_curves(tmp_path / "curves")
