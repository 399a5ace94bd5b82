"""Conservation and restitution of the binary collision."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.collision import collision_history, final_velocities


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("m_1", "m_2"), [(1.0, 1.0), (2.0, 5.0), (1e3, 1e-3)])
def test_momentum_is_kept_and_the_relative_velocity_turned(e: float, m_1: float, m_2: float) -> None:
    # The two conditions that define the impact, solved as a linear system.
    expected = np.linalg.solve([[m_1, m_2], [1.0, -1.0]], [m_1 * 1.3 - m_2 * 0.4, -e * (1.3 + 0.4)])
    assert final_velocities(v_1=1.3, v_2=-0.4, mass_1=m_1, mass_2=m_2, restitution=e) == pytest.approx(
        expected, rel=1e-9
    )


@pytest.mark.parametrize(("e", "energy", "vx"), [(1.0, math.pi / 2, (0.0, 1.0)), (0.0, math.pi / 4, (0.5, 0.5))])
def test_histories_of_the_source(e: float, energy: float, vx: tuple[float, float]) -> None:
    t = np.array([0.0, 0.49, 0.5, 0.51, 1.0])
    h = collision_history(t, gap=0.5, speed=1.0, mass_1=math.pi, mass_2=math.pi, restitution=e)
    assert h.vx_1 == pytest.approx([1.0, 1.0, 1.0, vx[0], vx[0]], abs=1e-15)
    assert h.vx_2 == pytest.approx([0.0, 0.0, 0.0, vx[1], vx[1]], abs=1e-15)
    assert h.energy == pytest.approx([math.pi / 2] * 3 + [energy] * 2, rel=1e-15)
    assert h.momentum_x == pytest.approx(math.pi * (h.vx_1 + h.vx_2), rel=1e-15)
    assert not np.any([h.vy_1, h.vy_2])


def test_restitution_out_of_range_is_named() -> None:
    with pytest.raises(ValueError, match=r"restitution = 1.1 .*\[0, 1\]"):
        final_velocities(v_1=1.0, v_2=0.0, mass_1=1.0, mass_2=1.0, restitution=1.1)
