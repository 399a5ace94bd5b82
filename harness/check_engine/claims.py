"""What a probe holds against what, and the bounds that it uses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.history import History
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo

COARSE = 0.3
"""Part of a quantity's scale that a run which is graded approximate may be off: conventions stay below, a wrong unit, sign or
factor of two does not."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A quantity of a run against its closed form; ``bound`` is absolute, ``why`` says where it comes from."""

    quantity: str
    unit: str
    value: ArrayLike
    expected: ArrayLike
    bound: float
    why: str
    mend: str = ""
    observed: bool = True
    """False: NaN is allowed, since an engine need not observe it."""

    def error(self) -> float:
        """Largest absolute difference; NaN where a number is missing that must be there."""
        value, expected = np.asarray(self.value, dtype=np.float64), np.asarray(self.expected, dtype=np.float64)
        apart = np.abs(value - expected)
        if not self.observed:
            apart = apart[~np.isnan(apart)]
        return float(apart.max()) if apart.size else 0.0

    def scale(self) -> float:
        """Largest magnitude of the closed form."""
        return float(np.abs(np.asarray(self.expected, dtype=np.float64)).max(initial=0.0))

    def holds(self, *, coarse: bool = False) -> bool:
        """Whether the error is within the bound, or within `COARSE` of the scale."""
        return self.error() <= (max(self.bound, COARSE * self.scale()) if coarse else self.bound)

    def text(self) -> str:
        """The numbers of a claim that does not hold."""
        value, expected = np.atleast_1d(self.value), np.atleast_1d(self.expected)
        apart = np.abs(value - expected).ravel()
        worst = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
        shown = f"{value.ravel()[worst]:.9g} instead of {np.broadcast_to(expected, value.shape).ravel()[worst]:.9g}"
        return f"{self.quantity} is {shown} {self.unit} (allowed: {self.bound:.2g}, {self.why})"


@dataclass(frozen=True, kw_only=True)
class Probe:
    """A scene and what is known about its run."""

    name: str
    setup: Setup
    claims: Callable[[History], Sequence[Claim]]


def round_off(info: EngineInfo) -> float:
    """Relative bound of what every engine of this precision does to the last bits in some ten or hundred steps."""
    return 1e-4 if "32" in info.precision else 1e-10


def contact_error(info: EngineInfo) -> float:
    """Relative bound of a contact's force where nothing but the solver, or the engine's own softness, errs."""
    if info.contact == "soft":
        return 1e-2 if info.softness is None else max(info.softness, 1e-6)
    return max(1e-6, round_off(info))
