"""Settings that an engine takes from ``Numerics.options``, named ``<engine>.<setting>``: their ranges and defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.validate import real, short_repr


@dataclass(frozen=True, kw_only=True)
class Option:
    """One setting: a choice of words, any text, or a number between ``low`` and ``high``.

    Parameters
    ----------
    default : str, int, float or None
    why : str
        Where the default comes from.
    low, high : float
        Range of a number, both ends allowed unless ``low_open`` or ``high_open``; infinity is never allowed.
    whole : bool
        Whether it has to be a whole number.
    choices : tuple of str
        All words that are allowed.
    text : bool
        Whether any text is allowed.
    none : str
        Meaning of None, which the command line writes ``none``; empty: None is not allowed.
    stock : str, int, float or None
        Default under the engine's own settings (option ``profile``); None: the same.
    """

    default: Any
    why: str
    low: float = 0.0
    high: float = float("inf")
    low_open: bool = False
    high_open: bool = False
    whole: bool = False
    choices: tuple[str, ...] = ()
    text: bool = False
    none: str = ""
    stock: Any = None

    @property
    def allowed(self) -> str:
        """The values it takes, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.text:
            return "a text"
        number = f"{'a whole number' if self.whole else 'a number'} {self._span}"
        return f"{number}, or none ({self.none})" if self.none else number

    @property
    def _span(self) -> str:
        if self.high == float("inf"):
            return f"{'>' if self.low_open else '>='} {self.low:g}"
        return f"in {'(' if self.low_open else '['}{self.low:g}, {self.high:g}{')' if self.high_open else ']'}"

    def parsed(self, name: str, text: str) -> Any:
        """The value that a text represents, if it is allowed; raises as `checked` does."""
        if self.choices or self.text:
            return self.checked(name, text)
        if self.none and text == "none":
            return None
        try:
            number = float(text)
        except ValueError:
            raise InvalidNumericsError(f"{name} = {text} is not allowed: it must be {self.allowed}") from None
        return self.checked(name, number)

    def checked(self, name: str, value: Any) -> Any:
        """The value if it is allowed; a number as int or float.

        Raises
        ------
        InvalidNumericsError
            Naming the setting, the value and what is allowed.
        """
        if self.choices:
            if not isinstance(value, str) or value not in self.choices:
                raise InvalidNumericsError(
                    f"{name} = {short_repr(value)} is unknown: use one of {', '.join(self.choices)}"
                )
            return value
        if value is None and self.none:
            return None
        if self.text and isinstance(value, str):
            return value
        number = float("nan") if self.text else real(value)
        above = number > self.low if self.low_open else number >= self.low
        below = number < self.high if self.high_open or self.high == float("inf") else number <= self.high
        if not (above and below) or (self.whole and not number.is_integer()):
            raise InvalidNumericsError(f"{name} = {short_repr(value)} is not allowed: it must be {self.allowed}")
        return int(number) if self.whole else number


PROFILE = Option(
    default="tuned",
    choices=("tuned", "stock"),
    why="stock: every other setting is the engine's own, as in a script that sets the physics alone",
)
"""The option ``profile`` of an engine that has stock settings."""


def read_options(engine: str, known: Mapping[str, Option], numerics: Numerics) -> dict[str, Any]:
    """All settings of ``engine`` by their full names: the defaults, of its profile if it has any, then what ``numerics.options`` says.

    Parameters
    ----------
    engine : str
        Id of the engine; options of others are left alone.
    known : mapping from str to Option
        By the names without the engine's id.
    numerics : Numerics

    Raises
    ------
    InvalidNumericsError
        Unknown name, a value that is not allowed, or another option beside the profile ``stock``.
    """
    stock = numerics.options.get(f"{engine}.profile") == "stock"
    options = {
        f"{engine}.{name}": option.stock if stock and option.stock is not None else option.default
        for name, option in known.items()
    }
    for name, value in numerics.options.items():
        if not name.startswith(f"{engine}."):
            continue
        if name not in options:
            there = f"use one of {', '.join(options)}" if options else f"{engine} has no options, drop it"
            raise InvalidNumericsError(f"the option {name!r} is unknown: {there}")
        if stock and name != f"{engine}.profile":
            raise InvalidNumericsError(
                f"the option {name!r} is not allowed with {engine}.profile = stock, which leaves all settings at the engine's own: drop one"
            )
        options[name] = known[name.removeprefix(f"{engine}.")].checked(name, value)
    return options
