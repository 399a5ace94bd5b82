"""One exception per mistake that a user of the core can make.

Every message names the bad value, the allowed range and the way out, so that the
command line can show it unchanged.
"""

from __future__ import annotations

from typing import Protocol

from ninedisk.core.array_types import FloatArray


class CoreError(ValueError):
    """Base of every error that the core raises deliberately.

    Examples
    --------
    >>> try:
    ...     Disks(x=[[0.0, 0.0]], radius=-1.0, mass=1.0)
    ... except CoreError as error:
    ...     print(error)
    disks.radius[0] = -1 is not allowed: it must be > 0
    """


class InvalidSceneError(CoreError):
    """A scene is physically or geometrically impossible (negative radius, walls that cross, ...).

    Examples
    --------
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=1e6))
    >>> disk = Disks(x=[[0.0, -1.0]], radius=0.5, mass=1.0)
    >>> Scene(disks=disk, disk_disk=ContactLaw(kn=1e6), walls=[floor])
    Traceback (most recent call last):
    ninedisk.core.errors.InvalidSceneError: the centre of disk 0 lies 1 m behind wall 'floor': ...
    """


class InvalidNumericsError(CoreError):
    """A numerical parameter is out of its range (``dt <= 0``, ``theta`` outside [1/2, 1], ...).

    Examples
    --------
    >>> Numerics(dt=0.0, n_steps=1)
    Traceback (most recent call last):
    ninedisk.core.errors.InvalidNumericsError: dt = 0.0 is not allowed: it must be a finite number > 0
    """


class UnstableTimeStepError(CoreError):
    """The time step exceeds the stability limit of the explicit scheme on this scene.

    Examples
    --------
    A disk of 1 kg on a wall of 1 MN/m has the critical step ``2 sqrt(m/kn)`` = 2 ms:

    >>> law = ContactLaw(kn=1e6)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> scene = Scene(disks=Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0), disk_disk=law, walls=[floor])
    >>> simulate(scene, Numerics(dt=0.01, n_steps=1, contact_dt=0.01))
    Traceback (most recent call last):
    ninedisk.core.errors.UnstableTimeStepError: contact_dt = 0.01 s exceeds the critical step 0.002 s ...
    """


class TooFastError(CoreError):
    """Two bodies that meet move so far in a contact step that contacts could be jumped over.

    Examples
    --------
    At 1000 m/s a disk moves 1 m in a step of 1 ms:

    >>> disks = Disks(x=[[0.0, 0.0], [1.5, 0.0]], v=[[1e3, 0.0], [0.0, 0.0]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e6))
    >>> simulate(scene, Numerics(dt=1e-3, n_steps=1, contact_dt=1e-3))
    Traceback (most recent call last):
    ninedisk.core.errors.TooFastError: disk 0 moves 1 m against disk 1 in the contact step that ends at t = 0.001 s; ...
    """


class NonFiniteStateError(CoreError):
    """Positions or velocities stopped being finite numbers during a run.

    Examples
    --------
    Gravity beyond the range of a double:

    >>> disk = Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=disk, disk_disk=ContactLaw(kn=1e6), gravity=(0.0, -1e308))
    >>> simulate(scene, Numerics(dt=1.0, n_steps=4))
    Traceback (most recent call last):
    ninedisk.core.errors.NonFiniteStateError: the position of disk 0 is no finite number at contact step 2 (t = 2 s): ...
    """


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
    """The centre of a disk has got behind a wall during a run: too fast for the step, too soft a contact, or walls that closed in on it.

    Examples
    --------
    A wall of 1 N/m stops a disk of 1 kg that falls at 10 m/s after some 10 m, twenty times its radius:

    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=1.0))
    >>> disk = Disks(x=[[0.0, 0.6]], v=[[0.0, -10.0]], radius=0.5, mass=1.0)
    >>> simulate(Scene(disks=disk, disk_disk=ContactLaw(kn=1.0), walls=[floor]), Numerics(dt=0.01, n_steps=10))
    Traceback (most recent call last):
    ninedisk.core.errors.BehindWallError: the centre of disk 0 is ... m behind wall 'floor' at contact step 7 ...
    """


class UnwritableFileError(CoreError):
    """A file or folder that cannot be written; what stood there before is unchanged.

    Examples
    --------
    >>> from ninedisk.core.dem.session import DemSession
    >>> scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0), disk_disk=ContactLaw(kn=1e6))
    >>> DemSession(scene, Numerics(dt=0.01, n_steps=1)).save("missing/folder/run.npz")
    Traceback (most recent call last):
    ninedisk.core.errors.UnwritableFileError: ...
    """


class InterruptedRunError(CoreError):
    """A run was stopped inside a step, whose state is neither that before nor that after it.

    Examples
    --------
    A session that was stopped by Ctrl-C raises it at each further call; it is caught as any error of the core:

    >>> try:
    ...     raise InterruptedRunError("the run was stopped inside a step after step 3")
    ... except CoreError as error:
    ...     print(error)
    the run was stopped inside a step after step 3
    """


class SolverNotConvergedError(CoreError):
    """An iterative contact solver stopped before its tolerance.

    Parameters
    ----------
    message : str
        What happened and the way out.
    iterations : int
        Iterations done.
    residuals : Figures or None
        The best figures reached, at any iteration; None where a sequence of solved problems did not settle.
    forces : ndarray, shape (c, 2), or None
        Contact forces [N] with these figures, where one problem was not solved. They are no solution, and may be good enough for
        another purpose.

    Examples
    --------
    One sweep of Gauss-Seidel does not carry the weight of three disks down to the floor:

    >>> law = ContactLaw(kn=1e6, ks=1e6, mu=0.3, regularised=True)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> column = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=column, disk_disk=law, walls=[floor], gravity=(0.0, -10.0))
    >>> one_sweep = Numerics(dt=0.01, n_steps=1, solver="gauss-seidel", options={"cd.max_iterations": 1})
    >>> try:
    ...     simulate(scene, one_sweep, method="cd")
    ... except SolverNotConvergedError as error:
    ...     print(error.iterations, error.residuals.worst > 1e-12)
    1 True
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
    """A quasi-static step has no solution: a mechanism is driven, or the load exceeds the limit.

    Examples
    --------
    A push of 1 N along a smooth floor is balanced by nothing:

    >>> law = ContactLaw(kn=1e6, regularised=True)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> disk, push = Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0), BodyForce(disk=0, force=(1.0, 0.0))
    >>> scene = Scene(disks=disk, disk_disk=law, walls=[floor], gravity=(0.0, -10.0), forces=[push])
    >>> simulate(scene, Numerics(dt=0.1, n_steps=1, regime="quasi-static"), method="cd")
    Traceback (most recent call last):
    ninedisk.core.errors.NoEquilibriumError: step 1 (t = 0.1 s): there is no equilibrium near: ...
    """
