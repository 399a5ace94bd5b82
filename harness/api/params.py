"""From what the user sets to a complete, validated variant of a case; numbers may carry a unit (``10 ms``, ``36 kN/m``, ``20 deg``)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any
from urllib.parse import quote

from ninedisk.harness.api.case import Case, Parameter, ParameterError, Variant
from ninedisk.harness.api.errors import close_matches

LARGEST = 1e100
"""Largest size of a number parameter, and its inverse the smallest that is not zero: beyond, squares and ratios of two of them
leave the range of a double, in the case as in the engines."""

_TRUE = ("true", "yes", "on", "1")
_FALSE = ("false", "no", "off", "0")


def resolve(case: Case, overrides: Mapping[str, Any]) -> Variant:
    """Fix every parameter of a case: defaults, then overrides.

    Parameters
    ----------
    case : Case
    overrides : mapping
        Values as numbers, words, booleans, None, or as text that may carry a unit (``"10 ms"``) or be a fraction
        (``"2/3"``).

    Returns
    -------
    Variant
        Its id is ``name=value,...`` over the parameters that are always part of it and those that differ from their
        default, in declaration order, without spaces or slashes; ``"default"`` where there is none.

    Raises
    ------
    ParameterError
        Unknown parameter (close matches and the case's parameters are listed), value outside its range or
        choices, wrong unit.

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_case
    >>> case = get_case("binary-collision")
    >>> resolve(case, {"dt": "10 ms", "restitution": "1/2"}).params["restitution"]
    0.5
    """
    known = {parameter.name: parameter for parameter in case.parameters}
    for name in overrides:
        if name not in known:
            raise ParameterError(
                f"the case {case.id!r} has no parameter {name!r}.{close_matches(name, known)} "
                f"`ninedisk list cases {case.id}` shows them in a table. Its parameters:\n{describe_parameters(case.parameters)}"
            )
    params: dict[str, Any] = {}
    shown: list[str] = []
    for parameter in case.parameters:
        default = parse(parameter, parameter.default)
        value = parse(parameter, overrides[parameter.name]) if parameter.name in overrides else default
        params[parameter.name] = value
        if parameter.in_id or value != default:
            shown.append(f"{parameter.name}={format_value(value)}")
    return Variant(id=",".join(shown) or "default", params=params)


def settings_of_other_engines(case: Case, params: Mapping[str, Any], contact: str) -> list[str]:
    """Return the parameters that differ from their default although only engines with another kind of contact have them.

    Parameters
    ----------
    case : Case
    params : mapping from str to value
        All parameters of a variant.
    contact : {"spring", "impulse", "cd", "soft"}
        Kind of contact of the engine.

    Returns
    -------
    list of str
        Names of parameters.

    Examples
    --------
    Newton's law of impact means something to contact dynamics only:

    >>> from ninedisk.harness.api.registry import get_case
    >>> case = get_case("binary-collision")
    >>> newton = resolve(case, {"impact": "newton"}).params
    >>> settings_of_other_engines(case, newton, "spring"), settings_of_other_engines(case, newton, "cd")
    (['impact'], [])
    """
    return [
        parameter.name
        for parameter in case.parameters
        if parameter.only_for not in ("", contact) and params[parameter.name] != parse(parameter, parameter.default)
    ]


def describe_parameters(parameters: Sequence[Parameter]) -> str:
    """Describe parameters, one line each: name, default, unit, help and allowed values.

    Parameters
    ----------
    parameters : sequence of Parameter

    Returns
    -------
    str

    Examples
    --------
    >>> from ninedisk.harness.api.case import Parameter
    >>> speed = Parameter.positive("speed", 3.0, unit="m/s", help="initial speed")
    >>> describe_parameters([speed]).strip()
    'speed = 3 m/s: initial speed [a number > 0]'
    """
    lines = []
    for p in parameters:
        unit = f" {p.unit}" if p.unit and p.unit != "-" else ""
        lines.append(f"  {p.name} = {format_value(p.default)}{unit}: {p.help} [{allowed(p)}]")
    return "\n".join(lines)


def allowed(parameter: Parameter) -> str:
    """Describe the values that a parameter takes.

    Parameters
    ----------
    parameter : Parameter

    Returns
    -------
    str

    Examples
    --------
    >>> from ninedisk.harness.api.case import Parameter
    >>> allowed(Parameter(name="restitution", default=0.5, low=0.0, high=1.0, help="of the contact"))
    'a number >= 0 and <= 1'
    """
    kind = _kind(parameter)
    if kind == "bool":
        text = "true or false"
    elif kind == "choice":
        text = "one of " + ", ".join(format_value(choice) for choice in parameter.choices)
    elif kind == "text":
        text = "any text"
    else:
        text = "a whole number" if parameter.whole else "a number"
        if math.isfinite(parameter.low):
            text += f" {'>' if parameter.low_open else '>='} {parameter.low:g}"
        if math.isfinite(parameter.high):
            text += f"{' and' if math.isfinite(parameter.low) else ''} <= {parameter.high:g}"
    extra = [*parameter.words, *(["none"] if parameter.optional else [])]
    return text + "".join(f", or {word!r}" for word in extra)


def format_value(value: Any) -> str:
    """Format a value: the shortest text that reads back to the same value, without space, slash or comma.

    Parameters
    ----------
    value : float, int, str, bool or None

    Returns
    -------
    str

    Examples
    --------
    >>> format_value(0.1), format_value(1e6), format_value(True), format_value(None)
    ('0.1', '1e+06', 'true', 'none')
    """
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        short = format(value, "g")
        return short if float(short) == value else repr(value)
    return quote(str(value), safe="+@~")


def parse(parameter: Parameter, given: Any) -> Any:
    """Check and convert one value.

    Parameters
    ----------
    parameter : Parameter
    given : float, int, str, bool or None
        A text may carry a unit or be a fraction.

    Returns
    -------
    float, int, str, bool or None
        A number is in the parameter's unit.

    Raises
    ------
    ParameterError
        Naming the value and what is allowed.

    Examples
    --------
    >>> from ninedisk.harness.api.case import Parameter
    >>> speed = Parameter.positive("speed", 3.0, unit="m/s", help="initial speed")
    >>> parse(speed, "36 km/h"), parse(speed, "1/4")
    (10.0, 0.25)
    """
    text = given.strip() if isinstance(given, str) else None
    if given is None or (text == "none" and text not in parameter.choices):
        if parameter.optional or parameter.default is None:
            return None
        raise _refusal(parameter, given)
    if text is not None and text in parameter.words:
        return text
    kind = _kind(parameter)
    if kind == "bool":
        return _parse_bool(parameter, given)
    if kind == "choice":
        return _parse_choice(parameter, given)
    if kind == "text":
        if not text:
            raise _refusal(parameter, given)
        return text
    return _parse_number(parameter, given)


def _kind(parameter: Parameter) -> str:
    if isinstance(parameter.default, bool):
        return "bool"
    if parameter.choices:
        return "choice"
    if isinstance(parameter.default, str) and parameter.default not in parameter.words:
        return "text"
    return "number"


def _refusal(parameter: Parameter, given: Any, why: str = "") -> ParameterError:
    shown = given if isinstance(given, str) else format_value(given) if _plain(given) else repr(given)
    return ParameterError(f"{parameter.name} = {shown} is not allowed: {why or f'it must be {allowed(parameter)}'}")


def _plain(given: Any) -> bool:
    return given is None or isinstance(given, bool | int | float)


def _parse_bool(parameter: Parameter, given: Any) -> bool:
    text = str(given).strip().lower()
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    raise _refusal(parameter, given)


def _parse_choice(parameter: Parameter, given: Any) -> Any:
    for choice in parameter.choices:
        if given == choice and isinstance(given, bool) == isinstance(choice, bool):
            return choice
    text = str(given).strip()
    for choice in parameter.choices:
        if text == choice or text == format_value(choice):
            return choice
    if any(isinstance(choice, int | float) for choice in parameter.choices) and isinstance(given, str):
        try:
            value = _number(parameter, given)
        except ParameterError:
            raise _refusal(parameter, given) from None
        for choice in parameter.choices:
            if not isinstance(choice, str) and value == choice:
                return choice
    names = [format_value(choice) for choice in parameter.choices]
    hint = close_matches(text, names)
    raise _refusal(parameter, given, f"it must be {allowed(parameter)}.{hint}" if hint else "")


def _parse_number(parameter: Parameter, given: Any) -> float | int:
    value = _number(parameter, given)
    below = value <= parameter.low if parameter.low_open else value < parameter.low
    if not math.isfinite(value) or below or value > parameter.high:
        raise _refusal(parameter, given)
    if abs(value) > LARGEST or 0.0 < abs(value) < 1.0 / LARGEST:
        raise _refusal(parameter, given, f"its size must lie between {1.0 / LARGEST:g} and {LARGEST:g}, or be 0")
    if parameter.whole:
        if value != int(value):
            raise _refusal(parameter, given)
        return int(value)
    return value


def _number(parameter: Parameter, given: Any) -> float:
    if isinstance(given, bool):
        raise _refusal(parameter, given)
    if not isinstance(given, str):
        try:
            return float(given)
        except (TypeError, ValueError, OverflowError):
            raise _refusal(parameter, given) from None
    split = split_number(given)
    if split is None:
        raise _refusal(parameter, given)
    number, suffix = split
    try:
        value = float(Fraction(number)) if "/" in number else float(number)
    except (ZeroDivisionError, OverflowError):
        raise _refusal(parameter, given) from None
    if not math.isfinite(value):
        raise _refusal(parameter, given)
    return to_unit(parameter.name, number, suffix, parameter.unit) if suffix not in ("", parameter.unit) else value


_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?(?:/\d+(?:\.\d+)?(?![\w.]))?)\s*(?P<suffix>.*?)\s*"
)
_SUFFIX = re.compile(r"(?:[^\W\d_]|[µ°%]|[*/ .]|\^-?\d(?!\d|\s*\^)|(?<![\d^])1(?=\s*/))+")
"""Letters, unit signs and one-digit exponents: nothing that could make an expression expensive to evaluate."""


def split_number(text: str) -> tuple[str, str] | None:
    """Split a text into number and unit; None if it is no number.

    Parameters
    ----------
    text : str
        A decimal or a fraction of two numbers, and a unit.

    Returns
    -------
    tuple of str, or None
        The number's text and the unit's, which may be empty.

    Examples
    --------
    >>> split_number("36 km/h"), split_number("2/3"), split_number("fast")
    (('36', 'km/h'), ('2/3', ''), None)
    """
    if len(text) > 80:
        return None
    match = _NUMBER.fullmatch(text)
    return (match["number"], match["suffix"]) if match else None


def to_unit(name: str, number: str, suffix: str, unit: str) -> float:
    """Convert ``number suffix`` to ``unit``.

    Parameters
    ----------
    name : str
        What the number is for, in messages.
    number : str
        A decimal or a fraction of two numbers, as `split_number` gives it.
    suffix : str
        Unit in which it is given.
    unit : str
        Unit that is wanted; "" or "-" for none.

    Returns
    -------
    float
        In ``unit``.

    Raises
    ------
    ParameterError
        If the unit is unknown or has another dimension; the message names the expected unit.

    Examples
    --------
    >>> to_unit("kn", "36", "kN/m", "N/m"), to_unit("dt", "1/4", "ms", "s")
    (36000.0, 0.00025)
    """
    expected = unit if unit != "-" else ""
    want = f"give it in {expected}" if expected else "it has no unit: give a bare number"
    shown = f"{name} = {number} {suffix} is not allowed"
    plain = suffix.replace("**", "^")
    if not _SUFFIX.fullmatch(plain):
        raise ParameterError(f"{shown}: {suffix!r} is no unit; {want}")
    import pint

    registry: Any = pint.UnitRegistry()
    try:
        converted = registry.Quantity(Fraction(number), registry.parse_units(plain)).to(expected or "dimensionless")
        return float(converted.magnitude)
    except pint.DimensionalityError:
        raise ParameterError(f"{shown}: {suffix!r} has the wrong dimension; {want}") from None
    except Exception:  # pint's parser leaks many kinds of errors for text that is no unit
        raise ParameterError(f"{shown}: the unit {suffix!r} is unknown; {want}") from None
