"""The thrown disk against integration of rigid and elastic friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.slip_to_roll import (
    rolling_speed,
    slide_to_stop,
    slip_end,
    slip_to_roll,
    spring_overshoot,
    stop_time,
)

MU, G, V0, RADIUS = 0.3, 10.0, 2.0, 0.5


@pytest.mark.parametrize(("ratio", "time", "speed"), [(0.5, 1.0 / 3.0, 2.0 / 3.0), (0.4, 2.0 / 7.0, 5.0 / 7.0)])
def test_disk_and_sphere(ratio: float, time: float, speed: float) -> None:
    assert slip_end(mu=MU, speed=V0, g=G, inertia_ratio=ratio) == pytest.approx(time * V0 / (MU * G), rel=1e-15)
    assert rolling_speed(speed=V0, inertia_ratio=ratio) == pytest.approx(speed * V0, rel=1e-15)


@pytest.mark.parametrize("ratio", [0.4, 0.5, 1.0])
def test_equals_the_integrated_disk(ratio: float) -> None:
    end = slip_end(mu=MU, speed=V0, g=G, inertia_ratio=ratio)
    t = np.linspace(0.0, end, 20)
    # x, vx, spin; counter-clockwise positive, the plane below: slip velocity vx + R spin, friction -mu m g.
    run = solve_ivp(
        lambda _, y: [y[1], -MU * G, -MU * G * RADIUS / (ratio * RADIUS**2)], (0.0, end), [0.0, V0, 0.0], t_eval=t
    )
    h = slip_to_roll(t, mu=MU, speed=V0, g=G, radius=RADIUS, inertia_ratio=ratio)
    for ours, theirs in zip(h, run.y, strict=True):
        assert ours == pytest.approx(theirs, abs=1e-12)
    assert h.vx[-1] + RADIUS * h.spin[-1] == pytest.approx(0.0, abs=1e-14)
    assert np.all(h.vx[:-1] + RADIUS * h.spin[:-1] > 0.0)
    later = slip_to_roll([2 * end, 3 * end], mu=MU, speed=V0, g=G, radius=RADIUS, inertia_ratio=ratio)
    assert later.vx == pytest.approx(rolling_speed(speed=V0, inertia_ratio=ratio))
    assert np.diff(later.x) == pytest.approx(end * later.vx[0])


def test_disk_that_cannot_rotate_stops() -> None:
    end = stop_time(mu=MU, speed=V0, g=G)
    assert end == pytest.approx(V0 / (MU * G))
    h = slide_to_stop([0.0, end / 2, end, 2 * end], mu=MU, speed=V0, g=G)
    assert h.vx == pytest.approx([V0, V0 / 2, 0.0, 0.0], abs=1e-15)
    assert h.x[2:] == pytest.approx(V0**2 / (2.0 * MU * G))


@pytest.mark.parametrize("ratio", [0.5, 0.4])
@pytest.mark.parametrize("ks", [1e4, 1e6])
def test_overshoot_of_a_shear_spring(ratio: float, ks: float) -> None:
    mass = 3.0
    cap = MU * mass * G
    omega = math.sqrt((1.0 + 1.0 / ratio) * ks / mass)

    def motion(_: float, y: np.ndarray) -> list[float]:
        """vx and spring force; the slip velocity follows from the conserved moment about the plane."""
        vx, force = y
        slip = vx - (V0 - vx) / ratio
        sliding = force >= cap and slip > 0.0
        return [-min(force, cap) / mass, 0.0 if sliding else ks * slip]

    def reaches_cap(_: float, y: np.ndarray) -> float:
        return y[1] - cap

    def stops_slipping(_: float, y: np.ndarray) -> float:
        return y[0] - (V0 - y[0]) / ratio

    reaches_cap.terminal = stops_slipping.terminal = True
    stops_slipping.direction = -1.0
    keys = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.05 / omega}
    load = solve_ivp(motion, (0.0, 1.0), [V0, 0.0], events=reaches_cap, **keys)
    # While it slides the force is the cap exactly.
    slide = slip_end(mu=MU, speed=V0, g=G, inertia_ratio=ratio)
    vx = load.y_events[0][0][0]
    assert vx > rolling_speed(speed=V0, inertia_ratio=ratio)
    run = solve_ivp(
        lambda *_: [-cap / mass, 0.0], (0.0, 2 * slide), [vx, cap], events=stops_slipping, rtol=1e-12, atol=1e-13
    )
    start = run.y_events[0][0]
    roll = solve_ivp(
        lambda _, y: [-y[1] / mass, ks * (y[0] - (V0 - y[0]) / ratio)],
        (0.0, 3 * 2 * math.pi / omega), start, **keys,
    )  # fmt: skip
    assert np.abs(roll.y[1]).max() <= cap * (1 + 1e-6)
    amplitude = spring_overshoot(mu=MU, g=G, mass=mass, ks=ks, inertia_ratio=ratio)
    # Crests fall between samples 0.05 rad apart: (0.025)^2/2 = 3e-4.
    assert np.ptp(roll.y[0]) / 2.0 == pytest.approx(amplitude, rel=4e-4)
    middle = (roll.y[0].max() + roll.y[0].min()) / 2.0
    assert middle == pytest.approx(rolling_speed(speed=V0, inertia_ratio=ratio), abs=4e-4 * amplitude)
    if ratio == 0.5:
        assert amplitude == pytest.approx(MU * G * math.sqrt(3.0 * mass / ks) / 3.0, rel=1e-14)


def test_frictionless_plane_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mu = 0.0 .*> 0"):
        slip_end(mu=0.0, speed=V0, g=G)
