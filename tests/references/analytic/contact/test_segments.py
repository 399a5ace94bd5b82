"""Forces by segments: work equals kinetic energy, momentum their impulse, a shift in time is one."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.contact.segments import under_segments

SEGMENTS = [(0.1, 0.4, 3.0), (0.3, 0.9, -5.0), (0.95, 2.0, 2.0)]


def test_work_and_impulse():
    end = under_segments(1.5, inertia=2.0, start=0.7, segments=SEGMENTS)
    impulse = 0.3 * 3.0 - 0.6 * 5.0 + 0.55 * 2.0
    assert end.rate == pytest.approx(0.7 + impulse / 2.0, rel=1e-14)
    work = 0.0
    for begin, until, force in SEGMENTS:
        ends = under_segments([begin, min(until, 1.5)], inertia=2.0, start=0.7, segments=SEGMENTS).path
        work += force * (ends[1] - ends[0])
    assert 0.5 * 2.0 * (end.rate**2 - 0.7**2) == pytest.approx(work, rel=1e-13)


def test_the_path_is_the_integral_of_the_velocity():
    t = np.linspace(0.0, 2.5, 25001)
    found = under_segments(t, inertia=2.0, start=0.7, segments=SEGMENTS)
    assert found.path[-1] == pytest.approx(np.trapezoid(found.rate, t), abs=1e-7)


def test_bad_segments():
    with pytest.raises(ValueError, match="segments"):
        under_segments(0.0, inertia=1.0, start=0.0, segments=[(0.5, 0.5, 1.0)])
