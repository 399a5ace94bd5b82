"""Converged tables come back to the last bit, match exactly, and are refused when broken."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from ninedisk.references._data import ReferenceDataError
from ninedisk.references.converged_tables import (
    CONVERGED_FOLDER,
    ConvergedCurve,
    ConvergedScalar,
    load_converged,
    read_index,
)
from ninedisk.references.converged_writer import write_converged

CASE = "nine-disk/distortion"
PARAMS = {"phi_deg": 15.0, "ks_over_kn": 2 / 3, "walls": "mid-pivot", "wall_mu": "mu", "theta": None, "preload": True}
CURVE = ConvergedCurve(
    case=CASE,
    params=PARAMS,
    method='refinement of dt by 4, 8, 16; "Richardson" at order 2',
    step=np.arange(0, 500, 100),
    t=np.arange(0, 500, 100) * 0.01525,
    quantities={"fn_up": np.pi * 1e9 ** np.linspace(0.1, 1.0, 5), "fs_up": np.array([0.0, -0.1, 1 / 3, 5e-324, 1e300])},
    units={"fn_up": "N", "fs_up": "N"},
    uncertainty={"fn_up": 1e3 / 3, "fs_up": 0.0},
    scalars={"first_slip_cycle": ConvergedScalar(value=140.1, unit="-", uncertainty=1.0)},
)


def test_round_trip_to_the_last_bit(tmp_path: Path) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path)
    back = load_converged(CASE, PARAMS, folder=tmp_path)
    assert back is not None
    assert np.array_equal(back.step, CURVE.step)
    assert back.step.dtype == np.int64
    assert np.array_equal(back.t, CURVE.t)
    for name in CURVE.quantities:
        assert np.array_equal(back.quantities[name], CURVE.quantities[name])
    assert (back.units, back.uncertainty, back.scalars, back.method) == (
        CURVE.units, CURVE.uncertainty, CURVE.scalars, CURVE.method,
    )  # fmt: skip


@pytest.mark.parametrize(
    "change",
    [{"phi_deg": 30.0}, {"ks_over_kn": 0.6667}, {"walls": "corner"}, {"theta": 0.5}, {"preload": 1}, {"new_knob": 2.0}],
)
def test_other_parameters_have_no_reference(tmp_path: Path, change: dict[str, object]) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path)
    assert load_converged(CASE, {**PARAMS, **change}, folder=tmp_path) is None


def test_missing_parameter_and_other_case_have_no_reference(tmp_path: Path) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path)
    fewer = {key: value for key, value in PARAMS.items() if key != "phi_deg"}
    assert load_converged(CASE, fewer, folder=tmp_path) is None
    assert load_converged("nine-disk/compression", PARAMS, folder=tmp_path) is None


def test_harmless_differences_match(tmp_path: Path) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path, ignored=("substeps",))
    for change in ({"phi_deg": 15}, {"theta": "none"}, {"other": None}, {"substeps": 8}):
        assert load_converged(CASE, {**PARAMS, **change}, folder=tmp_path) is not None


def test_writing_again_replaces_and_other_variants_stay(tmp_path: Path) -> None:
    other = dataclasses.replace(CURVE, params={**PARAMS, "phi_deg": 30.0})
    write_converged(CURVE, file="a.csv", folder=tmp_path, ignored=("substeps",))
    write_converged(other, file="b.csv", folder=tmp_path, ignored=("damping_form",))
    write_converged(dataclasses.replace(CURVE, method="finer"), file="a.csv", folder=tmp_path)
    ignored, entries = read_index(tmp_path)
    assert ignored == {CASE: ["damping_form", "substeps"]}
    assert [entry["file"] for entry in entries] == ["a.csv", "b.csv"]
    found = load_converged(CASE, PARAMS, folder=tmp_path)
    assert found is not None
    assert found.method == "finer"
    with pytest.raises(ValueError, match=r"'b\.csv' belongs to another entry"):
        write_converged(CURVE, file="b.csv", folder=tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"units": {"fn_up": "N"}}, "must have the same names"),
        ({"t": np.zeros(3)}, r"t has shape \(3,\)"),
        ({"t": np.array([0, 1, 2, 3, math.inf])}, "t holds a value that is not finite"),
    ],
)
def test_incomplete_curves_are_not_written(tmp_path: Path, change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        write_converged(dataclasses.replace(CURVE, **change), file="a.csv", folder=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("index.toml", "format = 1", "format = 2", "format 2 is unknown"),
        ("index.toml", 'file = "a.csv"', 'file = "../a.csv"', "plain name"),
        ("index.toml", 'file = "a.csv"', 'file = "c.csv"', r"c\.csv, named by index\.toml, cannot be read"),
        ("index.toml", '"fs_up" = 0.0', '"fs_down" = 0.0', "'fs_down' has a unit or an uncertainty but not both"),
        ("index.toml", '"fs_up" = 0.0', '"fs_up" = -1.0', "fs_up = -1.0 must be >= 0"),
        ("index.toml", "method =", "methods =", "unknown key 'methods'"),
        ("a.csv", "step,t,fn_up", "step,t,fn", "the columns are"),
        ("a.csv", "100,", "100,,", "line 3: could not convert"),
        ("a.csv", "100,", "100,1,", "line 3: .* is not 4 finite numbers"),
        ("a.csv", "100,", "nan,", "line 3: .* is not 4 finite numbers"),
        ("a.csv", "100,", "100.5,", "ascending whole numbers"),
        ("a.csv", "100,", "300,", "ascending whole numbers"),
    ],
)
def test_broken_tables_are_refused(tmp_path: Path, file: str, old: str, new: str, words: str) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path)
    text = (tmp_path / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new, 1))
    with pytest.raises(ReferenceDataError, match=words):
        load_converged(CASE, PARAMS, folder=tmp_path)


def test_two_fitting_entries_are_refused(tmp_path: Path) -> None:
    write_converged(CURVE, file="a.csv", folder=tmp_path)
    text = (tmp_path / "index.toml").read_text()
    (tmp_path / "index.toml").write_text(text + text[text.index("[[curve]]") :])
    with pytest.raises(ReferenceDataError, match=r"a\.csv and a\.csv are both for"):
        load_converged(CASE, PARAMS, folder=tmp_path)


def test_every_shipped_table_can_be_read() -> None:
    _, entries = read_index(CONVERGED_FOLDER)
    for entry in entries:
        assert load_converged(entry["case"], entry["params"]) is not None
