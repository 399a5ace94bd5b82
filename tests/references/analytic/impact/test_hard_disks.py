"""Hard disks from collision to collision: collisions by hand, what is conserved, and the way back."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.impact.hard_disks import hard_disks


def lattice(rows, spacing, seed):
    rng = np.random.default_rng(seed)
    place = spacing * (np.arange(rows) + 0.5)
    return np.array([(a, b) for b in place for a in place]), rng.standard_normal((rows**2, 2))


def test_two_disks_and_a_wall_by_hand():
    """A disk at 1 m/s closes 2 m, gives (1 + e)/2 of its speed on, and the other one comes back from the wall, 2 m away."""
    found = hard_disks(x=[(2.0, 5.0), (6.0, 5.0)], v=[(1.0, 0.0), (0.0, 0.0)], radius=1.0, side=9.0, restitution=0.5,
                       times=[1.9, 2.1, 2.0 + 2.0 / 0.75 + 0.1])  # fmt: skip
    assert found.collisions.tolist() == [0, 1, 1]
    assert found.v[:, :, 0] == pytest.approx(np.array([(1.0, 0.0), (0.25, 0.75), (0.25, -0.75)]), abs=1e-15)
    assert found.x[2, 1] == pytest.approx((8.0 - 0.075, 5.0), abs=1e-14)


def test_an_oblique_hit_keeps_what_is_along_the_tangent():
    """The line of centres at touch is that of the displacement (4, 3)/5 of two radii."""
    found = hard_disks(
        x=[(2.0, 2.0), (4.6, 3.2)], v=[(1.0, 0.0), (0.0, 0.0)], radius=1.0, side=20.0, restitution=0.8, times=[1.5]
    )
    normal = np.array([1.6, 1.2]) / 2.0
    kick = 0.5 * 1.8 * normal[0] * normal
    assert found.v[0, 1] == pytest.approx(kick, abs=1e-15)
    assert found.v[0, 0] == pytest.approx(np.array([1.0, 0.0]) - kick, abs=1e-15)


def test_an_elastic_gas_goes_back_where_it_came_from_and_none_overlaps():
    x, v = lattice(4, 3.0, 1)
    there = hard_disks(x=x, v=v, radius=1.0, side=12.0, restitution=1.0, times=np.linspace(0.0, 4.0, 41))
    assert there.collisions[-1] > 15
    assert (there.v**2).sum(axis=(1, 2)) == pytest.approx((v**2).sum(), rel=1e-13)
    apart = np.hypot(*(there.x[:, :, None] - there.x[:, None]).transpose(3, 0, 1, 2)) + 9.0 * np.eye(16)
    assert apart.min() > 2.0 - 1e-12
    assert there.x.min() > 1.0 - 1e-12
    assert there.x.max() < 11.0 + 1e-12
    back = hard_disks(x=there.x[-1], v=-there.v[-1], radius=1.0, side=12.0, restitution=1.0, times=[4.0])
    assert back.x[0] == pytest.approx(x, abs=1e-6)  # round-off, grown by some collisions of each disk


def test_each_collision_takes_its_part():
    """With samples as fine as collisions are rare, each sees one of them at most: its loss is (1 - e^2) of the approach."""
    x, v = lattice(5, 4.0, 2)
    found = hard_disks(x=x, v=v, radius=1.0, side=20.0, restitution=0.6, times=np.linspace(0.0, 5.0, 5001))
    alone = np.flatnonzero(np.diff(found.collisions) == 1)
    assert len(alone) > 10
    for k in alone:
        i, j = np.flatnonzero(np.abs(np.diff(found.v[k : k + 2].sum(axis=2), axis=0)[0]) > 0)[:2]
        if np.abs(found.v[k, i] + found.v[k, j] - found.v[k + 1, i] - found.v[k + 1, j]).max() > 1e-12:
            continue  # a wall as well
        kick = found.v[k + 1, i] - found.v[k, i]
        approach = ((found.v[k, j] - found.v[k, i]) @ kick) ** 2 / (kick @ kick)
        lost = 0.5 * ((found.v[k] ** 2).sum() - (found.v[k + 1] ** 2).sum())
        assert lost == pytest.approx((1.0 - 0.6**2) * 0.25 * approach, abs=1e-13)


@pytest.mark.parametrize(
    "wrong",
    [
        {"x": [(2.0, 2.0), (3.5, 2.0)]},
        {"x": [(0.5, 2.0), (6.0, 2.0)]},
        {"x": [2.0, 6.0]},
        {"restitution": 0.0},
        {"times": [1.0, 0.5]},
        {"times": [-1.0]},
        {"v": [(0.0, 0.0)]},
    ],
)
def test_what_is_no_gas_is_refused(wrong):
    right = {
        "x": [(2.0, 2.0), (6.0, 2.0)],
        "v": [(1.0, 0.0), (0.0, 0.0)],
        "radius": 1.0,
        "side": 9.0,
        "restitution": 0.5,
        "times": [1.0],
    }
    with pytest.raises(ValueError, match="not allowed"):
        hard_disks(**right | wrong)
