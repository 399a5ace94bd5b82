"""The triangular lattice: moduli, contacts summed one by one, swings of the disks, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.lattice import moduli, sheared, stretched

KN, KS, RADIUS = 3.0, 1.7, 0.5


def summed(rate: np.ndarray, spacing: float, angle: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Stress of three contacts whose shear forces grow by small steps, at the last time."""
    total, dt = np.zeros((2, 2)), times[1] - times[0]
    for turn in np.radians([0.0, 60.0, 120.0]):
        first, fs = spacing * np.array([np.cos(turn), np.sin(turn)]), 0.0
        for k in range(len(times) - 1):
            d = first + (times[k] + 0.5 * dt) * rate @ first
            t = np.array([-d[1], d[0]]) / np.hypot(*d)
            fs -= KS * (-(rate @ first) @ t * dt + 2.0 * RADIUS * (angle[k + 1] - angle[k]))
        d = first + times[-1] * rate @ first
        n = d / np.hypot(*d)
        force = KN * (2.0 * RADIUS - np.hypot(*d)) * n - fs * np.array([-n[1], n[0]])
        total += np.outer(force, d)
    return total / (0.5 * np.sqrt(3.0) * spacing**2 * np.linalg.det(np.eye(2) + times[-1] * rate))


def test_disks_that_just_touch_have_the_moduli_of_the_lattice() -> None:
    known, small = moduli(kn=KN, ks=KS), 1e-7
    assert known[:2] == pytest.approx((0.5 * 3**0.5 * KN, 0.25 * 3**0.5 * (KN + KS)))
    assert known.young == pytest.approx(2.0 * known.shear * (1.0 + known.poisson))
    for rate, modulus in (((-1.0, -1.0), -known.bulk), ((1.0, -1.0), known.shear)):
        found = stretched(t=[0.0, small], rate=rate, spacing=1.0 - 4.0 * small, radius=RADIUS, kn=KN, ks=KS).stress
        change = found[1] - found[0]
        assert 0.25 * (change[1, 1] - change[0, 0]) / small == pytest.approx(max(modulus, 0.0), abs=1e-5)
        assert 0.25 * np.trace(change) / small == pytest.approx(max(-modulus, 0.0), abs=1e-5)


@pytest.mark.parametrize("rate", [(-0.3, -0.3), (0.1, -0.4), (-0.2, 0.0)])
def test_a_stretched_lattice_is_the_sum_of_its_contacts(rate: tuple[float, float]) -> None:
    """At a strain of a tenth; the energy grows by area times stress times rate."""
    times = np.linspace(0.0, 0.3, 2001)
    found = stretched(t=times, rate=rate, spacing=0.96, radius=RADIUS, kn=KN, ks=KS)
    np.testing.assert_allclose(found.stress[-1], summed(np.diag(rate), 0.96, 0.0 * times, times), rtol=0, atol=1e-7)
    edges = 1.0 + times[:, None] * np.array(rate)
    force = found.stress[:, [0, 1], [0, 1]] * 0.5 * 3**0.5 * 0.96**2 * np.prod(edges, axis=1)[:, None] / edges
    power = -force @ np.array(rate)
    work = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(times))
    assert found.energy[-1] - found.energy[0] == pytest.approx(work, rel=1e-6)


def test_a_sheared_lattice_is_the_sum_of_its_contacts_to_first_order() -> None:
    """Errors fall with the square of the strain."""
    times, spacing = np.linspace(0.0, 0.4, 2001), 0.99

    def error(rate: float) -> float:
        found = sheared(t=times, rate=rate, spacing=spacing, radius=RADIUS, kn=KN, ks=KS, inertia=0.05)
        exact = summed(np.array([[0.0, rate], [0.0, 0.0]]), spacing, found.angle, times)
        return float(np.abs(found.stress[-1] - exact).max())

    assert error(1e-3) < 1e-5
    assert 3.8 < error(2e-3) / error(1e-3) < 4.2


def test_swings_obey_the_torques_and_central_differences_theirs() -> None:
    inertia, dt = 0.05, 0.02
    how = {"rate": 0.01, "spacing": 0.98, "radius": RADIUS, "kn": KN, "ks": KS, "inertia": inertia}
    area = 0.5 * 3**0.5 * 0.98**2 / 0.98  # arms R of contacts that are 0.98 of 2 R long
    times = np.linspace(0.0, 1.0, 10001)
    found = sheared(t=times, **how)
    torque = np.gradient(found.omega, times)[1:-1] * inertia
    np.testing.assert_allclose(torque, area * (found.stress[1:-1, 0, 1] - found.stress[1:-1, 1, 0]), rtol=0, atol=1e-7)
    n = np.arange(60)
    stepped = sheared(t=n * dt, dt=dt, **how)
    square, about = 12.0 * KS * RADIUS**2 / inertia, -0.5 * 0.98 * 0.01 * n * dt
    angle = np.zeros(60)
    for k in range(1, 59):
        angle[k + 1] = 2.0 * angle[k] - angle[k - 1] - square * dt**2 * (angle[k] - about[k])
    np.testing.assert_allclose(stepped.angle, angle, rtol=0, atol=1e-14)
    np.testing.assert_allclose(stepped.omega[1:-1], (angle[2:] - angle[:-2]) / (2.0 * dt), rtol=0, atol=1e-13)


def test_contacts_that_do_not_hold_and_steps_that_are_unstable_are_refused() -> None:
    how = {"radius": RADIUS, "kn": KN, "ks": KS}
    for spacing, rate, words in ((1.01, (0.0, 0.0), "must touch"), (0.99, (0.1, 0.0), "opened")):
        with pytest.raises(ValueError, match=words):
            stretched(t=[0.0, 0.5], rate=rate, spacing=spacing, **how)
    with pytest.raises(ValueError, match="must touch"):
        sheared(t=[0.0], rate=1.0, spacing=1.01, inertia=1.0, **how)
    with pytest.raises(ValueError, match="stable below"):
        sheared(t=[0.0], rate=1.0, spacing=0.99, inertia=0.01, dt=0.2, **how)
