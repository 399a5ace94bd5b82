"""How a scene is stepped and sampled; shared by the DEM, the CD stepper and every external engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ninedisk.core._validate import real
from ninedisk.core.errors import InvalidNumericsError

DampingForm = Literal["central", "lagged"]
Impact = Literal["theta", "newton"]
Sliding = Literal["associated", "coulomb"]
Regime = Literal["dynamic", "quasi-static"]
_CHOICES = {
    "damping_form": ("central", "lagged"),
    "impact": ("theta", "newton"),
    "sliding": ("associated", "coulomb"),
    "regime": ("dynamic", "quasi-static"),
}

MOST_SUBSTEPS = 1e15
"""Contact steps in one ``dt``, below where doubles stop being whole numbers; how many are run is limited elsewhere."""


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """Time stepping and sampling.

    Parameters
    ----------
    dt : float
        Step of impulse and CD engines, and sampling interval of engines with contact springs [s], > 0.
    n_steps : int
        Number of steps ``dt``, >= 1.
    contact_dt : float or None
        Own step [s] of engines with contact springs; it must divide ``dt``. None: a fraction of the
        critical step that divides ``dt``.
    sample_every : int
        A sample each so many steps ``dt``.
    sample_from, sample_until : int, int or None
        Regular samples begin and end at these steps (None: at the last). Steps 0 and ``n_steps`` are always sampled.
    damping_form : {"central", "lagged"}
        Velocity that damping forces see: at ``t_n`` to second order, or ``v_{n-1/2}`` as an engine
        with a viscous force has it.
    theta : float
        Parameter of the theta scheme (contact dynamics), in [1/2, 1].
    impact : {"theta", "newton"}
        Impact law of contact dynamics: the theta scheme's own, or Newton's at velocity level.
    sliding : {"associated", "coulomb"}
        Sliding rule of contact dynamics.
    regime : {"dynamic", "quasi-static"}
        Motion with inertia, or a series of equilibria under prescribed motions (contact dynamics).
    solver : str
        Contact solver of contact dynamics; "auto" chooses by size and tolerance.
    allow_unstable : bool
        True: run although ``contact_dt`` exceeds the critical step.
    options : mapping
        Settings of one engine, named by that engine (e.g. ``{"pymunk.iterations": 100}``).
    """

    dt: float
    n_steps: int
    contact_dt: float | None = None
    sample_every: int = 1
    sample_from: int = 0
    sample_until: int | None = None
    damping_form: DampingForm = "central"
    theta: float = 1.0
    impact: Impact = "theta"
    sliding: Sliding = "associated"
    regime: Regime = "dynamic"
    solver: str = "auto"
    allow_unstable: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("dt", "contact_dt"):
            value = getattr(self, name)
            if value is None and name == "contact_dt":
                continue
            number = real(value)
            if not (np.isfinite(number) and number > 0.0):
                raise InvalidNumericsError(f"{name} = {value!r} is not allowed: it must be a finite number > 0")
            object.__setattr__(self, name, number)
        for name, low in (("n_steps", 1), ("sample_every", 1), ("sample_from", 0), ("sample_until", 0)):
            value = getattr(self, name)
            if value is None and name == "sample_until":
                continue
            number = real(value)
            if not (number.is_integer() and number >= low):
                raise InvalidNumericsError(f"{name} = {value!r} is not allowed: it must be a whole number >= {low}")
            object.__setattr__(self, name, int(value))
        theta = real(self.theta)
        if not 0.5 <= theta <= 1.0:
            raise InvalidNumericsError(f"theta = {self.theta!r} is not allowed: it must be a number in [0.5, 1]")
        object.__setattr__(self, "theta", theta)
        if not isinstance(self.allow_unstable, bool):
            raise InvalidNumericsError(
                f"allow_unstable = {self.allow_unstable!r} is not allowed: it must be true or false"
            )
        if not isinstance(self.solver, str):
            raise InvalidNumericsError(f"solver = {self.solver!r} is not allowed: it must be the name of a solver")
        if not isinstance(self.options, Mapping):
            raise InvalidNumericsError(
                f"options = {self.options!r} is not allowed: they must be a mapping from names to values"
            )
        for key in self.options:
            if not isinstance(key, str):
                raise InvalidNumericsError(
                    f"options have the name {key!r}, which is not allowed: names are texts, ENGINE.NAME, for instance 'cd.tolerance'"
                )
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise InvalidNumericsError(
                    f"{name} = {getattr(self, name)!r} is unknown: use one of {', '.join(choices)}"
                )
        if self.contact_dt is not None:
            self.substeps(self.contact_dt)

    def substeps(self, contact_dt: float) -> int:
        """Number of contact steps in one ``dt``.

        Raises
        ------
        InvalidNumericsError
            If ``contact_dt`` does not divide ``dt`` (relative tolerance 1e-9: the round-off of a decimal fraction).
        """
        ratio = self.dt / contact_dt
        if not ratio <= MOST_SUBSTEPS:
            raise InvalidNumericsError(
                f"contact_dt = {contact_dt:g} s is too small for dt = {self.dt:g} s: use at least dt / {MOST_SUBSTEPS:g}"
            )
        whole = round(ratio)
        if whole < 1 or abs(ratio - whole) > 1e-9 * whole:
            raise InvalidNumericsError(
                f"contact_dt = {contact_dt:g} s does not divide dt = {self.dt:g} s: use dt / k for a whole k, "
                f"for instance {self.dt / max(1, int(np.ceil(ratio))):g}"
            )
        return whole

    def sampled_steps(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Steps ``dt`` at which a sample is taken, in order, shape (s,)."""
        last = self.n_steps if self.sample_until is None else min(self.sample_until, self.n_steps)
        regular = np.arange(min(self.sample_from, self.n_steps), last + 1, self.sample_every, dtype=np.int64)
        return np.union1d(regular, np.array([0, self.n_steps], dtype=np.int64))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {**asdict(self), "options": dict(self.options)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Numerics:
        """Inverse of `to_dict`; raises `InvalidNumericsError` on unknown or missing keys."""
        try:
            return cls(**data)
        except TypeError as error:
            raise InvalidNumericsError(f"the numerics' data have the wrong form: {error}") from error

    def replace(self, **changes: Any) -> Numerics:
        """Copy with some fields changed."""
        return replace(self, **changes)
