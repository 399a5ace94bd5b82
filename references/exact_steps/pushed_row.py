"""Row of equal disks between two walls, one of which moves in: exact steps of central differences and of contact dynamics."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import MOST, count, finite, form_in_range, not_negative, positive, theta_in_range
from ninedisk.references.analytic.assembly.pushed_row import MOST_DISKS, ChainModes, chain_modes, forces_of

FloatArray = NDArray[np.float64]


def chain_central(
    *, n: int, kn: float, mass: float, xi: float, dt: float, n_load: int, v_wall: float, n_steps: int,
    form: Literal["central", "lagged"] = "central",
) -> FloatArray:  # fmt: skip
    """Change of the contact forces [N] at ``t_0 .. t_n``, central differences: modes decouple in the time-discrete scheme, too.

    Each mode is stepped as `ninedisk.references.exact_steps.compression.smooth_row` steps its one oscillator.

    Parameters
    ----------
    n, kn, mass, xi, v_wall
        As in `ninedisk.references.analytic.assembly.pushed_row.chain_forces`.
    dt : float
        Time step [s], > 0.
    n_load : int
        Number of steps during which the wall moves.
    n_steps : int
        Number of steps.
    form : {"central", "lagged"}
        Velocity that the damping force sees.

    Returns
    -------
    ndarray, shape (n_steps + 1, n + 1)

    Raises
    ------
    ValueError
        If a value is out of range, or so far beyond the stable step that forces exceed all numbers.
    """
    form_in_range(form)
    modes, wall, step, rate = _start(n, kn, mass, xi, dt, n_load, v_wall, n_steps)
    half = rate * step / 2
    keep, gain = ((1 - half) / (1 + half), 1 / (1 + half)) if form == "central" else (1 - 2 * half, np.longdouble(1))
    q, v = np.zeros((n_steps + 1, n), dtype=np.longdouble), np.zeros(n, dtype=np.longdouble)
    for k in range(n_steps):
        v = keep * v + gain * step * (modes.drive * wall[k] - modes.omega**2 * q[k])
        q[k + 1] = q[k] + step * v
    with np.errstate(over="ignore", invalid="ignore"):
        forces = forces_of(modes, q, wall, kn).astype(np.float64)
    if not np.isfinite(forces).all():
        raise ValueError(
            f"dt = {dt!r} s is not allowed: forces grow beyond all numbers; central differences are stable up to "
            f"2/omega = {2.0 / float(modes.omega.max()):g} s (mass, kn)"
        )
    return forces


def chain_theta(
    *, n: int, kn: float, mass: float, xi: float, dt: float, n_load: int, v_wall: float, n_steps: int, theta: float
) -> FloatArray:
    """Change of the contact forces [N] at the end of each step of the theta scheme with elastic contacts.

    Each mode is stepped as `ninedisk.references.exact_steps.cd_row.smooth_row_cd` steps its one oscillator; parameters as in
    `chain_central`, ``theta`` in [1/2, 1].
    """
    theta_in_range(theta)
    modes, wall, step, rate = _start(n, kn, mass, xi, dt, n_load, v_wall, n_steps)
    weight = np.longdouble(theta)
    resistance = 1 / (weight * step**2) + rate / step + modes.omega**2
    q, v = np.zeros((n_steps + 1, n), dtype=np.longdouble), np.zeros(n, dtype=np.longdouble)
    for k in range(n_steps):
        moved = (v / (weight * step) + modes.drive * wall[k + 1] - modes.omega**2 * q[k]) / resistance
        v = (moved / step - (1 - weight) * v) / weight
        q[k + 1] = q[k] + moved
    return forces_of(modes, q, wall, kn).astype(np.float64)


class _Start(NamedTuple):
    """Modes, the wall's way at each step, step and damping in extended precision."""

    modes: ChainModes
    wall: NDArray[np.longdouble]
    step: np.longdouble
    rate: np.longdouble


def _start(n: int, kn: float, mass: float, xi: float, dt: float, n_load: int, v_wall: float, n_steps: int) -> _Start:
    """What both schemes start with; raises ValueError on arguments out of range."""
    positive(dt=dt)
    not_negative(xi=xi)
    finite(v_wall=v_wall)
    count(n=n, least=1, most=MOST_DISKS)
    count(n_load=n_load)
    count(n_steps=n_steps, most=MOST // n)
    ext = np.longdouble
    wall = ext(v_wall) * ext(dt) * np.minimum(np.arange(n_steps + 1), n_load).astype(ext)
    return _Start(chain_modes(n=n, kn=kn, mass=mass), wall, ext(dt), ext(xi))
