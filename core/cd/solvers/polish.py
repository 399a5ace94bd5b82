"""Polish for Coulomb's law: from forces that are nearly a solution to forces that are one to round-off.

What each contact does, its status, is read off the forces: open, stick, or slip either way. Where the statuses are those of a solution
the law is linear: ``u = 0`` where a contact sticks, ``u_n = 0`` and ``q = +-mu p`` where it slips, no force where it is open. Packings
have more forces than these equations fix. Of all their solutions the one is taken that changes the forces least, by a compliance
that acts on the change alone: one with the least forces would pull where the forces found push.

Statuses that are not quite right are repaired by pivots. With ``z = r - rho u``, of which ``r = P(z)`` is the part inside the cone
(``p = max(z_n, 0)``, ``q`` the nearest to ``z_t`` with ``|q| <= mu p``), Coulomb's law is the one equation

    F(z) = W P(z) + b - (P(z) - z)/rho = 0,

linear as long as no status changes. From the forces r_0 found the path ``F(z) = t F(z_0)`` is followed from t = 1 to 0, piece by piece;
each kink changes the status of one contact. This is Lemke's method with the error of r_0 for its covering vector: as few pivots as
contacts are wrong, where that from nothing needs several for each contact, and the solution is that next to the forces found. The
path may turn back in t, which ways that only flip statuses never do: between two sets of statuses that both break an inequality they
go to and fro. Where it closes without reaching t = 0 another one begins from a point near by.

Where that path ends in a ray, one from forces of zero is left, whose covering vector is positive: see `Polish.from_nothing`.

Nothing is accepted but what the law's own residuals accept.

C. E. Lemke, "Bimatrix equilibrium points and mathematical programming", Management Sci. 11 (1965) 681-689; J. Katzenelson, "An algorithm
for solving nonlinear resistor networks", Bell Syst. Tech. J. 44 (1965) 1605-1620 (the path of a piecewise linear equation).
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, measure
from ninedisk.core.cd.solvers.factorise import UnsymmetricMatrix
from ninedisk.core.cd.solvers.gauss_seidel import starting_forces
from ninedisk.core.cd.solvers.outcome import Stopwatch
from ninedisk.core.cd.solvers.polish_kernels import (
    MINUS,
    OPEN,
    PLUS,
    STICK,
    law_error,
    next_kink,
    remaining_velocities,
    statuses_at,
)
from ninedisk.core.cd.solvers.unsymmetric_kernels import forces_of_velocities, load_of_velocities

IntArray = NDArray[np.int64]

SIDE = np.array([0.0, 0.0, 1.0, -1.0])
"""Sign of the friction force of slip."""
SOFT = 1e-9
"""Compliance over ``1/rho`` that acts on the change of the forces: below, the digits of its effect are lost to round-off."""
PATHS = 8
"""Times the pivots of one path that a polish may take in all: most take one or two paths of a few pivots."""
FIRST_JITTER, MOST_JITTER = 1e-6, 1e-3
"""Change at random of the point where a path begins anew, over the largest ``|z|``, ten times as much each time: enough to leave a
loop, far from enough to need many pivots."""
PARALLEL = 0.99
"""Least cosine of two changes, and ratio of their lengths, that count as the same drift."""
STRIDE = 0.1
"""Length of a stride over the largest force: so far that a status changes on the way."""
COVERS = 3
"""Paths from nothing, each with its own covering vector, before it is given up: one that is at random meets no two kinks at once."""
PIVOTS = 12
"""Pivots for each contact on a path from nothing: 2 to 9 were needed."""
FAR = 100.0
"""Multiple of its first t at which a path is taken for a ray: of 1,832 that found an end none went that far, of the others 18 did."""
SAME = 1e-7
"""Relative difference of points of a path that are one point: what round-off over `SOFT` leaves of their digits."""
ALL_SEEN = 500
"""Contacts up to which all are in the matrix from the start; of more those that have been closed: in a flow half of those that are near
stay open, and with them factors take three times as long. Of few an analysis costs as much as some pivots, and the path from nothing closes
one after the other."""
MOST_SEEN = 0.9
"""Share of the contacts from which all are in the matrix: in a packing at rest the others save nothing, and each that closes costs an
analysis."""
REFINED_BELOW = 1e-7
"""Compliance over ``1/rho`` below which the direction of a path is solved for twice: round-off over it is the error of one solution."""
REFINEMENTS = 8
"""Solutions with a factorisation: each leaves of an error the compliance's share of its resistance. Most is below 1e-6; of the few
directions that resist as little as the compliance, one falls away with each further solution."""
DEPENDENT = 1e-12
"""Part of a change at right angles to those before that is round-off."""


class LawPoint(NamedTuple):
    """Coulomb's law at ``z``, shape (c, 2): the ``status`` of each contact, forces ``r`` inside the cones, velocities ``u``, the ``error``
    F(z), and ``size``, the norm of ``rho`` times that [N]: see `law_error`.
    """

    z: FloatArray
    status: IntArray
    r: FloatArray
    u: FloatArray
    error: FloatArray
    size: float


class Polish:
    """Polishes contact forces of one problem.

    Parameters
    ----------
    problem : ContactProblem
    tolerance : float
    clock : Stopwatch
        No pivot begins after its limit.

    Attributes
    ----------
    count : int
        Factorisations so far.
    soft : ndarray, shape (c,)
        Compliance of each contact over ``1/rho``; another array takes its place where it changes.
    best : tuple of ndarray, shape (c, 2), and Residuals, or None
        Forces that came nearest to a solution.
    """

    def __init__(self, problem: ContactProblem, tolerance: float, clock: Stopwatch) -> None:
        self.problem, self.tolerance, self.clock, self.count = problem, tolerance, clock, 0
        c = problem.n_contacts
        self.soft = self._made_for = np.full(c, SOFT)
        self._status, self._d = np.full(c, OPEN), np.zeros((c, 2, 2))
        self._seen = np.full(c, c <= ALL_SEEN)
        self._matrix: UnsymmetricMatrix  # from the first factorisation on
        self.best: tuple[FloatArray, Residuals] | None = None
        self._random = np.random.default_rng(c)
        self._v, self._nothing = np.zeros((2, problem.n_bodies, 3))

    def improve(self, r: FloatArray, pivots: int, paths: int = PATHS) -> tuple[FloatArray, Residuals] | None:
        """Exact forces, shape (c, 2), near ``r``, and their residuals; None if ``paths`` paths of ``pivots`` pivots do not lead to any.

        A round follows the path to the forces that the compliance holds near those of the last one. Where more contacts are closed than
        can be at once, by gaps d times a step's displacement, each changes them by ``d/SOFT`` along what W does not see, until a contact
        opens or slips the other way. Such a drift is followed in one stride as far as the first change of a status: strides beyond
        it can cycle, from one set of such contacts to the next.
        """
        z = r - self.problem.rho[:, None] * self.velocity(r)
        status, held, drift, striding = statuses(self.problem, z), r, np.zeros_like(r), False
        budget = self.count + paths * pivots
        while True:
            found = self._nearest_forces(r, status)
            if found is None:
                return None
            if exact := self.judged(found):
                return exact
            ended = self._follow(r, held, pivots, to_first=striding)
            jitter = FIRST_JITTER
            while ended is None and self.count < budget and not self.clock.over:
                held, ended, striding = r, self._follow(r, r, pivots, jitter=jitter), False
                jitter = min(10.0 * jitter, MOST_JITTER)
            if ended is None or self.count > budget:
                return None
            r, status = ended
            if exact := self.judged(r):
                return exact
            if striding:
                held, striding = r, False
                continue
            before, drift = drift, r - held
            striding = _is_steady(before, drift)
            held = r + STRIDE * float(np.abs(r).max() / np.abs(drift).max()) * drift if striding else r

    def from_nothing(self, r: FloatArray, pivots: int) -> tuple[FloatArray, Residuals] | None:
        """Exact forces, shape (c, 2), on a path that begins with no contact closed; ``r`` are some that are nearly a solution.

        All normal velocities are raised by a vector ``t d`` with ``d > 0``, so that nothing touches, and t falls to 0. With compliance W is
        positive definite, and for such a d the path cannot end in a ray (D. E. Stewart, J. C. Trinkle, Int. J. Numer. Methods Eng. 39
        (1996) 2673-2691; J.-S. Pang, J. C. Trinkle, Math. Programming 73 (1996) 199-226), as that from ``r`` can.
        """
        problem, rho = self.problem, self.problem.rho
        for _cover in range(COVERS):
            d = self._random.uniform(1.0, 2.0, problem.n_contacts) / np.sqrt(rho)
            b = problem.b - (self.soft / rho)[:, None] * r
            error = np.zeros_like(b)
            error[:, 0] = -1.01 * max(0.0, float((-b[:, 0] / d).max())) * d
            ended = self.path(rho[:, None] * (error - b), error, PIVOTS * problem.n_contacts)
            if ended is None:
                continue
            r = ended[0]
            if exact := self.judged(r) or self.improve(starting_forces(problem, r), pivots):
                return exact
        return None

    def judged(self, forces: FloatArray) -> tuple[FloatArray, Residuals] | None:
        """The forces inside their cones and their residuals, if the law accepts them."""
        if not np.isfinite(forces).all():
            return None
        inside = starting_forces(self.problem, forces)
        residuals = measure(self.problem, self.problem.body_velocity(inside), inside, sliding="coulomb")
        if self.best is None or residuals.worst < self.best[1].worst:
            self.best = inside, residuals
        return (inside, residuals) if residuals.reached(self.tolerance) else None

    def _nearest_forces(self, r: FloatArray, status: IntArray) -> FloatArray | None:
        """Forces with these statuses that differ least from ``r``; None if the matrix cannot be factorised."""
        if not self.factorise(status):
            return None
        forces = self.inside(r, status)
        rest, pairs = self._correction(forces, status), list[tuple[FloatArray, FloatArray]]()
        for _ in range(REFINEMENTS):
            # Less those of the steps so far that together leave least: each of them leaves the same of what resists least.
            step = rest
            for change, cause in pairs:
                step = step - float((change * rest).sum()) * (change + cause)
            tried = self.inside(forces + step, status)
            left = self._correction(tried, status)
            if norm(left) >= norm(rest):
                break
            # Changes of the rest are kept at right angles, by Gram and Schmidt, and with each the steps that make it.
            new, cause = left - rest, step
            whole = norm(new)
            for change, other in pairs:
                part = float((change * new).sum())
                new, cause = new - part * change, cause - part * other
            if (size := norm(new)) > DEPENDENT * whole:
                pairs.append((new / size, cause / size))
            forces, rest = tried, left
        return self.inside(forces + rest, status)

    def _correction(self, forces: FloatArray, status: IntArray) -> FloatArray:
        """What a solution with the last factorisation takes off forces, on the edge of the cone to the last bit."""
        return -self.inside(self.change(self.velocity(forces)), status)

    def _follow(
        self, r: FloatArray, held: FloatArray, pivots: int, *, jitter: float = 0.0, to_first: bool = False
    ) -> tuple[FloatArray, IntArray] | None:
        """Forces and statuses at the end of the path from ``r``, with compliance that acts on their difference from ``held``."""
        rho = self.problem.rho[:, None]
        z = r - rho * self.velocity(r)
        z = z + jitter * float(np.abs(z).max()) * self._random.uniform(-1.0, 1.0, z.shape)
        return self.path(z, self.at(z, held).error, pivots, to_first=to_first)

    def path(
        self, z: FloatArray, error: FloatArray, pivots: int, *, to_first: bool = False
    ) -> tuple[FloatArray, IntArray] | None:
        """Forces and statuses at the end of the path from z, where F is ``error``; None if there is no end, or it takes too long.

        The path goes through z, and one of its two directions leads to a solution: with the sign of the determinant that F has where all
        contacts are open, and so on the path from nothing, t falls; with the other it rises first. The path may still be a loop, which
        ends where it began, or a ray. With ``to_first`` it ends where a status changes first.
        """
        problem, rho = self.problem, self.problem.rho[:, None]
        status = statuses(problem, z)
        first, begin, t, ahead = status.copy(), z, 1.0, -1.0
        contact = border = -1
        for pivot in range(pivots):
            if self.clock.over or not self.factorise(status):
                return None
            if pivot == 0:
                ahead = -self._matrix.sign()
            # dz/dt, where J dz/dt = error.
            dr = self.change(error)
            if self.soft.min() < REFINED_BELOW:
                dr = dr + self.change(self.remaining(error, dr))
            rate = dr + rho * self.remaining(error, dr)
            ahead, step, contact, border = next_kink(problem.mu, status, z, rate, ahead, contact, border)
            if ahead < 0.0 and step >= t:
                ended = self.inside(z - t * rate, status)
                return (ended, status) if np.isfinite(ended).all() else None
            round_trip = pivot > 0 and (t - 1.0) * (t + ahead * step - 1.0) <= 0.0 and np.array_equal(status, first)
            if t + ahead * step > FAR or (round_trip and _is_near(z + (1.0 - t) * rate, begin)):
                return None
            z, t = z + ahead * step * rate, t + ahead * step
            if border == 0:
                z[contact, 0] = 0.0
                closed = PLUS if z[contact, 1] > 0.0 or problem.mu[contact] == 0.0 else MINUS
                status[contact] = closed if status[contact] == OPEN else OPEN
            else:
                slip = PLUS if border == 1 else MINUS
                z[contact, 1] = SIDE[slip] * problem.mu[contact] * z[contact, 0]
                status[contact] = slip if status[contact] == STICK else STICK
            if to_first:
                return self.inside(z, status), status
        return None

    def factorise(self, status: IntArray) -> bool:
        """Factorise for `change` with these statuses; False if that is impossible."""
        self.count += 1
        closed = status != OPEN
        changed = np.flatnonzero((status != self._status) | (closed & (self.soft != self._made_for)))
        self._d[changed] = self._blocks(status, changed)
        self._status, self._made_for = status.copy(), self.soft
        if self.count == 1 or (closed & ~self._seen).any():
            self._matrix = self._analyse(closed)
            return self._matrix.factorise(self._d)
        return self._matrix.factorise(self._d, changed)

    def _analyse(self, closed: NDArray[np.bool_]) -> UnsymmetricMatrix:
        """The matrix of contacts some of which are closed for the first time."""
        if self._seen.any():
            # What one of them does, its neighbours may do next.
            bodies = self.problem.bodies
            there = np.zeros(self.problem.n_bodies + 1, dtype=np.bool_)
            there[bodies[closed & ~self._seen]] = True
            there[-1] = False  # where -1 represents no body
            closed = closed | there[bodies].any(axis=1)
        self._seen |= closed
        self._seen[:] |= self._seen.mean() > MOST_SEEN
        return UnsymmetricMatrix(self.problem, self._seen)

    def _blocks(self, status: IntArray, contacts: IntArray) -> FloatArray:
        """Change of the forces per change of the velocities of some contacts, shape (k, 2, 2)."""
        problem, status = self.problem, status[contacts]
        give = problem.compliance[contacts] + (self.soft[contacts] / problem.rho[contacts])[:, None]
        d = np.zeros((len(contacts), 2, 2))
        d[:, 0, 0] = (status != OPEN) / give[:, 0]
        d[:, 1, 0] = SIDE[status] * problem.mu[contacts] * d[:, 0, 0]
        d[:, 1, 1] = (status == STICK) / give[:, 1]
        return d

    def change(self, u: FloatArray) -> FloatArray:
        """Change ``dr`` of the forces that changes the velocities by ``u``: ``dr = D (u - H dv)`` where ``M dv = H' dr``."""
        matrix, bodies = self._matrix, self.problem.bodies
        load, dr = np.empty((self.problem.n_bodies, 3)), np.empty_like(u)
        load_of_velocities(bodies, matrix.rows, self._d, u, load)
        forces_of_velocities(bodies, matrix.rows, self._d, u, matrix.solve(load), dr)
        return dr

    def velocity(self, r: FloatArray) -> FloatArray:
        return self.problem.contact_velocity(self.problem.body_velocity(r), r)

    def at(self, z: FloatArray, held: FloatArray) -> LawPoint:
        """The law at ``z`` with the compliance on the change from the forces ``held``, shape (c, 2) each."""
        problem, status = self.problem, np.empty(len(z), dtype=np.int64)
        r, u, error = np.empty_like(z), np.empty_like(z), np.empty_like(z)
        load = (problem.force, problem.offset, problem.shear_0, problem.rho)
        size = law_error(
            problem.contacts, problem.inverse_mass, *load, SIDE, self.soft, z, held, status, r, u, error, self._v
        )
        return LawPoint(z, status, r, u, error, size)

    def remaining(self, u: FloatArray, dr: FloatArray) -> FloatArray:
        """What a change ``dr`` of the forces leaves of contact velocities ``u``, shape (c, 2) each."""
        problem, left = self.problem, np.empty_like(u)
        remaining_velocities(
            problem.contacts, problem.inverse_mass, self._nothing, problem.rho, self.soft, u, dr, self._v, left
        )
        return left

    def inside(self, z: FloatArray, status: IntArray) -> FloatArray:
        """``P(z)`` by the statuses."""
        p = np.where(status == OPEN, 0.0, z[:, 0])
        return np.column_stack([p, np.where(status == STICK, z[:, 1], SIDE[status] * self.problem.mu * p)])


def statuses(problem: ContactProblem, z: FloatArray) -> IntArray:
    """Status of each contact, shape (c,), by ``z = r - rho u``, shape (c, 2)."""
    status = np.empty(len(z), dtype=np.int64)
    statuses_at(problem.mu, z, status)
    return status


def norm(x: FloatArray) -> float:
    """Euclidean norm. NumPy's, and its least squares, take BLAS, whose threads cost more than a pivot where cores are busy."""
    return sqrt((x * x).sum())


def _is_steady(before: FloatArray, drift: FloatArray) -> bool:
    """Whether the second of two changes of the forces goes on as the first did, in direction and length."""
    old, new = norm(before), norm(drift)
    return bool(0.0 < PARALLEL * old <= new <= old / PARALLEL and (before * drift).sum() >= PARALLEL * old * new)


def _is_near(z: FloatArray, other: FloatArray) -> bool:
    """Whether they are the same but for round-off and what the compliance leaves of it."""
    return float(np.abs(z - other).max()) <= SAME * float(np.abs(other).max())
