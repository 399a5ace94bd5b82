"""Which contacts a step needs: found so that none that can close is missed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.frames import Frames, contact_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.residuals import Sliding
from ninedisk.core.cd.step import Solved, Step, relative
from ninedisk.core.contacts.finder import PairFinder

FloatArray = NDArray[np.float64]

ROUND_OFF = 4.0 * float(np.finfo(np.float64).eps)
"""Of the largest coordinate: gaps are differences of a few of them."""

NEARBY = 1e-2
"""Gap over the smallest radius of the pairs that are looked at in any case: contact forces move disks that would rest without."""


@dataclass(frozen=True)
class Place:
    """Where bodies are: disks at the start of a step, walls at both its ends.

    Attributes
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    radius : ndarray, shape (n,)
        Radii [m].
    before, after : ndarray, shape (m, 11)
        Walls.
    """

    x: FloatArray
    radius: FloatArray
    before: FloatArray
    after: FloatArray

    def round_off(self) -> float:
        """Error of a gap [m] that the rounding of coordinates explains."""
        largest = max(float(np.abs(self.x).max()), float(self.radius.max()))
        return ROUND_OFF * max(largest, float(np.abs(self.after[:, 0:2]).max(initial=0.0)))

    def wall_way(self) -> float:
        """Bound on the displacement of a wall's surface over the step near the disks [m]."""
        if not len(self.after):
            return 0.0
        moved = np.hypot(*(self.after[:, 0:2] - self.before[:, 0:2]).T)
        turned = np.hypot(*(self.after[:, 2:4] - self.before[:, 2:4]).T)
        far = np.sqrt(((self.x[:, None, :] - self.after[None, :, 0:2]) ** 2).sum(axis=2)).max(axis=0)
        # The chord of the normal's turn times pi/2 bounds the angle.
        return float((moved + 0.5 * np.pi * turned * far).max())


def solve_with_contacts(
    step: Step,
    place: Place,
    finder: PairFinder,
    laws: LawTable,
    memory: ContactMemory,
    sliding: Sliding,
    margin: float = 0.0,
) -> tuple[Frames, Solved]:
    """Solve a step on a set of contacts that grows until no pair outside it is violated.

    A pair enters if its gap at the end of the step, minus ``mu`` times its slip under the associated rule, is not
    positive: first for the motion without contacts, then for each solution. The search covers every pair that the
    displacements found can bring that far, so the final solution violates no contact, listed or not.

    Parameters
    ----------
    step : Step
    place : Place
    finder : PairFinder
    laws : LawTable
    memory : ContactMemory
        Forces of the last step.
    sliding : {"associated", "coulomb"}
    margin : float
        Pairs with a gap up to this [m] enter at once.

    Returns
    -------
    frames : Frames
        Contacts of the step.
    solved : Solved
    """
    # Rounding of this gap, of the displacements and of those of earlier steps that a contact still carries.
    tolerance = 16.0 * place.round_off()
    dilation = laws.mu if sliding == "associated" else np.zeros_like(laws.mu)
    factor = 1.0 + float(dilation.max())
    walls = place.wall_way()

    def reach_of(dx: FloatArray) -> float:
        surface = np.hypot(dx[:, 0], dx[:, 1]) + place.radius * np.abs(dx[:, 2])
        return factor * (2.0 * float(surface.max()) + walls) + max(margin, 2.0 * tolerance)

    def near(reach: float) -> Frames:
        pairs = finder.within(place.x, place.after, reach)
        return contact_frames(pairs, place.x, place.radius, place.before, place.after, laws)

    def closing(frames: Frames, dx: FloatArray) -> FloatArray:
        u = relative(frames, dx)
        rise: FloatArray = dilation[frames.row] * np.abs(frames.shift + u[:, 1])
        return frames.gap + u[:, 0] - rise

    dx = step.guess()
    reach = max(2.0 * reach_of(dx), NEARBY * float(place.radius.min()))
    frames = near(reach)
    inside = closing(frames, dx) < max(margin, tolerance)
    while True:
        chosen = frames.pick(inside)
        solved = step.solve(chosen, memory.of(chosen.pairs))
        needed = reach_of(solved.dx)
        if needed > reach:
            reach = 1.5 * needed
            known = {tuple(pair) for pair in chosen.pairs.tolist()}
            frames = near(reach)
            inside = np.array([tuple(pair) in known for pair in frames.pairs.tolist()], dtype=bool)
        missed = ~inside & (closing(frames, solved.dx) < -tolerance)
        if not missed.any():
            return chosen, solved
        inside |= missed
