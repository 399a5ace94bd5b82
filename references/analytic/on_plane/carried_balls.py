"""A box that slides on a plane with balls on it, which roll without slip."""

from __future__ import annotations

from typing import NamedTuple

from ninedisk.references._validate import not_negative, positive


class Carried(NamedTuple):
    """Accelerations of the ``box`` and of its ``balls`` [m/s^2], and the friction ``needed`` between them [-]."""

    box: float
    balls: float
    needed: float


def carried_balls(*, push: float, mass: float, carried: float, mu: float, g: float) -> Carried:
    """Accelerations of a box that a level force pushes along a plane, with uniform balls at rest on its level top.

    The box has a friction of ``mu (M + m) g`` to overcome, m the mass of all balls together. A ball of any radius follows with 2/7 of its
    acceleration: ``A = (F - mu (M + m) g)/(M + 2 m/7)``. Below the friction all stay at rest.

    Parameters
    ----------
    push : float
        Force on the box [N], >= 0.
    mass, carried : float
        Mass of the box [kg], > 0, and of all balls together [kg], >= 0.
    mu : float
        Friction coefficient of the box on the plane, >= 0.
    g : float
        Gravity [m/s^2], > 0.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> round(carried_balls(push=150.0, mass=10.0, carried=25.0, mu=0.4, g=9.81).box, 4)
    0.7385
    """
    positive(mass=mass, g=g)
    not_negative(push=push, carried=carried, mu=mu)
    driving = max(push - mu * (mass + carried) * g, 0.0)
    acceleration = driving / (mass + 2.0 / 7.0 * carried)
    balls = 2.0 / 7.0 * acceleration
    return Carried(acceleration, balls, balls / g)
