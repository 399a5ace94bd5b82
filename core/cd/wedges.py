"""Corners in which Newton's restitution with friction can have no solution: told before a run."""

from __future__ import annotations

from itertools import combinations
from math import acos, atan, degrees, pi

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

ADVICE = "use impact = 'theta', with which a solution always exists, or a restitution of 0"


def wedging_corners(scene: Scene, numerics: Numerics) -> list[str]:
    """Sentences about the corners of walls at time 0 where a disk can be wedged; none under laws that always have a solution.

    With the offsets c of `ninedisk.core.cd.step.DynamicStep`, negative where a contact closes and ``e > 0``, the associated rule asks
    for ``u_n + c >= mu |u_t|``. By Farkas' lemma that is possible unless forces r in the friction cones balance each other and
    ``c.p < 0``; and without such forces Coulomb's law has a solution too (Anitescu & Potra, Nonlinear Dynamics 14 (1997) 231-247).
    On a disk between two walls whose free sides enclose the angle alpha, the normal forces enclose ``pi - alpha``, and each force
    leans from its normal by its angle of friction at most: they are opposite only if ``arctan(mu_1) + arctan(mu_2) >= alpha``. There
    Coulomb's law fails as well: a disk that comes into a right corner and cannot turn gets ``(1 - mu) (P_1 + P_2)``, added up over both
    directions, and has to leave in both of them.

    The theta scheme's own law always has a solution, as ``r.u`` of balanced forces is ``p.gap/(theta dt) >= 0`` with walls at rest, and so
    has ``e = 0``, where no c is negative. Parallel walls do not count: what closes one contact opens the other. Contacts between disks
    can wedge as well, which no scene tells in advance: then the step itself ends in an error.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    """
    if numerics.impact != "newton" or numerics.regime != "dynamic":
        return []
    told = []
    for one, two in combinations(scene.walls, 2):
        inner = one.normal[0] * two.normal[0] + one.normal[1] * two.normal[1]
        alpha = pi - acos(min(1.0, max(-1.0, inner)))
        friction = atan(one.law.mu) + atan(two.law.mu)
        bounces = max(one.law.restitution or 0.0, two.law.restitution or 0.0) > 0.0
        if bounces and 1e-9 < alpha <= friction and one.law.mu > 0.0 and two.law.mu > 0.0:
            told.append(
                f"walls {one.name!r} and {two.name!r} meet at {degrees(alpha):.3g} degrees, no more than their angles of friction "
                f"together ({degrees(friction):.3g}): Newton's restitution can have no solution for a disk that is wedged there; {ADVICE}"
            )
    return told
