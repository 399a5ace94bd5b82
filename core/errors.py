"""One exception per mistake that a user of the core can make.

Every message names the bad value, the allowed range and the way out, so that the
command line can show it as it stands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ninedisk.core.cd.residuals import Residuals


class CoreError(ValueError):
    """Base of every error that the core raises on purpose."""


class InvalidSceneError(CoreError):
    """A scene is physically or geometrically impossible (negative radius, walls that cross, ...)."""


class InvalidNumericsError(CoreError):
    """A numerical parameter is out of its range (``dt <= 0``, ``theta`` outside [1/2, 1], ...)."""


class UnstableTimeStepError(CoreError):
    """The time step exceeds the stability limit of the explicit scheme on this scene."""


class NonFiniteStateError(CoreError):
    """Positions or velocities stopped being finite numbers during a run."""


class BehindWallError(CoreError):
    """The centre of a disk has got behind a wall during a run: too fast for the step, too soft a contact, or walls that closed in on it."""


class InterruptedRunError(CoreError):
    """A run was stopped inside a step, whose state is neither that before nor that after it."""


class SolverNotConvergedError(CoreError):
    """An iterative contact solver stopped before its tolerance.

    Attributes
    ----------
    iterations : int
        Iterations done.
    residuals : ninedisk.core.cd.residuals.Residuals or None
        The best figures reached, at any iteration; None where a sequence of solved problems did not settle.
    """

    def __init__(self, message: str, *, iterations: int = 0, residuals: Residuals | None = None) -> None:
        super().__init__(message)
        self.iterations, self.residuals = iterations, residuals


class NoEquilibriumError(CoreError):
    """A quasi-static step has no solution: a mechanism is driven, or the load exceeds the limit."""
