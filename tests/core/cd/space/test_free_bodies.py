"""Bodies without contacts: free fall, and rotation against integrals of Euler's equations and their invariants."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from solids import G, matrix, rigid, steps, turn_about

from ninedisk.core import BodyForce, InvalidNumericsError, Spheres, SphereScene, simulate
from ninedisk.core.history import History

HALF = np.array([0.3, 0.5, 0.9])
MASS = 2.0
MOMENTS = MASS * (HALF @ HALF - HALF**2) / 3.0
TURN = turn_about([1.0, -2.0, 0.5], 0.7)


def spinning(omega: NDArray[np.float64], dt: float, count: int) -> History:
    box = Spheres(x=[[0.0, 0.0, 0.0]], mass=MASS, half_sizes=[HALF], quaternion=[TURN], omega=[omega])
    scene = SphereScene(spheres=box, sphere_sphere=rigid())
    return simulate(scene, steps(dt, count), method="cd")


def exact_body_spin(omega: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Spin in the axes of the body, by Euler's equations."""

    def rate(_: float, w: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(-np.cross(w, MOMENTS * w) / MOMENTS)

    found = solve_ivp(rate, (0.0, t[-1]), matrix(TURN).T @ omega, method="DOP853", t_eval=t, rtol=1e-12, atol=1e-13)
    return np.asarray(found.y.T)


def body_spin(history: History) -> NDArray[np.float64]:
    assert history.quaternion is not None
    return np.array([matrix(q).T @ w for q, w in zip(history.quaternion[:, 0], history.omega[:, 0], strict=True)])


def test_a_free_spin_is_that_of_eulers_equations_to_second_order() -> None:
    omega = np.array([1.0, 2.0, -0.7])
    errors = []
    for count in (100, 200, 400):
        history = spinning(omega, 4.0 / count, count)
        errors.append(np.abs(body_spin(history) - exact_body_spin(omega, history.t)).max())
    assert errors[2] < 2e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.05)


def test_angular_momentum_is_kept_to_rounding_and_energy_within_bounds() -> None:
    history = spinning(np.array([3.0, 1.0, 2.0]), 0.04, 800)
    assert history.quaternion is not None
    tensors = np.array([matrix(q) @ np.diag(MOMENTS) @ matrix(q).T for q in history.quaternion[:, 0]])
    momentum = np.einsum("sij,sj->si", tensors, history.omega[:, 0])
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.linalg.norm(momentum[0])
    energy = history.energy["rotation"]
    assert np.abs(energy / energy[0] - 1.0).max() < 8e-3
    # No drift: the mean of the last quarter is that of the first one to a fraction of the oscillation.
    assert abs(energy[-200:].mean() - energy[:200].mean()) < 0.1 * np.ptp(energy)
    assert np.abs(np.linalg.norm(history.quaternion[:, 0], axis=1) - 1.0).max() < 1e-14


def test_a_spin_about_the_middle_axis_flips_when_it_has_to() -> None:
    """A body turned about its intermediate axis flips (Dzhanibekov); the time is that of Euler's equations."""
    omega = matrix(TURN) @ np.array([0.002, 4.0, 0.002])
    history = spinning(omega, 0.008, 1000)
    exact = exact_body_spin(omega, history.t)
    assert exact[:, 1].min() < -3.9
    assert np.abs(body_spin(history) - exact).max() < 0.2


def test_a_constant_force_and_a_torque_on_a_sphere_are_integrated_exactly() -> None:
    """With theta = 1/2 the scheme is exact for a constant acceleration, with theta = 1 it adds ``a dt t/2``."""
    sphere = Spheres(x=[[0.0, 0.0, 1.0]], v=[[1.0, 0.0, 2.0]], radius=0.5, mass=2.0, inertia=0.3)
    push = BodyForce(disk=0, force=(1.0, -2.0, 0.5), torque=(0.3, 0.6, -0.9), end=0.25)
    scene = SphereScene(spheres=sphere, sphere_sphere=rigid(), gravity=(0.0, 0.0, -G), forces=[push])
    for theta in (0.5, 1.0):
        history = simulate(scene, steps(0.1, 5, theta=theta), method="cd")
        a = np.array([0.0, 0.0, -G])
        x = np.array([0.0, 0.0, 1.0]) + [0.5, 0.0, 1.0] + 0.5 * a * 0.5 * (0.5 + (2.0 * theta - 1.0) * 0.1)
        f = np.array([1.0, -2.0, 0.5]) / 2.0
        v = np.array([f * 0.1, f * 0.2, f * 0.25, f * 0.25, f * 0.25])
        before = np.concatenate([[np.zeros(3)], v[:-1]])
        x += 0.1 * (theta * v + (1.0 - theta) * before).sum(axis=0)
        assert history.x[-1, 0] == pytest.approx(x, abs=1e-13)
        assert history.v[-1, 0] == pytest.approx([1.0, 0.0, 2.0] + a * 0.5 + 0.25 * f, abs=1e-13)
        assert history.omega[-1, 0] == pytest.approx(0.25 * np.array([1.0, 2.0, -3.0]), abs=1e-13)


def test_a_prescribed_spin_stays_whatever_the_inertia() -> None:
    box = Spheres(x=[[0.0, 0.0, 0.0]], mass=MASS, half_sizes=[HALF], omega=[[0.0, 0.0, 0.5]], rotating=False)
    history = simulate(SphereScene(spheres=box, sphere_sphere=rigid()), steps(0.1, 10), method="cd")
    assert history.quaternion is not None
    assert history.omega[-1, 0].tolist() == [0.0, 0.0, 0.5]
    assert np.abs(history.quaternion[-1, 0] @ turn_about([0.0, 0.0, 1.0], 0.5)) == pytest.approx(1.0, abs=1e-14)


def test_a_spin_too_fast_for_the_step_is_named() -> None:
    with pytest.raises(InvalidNumericsError, match=r"^step 1 .*dt = 1 s is not allowed for a body that spins at"):
        spinning(np.array([9.0, 20.0, 9.0]), 1.0, 1)
