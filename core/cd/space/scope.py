"""What contact dynamics in space takes on: scenes, laws and settings that it lacks are refused by name."""

from __future__ import annotations

import numpy as np

from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.core.shapes.search import near_pairs

TOUCHING = 1e-9
"""Overlap over radius up to which a rigid contact counts as touching, as in `ninedisk.core.cd.step`."""


def refused_law(law: ContactLaw, *, rotating: bool) -> str:
    """What a law asks for that contact dynamics in space lacks; empty: nothing.

    Parameters
    ----------
    law : ContactLaw
    rotating : bool
        Whether any body can turn.
    """
    if law.hertz:
        return "Hertz' law"
    if law.cohesion > 0.0:
        return "cohesion"
    if law.rolling is not None and rotating:
        return "rolling resistance"
    return "twisting resistance" if law.twisting is not None and rotating else ""


def check_scene(scene: SphereScene, numerics: Numerics) -> None:
    """Refuse what contact dynamics in space lacks, by name.

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
    """
    if len(scene.spheres) == 0:
        raise InvalidSceneError("the scene has no sphere: there is nothing to simulate")
    rotating = bool(scene.spheres.rotating.any())
    kind = numerics.options.get("cd.contacts", "auto")
    asked = [refused_law(law, rotating=rotating) for law in scene.laws_in_use]
    asked += ["a periodic cell"] if scene.cell is not None else []
    missing = [name for name in asked if name]
    if missing:
        raise InvalidSceneError(
            f"the scene has {missing[0]}, which contact dynamics in space does not have: leave it out, or use method = 'dem'"
        )
    if kind == "auto" and not all(law.regularised for law in scene.laws_in_use):
        raise InvalidSceneError(
            "the scene has elastic contacts, which contact dynamics in space does not have: make them rigid (regularised, or cd.contacts = "
            "rigid), or use method = 'dem'"
        )
    for pair, force in scene.initial_shear.items():
        if np.any(force):
            names = " and ".join(scene.body_name(body) for body in pair)
            raise InvalidSceneError(
                f"the initial shear force {tuple(force)} N belongs to {names}, whose contact is rigid and does not hold one: drop the entry"
            )
    if numerics.regime != "dynamic":
        raise InvalidNumericsError("regime = 'quasi-static' is not allowed for spheres: use 'dynamic'")
    if numerics.energy_budget:
        raise InvalidNumericsError("energy_budget = True is not allowed in contact dynamics in space: leave it out")
    for refused in refused_settings(numerics):
        raise InvalidNumericsError(f"{refused} is not allowed in space: leave it out")


def refused_settings(numerics: Numerics) -> list[str]:
    """Settings that have no meaning in space: its problems have one solver, without relaxation, of rigid contacts.

    Parameters
    ----------
    numerics : Numerics

    Returns
    -------
    list of str
    """
    refused = [] if numerics.solver == "auto" else [f"solver = {numerics.solver!r}"]
    for name, meant in (("cd.relaxation", (1.0,)), ("cd.contacts", ("auto", "rigid"))):
        value = numerics.options.get(name, meant[0])
        if value not in meant:
            refused.append(f"{name} = {value}")
    return refused


def spheres_overlap(spheres: Spheres) -> bool:
    """Whether two spheres overlap by more than rounding; boxes are not looked at.

    Parameters
    ----------
    spheres : Spheres
    """
    some = np.flatnonzero(~spheres.boxes)
    x, radius = spheres.x[some], spheres.radius[some]
    pairs = near_pairs(x, radius, 0.0)
    pairs = pairs[~spheres.fixed[some][pairs].all(axis=1)]
    i, j = pairs.T
    overlap = radius[i] + radius[j] - np.linalg.norm(x[j] - x[i], axis=1)
    return bool((overlap > TOUCHING * np.minimum(radius[i], radius[j])).any())
