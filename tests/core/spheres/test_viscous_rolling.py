"""Viscous rolling resistance in 3D: the exact steps of the scheme, the energy it takes, checkpoints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, InvalidSceneError, Numerics, Rolling, Spheres, SphereScene, simulate
from ninedisk.core.dem.space.session import SphereSession

RADIUS, MASS, INERTIA = np.array([1.0, 0.6]), np.array([2.0, 0.7]), np.array([0.9, 0.15])
NORMAL = np.array([2.0, -1.0, 2.0]) / 3.0
SPIN = np.array([[3.0, 1.0, -2.0], [-1.0, 4.0, 0.5]])
KN, OVERLAP, MU, DT = 1e4, 1e-2, 0.3, 2e-4


def pair(**law: Any) -> SphereScene:
    """Two unequal spheres that touch, turn and do not move."""
    x = np.outer([0.0, RADIUS.sum() - OVERLAP], NORMAL)
    spheres = Spheres(x=x, omega=SPIN, radius=RADIUS, mass=MASS, inertia=INERTIA, held=True)
    values: dict[str, Any] = {"kn": KN, "rolling": Rolling(model="viscous", mu=MU), **law}
    return SphereScene(spheres=spheres, sphere_sphere=ContactLaw(**values))


def numerics(steps: int, form: str = "central") -> Numerics:
    return Numerics(dt=DT, n_steps=steps, contact_dt=DT, damping_form=form, energy_budget=True, allow_unstable=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("slip_at", ["middle", "end"])
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_spins_decay_as_the_scheme_says(form: str, slip_at: str) -> None:
    """``I dw/dt = -mu R^2 fn (w_i - w_j)`` across the normal, opposite on both bodies; the spin about the normal stays. The torque sees
    the spin of the half step before ("lagged"), or that plus half of its last change ("central"); after the first half kick, all of it.
    """
    steps = 400
    reduced = 1.0 / np.sum(1.0 / RADIUS)
    history = simulate(pair(slip_at=slip_at), numerics(steps, form))
    across = np.eye(3) - np.outer(NORMAL, NORMAL)
    torque = MU * reduced**2 * KN * OVERLAP
    spin, seen = SPIN.copy(), SPIN.copy()
    for step in range(steps + 1):
        m = torque * across @ (seen[0] - seen[1])
        change = np.array([-m, m]) / INERTIA[:, None] * (DT if step else 0.5 * DT)
        expected = spin + (0.5 * change if step else 0.0)
        np.testing.assert_allclose(history.omega[step], expected, rtol=0.0, atol=1e-12)
        spin = spin + change
        seen = spin + ((0.5 if step else 1.0) * change if form == "central" else 0.0)
    assert np.linalg.norm(across @ (spin[0] - spin[1])) < 0.5 * np.linalg.norm(across @ (SPIN[0] - SPIN[1]))
    assert history.omega[-1] @ NORMAL == pytest.approx(SPIN @ NORMAL, rel=1e-12)


def test_what_spins_lose_is_lost_by_rolling() -> None:
    """The budget of the scheme drifts to second order: a quarter with half of the step."""
    drifts = []
    for dt in (DT, 0.5 * DT):
        how = Numerics(dt=DT, n_steps=400, contact_dt=dt, energy_budget=True)
        energy = simulate(pair(), how).energy
        assert energy["rolling_loss"][-1] > 1.0
        drifts.append(abs(energy["kinetic"] + energy["rolling_loss"] - energy["kinetic"][0]).max())
    assert drifts[0] < 1e-3
    assert drifts[1] == pytest.approx(0.25 * drifts[0], rel=0.02)


def test_a_checkpoint_goes_on_to_the_bit(tmp_path: Path) -> None:
    scene = replace(pair(ks=5e3, mu=0.3, beta=0.1), gravity=(0.3, 0.0, -1.0))
    scene = replace(scene, spheres=replace(scene.spheres, held=[[False] * 3, [True] * 3]))
    session = SphereSession(scene, numerics(60))
    session.advance(25)
    session.save(tmp_path / "half.npz")
    one, two = SphereSession.load(tmp_path / "half.npz").run(), simulate(scene, numerics(60))
    assert np.array_equal(one.omega, two.omega)
    assert np.array_equal(one.energy["rolling_loss"], two.energy["rolling_loss"])


def test_resistance_to_twisting_is_never_viscous() -> None:
    with pytest.raises(
        InvalidSceneError, match="twisting model 'viscous' is not allowed: use one of constant, elastic-plastic"
    ):
        pair(twisting=Rolling(model="viscous", mu=0.1))
