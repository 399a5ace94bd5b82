"""The implicit row against three disks solved in rational arithmetic, its damping law and its limits."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.compression import continuous_row, steady_force
from ninedisk.references.exact_steps.cd_row import smooth_row_cd

MASS = 1000.0 * math.pi * 50.0**2
A1 = {"kn": 1.35e9, "mass": MASS, "dt": 0.01525, "n_load": 40, "v_wall": 0.12}


def solve(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Gauss-Jordan elimination; no pivoting, for diagonally dominant matrices."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for column, pivot in enumerate(rows):
        for other in range(len(rows)):
            if other != column:
                factor = rows[other][column] / pivot[column]
                rows[other] = [a - factor * b for a, b in zip(rows[other], pivot, strict=True)]
    return [row[-1] / row[i] for i, row in enumerate(rows)]


def three_disks(*, kn, mass, xi, dt, n_load, v_wall, n_steps, theta):
    """Optimality conditions of the program with multipliers: unknowns are 3 displacements and 4 contact forces.

    Body i: ``Mbar dx_i - p_i + p_{i+1} = M v_i/(theta dt)``; contact: ``closing - p/kn = gap`` at the start, where the
    closing of the step includes the walls' prescribed motion.
    """
    kn, mass, xi, dt, v_wall, theta = map(Fraction, (kn, mass, xi, dt, v_wall, theta))
    mbar = mass * (1 / (theta * dt**2) + xi / dt)
    x, v = [Fraction(0)] * 3, [Fraction(0)] * 3
    wall = Fraction(0)
    disk_disk, wall_force = [0.0], [0.0]
    for n in range(1, n_steps + 1):
        dw = v_wall * dt * min(n, n_load) - wall
        gaps = [x[0] - wall, x[1] - x[0], x[2] - x[1], -wall - x[2]]
        matrix = [[Fraction(0)] * 7 for _ in range(7)]
        right = [Fraction(0)] * 7
        for i in range(3):
            matrix[i][i] = mbar
            matrix[i][3 + i], matrix[i][4 + i] = Fraction(-1), Fraction(1)
            right[i] = mass * v[i] / (theta * dt)
        for c in range(4):
            # Closing of contact c: motion of its left body minus that of its right body; walls are bodies -1 and 3.
            row = 3 + c
            if c > 0:
                matrix[row][c - 1] = Fraction(1)
            if c < 3:
                matrix[row][c] = Fraction(-1)
            matrix[row][3 + c] = -1 / kn
            right[row] = gaps[c] - (dw if c in (0, 3) else 0)
        # The forces are eliminated first: their diagonal -1/kn cannot vanish.
        order = [3, 4, 5, 6, 0, 1, 2]
        found = solve([[matrix[i][j] for j in order] for i in order], [right[i] for i in order])
        p, dx = found[:4], found[4:]
        assert min(p) >= 0
        v = [(d / dt - (1 - theta) * old) / theta for d, old in zip(dx, v, strict=True)]
        x = [a + d for a, d in zip(x, dx, strict=True)]
        wall += dw
        disk_disk.append(float(p[1]))
        wall_force.append(float(p[0]))
    return np.array(disk_disk), np.array(wall_force)


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
@pytest.mark.parametrize("xi", [0.0, 3.0])
def test_equals_three_disks_in_rational_arithmetic(theta: float, xi: float) -> None:
    keys = {**A1, "n_load": 6, "v_wall": 0.03, "xi": xi, "n_steps": 10, "theta": theta}
    for ours, exact in zip(smooth_row_cd(**keys), three_disks(**keys), strict=True):
        assert np.abs(ours - exact).max() <= 4.5e-16 * exact.max()  # one rounding of each force


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_undamped_oscillation_decays_by_the_amplification_factor(theta: float) -> None:
    dt = A1["dt"]
    disk_disk, _ = smooth_row_cd(**A1, xi=0.0, n_steps=70, theta=theta)
    swing = disk_disk - steady_force(kn=1.35e9, v_wall=0.12, t_wall=40 * dt)
    square = 2.0 * 1.35e9 / MASS * dt**2
    # For x_n = |l|^n cos(n a + b) the Casoratian x_n x_{n+2} - x_{n+1}^2 falls by exactly |l|^2 a step.
    casorati = swing[40:-2] * swing[42:] - swing[41:-1] ** 2
    assert casorati[1:20] / casorati[:19] == pytest.approx(1.0 / (1.0 + theta * square), rel=1e-9)


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_tends_to_the_continuous_row_at_first_order(theta: float) -> None:
    errors = []
    for k in (64, 128, 256):
        dt, n = A1["dt"] / k, 100 * k
        ours, _ = smooth_row_cd(kn=1.35e9, mass=MASS, xi=3.0, dt=dt, n_load=40 * k, v_wall=0.12, n_steps=n, theta=theta)
        truth, _ = continuous_row(
            dt * np.arange(n + 1), kn=1.35e9, mass=MASS, xi=3.0, v_wall=0.12, t_wall=40 * A1["dt"]
        )
        errors.append(np.abs(ours - truth).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("factor", [10, 100, 1000])
def test_implicit_steps_far_beyond_the_explicit_limit_settle(factor: int) -> None:
    dt = factor * 2.0 / math.sqrt((2.0 + math.sqrt(2.0)) * 1.35e9 / MASS)
    disk_disk, wall = smooth_row_cd(
        kn=1.35e9, mass=MASS, xi=3.0, dt=dt, n_load=1, v_wall=0.0732 / dt, n_steps=51, theta=1.0
    )
    assert disk_disk[-1] == pytest.approx(1.35e9 * 0.0732 / 2.0, rel=1e-8)
    assert wall[-1] == pytest.approx(1.35e9 * 0.0732 / 2.0, rel=1e-8)


def test_theta_out_of_range_is_named() -> None:
    with pytest.raises(ValueError, match=r"theta = 0.4 .*\[0.5, 1\]"):
        smooth_row_cd(**A1, xi=3.0, n_steps=10, theta=0.4)
