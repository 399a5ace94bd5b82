"""What one check has found: comparisons, the first and the worst, and what could not be compared; the states that it judges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray

TITLES = {
    "finite": ("Every number is finite", ""),
    "particles": ("No body is lost, duplicated or new", ""),
    "time": ("Times grow", "s"),
    "motion": ("Positions change as velocities say", "m"),
    "turning": ("Angles change as spins say", "rad"),
    "free": ("Velocities change only at contacts", "m/s"),
    "momentum": ("Momentum changes only by gravity and walls", "N s"),
    "spin": ("Angular momentum is conserved", "N m s"),
    "torque": ("Spins change as the listed torques say", "N m s"),
    "energy": ("Energy grows only by the work of walls", "J"),
    "kept": ("Energy is conserved without friction and damping", "J"),
    "overlap": ("No overlap beyond springs or slop", "m"),
    "cone": ("Contact forces lie in the friction cone", "N"),
    "history": ("Shear forces of closed contacts keep their history", "N"),
    "reversal": ("The reversed run retraces the path", "m"),
}
"""Checks: title, unit of value and allowance."""
Words = Callable[[int], str]


@dataclass(frozen=True)
class State:
    """One frame, bodies in the order of the first frame's ids; errors are half units of the last printed place, NaN where a body lacks.

    With n bodies, d components of vectors and k of turning (1 in the plane, 3 in space): x, v (n, d), omega, angle (n, k).
    ``torque`` (n, k) with the error eq is that of each body [N m], None where the file has none.
    ``cell`` has the edges along which everything repeats, shape (p, d); ``x`` then goes on where a body is put back into the box.
    """

    step: int
    t: float
    et: float
    place: str
    x: FloatArray
    v: FloatArray
    omega: FloatArray | None
    angle: FloatArray | None
    ex: FloatArray
    ev: FloatArray
    eo: FloatArray
    ea: FloatArray
    here: NDArray[np.bool_]
    cell: FloatArray | None = None
    torque: FloatArray | None = None
    eq: FloatArray = field(default_factory=lambda: np.empty(0))

    def places(self) -> State:
        """Places alone, for a picture: the rest would stay in memory."""
        none = np.empty(0)
        return State(
            self.step,
            self.t,
            self.et,
            self.place,
            self.x,
            none,
            None,
            None,
            none,
            none,
            none,
            none,
            self.here,
            self.cell,
        )


@dataclass(frozen=True)
class Bodies:
    """What does not change: ids, radii [m], masses [kg], moments of inertia [kg m^2], which bodies are fixed, what one is called.

    ``er`` and ``em`` are the errors of radii and masses by the digits of the file, 0 where the TOML gives them.
    """

    id: NDArray[np.int64]
    radius: FloatArray
    mass: FloatArray
    inertia: FloatArray
    fixed: NDArray[np.bool_]
    noun: str
    er: FloatArray
    em: FloatArray


@dataclass
class Tally:
    """What one check has found so far.

    Attributes
    ----------
    judged, undecided, beyond : int
        Comparisons made, not made, and lost.
    why_not : Counter
        Reasons why some could not be made.
    first, worst : dict or None
        The earliest violation and the largest value over its allowance.
    series : list of (t, value, allowance)
        The worst of each instant.
    """

    name: str
    judged: int = 0
    undecided: int = 0
    beyond: int = 0
    why_not: Counter[str] = field(default_factory=Counter)
    first: dict[str, Any] | None = None
    worst: dict[str, Any] | None = None
    scene: State | None = None
    series: list[tuple[float, float, float]] = field(default_factory=list)

    def skip(self, count: int, why: str) -> None:
        """Note comparisons that cannot be made."""
        if count > 0:
            self.undecided += int(count)
            self.why_not[why] += int(count)

    def judge(
        self,
        state: State,
        value: FloatArray,
        parts: Mapping[str, FloatArray],
        who: Words,
        members: Callable[[int], NDArray[np.int64]],
    ) -> None:
        """Compare values with allowances, the sum of their parts.

        Parameters
        ----------
        state : State
            The instant.
        value : ndarray, shape (k,)
        parts : mapping from reason to ndarray, shape (k,)
        who, members : function of int
            Whom the k-th value is about: words, and numbers of disks.
        """
        if len(value) == 0:
            return
        allowance = np.zeros(len(value))
        for part in parts.values():
            allowance += part
        k, lost, largest, value, allowance = _worst(np.ascontiguousarray(value, dtype=float), allowance)
        self.judged += len(value)
        self.beyond += lost
        self.series.append((state.t, float(value[k]), float(allowance[k])))
        worse = self.worst is None or largest > self.worst["ratio"]
        if worse or (lost and self.first is None):
            given = {
                "step": state.step, "t": state.t, "place": state.place, "who": who(k), "value": float(value[k]),
                "allowance": float(allowance[k]), "ratio": min(largest, 1e300),
                "parts": {name: float(np.nan_to_num(np.broadcast_to(part, value.shape)[k])) for name, part in parts.items()},
                "disks": members(k)[:50].tolist(),
            }  # fmt: skip
            if lost and self.first is None:
                self.first = given
            if worse:
                self.worst, self.scene = given, state.places() if largest > 1.0 else None


def _worst(value: FloatArray, allowance: FloatArray) -> tuple[int, int, float, FloatArray, FloatArray]:
    """Place of the largest ratio, how many are above 1, it, and both arrays as finite numbers."""
    from ninedisk.harness.audit.sums import largest_ratio

    found = np.zeros(3, dtype=np.int64)
    largest_ratio(value, allowance, found)
    k, lost, odd = found.tolist()
    if not odd:
        return k, lost, float(value[k] / allowance[k]) if value[k] > 0.0 else 0.0, value, allowance
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(np.where(value <= 0.0, 0.0, value / allowance), posinf=np.inf)
    k = int(np.argmax(ratio))
    return k, int((ratio > 1.0).sum()), float(ratio[k]), np.nan_to_num(value), np.nan_to_num(allowance)
