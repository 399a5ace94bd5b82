"""Units do not matter: a scene whose lengths are multiplied by a power of two gives the same bits, multiplied."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ninedisk.core import Cell, ContactLaw, Disks, History, Numerics, Scene, Wall, simulate
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene

HOW = Numerics(dt=1e-2, contact_dt=1e-3, n_steps=12)
LEAST, MOST = -495, 490
"""Exponents of 2: lengths of 1 to 10 radii from 1e-149 to 1e149, in the range that scenes allow."""


def heap(exponent: int, kind: str) -> Scene | SphereScene:
    """Bodies that fall on each other and, but in a cell, on a floor; with friction and dashpots."""
    f, rng, n = np.ldexp(1.0, exponent), np.random.default_rng(7), 12
    x = np.array([[2.05 * (k % 4), 0.0, 1.05 + 2.05 * (k // 4)] for k in range(n)]) + rng.uniform(0.0, 0.05, (n, 3))
    v, radius = 3.0 * rng.normal(0.0, 1.0, (n, 3)), rng.uniform(0.8, 1.0, n)
    if kind == "space":
        law = SphereLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.1)
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        spheres = Spheres(x=x * f, v=v * f, radius=radius * f, mass=1.0)
        return SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -50.0 * f))
    flat = ContactLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.1)
    disks = Disks(x=x[:, ::2] * f, v=v[:, ::2] * f, radius=radius * f, mass=1.0)
    if kind == "cell":
        cell = Cell(size=(8.2 * f, 6.2 * f), rate=((0.0, 0.5), (0.0, -0.2)))
        return Scene(disks=disks, disk_disk=flat, cell=cell)
    wall = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=flat)
    return Scene(disks=disks, disk_disk=flat, walls=(wall,), gravity=(0.0, -50.0 * f))


WATCHED = [(0, 1), (1, 2), (0, 4), (4, 8)]
AT_ONE: dict[str, History] = {}


def compared(exponent: int, kind: str) -> None:
    if kind not in AT_ONE:
        AT_ONE[kind] = simulate(heap(0, kind), HOW, watch=WATCHED)
        assert AT_ONE[kind].fn.max() > 0.0
        assert np.abs(AT_ONE[kind].omega[-1]).max() > 0.0
    one, found = AT_ONE[kind], simulate(heap(exponent, kind), HOW, watch=WATCHED)
    for name in ("x", "v", "gap", "fn", "fs"):
        np.testing.assert_array_equal(getattr(found, name), np.ldexp(getattr(one, name), exponent), err_msg=name)
    for name in ("angle", "omega"):
        np.testing.assert_array_equal(getattr(found, name), getattr(one, name), err_msg=name)


@pytest.mark.parametrize("kind", ["plane", "cell", "space"])
@pytest.mark.parametrize("exponent", [LEAST, -70, -64, 64, MOST])
def test_lengths_at_the_ends_of_the_range_and_of_single_precision(kind: str, exponent: int) -> None:
    compared(exponent, kind)


@settings(max_examples=30, deadline=None)
@given(exponent=st.integers(LEAST, MOST), kind=st.sampled_from(["plane", "cell", "space"]))
def test_any_power_of_two(exponent: int, kind: str) -> None:
    compared(exponent, kind)
