"""One step in space: its contact problem, and the search for the contacts that it needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan, sqrt
from typing import NamedTuple, NoReturn

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.cd.contact_kernels import FED, MISSED, NEARBY
from ninedisk.core.cd.delassus import DelassusProblem, natural_map
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.problem import Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix.cone import solve_by_convex_problems, solve_cones
from ninedisk.core.cd.solvers.outcome import MatrixSolution
from ninedisk.core.cd.space.bodies import FreeStep
from ninedisk.core.cd.space.contacts import ContactSearch, Frames, Place
from ninedisk.core.cd.step import LIKELY, WITH_MISSED
from ninedisk.core.errors import InvalidSceneError, SolverNotConvergedError

WARM_FROM = 50
"""Contacts from which those that may close in the step enter with those that do: a solution costs more than some open contacts."""


class Figures(NamedTuple):
    """How far forces are from a solution: distance from the projection on the cones, and the largest of all relative errors."""

    natural_map: float
    worst: float
    duality_gap: float = nan


@dataclass(frozen=True)
class Memory:
    """Contact forces of a step.

    Attributes
    ----------
    key : ndarray of int64, shape (c,)
        Contacts, ascending; two with the same key are one to a warm start.
    pairs : ndarray of int64, shape (c, 2)
        Bodies, in the order of the contacts of the step.
    force, friction : ndarray, shape (c, 3)
        Forces on the first bodies [N] and their parts across the normal, in the axes of the scene, in that order.
    arm : ndarray, shape (c, 3)
        Points of the first bodies from their centres [m], in that order.
    r : ndarray, shape (c, 3)
        Normal and tangential forces [N], in that order.
    order : ndarray of int64, shape (c,)
        Contacts of the step in the order of ``key``.
    """

    key: IntArray
    pairs: IntArray
    force: FloatArray
    friction: FloatArray
    arm: FloatArray
    r: FloatArray
    order: IntArray

    @classmethod
    def of(cls, frames: Frames, r: FloatArray) -> Memory:
        """The memory of forces ``r``, shape (c, 3)."""
        order = np.argsort(frames.key, kind="stable")
        friction = np.einsum("ka,kaj->kj", r[:, 1:], frames.axes[:, 1:])
        force = friction - r[:, :1] * frames.axes[:, 0]
        return cls(frames.key[order], frames.pairs, force, friction, frames.arm, r, order)

    @classmethod
    def empty(cls) -> Memory:
        """The memory of no contact."""
        vectors, none = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        return cls(none, np.zeros((0, 2), dtype=np.int64), vectors, vectors, vectors, vectors, none)

    def guess(self, frames: Frames) -> FloatArray:
        """Forces ``r`` of these contacts, shape (c, 3), those of contacts that are new 0."""
        found = np.zeros((frames.size, 3))
        if len(self.key) and frames.size:
            at = np.minimum(np.searchsorted(self.key, frames.key), len(self.key) - 1)
            known = self.key[at] == frames.key
            force = self.force[self.order[at[known]]]
            found[known] = np.einsum("kaj,kj->ka", frames.axes[known], force) * [-1.0, 1.0, 1.0]
        return found

    def known(self, frames: Frames) -> NDArray[np.bool_]:
        """Which contacts are in the memory."""
        return np.isin(frames.key, self.key)


class Solved(NamedTuple):
    """Outcome of a step: contacts, forces ``r`` (c, 3) [N], velocities (n, 6) at its end, moments of the forces (n, 3) [N m], and how."""

    frames: Frames
    r: FloatArray
    velocity: FloatArray
    moment: FloatArray
    problem: DelassusProblem | None
    answer: MatrixSolution
    solutions: int


class ContactStep:
    """Solves a step with whatever contacts it needs, under the laws of `ninedisk.core.cd.step.DynamicStep`.

    With bodies eliminated the problem is ``u = W r + b``, W from contact velocities and inverse masses, solved by
    `ninedisk.core.cd.solvers.by_matrix.cone.solve_cones`. Forces of single points of a face are not unique, and no motion depends on them.

    Parameters
    ----------
    free : FreeStep
    laws : LawTable
    options : SolverOptions
    sliding : {"associated", "coulomb"}
    dt, theta : float
    round_off : float
        Rounding error of a gap [m].

    Attributes
    ----------
    problem : DelassusProblem or None
        The last one that was tried.
    """

    def __init__(
        self,
        free: FreeStep,
        laws: LawTable,
        options: SolverOptions,
        sliding: Sliding,
        dt: float,
        theta: float,
        round_off: float,
    ) -> None:
        self._free, self._laws, self._options, self._sliding = free, laws, options, sliding
        self._dt, self._theta, self._round_off = dt, theta, round_off
        self.problem: DelassusProblem | None = None

    def velocities_without(self, frames: Frames) -> FloatArray:
        """``b``: contact velocities without contact forces, those that the law at hand restricts, shape (c, 3)."""
        theta, dt = self._theta, self._dt
        start, end = frames.relative(self._free.before), frames.relative(self._free.without)
        e = self._laws.restitution[frames.row]
        newton = ~np.isnan(e)
        b = end + (1.0 - theta) / theta * start
        touching = np.abs(frames.gap) <= MISSED * self._round_off
        b[:, 0] += np.where(touching, 0.0, frames.gap) / (theta * dt)
        b[:, 1:] += frames.shift / (theta * dt)
        if newton.any():
            wall = (frames.gap - frames.gap_before) / dt
            before = wall + start[:, 0]
            rebound = np.where(before < 0.0, np.where(newton, e, 0.0) * before, before)
            b[newton, 0] = (wall + end[:, 0] + rebound)[newton]
            b[newton, 1:] = (frames.shift / dt + end[:, 1:])[newton]
        return b

    def jacobian(self, frames: Frames) -> sp.bsr_array:
        """Contact velocities of the velocities of all bodies that can move, shape (3 c, 6 n)."""
        n = len(self._free.movable)
        listed = np.zeros(frames.pairs.shape, dtype=bool)
        listed[:, 0] = self._free.movable[frames.pairs[:, 0]]
        of_body = frames.pairs[:, 1] < n
        listed[of_body, 1] = self._free.movable[frames.pairs[of_body, 1]]
        pointers = np.concatenate([[0], np.cumsum(listed.sum(axis=1))])
        return sp.bsr_array(
            (frames.motion[listed], frames.pairs[listed], pointers), shape=(3 * frames.size, 6 * n), blocksize=(3, 6)
        )

    def can_be_opened(self, frames: Frames) -> NDArray[np.bool_]:
        """Which contacts some body can open: the others are between motions that are prescribed, whatever forces act."""
        free, n = self._free, len(self._free.movable)
        found = np.zeros(frames.size)
        for side in range(2):
            body = np.minimum(frames.pairs[:, side], n - 1)  # at walls the motion is 0
            row = frames.motion[:, side, 0]
            found += np.einsum("ka,kab,kb->k", row, free.inverse[body], row)
        return np.asarray(found > 0.0)

    def solve(self, frames: Frames, start: FloatArray) -> Solved:
        """Solve with these contacts, ``start`` a guess of their forces, shape (c, 3).

        Raises
        ------
        SolverNotConvergedError
            If the best forces miss the tolerance and ``cd.accept``.
        """
        free, n = self._free, len(self._free.movable)
        b = self.velocities_without(frames)
        resolution = self._round_off / (self._theta * self._dt)
        slip = self._laws.mu[frames.row] * np.linalg.norm(b[:, 1:], axis=1) if self._sliding == "associated" else 0.0
        if not (b[:, 0] - slip < -resolution).any():
            # No contact would close by more than the rounding of gaps: without forces the law is obeyed.
            answer = MatrixSolution(np.zeros((frames.size, 3)), 0.0, 0, 0.0)
            return Solved(frames, answer.r, free.without, np.zeros((n, 3)), None, answer, 1)
        h = self.jacobian(frames)
        inverse = sp.bsr_array((free.inverse, np.arange(n), np.arange(n + 1)), blocksize=(6, 6))
        columns = inverse @ h.T
        w = sp.csr_array(h @ columns)
        self.problem = problem = DelassusProblem(w=self._with_stiff_tangents(w, b), b=b, mu=self._laws.mu[frames.row])
        answer = solve_cones(problem, self._options, sliding=self._sliding, start=start)
        enough = replace(self._options, tolerance=max(self._options.tolerance, self._options.accept or 0.0))
        if self._options.max_iterations is None and answer.error > enough.tolerance and self._sliding == "coulomb":
            more = solve_by_convex_problems(problem, enough, start=answer.r)
            answer = more._replace(
                iterations=answer.iterations + more.iterations, seconds=answer.seconds + more.seconds
            )
        if not answer.error <= enough.tolerance:
            self._fail(problem, answer)
        impulse = np.asarray(h.T @ answer.r.ravel()).reshape(n, 6)
        velocity = free.without + np.einsum("nij,nj->ni", free.inverse, impulse)
        return Solved(frames, answer.r, velocity, impulse[:, 3:], problem, answer, 1)

    def _with_stiff_tangents(self, w: sp.csr_array, b: FloatArray) -> sp.csr_array:
        """W with a compliance along tangents that nothing moves and nothing drives: their friction is 0, and blocks are regular."""
        diagonal = w.diagonal().reshape(-1, 3)
        still = (diagonal[:, 1:] == 0.0) & (b[:, 1:] == 0.0)
        if not still.any():
            return w
        extra = np.zeros_like(diagonal)
        extra[:, 1:] = np.where(still, diagonal[:, :1], 0.0)
        return sp.csr_array(w + sp.diags_array(extra.ravel()))

    def _fail(self, problem: DelassusProblem, answer: MatrixSolution) -> NoReturn:
        over = answer.seconds > self._options.time_limit
        why = f"the time limit of {self._options.time_limit:g} s" if over else "its iteration limit or a stall"
        figures = Figures(natural_map(problem, answer.r, coulomb=self._sliding == "coulomb"), answer.error)
        raise SolverNotConvergedError(
            f"the solver of {problem.n_contacts} contacts in space stopped at {why} after {answer.iterations} iterations and "
            f"{answer.seconds:.3g} s: largest relative error {answer.error:.3g}, natural-map residual {figures.natural_map:.3g}; the "
            f"tolerance is {self._options.tolerance:g}. Loosen cd.tolerance, allow the best forces found by cd.accept, raise "
            "cd.time_limit, or reduce dt",
            iterations=answer.iterations,
            residuals=figures,
            forces=answer.r,
        )


def solve_with_contacts(
    step: ContactStep,
    free: FreeStep,
    search: ContactSearch,
    where: Place,
    laws: LawTable,
    memory: Memory,
    sliding: Sliding,
) -> Solved:
    """Solve a step on a set of contacts that grows until none outside it is violated.

    The rule is that of `ninedisk.core.cd.step.solve_with_contacts`. Gaps are those along normals at the start of the step: exact between
    spheres and walls or on the safe side; at corners and edges of boxes that turn by an angle a they err by the arm times ``a^2/2``.
    """
    tolerance = MISSED * search.round_off(where)
    dilation = laws.mu if sliding == "associated" else np.zeros_like(laws.mu)
    factor, walls = 1.0 + float(dilation.max()), search.wall_displacement(where)
    rigid = np.isnan(laws.restitution)

    def reach_of(dx: FloatArray) -> float:
        return factor * (2.0 * search.surface_displacement(dx) + walls) + 2.0 * tolerance

    def closing(frames: Frames, dx: FloatArray) -> FloatArray:
        u = frames.relative(dx)
        slip = np.linalg.norm(frames.shift + u[:, 1:], axis=1)
        return np.asarray(frames.gap + u[:, 0] - dilation[frames.row] * slip)

    dx = free.displacement(free.without)
    reach = max(2.0 * reach_of(dx), NEARBY * search.smallest_radius)
    frames = search.within(where, reach)
    gaps = closing(frames, dx)
    inside = (gaps < tolerance) | (memory.known(frames) & rigid[frames.row])
    if many := int(inside.sum()) > WARM_FROM:
        inside |= rigid[frames.row] & (gaps < LIKELY * sqrt(float((dx[:, :3] ** 2).sum(axis=1).mean())))
    iterations, solutions, seconds = 0, 0, 0.0
    guess = memory
    while True:
        stuck = ~step.can_be_opened(frames)
        if (stuck & (gaps < -tolerance)).any():
            i, j = frames.pairs[int(np.argmin(np.where(stuck, gaps, 0.0)))]
            raise InvalidSceneError(
                f"bodies {i} and {j} are driven into each other and neither can yield (walls are numbered after the bodies): release "
                "one, or change a prescribed motion"
            )
        inside &= ~stuck
        chosen = frames.pick(inside)
        solved = step.solve(chosen, guess.guess(chosen))
        guess = Memory.of(chosen, solved.r)
        iterations, solutions = iterations + solved.answer.iterations, solutions + 1
        seconds += solved.answer.seconds
        dx = free.displacement(solved.velocity)
        if not np.isfinite(dx).all():
            return solved
        if (needed := reach_of(dx)) > reach:
            reach = 1.5 * needed
            frames = search.within(where, reach)
            inside = guess.known(frames)
        gaps = closing(frames, dx)
        missed = ~inside & (gaps < -tolerance)
        if not missed.any():
            answer = solved.answer._replace(iterations=iterations, seconds=seconds)
            return solved._replace(answer=answer, solutions=solutions)
        if many:
            missed |= rigid[frames.row] & (gaps < -WITH_MISSED * float(gaps[missed].min()))
        inside |= missed


def impact_gain(
    solved: Solved, free: FreeStep, laws: LawTable, dt: float, tolerance: float, resolution: float
) -> float:
    """Energy [J] that contacts under Newton's law feed in a step; 0 where it is round-off.

    As `ninedisk.core.cd.contact_kernels.note_impact_work` has it in the plane; ``resolution`` is the rounding of contact velocities [m/s].
    """
    frames, r, velocity, problem = solved.frames, solved.r, solved.velocity, solved.problem
    newton = ~np.isnan(laws.restitution[frames.row])
    if problem is None or not newton.any():
        return 0.0
    wall = np.column_stack([frames.gap - frames.gap_before, frames.shift]) / dt
    start, end = frames.relative(free.before) + wall, frames.relative(velocity) + wall
    work = 0.5 * dt * np.sum(r * (start + end), axis=1)
    force = r[:, 0] + np.linalg.norm(r[:, 1:], axis=1)
    speed = np.abs(start).sum(axis=1) + np.abs(end).sum(axis=1)
    size = dt * force * (FED * tolerance * (speed + force / problem.rho) + resolution)
    total = float(np.maximum(work[newton], 0.0).sum())
    return total if total > float(size[newton].sum()) else 0.0
