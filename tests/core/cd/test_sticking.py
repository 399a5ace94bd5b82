"""Rigid contacts that take a pull, and elastic ones that attract by their overlap."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.errors import InvalidSceneError, NoEquilibriumError
from ninedisk.core.history import History
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall
from ninedisk.core.scene.loads import BodyForce

RIGID = ContactLaw(kn=1e6, ks=1e6, mu=0.5, restitution=0.0, regularised=True)
MASS, G = 2.0, 10.0


def at_wall(normal: tuple[float, float], law: ContactLaw, gap: float = 0.0, **more: Any) -> Scene:
    """A disk of radius 1 that touches a wall whose normal is this; it does not turn."""
    wall = Wall(name="wall", point=(0.0, 0.0), normal=normal, law=law)
    x = [[(1.0 + gap) * normal[0], (1.0 + gap) * normal[1]]]
    v = more.pop("v", [0.0, 0.0])
    disks = Disks(x=x, v=[v], radius=1.0, mass=MASS, rotating=False)
    return Scene(disks=disks, disk_disk=law, walls=(wall,), **{"gravity": (0.0, -G), **more})


def run(scene: Scene, **numerics: Any) -> History:
    return CdSession(scene, Numerics(**{"dt": 0.01, "n_steps": 40, "sliding": "coulomb", **numerics}), [(0, 1)]).run()


@pytest.mark.parametrize("solver", ["gauss-seidel", "interior-point"])
@pytest.mark.parametrize(("theta", "impact"), [(0.5, "theta"), (1.0, "theta"), (1.0, "newton")])
def test_a_block_hangs_from_a_ceiling_up_to_the_pull(theta: float, impact: Any, solver: str) -> None:
    """The load grows by 1 N every four steps: at a pull of 25 N it hangs with 5 N beside its weight, and falls with 6 N."""
    forces = [BodyForce(disk=0, force=(0.0, -1.0), begin=0.04 * k) for k in range(1, 9)]
    scene = at_wall((0.0, -1.0), replace(RIGID, adhesion=25.0), forces=forces)
    history = run(scene, theta=theta, impact=impact, solver=solver)
    load = MASS * G + np.minimum(np.floor(np.arange(40) / 4.0 + 1e-9), 8.0)
    holds = load <= 25.0
    assert np.abs(history.fn[1:, 0][holds] + load[holds]).max() <= 1e-10
    assert np.abs(history.gap[: 1 + holds.sum(), 0]).max() <= 1e-14
    # The pull still acts in the step that opens the contact, which was closed at its start; then none does.
    assert history.fn[25, 0] == pytest.approx(-25.0, abs=1e-10)
    assert (history.fn[26:, 0] == 0.0).all()
    fall = np.diff(history.v[24:, 0, 1]) / 0.01
    assert fall == pytest.approx(-np.append(1.0, load[25:]) / MASS, rel=1e-9)
    assert history.wall_force[5, 0] == pytest.approx([0.0, -load[4]], rel=1e-10)


@pytest.mark.parametrize(("adhesion", "holds"), [(20.0 * (1.0 + 1e-9), True), (20.0 * (1.0 - 1e-9), False)])
def test_a_static_block_hangs_by_no_less_than_its_weight(adhesion: float, holds: bool) -> None:
    scene = at_wall((0.0, -1.0), replace(RIGID, adhesion=adhesion))
    static = {"regime": "quasi-static", "dt": 1.0, "n_steps": 2}
    if not holds:
        with pytest.raises(NoEquilibriumError, match="disk"):
            run(scene, **static)
        return
    assert run(scene, **static).fn[1:, 0] == pytest.approx([-20.0, -20.0], rel=1e-9)


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize(("adhesion", "holds"), [(40.001, True), (30.0, False)])
def test_friction_sees_the_force_and_the_adhesion(adhesion: float, holds: bool, sliding: Any) -> None:
    """A block at an upright wall that attracts it: nothing presses it but the adhesion, mu of which is all that holds it."""
    scene = at_wall((1.0, 0.0), replace(RIGID, adhesion=adhesion))
    history = run(scene, sliding=sliding)
    if holds:
        assert np.abs(history.x[:, 0] - [1.0, 0.0]).max() <= 1e-12
        assert history.fn[1:, 0] == pytest.approx(np.zeros(40), abs=1e-9)
        assert np.abs(history.fs[1:, 0]) == pytest.approx(np.full(40, 20.0), rel=1e-9)
    elif sliding == "coulomb":
        assert history.v[:, 0, 1] == pytest.approx(-(G - 0.5 * adhesion / MASS) * history.t, abs=1e-9)


def test_contacts_stick_only_once_they_are_closed() -> None:
    """A block that flies past a wall at a distance is left alone; one that lands without rebound stays, lifted by less than the pull."""
    past = run(at_wall((0.0, 1.0), replace(RIGID, adhesion=1e3), gap=0.1, v=[1.0, 0.0], gravity=(0.0, 0.0)))
    assert np.array_equal(past.v[:, 0], np.tile([1.0, 0.0], (41, 1)))
    lift = BodyForce(disk=0, force=(0.0, 50.0), begin=0.2)
    landed = run(at_wall((0.0, 1.0), replace(RIGID, adhesion=30.1), gap=0.02, forces=[lift]))
    assert landed.fn[25:, 0] == pytest.approx(np.full(16, -30.0), rel=1e-9)
    assert np.abs(landed.gap[25:, 0]).max() <= 1e-13


SOFT = ContactLaw(kn=1e4, cohesion=4e3)


def test_cohesion_deepens_the_overlap_and_the_cone() -> None:
    """At rest ``overlap = m g/(kn - c)``; a sliding block is slowed by ``mu (m g + c overlap)``."""
    law = replace(SOFT, ks=1e4, mu=0.3)
    overlap = MASS * G / 6e3
    scene = at_wall((0.0, 1.0), law, gap=-overlap, v=[1.0, 0.0])
    history = run(scene, dt=1e-3, n_steps=150)
    assert history.fn[:, 0] == pytest.approx(np.full(151, 20.0), rel=1e-9)
    slides = np.diff(history.v[:, 0, 0])[-50:] / 1e-3
    assert slides == pytest.approx(np.full(50, -0.3 * (MASS * G + 4e3 * overlap) / MASS), rel=1e-9)
    assert history.energy["elastic_normal"] == pytest.approx(np.full(151, 0.5 * 6e3 * overlap**2), rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("beta", [0.0, 0.2155])
def test_cohesive_rebound_and_duration(beta: float) -> None:
    """``e(zeta)`` with ``zeta = beta/sqrt(1 - c/kn)``, the dashpot pulling before the contact opens, as the overlap ends; first order."""
    zeta = beta / math.sqrt(0.6)
    omega = math.sqrt(6e3 / MASS * (1.0 - zeta**2))
    expected, lasts = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)), math.pi / omega
    found, lowest = [], []
    for dt in (1.6e-4, 4e-5):
        scene = at_wall((0.0, 1.0), replace(SOFT, beta=beta), v=[0.0, -1.0], gravity=(0.0, 0.0))
        history = run(scene, dt=dt, n_steps=round(1.2 * lasts / dt), theta=0.5)
        touching = history.t[1:][history.fn[1:, 0] != 0.0]
        assert touching[-1] - touching[0] == pytest.approx(lasts, rel=0.01)
        found.append(history.v[-1, 0, 1] - expected)
        lowest.append(history.fn.min())
    assert abs(found[1]) < 0.02
    assert found[1] == pytest.approx(0.25 * found[0], rel=0.2)
    # When the overlap ends the dashpot alone pulls, by c e v.
    pull = -2.0 * beta * math.sqrt(MASS * 1e4) * expected
    assert lowest[1] == pytest.approx(pull, rel=0.02)


def test_what_cannot_stick_is_refused() -> None:
    for law, words in (
        (ContactLaw(kn=1e4, adhesion=2.0), "adhesion = 2 and an elastic contact"),
        (replace(RIGID, cohesion=2.0), "cohesion = 2 and a rigid contact"),
        (replace(SOFT, beta=0.1, ks=1e4, mu=0.2), "friction and a dashpot"),
    ):
        with pytest.raises(InvalidSceneError, match=f"the law of wall 'wall' has .*{words}.*: .*use|leave"):
            CdSession(at_wall((0.0, 1.0), law), Numerics(dt=0.1, n_steps=1))
