"""Problems of the suite ``cd``: rigid, frictional, at rest under gravity; one step from velocity zero."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.disks import Disks
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.packings import DENSITY, GRAVITY
from ninedisk.core.scene import Scene
from ninedisk.core.walls import Wall
from ninedisk.harness.bench.dem_problems import packing

DT, MU = 1e-3, 0.3
SIZES, LARGE = (1_000, 10_000), (100_000,)
COLUMN = 50.0
"""Height over width of the tall column."""
ROWS, COLUMNS, MORE_COLUMNS = 50, 200, 2_000
"""Of the hexagonal lattice."""
TURN = math.radians(1.0)
"""Angle by which gravity is turned in the problem whose forces make the warm start."""
TOUCHING = 1e-6
"""Gap over radius up to which two bodies are in contact; the overlaps of a settled packing are closed contacts all the same."""


def problems(
    sizes: list[int], *, large: bool, tell: Callable[[int, int], None] | None = None
) -> dict[str, Callable[[], ContactProblem]]:
    """Makers of the problems by name; the tall column has as many disks as the smallest packing."""
    made: dict[str, Callable[[], ContactProblem]] = {}
    for n in sizes:
        made[f"packing-{n}"] = lambda n=n: resting(packing(n, progress=tell))  # type: ignore[misc]
    if sizes:
        made[f"column-{sizes[0]}"] = lambda: resting(packing(sizes[0], aspect=COLUMN, progress=tell))
    for columns in (COLUMNS, MORE_COLUMNS)[: 2 if large else 1]:
        made[f"lattice-{ROWS}x{columns}"] = lambda columns=columns: resting(lattice(ROWS, columns))  # type: ignore[misc]
    return made


def lattice(rows: int, columns: int, radius: float = 0.5) -> Scene:
    """Equal disks in the densest lattice, each row shifted by a radius, between walls that all touch."""
    law = ContactLaw(kn=1.0, mu=MU, regularised=True)
    j, i = np.divmod(np.arange(rows * columns), columns)
    x = np.column_stack([radius * (1.0 + 2.0 * i + j % 2), radius * (1.0 + math.sqrt(3.0) * j)])
    width = radius * (2.0 * columns + 1.0)
    walls = (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(width, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
    )
    ones = np.ones(len(x))
    disks = Disks(x=x, radius=radius * ones, mass=DENSITY * math.pi * radius**2 * ones)
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY))


def resting(scene: Scene) -> ContactProblem:
    """The contact problem of one step `DT` from rest, with every touching pair a rigid contact that is just closed.

    Parameters
    ----------
    scene : Scene
        Disks that touch or overlap; their own laws do not matter.
    """
    from ninedisk.core.cd.contacts import Place, contact_frames
    from ninedisk.core.cd.laws import LawTable
    from ninedisk.core.cd.solvers.solver import ContactSolver
    from ninedisk.core.cd.step import DynamicStep, bodies_of
    from ninedisk.core.dem.neighbours import PairFinder
    from ninedisk.core.motion import compile_motion, wall_poses

    law = ContactLaw(kn=1.0, mu=MU, regularised=True)
    rigid = scene.replace(
        disk_disk=law,
        walls=tuple(replace(wall, law=law) for wall in scene.walls),
        initial_shear={},
    )
    radius, x = scene.disks.radius, scene.disks.x.copy()
    poses = wall_poses(compile_motion(rigid.walls), 0.0)
    numerics = Numerics(dt=DT, n_steps=1)
    laws = LawTable(rigid, numerics, "rigid")
    pairs = PairFinder(radius, len(rigid.walls)).within(x, poses, TOUCHING * float(radius.min()))
    frames = contact_frames(pairs, x, radius, poses, poses, laws)
    closed = frames._replace(gap=np.zeros(len(pairs)), gap_before=np.zeros(len(pairs)))
    solver = ContactSolver("interior-point", SolverOptions(), "associated")
    place = Place(x, np.zeros(len(x)), radius, poses, poses)
    rest = np.zeros((len(x), 3))
    step = DynamicStep(bodies_of(rigid), laws, solver, rest, DT, 1.0, place.round_off())
    made = step.problem(closed, np.zeros((len(pairs), 2)))
    # Contacts are closed by definition here, not by coordinates: nothing about them is unresolved.
    return replace(made, resolution=0.0)


def turned_gravity(problem: ContactProblem, angle: float = TURN) -> ContactProblem:
    """The same contacts under gravity turned by ``angle`` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    force = problem.force.copy()
    force[:, 0] = c * problem.force[:, 0] - s * problem.force[:, 1]
    force[:, 1] = s * problem.force[:, 0] + c * problem.force[:, 1]
    return replace(problem, force=force)
