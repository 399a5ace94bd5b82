"""Impacts under Newton's law feed no energy without friction, whatever e, theta, dt, loads and damping; with it they say what they fed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall

ROUND_OFF = 1e-11
"""Of the largest energy: the tolerance of a step's impulses, 1e-12, times the contacts that share in it."""


def dense_box(rng: np.random.Generator, *, law: ContactLaw, same: bool) -> Scene:
    """Sixteen unequal disks close to each other, some touching, in a box at rest whose walls have coefficients of their own or not."""
    x = np.array([(2.0 * i, 2.0 * j) for j in range(4) for i in range(4)])
    radius = np.where(rng.random(16) < 0.5, 1.0, rng.uniform(0.7, 1.0, 16))
    frames = (
        ((-1.0, 0.0), (1.0, 0.0)),
        ((7.2, 0.0), (-1.0, 0.0)),
        ((0.0, -1.0), (0.0, 1.0)),
        ((0.0, 7.2), (0.0, -1.0)),
    )
    laws = [law if same else replace(law, restitution=rng.choice([0.0, 1.0, rng.random()])) for _ in frames]
    walls = tuple(
        Wall(name=str(k), point=point, normal=normal, law=laws[k]) for k, (point, normal) in enumerate(frames)
    )
    disks = Disks(
        x=x, v=rng.normal(0.0, 4.0, x.shape), omega=rng.normal(0.0, 2.0, 16), radius=radius, mass=3.0 * radius**2
    )
    gravity = (0.0, 0.0) if rng.random() < 0.3 else (rng.normal(), -10.0 * rng.random())
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=gravity, xi=0.0 if rng.random() < 0.7 else 0.5)


def kept_energy(scene: Scene, numerics: Numerics, h: History) -> np.ndarray:
    """``(1 + kappa) T + V(x - (theta - 1/2) dt v)``, the energy that impacts cannot raise (`DynamicStep`), shape (s,) [J]."""
    ahead = (numerics.theta - 0.5) * numerics.dt
    mass, fall = scene.disks.mass, np.array(scene.gravity)
    kinetic = 0.5 * (mass * (h.v**2).sum(axis=2)).sum(axis=1) + 0.5 * (scene.disks.inertia * h.omega**2).sum(axis=1)
    return (1.0 + ahead * scene.xi) * kinetic - (mass * ((h.x - ahead * h.v) @ fall)).sum(axis=1)


def smooth_run(seed: int, *, same: bool, singly: bool) -> None:
    rng = np.random.default_rng(seed)
    e = rng.choice([0.0, 1.0, rng.random()])
    scene = dense_box(rng, law=ContactLaw(kn=1e6, restitution=e, regularised=True), same=same)
    numerics = Numerics(
        dt=10.0 ** rng.uniform(-3.0, -1.3),
        n_steps=120,
        theta=rng.choice([0.5, 1.0, rng.uniform(0.5, 1.0)]),
        impact="newton",
    )
    session = CdSession(scene, numerics)
    if singly:
        session._batches = None
    history = session.run()
    assert singly or session._batches is not None
    energy = kept_energy(scene, numerics, history)
    size = np.abs(energy).max() + history.energy["kinetic"].max()
    assert np.diff(energy).max() <= ROUND_OFF * size
    if scene.xi == 0.0 and {e, *(wall.law.restitution for wall in scene.walls)} == {1.0}:
        assert np.abs(energy - energy[0]).max() <= len(energy) * ROUND_OFF * size
    assert np.abs(history.v[-1] - history.v[0]).max() > 1.0  # there were impacts
    assert session.remarks == []
    assert history.energy["impact_gain"][-1] == 0.0


@pytest.mark.long
@pytest.mark.parametrize("singly", [False, True])
def test_smooth_impacts_never_raise_the_energy(singly: bool, part: Callable[[int], int]) -> None:
    for seed in range(part(4 if singly else 12)):
        smooth_run(seed, same=seed % 2 == 0, singly=singly)


@pytest.mark.parametrize("singly", [False, True])
def test_what_impacts_with_friction_feed_is_said_with_step_contact_and_energy(singly: bool) -> None:
    reported = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        law = ContactLaw(kn=1e6, mu=rng.uniform(0.2, 1.0), restitution=1.0, regularised=True)
        scene = dense_box(rng, law=law, same=True).replace(xi=0.0)
        numerics = Numerics(dt=0.01, n_steps=80, theta=rng.uniform(0.5, 1.0), impact="newton", sliding="coulomb")
        session = CdSession(scene, numerics)
        if singly:
            session._batches = None
        history = session.run()
        energy, gain = kept_energy(scene, numerics, history), history.energy["impact_gain"]
        size = np.abs(energy).max() + history.energy["kinetic"].max()
        rise, fed = np.maximum(np.diff(energy), 0.0), np.diff(gain)
        # Contacts that lose at the same time are left out; what is below the slack is not given.
        assert (fed >= rise - 1e3 * ROUND_OFF * size).all()
        if gain[-1] == 0.0:
            assert session.remarks == []
            continue
        reported += 1
        step, largest = int(np.argmax(fed)) + 1, fed.max()
        (remark,) = session.remarks
        assert f"fed {gain[-1]:.3g} J in {np.count_nonzero(np.diff(gain))} of 80 steps" in remark
        assert f"at step {step}: {largest:.3g} J, there most at the contact of disk" in remark
    assert reported >= 2


@pytest.mark.parametrize("singly", [False, True])
@pytest.mark.parametrize("losing", [False, True])
def test_what_a_contact_feeds_does_not_hide_behind_what_others_lose(losing: bool, singly: bool) -> None:
    """A disk in a smooth right-angled corner with a rough floor: the wall turns its slip round, and the floor spins it until it rolls.

    With ``v = (s, -s)`` before and ``(-s, s)`` after, e = 1, ``omega = s/R`` at the end: ``I omega^2/2 = m s^2/4`` out of nothing, at the
    floor. Far away two disks meet without rebound and lose ``m w^2/4``, with w their speed of approach.
    """
    s, w, mass = 0.5, 2.0, 3.0
    smooth = ContactLaw(kn=1e6, restitution=1.0, regularised=True)
    plastic = replace(smooth, restitution=0.0)
    walls = (
        Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=replace(smooth, ks=1e6, mu=0.5)),
        Wall(name="right", point=(1.0, 0.0), normal=(-1.0, 0.0), law=smooth),
    )
    x, v = [(0.0, 1.0), (-20.0, 9.0), (-18.0, 9.0)], [(s, -s), (0.5 * w, 0.0), (-0.5 * w, 0.0)]
    count = 3 if losing else 1
    scene = Scene(disks=Disks(x=x[:count], v=v[:count], radius=1.0, mass=mass), disk_disk=plastic, walls=walls)
    session = CdSession(scene, Numerics(dt=0.01, n_steps=3, theta=1.0, impact="newton", sliding="coulomb"))
    if singly:
        session._march = None
    history = session.run()
    fed, lost = 0.25 * mass * s**2, 0.25 * mass * w**2 * losing
    np.testing.assert_allclose(history.energy["impact_gain"], [0.0, fed, fed, fed], rtol=1e-11)
    np.testing.assert_allclose(np.diff(history.energy["kinetic"]), [fed - lost, 0.0, 0.0], atol=1e-11 * lost + 1e-12)
    assert any("there most at the contact of disk 0 and wall 'floor'" in remark for remark in session.remarks)
