"""Stability limits against eigenvalues of the stiffness and of one step's amplification matrix."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from ninedisk.references.analytic.contact.critical_step import lagged_limit, mode_limit, row_frequencies, row_limit

KN, MASS = 1.35e9, 7.85398e6
CHAIN = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])


def spectral_radius(dt: float, M: np.ndarray, C: np.ndarray, K: np.ndarray, *, central: bool = False) -> float:
    """Of ``(x, v) -> (x + dt v+, v+)``."""
    n = len(M)
    left, right = (M + dt / 2.0 * C, M - dt / 2.0 * C) if central else (M, M - dt * C)
    vx, vv = np.linalg.solve(left, -dt * K), np.linalg.solve(left, right)
    step = np.block([[np.eye(n) + dt * vx, dt * vv], [vx, vv]])
    return float(np.abs(np.linalg.eigvals(step)).max())


def test_frequencies_are_those_of_the_chain() -> None:
    assert row_frequencies(kn=KN, mass=MASS) ** 2 == pytest.approx(np.linalg.eigvalsh(CHAIN) * KN / MASS, rel=1e-13)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 3.0])
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_limit_of_a_mode_is_where_its_step_stops_being_stable(zeta: float, form: str) -> None:
    omega = 7.0
    limit = mode_limit(omega=omega, damping_ratio=zeta, form=form)
    M, C, K = np.eye(1), np.eye(1) * 2.0 * zeta * omega, np.eye(1) * omega**2
    inside, outside = (spectral_radius(limit * f, M, C, K, central=form == "central") for f in (1 - 1e-6, 1 + 1e-6))
    assert inside <= 1.0 + 1e-12
    assert outside > 1.0 + 1e-8


@pytest.mark.parametrize(
    ("c_disk_disk", "c_wall", "xi"), [(0.0, 0.0, 0.0), (0.0, 0.0, 3.0), (2e7, 3e7, 0.0), (1e8, 4e7, 3.0)]
)
def test_limit_of_the_row_is_where_its_step_stops_being_stable(c_disk_disk: float, c_wall: float, xi: float) -> None:
    limit = row_limit(kn=KN, mass=MASS, c_disk_disk=c_disk_disk, c_wall=c_wall, xi=xi)
    d, w = c_disk_disk, c_wall
    C = np.array([[w + d, -d, 0.0], [-d, 2 * d, -d], [0.0, -d, w + d]]) + xi * MASS * np.eye(3)
    M, K = MASS * np.eye(3), KN * CHAIN
    assert spectral_radius(limit * (1 - 1e-5), M, C, K) <= 1.0 + 1e-7  # two roots meet at the limit
    assert spectral_radius(limit * (1 + 1e-5), M, C, K) > 1.0 + 1e-6
    # Nothing below is unstable: the radius is scanned.
    assert max(spectral_radius(f * limit, M, C, K) for f in np.linspace(0.01, 0.999, 200)) <= 1.0 + 1e-7


def test_undamped_row_limit_is_below_the_tabulated_rule() -> None:
    limit = row_limit(kn=KN, mass=MASS)
    assert limit == pytest.approx(2.0 / math.sqrt((2.0 + math.sqrt(2.0)) * KN / MASS), rel=1e-13)
    assert limit == pytest.approx(mode_limit(omega=row_frequencies(kn=KN, mass=MASS)[-1]), rel=1e-13)
    assert limit < 2.0 * math.sqrt(MASS / KN)
    assert 0.1 * 2.0 * math.sqrt(MASS / KN) == pytest.approx(0.01525, abs=5e-6)


def test_single_mode_and_matrix_form_agree() -> None:
    omega, zeta = 5.0, 0.3
    limit = lagged_limit(mass=[[1.0]], damping=[[2.0 * zeta * omega]], stiffness=[[omega**2]])
    assert limit == pytest.approx(mode_limit(omega=omega, damping_ratio=zeta, form="lagged"), rel=1e-13)
    root = brentq(lambda dt: 4.0 - 4.0 * zeta * omega * dt - (omega * dt) ** 2, 0.0, 1.0)
    assert limit == pytest.approx(root, rel=1e-11)


def test_bad_matrices_are_named() -> None:
    with pytest.raises(ValueError, match="damping of shape"):
        lagged_limit(mass=np.eye(2), damping=[[0.0, 1.0], [0.0, 0.0]], stiffness=np.eye(2))
    with pytest.raises(ValueError, match="mass is not positive definite"):
        lagged_limit(mass=np.zeros((2, 2)), damping=np.eye(2), stiffness=np.eye(2))
