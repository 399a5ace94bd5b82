"""How far each printed number may be from the one meant: digits of texts, precision of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray

POWERS = np.array([*(float(f"1e{k}") for k in range(-324, 309)), np.inf])
"""Powers of ten that are float64, 0 before and infinity after them."""
VARIED = 20
"""Distinct numbers that a column must show for its own digits to count, else the file's most; exact numbers like 0.5 show none."""


@dataclass(frozen=True)
class Rounding:
    """How a column was rounded: to ``decimals``, to ``significant`` digits, or to ``bits`` of a mantissa.

    ``factor`` times what was rounded is the column (a radius is half a diameter); ``absolute`` is an error that it has besides.
    """

    decimals: int | None = None
    significant: int | None = None
    bits: int = 53
    factor: float = 1.0
    absolute: float = 0.0

    def error(self, values: FloatArray) -> FloatArray:
        """Most by which the number meant differs from the one read: half a unit of the last place."""
        return np.asarray(self.factor * self._of_printed(np.asarray(values) / self.factor) + self.absolute)

    def _of_printed(self, values: FloatArray) -> FloatArray:
        size = np.abs(values)
        found = np.ldexp(size, -self.bits)
        if self.decimals is not None:
            return np.maximum(found, 0.5 * 10.0**-self.decimals)
        if self.significant is not None:
            decade = np.floor(np.log10(np.where(size > 0.0, size, 1.0)))
            found = np.maximum(found, np.where(size > 0.0, 0.5 * 10.0 ** (decade + 1 - self.significant), 0.0))
        return found

    def place(self, values: FloatArray, axis: int, single: float, found: FloatArray, squares: FloatArray) -> None:
        """Copy values to ``found[:, axis]`` and add the squares of their errors, each at least ``single`` times the number."""
        from ninedisk.harness.audit.sums import place_rounded

        least, decades = 0.0, np.empty(0)
        if self.decimals is not None:
            least = 0.5 * 10.0**-self.decimals
        elif self.significant is not None:
            decades = 0.5 * 10.0 ** (np.arange(-324.0, 309.0) + 1 - self.significant)
        place_rounded(
            values, axis, 2.0**-self.bits, least, POWERS, decades, self.factor, self.absolute, single, found, squares
        )

    def description(self) -> str:
        """In words."""
        if self.decimals is not None:
            return f"{self.decimals} decimals"
        if self.significant is not None and self.significant < 16:
            return f"{self.significant} significant digits"
        return "single precision" if self.bits <= 24 else "double precision"


@dataclass
class Tokens:
    """Printed numbers of one column."""

    seen: set[str] = field(default_factory=set)

    def rounding(self, most: int) -> Rounding:
        """Rule that the tokens follow; ``most`` significant digits where they are too few to decide."""
        numbers = {token: float(token) for token in self.seen}
        values = [token for token in self.seen if numbers[token] != 0.0]
        sizes = np.abs([numbers[token] for token in values])
        finite = sizes[np.isfinite(sizes)]
        with np.errstate(over="ignore"):
            single = len(finite) >= VARIED and bool((finite == finite.astype(np.float32)).all())
        if single:
            return Rounding(bits=24)
        plain = {_decimals(token) for token in self.seen} if not any("e" in t.lower() for t in self.seen) else set()
        if len(plain) == 1 and (decimals := plain.pop()) > 0 and any(token.endswith("0") for token in self.seen):
            return Rounding(decimals=decimals)
        if plain and len(values) >= VARIED:
            by_decade: dict[float, int] = {}
            for token, decade in zip(values, np.floor(np.log10(sizes)).tolist(), strict=True):
                by_decade[decade] = max(by_decade.get(decade, 0), _decimals(token))
            low, high = min(by_decade), max(by_decade)
            if high > low and by_decade[low] == by_decade[high] > 0:
                return Rounding(decimals=by_decade[low])
        own = max((significant_digits(token) for token in values), default=0)
        return Rounding(significant=max(own, 1) if len(values) >= VARIED else max(own, most, 1))


@lru_cache(1 << 17)
def significant_digits(token: str) -> int:
    """Digits of a printed number, zeros at the end of a whole one left out."""
    mantissa, mark, _ = token.lower().partition("e")
    digits = mantissa.lstrip("+-").replace(".", "").lstrip("0")
    return len(digits) if mark or "." in token else len(digits.rstrip("0"))


def _decimals(token: str) -> int:
    return len(token.partition(".")[2])


def roundings_of(tokens: Mapping[str, Tokens]) -> dict[str, Rounding]:
    """Rule of each column; the most digits of any where one shows too few."""
    most = max((significant_digits(token) for each in tokens.values() for token in each.seen), default=1)
    return {name: each.rounding(most) for name, each in tokens.items()}


def of_arrays(data: Mapping[str, NDArray[Any]]) -> dict[str, Rounding]:
    """Roundings of arrays by their precision."""
    return {name: Rounding(bits=24 if array.dtype == np.float32 else 53) for name, array in data.items()}
