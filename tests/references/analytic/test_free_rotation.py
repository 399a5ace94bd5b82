"""Free rotation: invariants, and a symmetric body whose spin precesses in closed form."""

from __future__ import annotations

import numpy as np

from ninedisk.references.analytic.free_rotation import euler_steps, free_rotation

INERTIA = np.array([0.13, 0.29, 0.34])
TURN = np.array([0.5, 0.1, -0.7, 0.5])


def momentum(quaternion: np.ndarray, spin: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Angular momentum in space: ``q (I w) q*``."""
    own, axial, w = inertia * spin, quaternion[:, 1:], quaternion[:, :1]
    across = 2.0 * np.cross(axial, own)
    return own + w * across + np.cross(axial, across)


def test_energy_and_momentum_are_kept() -> None:
    t = np.linspace(0.0, 20.0, 41)
    found = free_rotation(t, inertia=INERTIA, spin=[0.05, 4.0, 0.02], quaternion=TURN)
    energy = 0.5 * found.spin**2 @ INERTIA
    kept = momentum(found.quaternion, found.spin, INERTIA)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)
    np.testing.assert_allclose(kept, np.tile(kept[0], (len(t), 1)), atol=1e-10)
    assert found.spin[:, 1].min() < -3.9, "it turns over"


def test_a_symmetric_body_precesses() -> None:
    t, inertia = np.linspace(0.0, 3.0, 7), np.array([0.2, 0.2, 0.5])
    found = free_rotation(t, inertia=inertia, spin=[1.0, 0.0, 2.0], quaternion=[1.0, 0.0, 0.0, 0.0])
    rate = (0.5 - 0.2) / 0.2 * 2.0
    expected = np.column_stack([np.cos(rate * t), np.sin(rate * t), np.full_like(t, 2.0)])
    np.testing.assert_allclose(found.spin, expected, atol=1e-11)


def test_plain_steps_err_in_proportion_to_the_step() -> None:
    spin = [3.0, 1.5, -2.0]
    exact = free_rotation([0.0, 1.0], inertia=INERTIA, spin=spin, quaternion=TURN)
    errors = [
        np.abs(euler_steps(n, dt=1.0 / n, inertia=INERTIA, spin=spin, quaternion=TURN).spin[-1] - exact.spin[-1]).max()
        for n in (1000, 2000)
    ]
    assert 1.9 < errors[0] / errors[1] < 2.1
