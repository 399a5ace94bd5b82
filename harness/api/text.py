"""Numbers and foreign text as the terminal and text files show them."""

from __future__ import annotations

import math
import re

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")


def short_number(value: float) -> str:
    """Format a number with up to three significant digits; ``-`` for no number.

    Parameters
    ----------
    value : float
        In any unit.

    Returns
    -------
    str

    Examples
    --------
    >>> short_number(9.80665), short_number(float("nan"))
    ('9.81', '-')
    """
    return "-" if math.isnan(value) else f"{value:.3g}"


def count_noun(count: int, word: str) -> str:
    """Format a number and a noun.

    Parameters
    ----------
    count : int
    word : str
        The noun in the singular.

    Returns
    -------
    str

    Examples
    --------
    >>> count_noun(1162, "check"), count_noun(1, "check")
    ('1,162 checks', '1 check')
    """
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def factor_text(base: float, head: float) -> str:
    """Format how many times as large a value is; ``-`` where that means nothing.

    Parameters
    ----------
    base : float
        In any unit, > 0.
    head : float
        In the unit of ``base``.

    Returns
    -------
    str

    Examples
    --------
    >>> factor_text(2.0, 2.6), factor_text(0.0, 1.0)
    ('1.30x', '-')
    """
    if math.isnan(base) or math.isnan(head) or base <= 0.0:
        return "-"
    return f"{head / base:.2f}x" if head < 100.0 * base else f"{head / base:.1e}x"


def duration(seconds: float) -> str:
    """Format a duration with a fitting unit.

    Parameters
    ----------
    seconds : float
        [s].

    Returns
    -------
    str

    Examples
    --------
    >>> duration(2.5), duration(0.025), duration(2.5e-5)
    ('2.5 s', '25 ms', '25 us')
    """
    if math.isnan(seconds):
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def one_line(text: str) -> str:
    """Replace control characters, which could move a terminal's cursor or break a file's syntax, by spaces.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        One line.

    Examples
    --------
    >>> one_line("two" + chr(10) + "lines")
    'two lines'
    """
    return _CONTROL.sub(" ", text)


def with_unit(number: str, unit: str) -> str:
    """Put the unit behind a number; nothing behind one without a unit.

    Parameters
    ----------
    number : str
    unit : str
        "", "-" or "1" for none.

    Returns
    -------
    str

    Examples
    --------
    >>> with_unit("0.5", "m/s"), with_unit("0.5", "-")
    ('0.5 m/s', '0.5')
    """
    return number if unit in ("", "-", "1") else f"{number} {unit}"


def found_and_expected(value: float, expected: float) -> tuple[str, str]:
    """Format two numbers with their signs, with as many digits as show that they differ, at least four.

    Parameters
    ----------
    value, expected : float
        In the same unit.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> found_and_expected(0.5, 0.25), found_and_expected(1.00001, 1.0)
    (('+0.5', '+0.25'), ('+1.00001', '+1'))
    """
    for digits in range(4, 17):
        found, wanted = (f"{number:+.{digits}g}" for number in (value, expected))
        if found != wanted or value == expected:
            break
    return found, wanted
