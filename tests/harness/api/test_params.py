"""Values that users set: kinds, ranges, units, ids."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ninedisk.harness.api.case import Parameter, ParameterError
from ninedisk.harness.api.params import format_value, parse, resolve


def parameter(**fields: Any) -> Parameter:
    return Parameter(name="p", help="help", **fields)


SECONDS = parameter(default=0.01, unit="s", low=0.0, low_open=True)
STIFFNESS = parameter(default=1e3, unit="N/m")
WALL_MU = parameter(default="mu", words=("mu",), low=0.0)
CYCLES = parameter(default=200, unit="cycles", whole=True, low=1)
RATIO = parameter(default=1.0, choices=(1.0, 2 / 3))
MAYBE = parameter(default=None, optional=True, low=0.0, high=1.0)


@pytest.mark.long
@pytest.mark.parametrize(
    ("which", "given", "value"),
    [
        (SECONDS, "10 ms", 0.01),
        (SECONDS, "10ms", 0.01),
        (SECONDS, "1.1 ms", 1.1e-3),
        (SECONDS, "4.3 ms", 4.3e-3),
        (SECONDS, "1e-3", 0.001),
        (SECONDS, "2/3 s", 2 / 3),
        (SECONDS, "1 hour", 3600.0),
        (STIFFNESS, "36 kN/m", 36000.0),
        (STIFFNESS, "5 N/mm", 5000.0),
        (STIFFNESS, "1 kg/s^2", 1.0),
        (STIFFNESS, "1 kg/s**2", 1.0),
        (parameter(default=15, unit="deg"), "20 deg", 20.0),
        (parameter(default=1.0, unit="rad"), "180 deg", 3.141592653589793),
        (parameter(default=3, unit="1/s"), "180 1/min", 3.0),
        (parameter(default=3, unit="-"), "0.5", 0.5),
        (WALL_MU, "mu", "mu"),
        (WALL_MU, "0.3", 0.3),
        (CYCLES, "2e2", 200),
        (CYCLES, "200 cycles", 200),
        (CYCLES, 200.0, 200),
        (RATIO, "2/3", 2 / 3),
        (RATIO, 1, 1.0),
        (RATIO, "0.6666666666666666", 2 / 3),
        (MAYBE, "none", None),
        (MAYBE, None, None),
        (MAYBE, "50 %", 0.5),
        (parameter(default=True), "no", False),
        (parameter(default="auto"), "x y/z", "x y/z"),
        (parameter(default="a1", choices=("a1", "a2")), "a2", "a2"),
    ],
)
def test_accepted(which: Parameter, given: Any, value: Any) -> None:
    found = parse(which, given)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("which", "given", "said"),
    [
        (SECONDS, "10 m", "wrong dimension; give it in s"),
        (SECONDS, "3 foo", "'foo' is unknown; give it in s"),
        (SECONDS, "3 m^9^9^9", "no unit; give it in s"),
        (SECONDS, "1 __import__('os')", "no unit"),
        (SECONDS, "0", "a number > 0"),
        (SECONDS, "nan", "a number > 0"),
        (SECONDS, "inf", "a number > 0"),
        (SECONDS, float("nan"), "a number > 0"),
        (SECONDS, "1e999", "a number > 0"),
        (SECONDS, "1/0", "a number > 0"),
        (SECONDS, "1/0 ms", "a number > 0"),
        (SECONDS, "", "a number > 0"),
        (SECONDS, "none", "a number > 0"),
        (SECONDS, [1.0], "a number > 0"),
        (parameter(default=3, unit="-"), "0.5 m", "it has no unit: give a bare number"),
        (WALL_MU, "mo", "a number >= 0, or 'mu'"),
        (WALL_MU, "-0.1", "a number >= 0, or 'mu'"),
        (CYCLES, "200.5", "a whole number >= 1"),
        (CYCLES, True, "a whole number >= 1"),
        (RATIO, "3", "one of 1, 0.6666666666666666"),
        (MAYBE, "1.5", "a number >= 0 and <= 1, or 'none'"),
        (parameter(default=True), "maybe", "true or false"),
        (parameter(default="a1", choices=("a1", "a2")), "A1", "Did you mean 'a1'?"),
    ],
)
def test_refused(which: Parameter, given: Any, said: str) -> None:
    with pytest.raises(ParameterError, match=r"^p = ") as caught:
        parse(which, given)
    assert said in str(caught.value)


CASE: Any = SimpleNamespace(
    id="some/case",
    parameters=(
        Parameter(name="load_case", default="a1", choices=("a1", "a2"), help="row", in_id=True),
        Parameter(name="xi", default=3, help="global damping", unit="1/s", low=0.0),
        Parameter(name="note", default="plain", help="any text"),
    ),
)


def test_variant_id() -> None:
    assert resolve(CASE, {}).id == "load_case=a1"
    assert resolve(CASE, {"xi": "3.0 1/s"}).id == "load_case=a1"
    assert resolve(CASE, {"xi": 0.1, "load_case": "a2"}).id == "load_case=a2,xi=0.1"
    assert resolve(CASE, {"xi": 1 / 3}).id == f"load_case=a1,xi={1 / 3!r}"
    assert resolve(CASE, {"note": "a b/c,d=e"}).id == "load_case=a1,note=a%20b%2Fc%2Cd%3De"
    assert resolve(CASE, {}).params == {"load_case": "a1", "xi": 3.0, "note": "plain"}


def test_variant_without_parameters() -> None:
    bare: Any = SimpleNamespace(id="bare", parameters=())
    assert resolve(bare, {}).id == "default"


def test_unknown_parameter_names_the_close_and_lists_all() -> None:
    with pytest.raises(ParameterError) as caught:
        resolve(CASE, {"loadcase": "a1"})
    text = str(caught.value)
    assert "no parameter 'loadcase'. Did you mean 'load_case'?" in text
    assert "xi = 3 1/s: global damping [a number >= 0]" in text


@pytest.mark.parametrize("value", [0.1, 1 / 3, 1e22, 5e-324, 1e-5, 200.0, -0.0, 123456789.123])
def test_ids_keep_every_digit(value: float) -> None:
    assert float(format_value(value)) == value
