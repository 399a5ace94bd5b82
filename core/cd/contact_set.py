"""Which contacts a step needs: found so that none that can close is missed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.frame_kernels import MISSED, NEARBY, closing_gaps, gap_round_off, surface_way, wall_way
from ninedisk.core.cd.frames import Frames, contact_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.residuals import Sliding
from ninedisk.core.cd.step import Solved, Step, pair_bodies
from ninedisk.core.contacts.finder import PairFinder

FloatArray = NDArray[np.float64]


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
        return gap_round_off(self.x, self.radius, self.after)

    def wall_way(self) -> float:
        """Bound on the displacement of a wall's surface over the step near the disks [m]."""
        return wall_way(self.x, self.before, self.after)


def solve_with_contacts(
    step: Step,
    place: Place,
    finder: PairFinder,
    laws: LawTable,
    memory: ContactMemory,
    sliding: Sliding,
    margin: float = 0.0,
    start: ContactMemory | None = None,
) -> tuple[Frames, Solved]:
    """Solve a step on a set of contacts that grows until no pair outside it is violated.

    A pair enters if its gap at the end of the step, minus ``mu`` times its slip under the associated rule, is not
    positive: first for the motion without contacts, then for each solution, and a solution starts from the one before. The
    search covers every pair that the displacements found can bring that far, so the final solution violates no contact,
    listed or not.

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
    start : ContactMemory, optional
        Guess of the step's forces; None: those of the last step.

    Returns
    -------
    frames : Frames
        Contacts of the step.
    solved : Solved
    """
    tolerance = MISSED * place.round_off()
    dilation = laws.mu if sliding == "associated" else np.zeros_like(laws.mu)
    factor = 1.0 + float(dilation.max())
    walls = place.wall_way()

    def reach_of(dx: FloatArray) -> float:
        return factor * (2.0 * surface_way(dx, place.radius) + walls) + max(margin, 2.0 * tolerance)

    def near(reach: float) -> Frames:
        pairs = finder.within(place.x, place.after, reach)
        return contact_frames(pairs, place.x, place.radius, place.before, place.after, laws)

    def closing(frames: Frames, dx: FloatArray) -> FloatArray:
        bodies, out = pair_bodies(frames, len(dx)), np.empty(len(frames))
        closing_gaps(bodies, frames.normal, frames.arms, frames.gap, frames.shift, frames.row, dilation, dx, out)
        return out

    dx = step.guess()
    reach = max(2.0 * reach_of(dx), NEARBY * float(place.radius.min()))
    frames = near(reach)
    inside = closing(frames, dx) < max(margin, tolerance)
    start, iterations = memory if start is None else start, 0
    while True:
        chosen = frames.pick(inside)
        solved = step.solve(chosen, memory.of(chosen.pairs), start.of(chosen.pairs))
        start, iterations = memory.renewed(chosen.pairs, solved.r), iterations + solved.result.iterations
        needed = reach_of(solved.dx)
        if needed > reach:
            reach = 1.5 * needed
            frames = near(reach)
            inside = memory.same(frames.pairs, chosen.pairs)
        missed = ~inside & (closing(frames, solved.dx) < -tolerance)
        if not missed.any():
            return chosen, solved._replace(result=replace(solved.result, iterations=iterations))
        inside |= missed
