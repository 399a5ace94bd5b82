"""One exception per mistake that a user of the core can make.

Every message names the bad value, the allowed range and the way out, so that the
command line can show it as it stands.
"""

from __future__ import annotations

from typing import Protocol

from ninedisk.core.array_types import FloatArray


class CoreError(ValueError):
    """Base of every error that the core raises on purpose."""


class InvalidSceneError(CoreError):
    """A scene is physically or geometrically impossible (negative radius, walls that cross, ...)."""


class InvalidNumericsError(CoreError):
    """A numerical parameter is out of its range (``dt <= 0``, ``theta`` outside [1/2, 1], ...)."""


class UnstableTimeStepError(CoreError):
    """The time step exceeds the stability limit of the explicit scheme on this scene."""


class TooFastError(CoreError):
    """Two bodies that meet move so far in a contact step that contacts could be jumped over."""


class NonFiniteStateError(CoreError):
    """Positions or velocities stopped being finite numbers during a run."""


class Figures(Protocol):
    """How far a solver's answer is from a solution, as `ninedisk.core.cd.problem.Residuals` has it; no units."""

    @property
    def natural_map(self) -> float:
        """Distance from the projection on the friction cones."""
        ...

    @property
    def duality_gap(self) -> float:
        """Bound on the error of the objective."""
        ...

    @property
    def worst(self) -> float:
        """The larger one of both."""
        ...


class BehindWallError(CoreError):
    """The centre of a disk has got behind a wall during a run: too fast for the step, too soft a contact, or walls that closed in on it."""


class UnwritableFileError(CoreError):
    """A file or folder that cannot be written; what stood there before is unchanged."""


class InterruptedRunError(CoreError):
    """A run was stopped inside a step, whose state is neither that before nor that after it."""


class SolverNotConvergedError(CoreError):
    """An iterative contact solver stopped before its tolerance.

    Attributes
    ----------
    iterations : int
        Iterations done.
    residuals : Figures or None
        The best figures reached, at any iteration; None where a sequence of solved problems did not settle.
    forces : ndarray, shape (c, 2), or None
        Contact forces with these figures, where one problem was not solved: no solution, and perhaps good enough for something else.
    """

    def __init__(
        self,
        message: str,
        *,
        iterations: int = 0,
        residuals: Figures | None = None,
        forces: FloatArray | None = None,
    ) -> None:
        super().__init__(message)
        self.iterations, self.residuals, self.forces = iterations, residuals, forces


class NoEquilibriumError(CoreError):
    """A quasi-static step has no solution: a mechanism is driven, or the load exceeds the limit."""
