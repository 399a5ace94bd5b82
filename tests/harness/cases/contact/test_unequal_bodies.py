"""Cases of unequal bodies: assumptions of their closed forms, and the forms against independent integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.harness.cases.contact.cluster import DURATION, MU, OVERLAP, cluster, truth
from ninedisk.references.analytic.contact.belt import belt_motion
from ninedisk.references.analytic.contact.cluster import Touch, cluster_swing
from ninedisk.references.analytic.impact.two_disks import Springs, two_disk_impact


@pytest.mark.parametrize(
    ("arrangement", "blocked", "contacts"),
    [("six", False, 12), ("many", False, 9), ("box", False, 8), ("box", True, 8)],
)
def test_contacts_of_a_cluster_stay_closed_and_stick(arrangement: str, blocked: bool, contacts: int) -> None:
    found = truth({"arrangement": arrangement, "blocked": blocked, "xi": 0.0}, np.linspace(0.0, DURATION, 50))
    assert found.overlap.shape[1] == contacts
    assert found.overlap.min() > 0.1 * OVERLAP
    assert found.fn.min() > 0.0
    assert np.abs(found.fs / found.fn).max() < MU


def test_a_large_disk_has_nine_neighbours() -> None:
    given = cluster("many")
    assert given.mass.max() / given.mass.min() > 1e4
    assert len(set(given.radius)) == len(given.radius) == 10


def test_a_cluster_swings_as_its_equations_integrate() -> None:
    """Contact by contact, with forces as vectors; one body is kept from turning."""
    radius, mass, inertia = np.array([0.5, 0.3, 0.4]), np.array([1.0, 3.0, 0.6]), np.array([0.2, 1e300, 0.03])
    touches = [
        Touch(0, 1, (0.6, 0.8), 1e-3, 50.0, 30.0, 0.2),
        Touch(1, 2, (-0.8, 0.6), 2e-3, 80.0, 10.0, 0.1),
        Touch(2, -1, (0.0, -1.0), 0.0, 40.0, 20.0, 0.3),
    ]
    start = np.array([[0.1, 0.0, 0.3], [0.0, -0.2, 0.0], [0.05, 0.1, -0.4]])

    def rates(t: float, state: np.ndarray) -> np.ndarray:  # noqa: ARG001
        q, v = state.reshape(2, 3, 3)
        force = np.zeros((3, 3))
        for touch in touches:
            n = np.array(touch.normal)
            along = np.array([-n[1], n[0]])
            x, u = q[touch.i].copy(), v[touch.i].copy()
            turned, light = radius[touch.i] * q[touch.i, 2], 1.0 / mass[touch.i]
            if touch.j >= 0:
                x, u = x - q[touch.j], u - v[touch.j]
                turned, light = turned + radius[touch.j] * q[touch.j, 2], light + 1.0 / mass[touch.j]
            fn = touch.kn * (touch.overlap + x[:2] @ n) + 2.0 * touch.beta * math.sqrt(touch.kn / light) * (u[:2] @ n)
            fs = -touch.ks * (x[:2] @ along + turned)
            push = -fn * n + fs * along
            force[touch.i] += [*push, radius[touch.i] * fs]
            if touch.j >= 0:
                force[touch.j] += [*-push, radius[touch.j] * fs]
        return np.concatenate([v.ravel(), (force / np.column_stack([mass, mass, inertia])).ravel()])

    t = np.linspace(0.0, 0.7, 5)
    right = solve_ivp(rates, (0.0, 0.7), np.concatenate([np.zeros(9), start.ravel()]), t_eval=t, rtol=1e-11, atol=1e-13)
    found = cluster_swing(t, velocity=start, radius=radius, mass=mass, inertia=inertia, touches=touches)
    np.testing.assert_allclose(found.velocity.reshape(5, -1), right.y[9:].T, atol=1e-9)


def test_masses_1_and_3_exchange_half_of_the_speed() -> None:
    """Head-on at 1 m/s, elastic: -1/2 and 1/2; smooth disks keep their spins."""
    velocity = np.array([[1.0, 0.0, 2.0], [0.0, 0.0, -1.0]])
    found = two_disk_impact(
        direction=(1.0, 0.0),
        velocity=velocity,
        radius=[0.4, 0.7],
        mass=[1.0, 3.0],
        inertia=[0.08, 0.735],
        mu=0.0,
        restitution=1.0,
    )
    np.testing.assert_allclose(found.velocity, [[-0.5, 0.0, 2.0], [0.5, 0.0, -1.0]], atol=1e-15)


@pytest.mark.parametrize("springs", [None, Springs(1e6, 7e5, 0.1)])
@pytest.mark.parametrize("mu", [0.1, 10.0])
def test_an_impact_keeps_momentum_and_its_moment(springs: Springs | None, mu: float) -> None:
    radius, mass, inertia = np.array([0.4, 0.7]), np.array([1.0, 3.0]), np.array([0.1, 0.5])
    n = np.array([0.6, 0.8])
    velocity = np.array([[1.0, 0.5, 2.0], [-0.3, -0.2, 1.5]])
    found = two_disk_impact(
        direction=(0.6, 0.8),
        velocity=velocity,
        radius=radius,
        mass=mass,
        inertia=inertia,
        mu=mu,
        restitution=0.5,
        springs=springs,
    )
    place = np.array([-radius[0] * n, radius[1] * n])

    def balance(v: np.ndarray) -> np.ndarray:
        moment = (mass * (place[:, 0] * v[:, 1] - place[:, 1] * v[:, 0]) + inertia * v[:, 2]).sum()
        return np.append(mass @ v[:, :2], moment)

    np.testing.assert_allclose(balance(found.velocity), balance(velocity), atol=1e-14)
    assert (mass @ (found.velocity[:, :2] ** 2).sum(axis=1) + inertia @ found.velocity[:, 2] ** 2) < (
        mass @ (velocity[:, :2] ** 2).sum(axis=1) + inertia @ velocity[:, 2] ** 2
    )
    if springs is None and mu == 10.0:  # the surfaces stick
        relative = (found.velocity[0, :2] - found.velocity[1, :2]) @ [-0.8, 0.6]
        assert relative + radius @ found.velocity[:, 2] == pytest.approx(0.0, abs=1e-14)


def test_a_belt_takes_bodies_along() -> None:
    """Reached after 0.1 s at 3 m/s^2; a disk has a third of it after the same time of slip; both rest after the belt has stopped."""
    t = np.array([0.0, 0.05, 0.1, 0.2, 0.25, 0.4])
    block = belt_motion(t, segments=[(0.2, 0.3)], pull=3.0, ease=1.0)
    np.testing.assert_allclose(block.v, [0.0, 0.15, 0.3, 0.3, 0.15, 0.0], atol=1e-15)
    np.testing.assert_allclose(block.x, [0.0, 0.00375, 0.015, 0.045, 0.05625, 0.06], atol=1e-15)
    np.testing.assert_allclose(block.belt, [0.0, 0.015, 0.03, 0.06, 0.06, 0.06], atol=1e-15)
    disk = belt_motion(t, segments=[(0.2, 0.3)], pull=3.0, ease=3.0)
    np.testing.assert_allclose(disk.v, [0.0, 0.1, 0.1, 0.1, 0.0, 0.0], atol=1e-15)
