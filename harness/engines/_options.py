"""Settings that an engine takes from ``Numerics.options``, named ``<engine>.<setting>``: their ranges and defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics


@dataclass(frozen=True, kw_only=True)
class Option:
    """One setting: a choice of words, or a number in ``[low, high]``.

    ``whole`` asks for a whole number; ``why`` says where the default comes from.
    """

    default: Any
    why: str
    low: float = 0.0
    high: float = float("inf")
    whole: bool = False
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """The values it takes, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        return f"{'a whole number' if self.whole else 'a number'} {self._span}"

    @property
    def _span(self) -> str:
        return f">= {self.low:g}" if self.high == float("inf") else f"in [{self.low:g}, {self.high:g}]"

    def parsed(self, name: str, text: str) -> Any:
        """The value that a text stands for, if it is allowed; raises as `checked` does."""
        if self.choices:
            return self.checked(name, text)
        try:
            number = float(text)
        except ValueError:
            raise InvalidNumericsError(f"{name} = {text} is not allowed: it must be {self.allowed}") from None
        return self.checked(name, number)

    def checked(self, name: str, value: Any) -> Any:
        """The value if it is allowed.

        Raises
        ------
        InvalidNumericsError
            Naming the setting, the value and what is allowed.
        """
        if self.choices:
            if value not in self.choices:
                raise InvalidNumericsError(f"{name} = {value!r} is unknown: use one of {', '.join(self.choices)}")
            return value
        number = isinstance(value, int | float) and not isinstance(value, bool)
        inside = number and self.low <= value <= self.high and value != float("inf")
        if not inside or (self.whole and value != int(value)):
            raise InvalidNumericsError(f"{name} = {value!r} is not allowed: it must be {self.allowed}")
        return int(value) if self.whole else float(value)


def read_options(engine: str, known: Mapping[str, Option], numerics: Numerics) -> dict[str, Any]:
    """All settings of ``engine`` by their full names: the defaults, then what ``numerics.options`` says.

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
        Unknown name, or a value that is not allowed.
    """
    options = {f"{engine}.{name}": option.default for name, option in known.items()}
    for name, value in numerics.options.items():
        if not name.startswith(f"{engine}."):
            continue
        if name not in options:
            raise InvalidNumericsError(f"the option {name!r} is unknown: use one of {', '.join(options)}")
        options[name] = known[name.removeprefix(f"{engine}.")].checked(name, value)
    return options
