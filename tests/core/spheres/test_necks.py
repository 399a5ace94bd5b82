"""JKR's contact in runs: force on the stable branch and break of the neck, energy, friction under a pull, what keeps a neck."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import Numerics, simulate
from ninedisk.core.dem.space import session
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.references.analytic.impact.jkr import neck, stable_contact, sticking_speed

R, M, G, E = 0.01, 0.01, 0.05, 1e7
LAW = SphereLaw(e_star=E, surface_energy=G, surface="jkr")
PAIR: dict[str, float] = {"e_star": E, "surface_energy": G, "radius": 0.5 * R}
END = neck(**PAIR)


def pair(gap: float, speed: float, law: SphereLaw = LAW, **more: Any) -> SphereScene:
    """Two spheres along z that part with a speed, the second one at a gap."""
    options = {"v": [(0, 0, 0), (0, 0, speed)], **more}
    return SphereScene(
        spheres=Spheres(x=[(0, 0, 0), (0, 0, 2.0 * R + gap)], radius=R, mass=M, **options), sphere_sphere=law
    )


def on_plane(gap: float, speed: float) -> SphereScene:
    floor = PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=LAW)
    return SphereScene(
        spheres=Spheres(x=[(0, 0, R + gap)], radius=R, mass=M, v=[(0, 0, speed)], held=True),
        sphere_sphere=LAW,
        walls=(floor,),
    )


@pytest.mark.parametrize("plane", [False, True], ids=["sphere", "plane"])
def test_force_there_and_back(plane: bool) -> None:
    """Nothing before the touch, then the closed form, also pulled apart, until the neck breaks."""
    one = {**PAIR, "radius": R if plane else 0.5 * R}
    end = neck(**one)
    make = on_plane if plane else (lambda gap, speed: pair(gap, speed, held=True))
    length, steps = 4.0 * end.breaking_overlap, 1000
    for start, speed in ((-length, length), (length, -length)):
        numerics = Numerics(dt=2.0 / steps, n_steps=steps, contact_dt=2.0 / steps, allow_unstable=True)
        h = simulate(make(start, speed), numerics, [(0, 1)])
        gap, fn = h.gap[:, 0], h.fn[:, 0]
        holds = gap < (0.0 if speed < 0.0 else -end.breaking_overlap)
        assert not fn[~holds].any()
        exact = stable_contact(-gap[holds], **one)[1]
        np.testing.assert_allclose(fn[holds], exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())  # round-off of gaps
        assert gap[holds].max() > (-0.01 if speed < 0.0 else 0.99) * -end.breaking_overlap


def test_a_contact_that_sticks_keeps_its_energy_to_second_order() -> None:
    """From the branch's point without force, shaken: the energy of the swing has no drift, its error falls by 4 with half the step."""
    rest = -float(END.zero_load_radius**2 / PAIR["radius"] - 2.0 * np.sqrt(np.pi * G * END.zero_load_radius / E))

    def error(dt: float) -> float:
        h = simulate(
            pair(rest, 0.5 * sticking_speed(**PAIR, m_eff=0.5 * M)),
            Numerics(dt=dt, n_steps=int(4e-3 / dt), contact_dt=dt),
        )
        total = h.energy["kinetic"] + h.energy["elastic"]
        return float(np.abs(total - total[0]).max() / h.energy["kinetic"].max())

    coarse, fine = error(4e-6), error(2e-6)
    assert 3.6 < coarse / fine < 4.4
    assert fine < 1e-4


def test_friction_under_a_pull() -> None:
    """Slip beyond every spring: the force is mu (fn + 6 pi g R), at the largest pull too."""
    law = SphereLaw(e_star=E, g_star=E, mu=0.4, surface_energy=G, surface="jkr", friction_pull=2.0)
    largest_pull = -END.breaking_overlap * 3.0 ** (1.0 / 3.0) / 3.0
    for gap in (0.99 * largest_pull, 0.0, -10.0 * largest_pull):
        start = pair(min(gap, -1e-12), 0.0, law, held=True).spheres.x
        # Down to a touch, up to the gap, then aside.
        lift = Numerics(dt=1e-5, n_steps=100, contact_dt=1e-5, allow_unstable=True)
        speed = (gap - min(gap, -1e-12)) / 1e-3
        spheres = Spheres(x=start, radius=R, mass=M, v=[(0, 0, 0), (0.05, 0, speed)], held=True)
        h = simulate(SphereScene(spheres=spheres, sphere_sphere=law), lift, [(0, 1)])
        fs, fn = np.linalg.norm(h.fs[-1, 0]), h.fn[-1, 0]
        np.testing.assert_allclose(fs, 0.4 * (fn + 2.0 * END.pull_off), rtol=1e-9)


def test_a_neck_outlives_lists_checkpoints_and_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair that hangs on its neck beyond the gap 0 and travels far: new lists, in the order of places, and a checkpoint."""
    monkeypatch.setattr(session, "SORT_FROM", 2)
    law = SphereLaw(e_star=E, surface_energy=G, surface="jkr")
    gap = -0.9 * END.breaking_overlap
    spheres = Spheres(
        x=[(0, 0, 0), (0, 0, 2.0 * R - 1e-6), (0.5, 0.1, 0)],
        radius=R,
        mass=M,
        v=[(5.0, 0, 0), (5.0, 0, (gap + 1e-6) / 1e-3), (-5.0, 0, 0)],
        held=True,
    )
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    numerics = Numerics(dt=1e-5, n_steps=100, contact_dt=1e-5, allow_unstable=True)
    whole = SphereSession(scene, numerics, [(0, 1)])
    history = whole.run()
    assert whole.counts.rebuilds >= 3
    np.testing.assert_allclose(
        history.fn[-1, 0], stable_contact(-gap, **PAIR)[1], rtol=1e-6
    )  # gaps of 1e-6 m in places of 0.1 m
    assert history.gap[-1, 0] > 0.0
    first = SphereSession(scene, numerics, [(0, 1)])
    first.advance(90)
    first.save(tmp_path / "necks.npz")
    again = SphereSession.load(tmp_path / "necks.npz").run()
    np.testing.assert_array_equal(again.fn, history.fn)
