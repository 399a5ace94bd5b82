"""Probes of grains: an ellipse that lies on its flat side, and a disk on a floor under the law of the common area."""

from __future__ import annotations

import math

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nurbs.grains import grains
from ninedisk.harness.check_engine.claims import Claim, Probe, contact_error
from ninedisk.harness.check_engine.scenes import FLOOR, KN, G, M, R, law, on_floor, resting_overlap

FLAT = 0.6
"""Half-axis of the ellipse across the floor, over that along it."""


def ellipse_at_rest(info: EngineInfo) -> Probe:
    """An ellipse of half-axes R and 0.6 R, given upright and turned by a right angle: it rests at the height of the smaller one."""
    from ninedisk.core.nurbs.nurbs_grain import uniform_grain
    from ninedisk.core.nurbs.shapes import ellipse

    grain = uniform_grain(ellipse(FLAT * R, R), M / (math.pi * FLAT * R**2))
    overlap, contact = resting_overlap(info), law(info)
    given = grains([grain], [0], x=[[0.0, FLAT * R - overlap]], angle=0.5 * math.pi)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    scene = Scene(**given, disk_disk=contact, walls=(floor,), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20, sample_from=20)
    allowed = contact_error(info)

    def claims(history: History) -> list[Claim]:
        why = "equilibrium: round-off and the solver's tolerance"
        mend = "the body's surface is its outline, turned by Disks.angle, not the circle of Disks.radius around it"
        return [
            Claim(quantity="fn", unit="N", value=history.fn[-1], expected=[M * G], bound=allowed * M * G, why=why, mend=mend),
            Claim(quantity="gap", unit="m", value=history.gap[-1], expected=[-overlap], bound=max(1e-9, allowed * overlap),
                  why=why, mend=mend),
            Claim(quantity="angle", unit="rad", value=history.angle[-1], expected=[0.0], bound=allowed, why=why,
                  mend="the flat side is the stable one, and angles count from time 0"),
        ]  # fmt: skip

    return Probe(name="ellipse at rest", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def lens_on_floor() -> Probe:
    """A disk sunk into a floor by a tenth of its radius, weighing what the law of the common area gives there.

    The segment has the area ``A = R^2 acos(h/R) - h c/2``, h its distance from the centre and c its chord, and the energy
    ``(kn/2) (9 A^2/(32 R))^(2/3)``, whose slope in A, times the chord, is the force.
    """
    depth = 0.1 * R
    h = R - depth
    chord = 2.0 * math.sqrt(R**2 - h**2)
    area = R**2 * math.acos(h / R) - 0.5 * h * chord
    energy = 0.5 * KN * (9.0 * area**2 / (32.0 * R)) ** (2.0 / 3.0)
    force = 4.0 / 3.0 * energy / area * chord
    scene = on_floor(ContactLaw(kn=KN, contact="area"), overlap=depth, gravity=(0.0, -force / M))
    numerics = Numerics(dt=0.002, n_steps=5)

    def claims(history: History) -> list[Claim]:
        return [
            Claim(quantity="fn", unit="N", value=history.fn[:, 0], expected=[force] * len(history.fn), bound=1e-9 * force,
                  why="round-off: the disk is in equilibrium", mend="fn = U'(A) times the chord, see ContactLaw.contact"),
            Claim(quantity="gap", unit="m", value=history.gap[:, 0], expected=[-depth] * len(history.gap), bound=1e-9 * R,
                  why="round-off: the disk is in equilibrium"),
        ]  # fmt: skip

    return Probe(name="lens on a floor", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)
