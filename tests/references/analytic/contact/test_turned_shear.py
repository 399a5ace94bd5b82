"""The shear spring of a turning contact, against the vector equation integrated in space, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.contact.turned_shear import kept_shear, turned_shear


@pytest.mark.parametrize("v", [(0.0, 0.0, 0.0), (0.3, -0.7, 0.4)])
def test_the_spring_turns_with_the_contact(v: tuple[float, ...]) -> None:
    """``s' = Omega x s - u`` with the rotation of the normal, and half of both spins about it, as vectors of space."""
    apart, u2, roll, spin = (
        np.array([0.2, 0.8, -0.3]),
        np.array(v),
        np.array([0.4, 0.1, -0.5]),
        np.array([2.0, -1.0, 3.0]),
    )
    times = np.linspace(0.0, 1.5, 7)

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        d = apart + t * u2
        n = d / np.linalg.norm(d)
        turning = np.cross(d, u2) / (d @ d) + 0.5 * (spin @ n) * n
        slip = np.cross(roll, n) - u2
        return np.cross(turning, s) - (slip - (slip @ n) * n)

    found = solve_ivp(rates, (0.0, 1.5), np.zeros(3), t_eval=times, rtol=1e-11, atol=1e-13)
    shear, frame = turned_shear(apart=apart, v=u2, roll=roll, spin=spin, t=times)
    np.testing.assert_allclose(shear, found.y.T, atol=1e-9)
    np.testing.assert_allclose(
        np.einsum("sik,sjk->sij", frame, frame), np.broadcast_to(np.eye(2), (7, 2, 2)), atol=1e-15
    )


def test_a_spring_that_keeps_its_direction() -> None:
    """The same equation without its first term, and what is left of it across the normal."""
    apart, u2, roll = np.array([0.2, 0.8, -0.3]), np.array([0.3, -0.7, 0.4]), np.array([0.4, 0.1, -0.5])
    times = np.linspace(0.0, 1.5, 7)

    def rates(t: float, s: np.ndarray) -> np.ndarray:  # noqa: ARG001
        n = (apart + t * u2) / np.linalg.norm(apart + t * u2)
        return u2 - (u2 @ n) * n - np.cross(roll, n)

    found = solve_ivp(rates, (0.0, 1.5), np.zeros(3), t_eval=times, rtol=1e-11, atol=1e-13).y.T
    n = apart + times[:, None] * u2
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    across = found - np.einsum("ij,ij->i", found, n)[:, None] * n
    np.testing.assert_allclose(kept_shear(apart=apart, v=u2, roll=roll, t=times), across, atol=1e-9)
    # Past a sphere that does not turn: a (arctan x/a) along the way and a/2 ln(1 + (x/a)^2) against the side.
    x = 0.25 * times
    past = kept_shear(apart=(0.0, 0.9, 0.0), v=(0.25, 0.0, 0.0), roll=(0.0, 0.0, 0.0), t=times)
    spring = np.stack([0.9 * np.arctan(x / 0.9), -0.45 * np.log1p((x / 0.9) ** 2), 0.0 * x], axis=1)
    n = np.stack([x, np.full_like(x, 0.9), 0.0 * x], axis=1) / np.hypot(x, 0.9)[:, None]
    np.testing.assert_allclose(past, spring - np.einsum("ij,ij->i", spring, n)[:, None] * n, atol=1e-14)


def test_closed_forms() -> None:
    """A circle about the normal; the way past a sphere that does not turn, ``a arsinh(v t/a)``."""
    t = np.linspace(0.0, 2.0, 5)
    circle, _ = turned_shear(apart=(0.0, 0.0, 1.0), v=(0.0, 0.0, 0.0), roll=(0.3, 0.0, 0.0), spin=(1.0, 0.0, 3.0), t=t)
    u, rate = -0.3, 1.5  # roll x n is along -y
    expected = np.stack([u / rate * (1.0 - np.cos(rate * t)), -u / rate * np.sin(rate * t), 0.0 * t], axis=1)
    np.testing.assert_allclose(circle, expected, atol=1e-14)
    past, _ = turned_shear(apart=(0.0, 0.9, 0.0), v=(0.25, 0.0, 0.0), roll=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), t=t)
    np.testing.assert_allclose(np.linalg.norm(past, axis=1), 0.9 * np.arcsinh(0.25 * t / 0.9), atol=1e-14)
    assert past[-1, 0] > 0.0, "the second sphere drags the first along"


def test_what_is_no_contact() -> None:
    with pytest.raises(ValueError, match="apart = "):
        turned_shear(apart=(0.0, 0.0, 0.0), v=(1.0, 0.0, 0.0), roll=(0.0,) * 3, spin=(0.0,) * 3, t=[0.0])
    with pytest.raises(ValueError, match="apart = "):
        kept_shear(apart=(0.0, 0.0, 0.0), v=(1.0, 0.0, 0.0), roll=(0.0,) * 3, t=[0.0])
