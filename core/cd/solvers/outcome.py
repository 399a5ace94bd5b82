"""What a contact solver gives back, the time it may take, and how it says that it failed."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, NoReturn

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import Residuals, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.errors import SolverNotConvergedError


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
    def remaining(self) -> float:
        """Seconds until the limit, at least a millisecond: a solver that is asked does something."""
        return max(self._limit - self.seconds, 1e-3)

    @property
    def over(self) -> bool:
        """Whether the time limit has passed."""
        return self.seconds > self._limit


def not_converged(
    solver: str,
    options: SolverOptions,
    iterations: int,
    best: tuple[FloatArray, Residuals],
    clock: Stopwatch,
    advice: str,
) -> NoReturn:
    """Raise `SolverNotConvergedError` with the best forces, shape (c, 2), their figures, and what to change."""
    forces, figures = best
    why = f"the time limit of {options.time_limit:g} s" if clock.over else "its iteration limit or a stall"
    raise SolverNotConvergedError(
        f"{solver} stopped at {why} after {iterations} iterations and {clock.seconds:.3g} s: natural-map residual "
        f"{figures.natural_map:.3g}, relative duality gap {figures.duality_gap:.3g}, complementarity {figures.complementarity:.3g}; "
        f"the tolerance is {options.tolerance:g}, and round-off of velocities alone explains {figures.floor_map:.3g} and "
        f"{figures.floor_gap:.3g} of the first two. {advice}",
        iterations=iterations,
        residuals=figures,
        forces=forces,
    )


class MatrixSolution(NamedTuple):
    """Best forces ``r`` of a problem that is given by its matrix, shape (c, d).

    Attributes
    ----------
    r : ndarray, shape (c, d)
    error : float
        What the solver holds against its tolerance: in 2D the natural map, in 3D the largest of all relative errors.
    iterations : int
        Sweeps and steps of other methods.
    seconds : float
        Wall-clock time.
    """

    r: FloatArray
    error: float
    iterations: int
    seconds: float
