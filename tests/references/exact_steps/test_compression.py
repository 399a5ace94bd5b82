"""The row's recurrence against three disks in rational arithmetic, the continuous row and known numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.compression import continuous_row, steady_force
from ninedisk.references.exact_steps.compression import smooth_row

MASS = 1000.0 * math.pi * 50.0**2
A1 = {"kn": 1.35e9, "mass": MASS, "dt": 0.01525, "n_load": 40, "v_wall": 0.12}
ROUND_OFF = 4.5e-16  # one rounding to float64 of each of the two forces, in units of the largest


def three_disks(*, kn, mass, xi, dt, n_load, v_wall, n_steps, form):
    """Central differences of all three disks and all four contacts, without use of the symmetry."""
    kn, mass, xi, dt, v_wall = map(Fraction, (kn, mass, xi, dt, v_wall))
    x, v = [Fraction(0)] * 3, [Fraction(0)] * 3
    disk_disk, wall_force = [], []
    for n in range(n_steps + 1):
        wall = v_wall * dt * min(n, n_load)
        overlaps = [wall - x[0], x[0] - x[1], x[1] - x[2], x[2] + wall]
        f = [kn * max(overlap, 0) for overlap in overlaps]
        disk_disk.append(f[1])
        wall_force.append(f[0])
        for i in range(3):
            push = f[i] - f[i + 1]
            if n == 0:
                v[i] += dt / 2 * (push / mass - xi * v[i])
            elif form == "central":
                v[i] = ((1 - xi * dt / 2) * v[i] + dt * push / mass) / (1 + xi * dt / 2)
            else:
                v[i] += dt * (push / mass - xi * v[i])
            x[i] += dt * v[i]
    return np.array(disk_disk, dtype=float), np.array(wall_force, dtype=float)


@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("xi", [0.0, 3.0])
def test_equals_three_disks_in_rational_arithmetic(form: str, xi: float) -> None:
    keys = {**A1, "xi": xi, "n_steps": 60, "form": form}
    for ours, exact in zip(smooth_row(**keys), three_disks(**keys), strict=True):
        assert np.abs(ours - exact).max() <= ROUND_OFF * exact.max()


def test_numbers_of_the_first_load_case() -> None:
    disk_disk, wall = smooth_row(**A1, xi=3.0, n_steps=200)
    assert disk_disk.max() == pytest.approx(5.31963e7, abs=50)  # half a unit of the last digit
    assert disk_disk.argmax() == 44
    assert wall.max() == pytest.approx(5.23351e7, abs=50)
    assert disk_disk[200] == pytest.approx(4.95185e7, abs=50)


def test_first_cycles_have_the_order_of_the_scheme() -> None:
    disk_disk, wall = smooth_row(**A1, xi=3.0, n_steps=2)
    assert disk_disk[:2].tolist() == [0.0, 0.0]
    assert wall[0] == 0.0
    assert wall[1] == pytest.approx(1.35e9 * 0.12 * 0.01525, rel=1e-15)
    assert disk_disk[2] > 0.0


@pytest.mark.parametrize(("form", "order"), [("central", 2.0), ("lagged", 1.0)])
def test_tends_to_the_continuous_row_at_the_order_of_the_scheme(form: str, order: float) -> None:
    errors = []
    for k in (4, 8, 16):
        dt, n = A1["dt"] / k, 100 * k
        ours, _ = smooth_row(kn=1.35e9, mass=MASS, xi=3.0, dt=dt, n_load=40 * k, v_wall=0.12, n_steps=n, form=form)
        truth, _ = continuous_row(
            dt * np.arange(n + 1), kn=1.35e9, mass=MASS, xi=3.0, v_wall=0.12, t_wall=40 * A1["dt"]
        )
        errors.append(np.abs(ours - truth).max())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx(order, abs=0.1)


def test_settles_at_the_steady_force() -> None:
    disk_disk, wall = smooth_row(**A1, xi=3.0, n_steps=2000)
    steady = steady_force(kn=1.35e9, v_wall=0.12, t_wall=40 * 0.01525)
    # What is left after 1960 cycles of decay at xi/2 is exp(-44.8).
    assert disk_disk[-1] == pytest.approx(steady, rel=1e-14)
    assert wall[-1] == pytest.approx(steady, rel=1e-14)


def test_an_opening_contact_is_refused() -> None:
    # One step of load is a kick: the discrete step response overshoots 2 by 1/cos(phi/2) - 1 and the disks bounce off.
    with pytest.raises(ValueError, match=r"contact of the row opens at step \d+ .*load more slowly"):
        smooth_row(kn=1.35e9, mass=MASS, xi=0.0, dt=0.01525, n_load=1, v_wall=0.12, n_steps=200)
    with pytest.raises(ValueError, match=r"contact of the row opens at step \d+ .*reduce dt"):
        smooth_row(**{**A1, "dt": 0.12}, xi=0.0, n_steps=200)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kn": 0.0}, "kn = 0.0"),
        ({"mass": -1.0}, "mass = -1.0"),
        ({"dt": math.nan}, "dt = nan"),
        ({"xi": -3.0}, "xi = -3.0"),
        ({"n_steps": -1}, "n_steps = -1"),
        ({"form": "implicit"}, "form = 'implicit'"),
    ],
)
def test_bad_values_are_named(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        smooth_row(**{**A1, "xi": 3.0, "n_steps": 10, **change})
