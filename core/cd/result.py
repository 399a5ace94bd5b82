"""What a contact solver is told and what it gives back."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ninedisk.core._crew import check_threads
from ninedisk.core.cd.options import FACTORISERS
from ninedisk.core.cd.residuals import Residuals, Sliding
from ninedisk.core.errors import InvalidNumericsError, SolverNotConvergedError
from ninedisk.core.validate import one_of, real, shown, whole

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """When a solver stops.

    Parameters
    ----------
    tolerance : float
        Bound on natural-map residual and relative duality gap (`residuals.Residuals`), in (0, 1).
    max_iterations : int or None
        Iteration limit; None: the solver's own default.
    time_limit : float
        Seconds of wall-clock time, > 0.
    relaxation : float
        Over-relaxation of Gauss-Seidel, in (0, 2).
    threads : int
        Threads of Gauss-Seidel, 1..64; the result does not depend on them.
    factoriser : {"auto", "supernodal", "qdldl"}
        Sparse factorisation of the interior-point method.

    Raises
    ------
    InvalidNumericsError
        If a value is out of range.
    """

    tolerance: float = 1e-10
    max_iterations: int | None = None
    time_limit: float = 600.0
    relaxation: float = 1.0
    threads: int = 1
    factoriser: str = "auto"

    def __post_init__(self) -> None:
        for name, most in (("tolerance", 1.0), ("relaxation", 2.0)):
            if not 0.0 < real(getattr(self, name)) < most:
                raise InvalidNumericsError(
                    f"{name} = {shown(getattr(self, name))} is not allowed: it must be a number in (0, {most:g})"
                )
        if self.max_iterations is not None:
            whole("max_iterations", self.max_iterations, 1, 2**53)
        if not real(self.time_limit) > 0.0:
            raise InvalidNumericsError(
                f"time_limit = {shown(self.time_limit)} is not allowed: it must be a number > 0 s"
            )
        check_threads(self.threads)
        one_of("factoriser", self.factoriser, FACTORISERS, error=InvalidNumericsError)
        for name, kind in (("tolerance", float), ("relaxation", float), ("time_limit", float), ("threads", int)):
            object.__setattr__(self, name, kind(getattr(self, name)))
        if self.max_iterations is not None:
            object.__setattr__(self, "max_iterations", int(self.max_iterations))


@dataclass(frozen=True, kw_only=True)
class SolverResult:
    """Solution of a `ContactProblem`.

    Attributes
    ----------
    solver : str
        Name of the method that found it.
    sliding : {"associated", "coulomb"}
    v : ndarray, shape (b, 3)
        Body velocities (displacements in the displacement form).
    r : ndarray, shape (c, 2)
        Contact forces ``(p, q)``, inside the cones.
    iterations : int
    residuals : Residuals
        Natural-map residual, complementarity, relative duality gap.
    seconds : float
        Wall-clock time.
    """

    solver: str
    sliding: Sliding
    v: FloatArray
    r: FloatArray
    iterations: int
    residuals: Residuals
    seconds: float


class Stopwatch:
    """Wall-clock time since its creation, against a limit."""

    def __init__(self, limit: float) -> None:
        self._begin, self._limit = perf_counter(), limit

    @property
    def seconds(self) -> float:
        """Seconds since the start."""
        return perf_counter() - self._begin

    @property
    def left(self) -> float:
        """Seconds until the limit, at least a millisecond: a solver that is asked does something."""
        return max(self._limit - self.seconds, 1e-3)

    @property
    def over(self) -> bool:
        """Whether the time limit has passed."""
        return self.seconds > self._limit


def not_converged(
    solver: str, options: SolverOptions, iterations: int, best: Residuals, clock: Stopwatch, advice: str
) -> NoReturn:
    """Raise `SolverNotConvergedError` with all figures and what to change."""
    why = f"the time limit of {options.time_limit:g} s" if clock.over else "its iteration limit or a stall"
    raise SolverNotConvergedError(
        f"{solver} stopped at {why} after {iterations} iterations and {clock.seconds:.3g} s: natural-map residual "
        f"{best.natural_map:.3g}, relative duality gap {best.duality_gap:.3g}, complementarity {best.complementarity:.3g}; "
        f"the tolerance is {options.tolerance:g}. {advice}",
        iterations=iterations,
        residuals=best,
    )
