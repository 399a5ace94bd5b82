"""What is given of a trajectory: what the file itself does not report (masses, walls and their motion, friction, stiffness, the step)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.scene.walls import AnyWall

INERTIA = {2: 0.5, 3: 0.4}
"""Moment of inertia over m R^2 where none is given: of disks in the plane, of spheres in space."""
LARGEST = 1e75
"""Numbers from here on count as no numbers: energies would overflow."""
Fact = float | FloatArray | Mapping[int, float]
"""A property of disks: one number, one a disk in the order of ids, or one a type."""


@dataclass(frozen=True)
class ContactFile:
    """A file of contact forces, names of its columns, and the number of the wall that all of them touch, None: it has partners."""

    path: Path
    columns: Mapping[str, str]
    wall: int | None = None


@dataclass(frozen=True)
class AuditScene:
    """What is given of a trajectory.

    Attributes
    ----------
    gravity : ndarray, shape (2,) or (3,)
        Acceleration [m/s^2].
    dimension : {2, 3}
        Components of every vector.
    stated_dimension : bool
        Whether the TOML says so, by ``dimension`` or by a vector; else a file in space makes it 3.
    lever_arm : {"radius", "overlap", "torque-overlap"} or None
        Arms of shear forces between bodies, as in `ninedisk.core.ContactLaw`; None: either.
    walls_known : bool
        False: nothing is said of walls, and what they would explain is not judged.
    damping : float
        Global damping [1/s], m a + damping m v = F.
    dt, interval : float or None
        The engine's own step and the time between two frames [s].
    radius, mass, density : number, array, mapping or None
        [m], [kg], [kg/m^2] or, in space, [kg/m^3]; None: the file has it.
    inertia : float
        Moment of inertia over m R^2: 1/2 of disks, 2/5 of spheres.
    fixed : tuple of int
        Ids of disks that nothing moves, or that are moved by what is not given.
    mu, kn, ks, restitution : float or None
        Law of every contact without its own law; [N/m].
    rigid : bool
        Contacts store no energy and are meant not to overlap, but by ``slop`` [m].
    cohesive, rolling : bool
        Contacts attract; contacts resist rolling.
    pull : bool
        Dashpots may pull at the end of a contact; where the TOML does not say, those of soft contacts that lose energy may.
    walls : tuple of Wall or PlaneWall
        Their laws hold mu, kn (1 where none is known) and ks.
    wall_kn : tuple of float or None
    columns : mapping
        Name here -> name in the file.
    contacts : tuple of ContactFile
    reverse : Path or None
        Trajectory that starts at this one's end with all velocities turned round.
    periodic : tuple of {"x", "y", "z"}
        Axes along which the domain of a file repeats that does not say so.
    data, data_style : Path, str or None
        LAMMPS data file with radii and masses; its atom style where its own head does not say enough.
    open : bool
        Bodies may come and leave.
    partial : bool
        The file has a part of the bodies: what others would explain is not judged.
    single : bool
        The engine computes in single precision, whatever its file shows.
    """

    gravity: FloatArray
    dimension: int = 2
    stated_dimension: bool = True
    lever_arm: str | None = None
    walls_known: bool = True
    inertia_given: bool = False
    damping: float = 0.0
    dt: float | None = None
    interval: float | None = None
    radius: Fact | None = None
    mass: Fact | None = None
    density: Fact | None = None
    inertia: float = 0.5
    fixed: tuple[int, ...] = ()
    mu: float | None = None
    kn: float | None = None
    ks: float | None = None
    restitution: float | None = None
    rigid: bool = False
    slop: float = 0.0
    cohesive: bool = False
    rolling: bool = False
    pull: bool = True
    walls: tuple[AnyWall, ...] = ()
    wall_mu: tuple[float | None, ...] = ()
    wall_kn: tuple[float | None, ...] = ()
    wall_ks: tuple[float | None, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict)
    contacts: tuple[ContactFile, ...] = ()
    reverse: Path | None = None
    periodic: tuple[str, ...] = ()
    data: Path | None = None
    data_style: str | None = None
    open: bool = False
    partial: bool = False
    single: bool = False

    def in_dimension(self, dimension: int) -> AuditScene:
        """The same scene in another dimension, of one that states none."""
        if dimension == self.dimension:
            return self
        inertia = self.inertia if self.inertia_given else INERTIA[dimension]
        return replace(self, dimension=dimension, gravity=np.zeros(dimension), inertia=inertia)

    @property
    def conservative(self) -> bool:
        """Whether what is given leaves nothing that takes energy."""
        return self.restitution == 1.0 and not self.frictional and self.damping == 0.0 and not self.rolling

    @property
    def pulling(self) -> float:
        """Most impulse by which a dashpot pulls at the end of a contact, over mass and speed: 2 beta^2, by the coefficient of restitution.

        The force ``c v - kn overlap`` pulls from the overlap ``c v/kn`` on; its impulse is ``c^2 v/(2 kn) = 2 beta^2 m v``.
        """
        if not self.pull:
            return 0.0
        if not self.restitution:
            return 2.0
        log = float(np.log(self.restitution))
        share = 2.0 * log * log / (np.pi**2 + log * log)
        return float(min(2.0, share / max(1.0 - share, 0.5)))

    @property
    def frictional(self) -> bool:
        """Whether some contact may have friction: all that say nothing."""
        return self.mu != 0.0 or any(mu != 0.0 for mu in self.wall_mu)
