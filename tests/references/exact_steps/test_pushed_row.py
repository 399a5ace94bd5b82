"""Chain between walls: modes against a matrix, the row of three, orders of convergence, statics."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.pushed_row import chain_forces, chain_modes, static_force
from ninedisk.references.analytic.contact.critical_step import row_frequencies
from ninedisk.references.exact_steps.pushed_row import chain_central, chain_theta

CHAIN = {"n": 5, "kn": 1e6, "mass": 1.0, "v_wall": 0.01}


def test_frequencies_are_those_of_the_stiffness_matrix():
    assert chain_modes(n=3, kn=7.0, mass=2.0).omega.astype(float) == pytest.approx(row_frequencies(kn=7.0, mass=2.0))
    modes = chain_modes(n=5, kn=1e6, mass=1.0)
    matrix = 1e6 * (2.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1))
    assert modes.omega.astype(float) ** 2 == pytest.approx(np.linalg.eigvalsh(matrix))
    assert modes.shape @ modes.drive == pytest.approx(1e6 * np.eye(5)[0], abs=1e-8)


@pytest.mark.parametrize("xi", [0.0, 60.0])
def test_steps_of_a_dense_matrix_are_those_of_the_modes(xi):
    dt, steps, half = 1e-4, 80, 0.5 * xi * 1e-4
    matrix = 1e6 * (2.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1))
    x, v, rows = np.zeros(5), np.zeros(5), []
    for k in range(steps + 1):
        wall = 0.01 * dt * min(k, 50)
        rows.append(1e6 * -np.diff([wall, *x, 0.0]))
        v = ((1.0 - half) * v + dt * (1e6 * wall * np.eye(5)[0] - matrix @ x)) / (1.0 + half)
        x = x + dt * v
    exact = chain_central(**CHAIN, xi=xi, dt=dt, n_load=50, n_steps=steps)
    assert np.allclose(exact, rows, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("scheme", "order"), [("central", 2.0), ("lagged", 1.0), ("theta", 1.0)])
def test_orders_of_convergence(scheme, order):
    errors = []
    for k in (8, 16):
        chain = {**CHAIN, "xi": 200.0, "dt": 1e-4 / k, "n_load": 100 * k, "n_steps": 200 * k}
        exact = chain_theta(**chain, theta=0.5) if scheme == "theta" else chain_central(**chain, form=scheme)
        t = np.arange(200 * k + 1) * 1e-4 / k
        errors.append(np.abs(exact - chain_forces(t, **CHAIN, xi=200.0, t_wall=0.01)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


def test_it_settles_where_statics_says():
    rest = chain_theta(**CHAIN, xi=300.0, dt=1e-4, n_load=100, n_steps=4000, theta=1.0)[-1]
    assert rest == pytest.approx(static_force(n=5, kn=1e6, path=1e-4), rel=1e-9)
    with pytest.raises(ValueError, match="theta"):
        chain_theta(**CHAIN, xi=0.0, dt=1e-4, n_load=1, n_steps=1, theta=0.4)
