"""One exception per mistake that a user of the core can make.

Every message names the bad value, the allowed range and the way out, so that the
command line can show it as it stands.
"""

from __future__ import annotations


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


class SolverNotConvergedError(CoreError):
    """An iterative contact solver stopped before its tolerance."""


class NoEquilibriumError(CoreError):
    """A quasi-static step has no solution: a mechanism is driven, or the load exceeds the limit."""
