"""A row of equal spheres that touch, of which the first is struck: integrated to round-off, and step by step."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, positive

FloatArray = NDArray[np.float64]


def _forces(x: FloatArray) -> FloatArray:
    """Accelerations of the displacements x, shape (n,): contacts push by the overlap to the power 3/2."""
    push = np.maximum(x[:-1] - x[1:], 0.0) ** 1.5
    found = np.zeros(len(x))
    found[:-1] -= push
    found[1:] += push
    return found


@lru_cache(maxsize=8)
def _integrated(n: int, times: tuple[float, ...], tolerance: float) -> FloatArray:
    from scipy.integrate import solve_ivp  # slow to import, and most runs do not need it

    start = np.zeros(2 * n)
    start[n] = 1.0

    def rates(_: float, state: FloatArray) -> FloatArray:
        return np.concatenate([state[n:], _forces(state[:n])])

    found = solve_ivp(
        rates,
        (0.0, times[-1]),
        start,
        method="DOP853",
        rtol=tolerance,
        atol=1e-2 * tolerance,
        t_eval=times,
        max_step=0.2,
    )
    velocities: FloatArray = found.y[n:].T
    return velocities


def struck_row(n: int, times: FloatArray) -> tuple[FloatArray, float]:
    """Velocities of the spheres, shape (s, n), and their uncertainty, the difference of two integrations.

    Units: the speed v of the blow, and the length ``(m v^2/K)^(2/5)`` of contacts of ``fn = K delta^(3/2)`` between spheres of mass m.

    Parameters
    ----------
    n : int
        Number of spheres, >= 2.
    times : array_like, shape (s,)
        Increasing, the first 0.
    """
    count(least=2, n=n)
    key = tuple(float(t) for t in times)
    fine, coarse = _integrated(n, key, 1e-12), _integrated(n, key, 1e-10)
    return fine, float(np.abs(fine - coarse).max())


def stepped_row(n: int, dt: float, steps: int, every: int) -> FloatArray:
    """Velocities at every so many steps by central differences of the step ``dt``, shape (steps // every + 1, n); units as above."""
    count(least=2, n=n)
    positive(dt=dt)
    x, v = np.zeros(n), np.zeros(n)
    v[0] = 1.0
    found, force = [v.copy()], _forces(x)
    for k in range(1, steps + 1):
        v = v + 0.5 * dt * force
        x = x + dt * v
        force = _forces(x)
        v = v + 0.5 * dt * force
        if k % every == 0:
            found.append(v.copy())
    return np.array(found)
