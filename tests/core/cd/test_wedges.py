"""Newton's restitution with friction in a corner: known before the run where no solution may exist, and at the step that has none."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ninedisk.core.cd.laws import wedging_corners
from ninedisk.core.cd.session import CdSession
from ninedisk.core.errors import InvalidSceneError, SolverNotConvergedError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.engines.cd.adapter import ENGINE

OPTIONS = {"cd.max_iterations": 5_000}


def corner(alpha: float, mu: float, e: float, *, rotating: bool) -> Scene:
    """A disk moving into the corner of a floor and a wall that leans at the angle alpha from it, along their bisector."""
    law = ContactLaw(kn=1e5, ks=1e5, mu=mu, restitution=e, regularised=True)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    side = Wall(name="side", point=(0.0, 0.0), normal=(math.sin(alpha), -math.cos(alpha)), law=law)
    away = (1.0 + 1e-3) / math.sin(0.5 * alpha)
    along = (math.cos(0.5 * alpha), math.sin(0.5 * alpha))
    disks = Disks(
        x=[[away * along[0], away * along[1]]], v=[[-along[0], -along[1]]], radius=1.0, mass=1.0, rotating=rotating
    )
    return Scene(disks=disks, disk_disk=law, walls=(floor, side))


@pytest.mark.parametrize("rotating", [False, True])
@pytest.mark.parametrize("degrees", [40.0, 90.0, 120.0])
@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
def test_steps_without_a_solution_are_those_in_corners_that_are_predicted(
    sliding: Any, degrees: float, rotating: bool
) -> None:
    alpha = math.radians(degrees)
    for factor, wedge in ((0.9, False), (1.1, True)):
        mu = factor * math.tan(0.5 * alpha)
        scene = corner(alpha, mu, 0.5, rotating=rotating)
        numerics = Numerics(dt=0.01, n_steps=3, impact="newton", sliding=sliding, options=OPTIONS)
        session = CdSession(scene, numerics)
        assert len(session.remarks) == wedge
        notes = " ".join(ENGINE.supports(scene, numerics).notes)
        assert (f"walls 'floor' and 'side' meet at {degrees:g} degrees" in notes) is wedge
        if wedge:
            wrong = InvalidSceneError if sliding == "associated" else SolverNotConvergedError
            with pytest.raises(wrong, match=r"^step 1 .*where bodies are wedged: use impact = 'theta'"):
                session.run()
        else:
            away = session.run().v[-1, 0]
            assert away[0] * math.cos(0.5 * alpha) + away[1] * math.sin(0.5 * alpha) > 0.4


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize(("impact", "e"), [("theta", 0.5), ("newton", 0.0)])
def test_the_remedies_have_a_solution(impact: Any, e: float, sliding: Any) -> None:
    scene = corner(0.5 * math.pi, 1.5, e, rotating=True)
    numerics = Numerics(dt=0.01, n_steps=20, theta=2.0 / 3.0, impact=impact, sliding=sliding, options=OPTIONS)
    assert wedging_corners(scene, numerics) == []
    history = CdSession(scene, numerics).run()
    assert history.energy["kinetic"].max() <= history.energy["kinetic"][0] * (1.0 + 1e-12)
