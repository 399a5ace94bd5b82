"""Closed forms of JKR against its own two equations, solved and integrated by other means."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from ninedisk.references.analytic.impact.jkr import neck, restitution, stable_contact, sticking_speed

E, G, R, M = 3e9, 0.05, 2e-4, 4e-8
SAME = {"e_star": E, "surface_energy": G, "radius": R}
END = neck(**SAME)
near = partial(pytest.approx, abs=0.0)  # these energies are below pytest's own absolute tolerance


def overlap_of(a: float) -> float:
    return a**2 / R - 2.0 * math.sqrt(math.pi * G * a / E)


def force_of(a: float) -> float:
    return 4.0 * E * a**3 / (3.0 * R) - 4.0 * math.sqrt(math.pi * G * E * a**3)


def radius_of(overlap: float) -> float:
    return float(brentq(lambda a: overlap_of(a) - overlap, END.breaking_radius, 1e3 * END.breaking_radius, xtol=1e-22))


def test_the_stable_branch_is_that_of_the_quartic() -> None:
    scale = -END.breaking_overlap
    for overlap in scale * np.array([-0.99, -0.5, -1e-3, 0.0, 1.0, 100.0]):
        a, force = stable_contact(overlap, **SAME)
        root = radius_of(overlap)
        # The bracket's root is known to the round-off of the overlap over its slope, which falls to 0 at the break.
        assert float(a) == near(root, rel=1e-12)
        assert float(force) == near(force_of(root), rel=1e-11)
    a, force = stable_contact(END.breaking_overlap, **SAME)
    assert (float(a), -float(force)) == near((END.breaking_radius, END.breaking_force), rel=1e-14)
    # Without adhesion the contact is Hertz', to the order of sqrt(g).
    stiff = stable_contact(1e-6, e_star=E, surface_energy=1e-16, radius=R)[1]
    assert float(stiff) == near(4.0 / 3.0 * E * math.sqrt(R) * 1e-9, rel=1e-7)


def test_forces_and_radii_that_name_the_neck() -> None:
    overlap = END.breaking_overlap * np.linspace(1.0, -3.0, 400_001)
    assert -float(stable_contact(overlap, **SAME)[1].min()) == near(END.pull_off, rel=1e-9)
    assert -float(stable_contact(0.0, **SAME)[1]) == near(END.touching_force, rel=1e-14)
    assert abs(force_of(END.zero_load_radius)) < 1e-13 * END.pull_off
    assert END.zero_load_radius == near((9.0 * math.pi * G * R**2 / E) ** (1.0 / 3.0), rel=1e-14)
    with pytest.raises(ValueError, match="where the neck breaks"):
        stable_contact(1.001 * END.breaking_overlap, **SAME)


def test_the_loss_of_a_cycle_is_the_work_of_the_pull() -> None:
    def rate(a: float) -> float:
        return force_of(a) * (2.0 * a / R - math.sqrt(math.pi * G / (E * a)))

    work, _ = quad(rate, END.breaking_radius, radius_of(0.0), epsabs=0.0, epsrel=1e-13)
    assert -work == near(END.loss, rel=1e-12)
    most = radius_of(END.pull_off_overlap)
    assert force_of(most) == near(-END.pull_off, rel=1e-12)
    assert -quad(rate, most, radius_of(0.0), epsabs=0.0, epsrel=1e-13)[0] == near(END.pull_off_loss, rel=1e-12)
    assert END.loss == near(7.09 * ((2.0 * G) ** 5 * R**4 / E**2) ** (1.0 / 3.0), rel=1e-3)


def test_sticking_and_rebound_share_one_balance_of_energy() -> None:
    slow = sticking_speed(**SAME, m_eff=M)
    assert 0.5 * M * slow**2 == near(END.loss, rel=1e-14)
    assert restitution(speed=slow, **SAME, m_eff=M) == 0.0
    assert restitution(speed=0.5 * slow, **SAME, m_eff=M) == 0.0
    fast = 3.0 * slow
    left = 0.5 * M * fast**2 * restitution(speed=fast, **SAME, m_eff=M) ** 2
    assert left == near(0.5 * M * fast**2 - END.loss, rel=1e-13)
