"""Which contacts a step needs: found so that none that can close is missed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import MISSED, NEARBY, closing_gaps, surface_way
from ninedisk.core.cd.contacts import Frames, contact_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.place import Place
from ninedisk.core.cd.residuals import Sliding
from ninedisk.core.cd.step import Solved, Step, pair_bodies
from ninedisk.core.dem.neighbours import PairFinder

if TYPE_CHECKING:
    from ninedisk.core.cd.grain_frames import GrainFrames
FloatArray = NDArray[np.float64]


def solve_with_contacts(
    step: Step,
    place: Place,
    finder: PairFinder,
    laws: LawTable,
    memory: ContactMemory,
    sliding: Sliding,
    margin: float = 0.0,
    start: ContactMemory | None = None,
    grains: GrainFrames | None = None,
) -> tuple[Frames, Solved]:
    """Solve a step on a set of contacts that grows until no pair outside it is violated.

    A pair enters if its gap at the end of the step, minus ``mu`` times its slip under the associated rule, is not
    positive: first for the motion without contacts, then for each solution, and a solution starts from the one before. Contacts of
    the guess that are near enter at once. The search covers every pair that the displacements found can bring that far, so the
    final solution violates no contact, listed or not. The gap is that along the normal at the start of the step: exact on disks and
    walls, or on the safe side; on outlines that turn by an angle a and have the radius of curvature rho it errs by ``rho a^2/2``.

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
    grains : GrainFrames, optional
        Where bodies have outlines.

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
        return frames_within(reach, place, finder, laws, grains)

    def closing(frames: Frames, dx: FloatArray) -> FloatArray:
        bodies, out = pair_bodies(frames, len(dx)), np.empty(len(frames))
        closing_gaps(bodies, frames.normal, frames.arms, frames.gap, frames.shift, frames.row, dilation, dx, out)
        return out

    dx = step.guess()
    reach = max(2.0 * reach_of(dx), NEARBY * float(place.radius.min()))
    frames = near(reach)
    inside = closing(frames, dx) < max(margin, tolerance)
    start, springs, iterations = memory if start is None else start, memory.springs(), 0
    # Under Newton's law a contact is one only once its gap closes; one with a stretched shear spring would hold on by it (associated rule).
    stretched = laws.elastic[frames.row] & (_forces(springs, frames, grains)[:, 1] != 0.0)
    inside |= start.same(frames.pairs, start.pairs) & np.isnan(laws.restitution[frames.row]) & ~stretched
    while True:
        chosen = frames.pick(inside)
        solved = step.solve(chosen, _forces(springs, chosen, grains), _forces(start, chosen, grains))
        start, iterations = memory.renewed(chosen.pairs, solved.r, chosen.place), iterations + solved.result.iterations
        needed = reach_of(solved.dx)
        if needed > reach:
            reach = 1.5 * needed
            frames = near(reach)
            inside = memory.same(frames.pairs, chosen.pairs) if grains is None else _among(frames, chosen)
        missed = ~inside & (closing(frames, solved.dx) < -tolerance)
        if not missed.any():
            return chosen, solved._replace(result=replace(solved.result, iterations=iterations))
        inside |= missed


def frames_within(reach: float, place: Place, finder: PairFinder, laws: LawTable, grains: GrainFrames | None) -> Frames:
    """Contacts with a gap below ``reach`` [m] at the end of the step if no body moved."""
    pairs = finder.within(place.x, place.after, reach)
    if grains is not None:
        return grains.frames(place, pairs, reach)
    return contact_frames(pairs, place.x, place.radius, place.before, place.after, laws)


def _forces(memory: ContactMemory, frames: Frames, grains: GrainFrames | None) -> FloatArray:
    """Forces that a memory has for the contacts, shape (c, 2) [N]."""
    return memory.of(frames.pairs) if grains is None else grains.inherited(memory, frames)


def _among(frames: Frames, others: Frames) -> NDArray[np.bool_]:
    """Which contacts of a step are among others of the same step: outlines can meet in several places."""

    def names(some: Frames) -> list[tuple[float, ...]]:
        return [(*pair, *place) for pair, place in zip(some.pairs.tolist(), some.place.tolist(), strict=True)]

    known = set(names(others))
    return np.array([name in known for name in names(frames)], dtype=bool)
