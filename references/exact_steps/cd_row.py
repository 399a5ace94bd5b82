"""Row of three disks squeezed by smooth walls, stepped by contact dynamics with elastic contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, not_negative, positive, theta_in_range
from ninedisk.references.exact_steps.compression import closed_row

FloatArray = NDArray[np.float64]


def smooth_row_cd(
    *,
    kn: float,
    mass: float,
    xi: float,
    dt: float,
    n_load: int,
    v_wall: float,
    n_steps: int,
    theta: float,
) -> tuple[FloatArray, FloatArray]:
    """Contact forces at the end of every step of the theta scheme with contact compliance ``1/kn``.

    The row is that of `ninedisk.references.exact_steps.compression.smooth_row`. A step solves
    ``Mbar dx = m v0/(theta dt) + f`` with ``Mbar = m (1/(theta dt^2) + xi/dt)``, where the contact forces are those at
    the END of the step, walls included: ``f = kn (w1 - (x0 + dx)) - kn (x0 + dx)``. Hence::

        dx = (m v0/(theta dt) + kn (w1 - 2 x0)) / (Mbar + 2 kn),    v1 = (dx/dt - (1 - theta) v0)/theta

    Without damping the amplification has ``|l|^2 = 1/(1 + theta (omega dt)^2)``, ``omega^2 = 2 kn/m``: dissipative at
    every theta.

    Parameters
    ----------
    kn : float
        Normal stiffness of every contact [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    xi : float
        Global damping [1/s], >= 0.
    dt : float
        Time step [s], > 0.
    n_load : int
        Number of steps during which the walls move.
    v_wall : float
        Speed of each wall [m/s], >= 0.
    n_steps : int
        Number of steps.
    theta : float
        Parameter of the scheme, in [1/2, 1].

    Returns
    -------
    fn_disk_disk, fn_wall : ndarray, shape (n_steps + 1,)
        Normal forces [N]; row 0 is the initial state, row n the end of step n.

    Raises
    ------
    ValueError
        If an argument is out of range or a contact would open.

    Notes
    -----
    Source: theta scheme of Lim's thesis, appendix A.3.2 at theta = 1, (A.1) with the compliance term
    added; derived here.
    """
    positive(kn=kn, mass=mass, dt=dt)
    not_negative(xi=xi, v_wall=v_wall)
    count(n_load=n_load, n_steps=n_steps)
    theta_in_range(theta)
    ext = np.longdouble
    step, stiffness, weight = ext(dt), ext(kn), ext(theta)
    inertia = ext(mass) / (weight * step)
    resistance = inertia / step + ext(mass) * ext(xi) / step + 2 * stiffness
    wall = ext(v_wall) * step * np.minimum(np.arange(n_steps + 1), n_load).astype(ext)
    x = np.zeros(n_steps + 1, dtype=ext)
    v = ext(0)
    for n in range(n_steps):
        dx = (inertia * v + stiffness * (wall[n + 1] - 2 * x[n])) / resistance
        v = (dx / step - (1 - weight) * v) / weight
        x[n + 1] = x[n] + dx
    return closed_row(kn=stiffness, x=x, wall=wall)
