"""The source's numbers: complete, quoted, selected by parameters; broken files are refused with their place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from ninedisk.references._data import ReferenceDataError, selects
from ninedisk.references.published_values import PublishedValue, load_entries, published_values

SLIDING = {"mu": 0.36, "angle_deg": 20.0, "dt": 0.01, "duration": 1.0}
STUCK = {**SLIDING, "mu": 0.4}
COLLISION = {"kind": "elastic", "speed": 1.0, "gap": 0.5, "dt": 0.01, "restitution": None, "beta": None, "theta": None}
DYNAMIC = {"mu": 0.5, "g0": 0.003, "speed": 1.5, "dt": 0.01, "steps": 1}


def by_quantity(case: str, params: dict[str, Any], **more: Any) -> dict[str, list[PublishedValue]]:
    found: dict[str, list[PublishedValue]] = {}
    for value in published_values(case, params, **more):
        found.setdefault(value.quantity, []).append(value)
    return found


def test_sliding_block() -> None:
    found = by_quantity("incline-block", SLIDING)
    assert set(found) == {"mu_crit", "x_final", "vx_final", "fn_final", "fs_final"}
    assert [value.value for value in found["mu_crit"]] == [0.364, math.tan(math.radians(20.0))]
    assert found["mu_crit"][0].precision == 0.0005
    assert found["x_final"][0].value == pytest.approx(0.018653999, abs=5e-10)
    assert found["vx_final"][0].value == pytest.approx(0.037307998, abs=5e-10)
    for quantity, value, better in (("fn_final", 78.540, "73.803458"), ("fs_final", 28.274, "26.569245")):
        (entry,) = found[quantity]
        assert entry.value == pytest.approx(value, abs=5e-4)
        assert better in entry.contradicted_by


def test_stuck_block() -> None:
    found = by_quantity("incline-block", STUCK)
    assert set(found) == {"mu_crit", "x_final", "vx_final", "gap_final", "creep_rate"}
    assert [found[name][0].value for name in ("x_final", "vx_final", "gap_final", "creep_rate")] == [0.0] * 4


def test_forces_are_published_for_the_source_block_only() -> None:
    assert "fn_final" not in by_quantity("incline-block", {**SLIDING, "mu": 0.35})
    assert "mu_crit" in by_quantity("incline-block", {**SLIDING, "angle_deg": 30.0})
    assert len(by_quantity("incline-block", {**SLIDING, "angle_deg": 30.0})["mu_crit"]) == 1


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("elastic", {"energy": math.pi / 2, "momentum_x": math.pi, "vx_1": 0.0, "vy_1": 0.0, "vx_2": 1.0}),
        ("plastic", {"energy": math.pi / 4, "momentum_x": math.pi, "vx_1": 0.5, "vx_2": 0.5}),
    ],
)
def test_collision(kind: str, expected: dict[str, float]) -> None:
    found = published_values("binary-collision", {**COLLISION, "kind": kind})
    assert {value.quantity: value.value for value in found} == {f"{name}_final": v for name, v in expected.items()}
    assert all(value.precision == 0.0 for value in found)


@pytest.mark.parametrize(
    "change", [{"restitution": 0.5}, {"beta": 0.1}, {"theta": 0.75}, {"speed": 2.0}, {"mass": 1.0}]
)
def test_collision_values_do_not_bind_other_impacts(change: dict[str, float]) -> None:
    assert published_values("binary-collision", {**COLLISION, **change}) == []


@pytest.mark.parametrize("change", [{"theta": 0.5}, {"restitution": 1.0}, {"mass": math.pi}])
def test_explicit_parameters_of_the_source_still_match(change: dict[str, float]) -> None:
    assert len(published_values("binary-collision", {**COLLISION, **change})) == 5


def test_dynamic_sliding_on_both_sides_of_the_critical_step() -> None:
    above = by_quantity("sliding/dynamic", DYNAMIC)
    assert [v.value for v in above["du_y_1"]] == [pytest.approx((0.5 * 1.5 * 0.01 - 0.003) / 1.25)]
    assert above["dt_cr"][0].value == pytest.approx(0.004)
    below = by_quantity("sliding/dynamic", {**DYNAMIC, "dt": 0.002})
    printed, none = below["du_y_1"]
    assert printed.value < 0.0
    assert "p = q = 0" in printed.contradicted_by
    assert (none.value, none.contradicted_by) == (0.0, "")


def test_quasistatic_sliding() -> None:
    found = by_quantity("sliding/quasistatic", {"mu": 0.4, "increment": 0.01, "steps": 3, "normal_load": 1.0})
    assert {name: entries[0].value for name, entries in found.items()} == pytest.approx(
        {"du_y_1": 0.004, "du_y_2": 0.0, "gap_final": 0.004}
    )


def test_inputs_of_the_load_cases() -> None:
    found = by_quantity("nine-disk/compression", {"load_case": "b1", "xi": 3.0}, kind="input")
    assert {name: entries[0].value for name, entries in found.items()} == {
        "kn": 1.5e8, "dt": 0.04576, "n_load": 40, "v_wall": 0.36, "radius": 50, "density": 1000, "phi_deg": 15,
        "cycles": 200, "xi": 3.0,
    }  # fmt: skip
    assert published_values("nine-disk/compression", {"load_case": "b1", "xi": 3.0}) == []


def test_every_entry_is_quoted_and_placed() -> None:
    entries = load_entries()
    assert len(entries) > 60
    assert all(entry.fields["place"].startswith("A.") for entry in entries)


def test_selectors_are_exact() -> None:
    assert selects({"mu": 1}, {"mu": 1.0})
    assert not selects({"mu": 1}, {"mu": True})
    assert not selects({"mu": 0.36}, {"mu": 0.36 + 1e-15})
    assert selects({"mu": [0.3, 0.36]}, {"mu": 0.36, "other": 5})
    assert selects({"theta": "none"}, {})
    assert selects({"theta": "none"}, {"theta": None})
    assert not selects({"theta": "none"}, {"theta": 0.0})


def test_missing_parameter_of_a_formula_is_named() -> None:
    with pytest.raises(ReferenceDataError, match="'incline-x' needs the parameter 'duration'"):
        published_values("incline-block", {"mu": 0.36, "angle_deg": 20.0})


HEAD = '[source]\ntitle = "t"\nnote = "n"\n'
ENTRY = 'id = "a"\ncase = "c"\nquantity = "q"\nunit = "m"\nplace = "p"\nquote = "w"\nprecision = 0\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[source\n", "cannot be read as TOML"),
        (HEAD, "'value' is missing"),
        (HEAD + "[[value]]\n" + ENTRY, "either a value or a formula"),
        (HEAD + "[[value]]\n" + ENTRY + 'value = 1\nformula = "mg"\n', "either a value or a formula"),
        (HEAD + "[[value]]\n" + ENTRY + 'formula = "E=mc2"\n', "formula 'E=mc2' is unknown"),
        (HEAD + "[[value]]\n" + ENTRY + 'value = 1\nwhen = "always"\n', "when = 'always' is unknown"),
        (HEAD + "[[value]]\n" + ENTRY + 'value = 1\nkind = "guess"\n', "kind = 'guess'"),
        (HEAD + "[[value]]\n" + ENTRY + "value = true\n", "value = True is not a finite number"),
        (HEAD + "[[value]]\n" + ENTRY + "value = nan\n", "value = nan is not a finite number"),
        (HEAD + "[[value]]\n" + ENTRY + "value = 1\ncolour = 3\n", "unknown key 'colour'"),
        (HEAD + "[[value]]\n" + ENTRY + "value = 1\nparams = { mu = [] }\n", r"params.mu = \[\]"),
        (HEAD + "[[value]]\n" + ENTRY.replace('"w"', '" "') + "value = 1\n", "quote is empty"),
        (HEAD + "[[value]]\n" + ENTRY.replace("precision = 0", "precision = -1") + "value = 1\n", "precision = -1"),
        (HEAD + ("[[value]]\n" + ENTRY + "value = 1\n") * 2, r"value 2 \('a'\): the id is used twice"),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "source.toml"
    path.write_text(text)
    with pytest.raises(ReferenceDataError, match=words):
        load_entries(path)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ReferenceDataError, match=r"nothing\.toml does not exist"):
        load_entries(tmp_path / "nothing.toml")
