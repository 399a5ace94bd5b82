"""A contact problem without bodies: the Delassus matrix, the velocities without forces and the friction coefficients are all there is.

Other codes hand their problems out in this form. Where they give mass matrix and Jacobian as well, and these are those of rigid bodies
in the plane, `bodies_of` finds the `ContactProblem` that all of the core's solvers take.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import splu

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd import delassus_kernels as kernels
from ninedisk.core.cd.problem import TINY, ContactProblem, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.outcome import Stopwatch
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, finite, numbers

Matrix = sp.csr_array | sp.csc_array | sp.coo_array | ArrayLike
ROUND_OFF = 16.0 * np.finfo(np.float64).eps
FIRST_SWEEPS, MOST_SWEEPS = 50, 2_000_000
NEWTON_STEPS = 60
"""Changes of statuses after a round of sweeps, at most."""
PATIENCE = 8
"""Changes of statuses that come no nearer, after which sweeps do."""
PROXIMAL = 1e-9
"""Part of the diagonal that is added to a system of statuses, whose forces need not be unique; refinement takes it out again."""
REFINEMENTS = 4
PARALLEL = 1e-12
"""Relative error of a Jacobian's entries up to which its rows are those of rigid bodies: some thousand roundings."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DelassusProblem:
    """Frictional contact of c contacts, ``u = W r + b``, under the laws of `ContactProblem`.

    Normal comes first in each pair ``r_k = (p, q)`` and ``u_k = (u_n, u_t)``: ``u_n > 0`` opens the contact, ``p >= 0`` presses, and
    friction opposes the slip, ``q u_t <= 0``. Units are the caller's, such that ``r . u`` is a work or a power: forces and
    velocities, impulses and velocities, forces and displacements. The tangent's direction is the caller's, too.

    Parameters
    ----------
    w : sparse or dense matrix, shape (2 c, 2 c)
        Delassus matrix W; a row and column for normal and tangential unknown of each contact in turn.
    b : array_like, shape (c, 2)
        Contact velocities without contact forces; Siconos and FCLIB call them q.
    mu : array_like, shape (c,)
        Friction coefficients, >= 0.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.
    """

    w: sp.csr_array
    b: FloatArray
    mu: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "mu", friction("mu", self.mu))
        c = len(self.mu)
        b = numbers("b", self.b)
        if b.size != 2 * c:
            raise InvalidSceneError(f"b has shape {b.shape}; it must have shape ({c}, 2): mu tells of {c} contacts")
        object.__setattr__(self, "b", finite("b", b.reshape(c, 2), (c, 2), most=LARGEST))
        object.__setattr__(self, "w", sparse("W", self.w, (2 * c, 2 * c)))
        diagonal = self.blocks[:, 0]
        if c and not diagonal.min() > 0.0:
            k = int(np.argmin(diagonal))
            raise InvalidSceneError(
                f"W[{2 * k}, {2 * k}] = {diagonal[k]:g} is not allowed: contact {k} can neither open nor close unless it is > 0; "
                f"drop the contact"
            )

    @property
    def n_contacts(self) -> int:
        """Number of contacts, c."""
        return len(self.mu)

    @cached_property
    def blocks(self) -> FloatArray:
        """``(W_nn, W_nt, W_tt)`` of each contact, shape (c, 3); the mean of both where W is not quite symmetric."""
        diagonal, above, below = self.w.diagonal(), self.w.diagonal(1), self.w.diagonal(-1)
        return np.column_stack([diagonal[::2], 0.5 * (above[::2] + below[::2]), diagonal[1::2]])

    @cached_property
    def rho(self) -> FloatArray:
        """1 / largest diagonal entry of each contact's block, shape (c,); of W_nn alone without friction."""
        return 1.0 / np.where(self.mu > 0.0, np.maximum(self.blocks[:, 0], self.blocks[:, 2]), self.blocks[:, 0])

    def velocity(self, r: FloatArray) -> FloatArray:
        """``u = W r + b``, shape (c, 2)."""
        return np.asarray(self.w @ r.ravel()).reshape(-1, 2) + self.b

    @classmethod
    def reduced(cls, m: Matrix, h: Matrix, f: ArrayLike, g: ArrayLike, mu: ArrayLike) -> DelassusProblem:
        """The problem in which the bodies of ``M v = f + H' r``, ``u = H v + g`` are eliminated: ``W = H M^-1 H'``, ``b = H M^-1 f + g``.

        Parameters
        ----------
        m, h : matrix, shapes (n, n) and (2 c, n)
            Mass matrix, of any blocks, and Jacobian.
        f, g, mu : array_like, shapes (n,), (c, 2) and (c,)

        Raises
        ------
        InvalidSceneError
            If a shape or value is not allowed, or M is singular.
        """
        mass, rows, load, offset, friction_of = _checked(m, h, f, g, mu)
        try:
            # A factorisation without pivots off the diagonal keeps a block diagonal one; M is positive definite.
            inverse = splu(sp.csc_matrix(mass), diag_pivot_thresh=0.0) if mass.shape[0] else None
        except RuntimeError as error:
            raise InvalidSceneError("M is singular: every unknown needs a mass > 0") from error
        if inverse is None:
            return cls(w=sp.csr_array((2 * len(friction_of),) * 2), b=offset, mu=friction_of)
        columns = _solved(inverse.solve, mass, rows)
        b = np.asarray(rows @ inverse.solve(load)).reshape(-1, 2) + offset
        return cls(w=sp.csr_array(rows @ columns), b=b, mu=friction_of)


class MatrixSolution(NamedTuple):
    """Best forces ``r`` that were found, shape (c, 2), their natural map, sweeps and changes of statuses, and the seconds it took."""

    r: FloatArray
    natural_map: float
    iterations: int
    seconds: float


class Rigid(NamedTuple):
    """A problem of rigid bodies, and the ratio, shape (c, 2), of the forces that were asked for to those of this problem."""

    problem: ContactProblem
    scale: FloatArray


def solve_matrix(problem: DelassusProblem, options: SolverOptions, *, sliding: Sliding) -> MatrixSolution:
    """Gauss-Seidel until the statuses of the contacts are those of a solution, whose linear system is then solved.

    In each round the sweeps double, and take no less time than what follows: Newton's method on the nonsmooth equations, which begins
    with the statuses of their forces and is a change of statuses at a time, each with a factorisation. It ends at the tolerance, or at
    the round-off of evaluating u, at the limits of time and iterations, with the best forces found: whether they are a solution is for
    the caller to judge.
    """
    clock, coulomb = Stopwatch(options.time_limit), sliding == "coulomb"
    limit = options.max_iterations or MOST_SWEEPS
    w, blocks = problem.w, np.ascontiguousarray(problem.blocks)
    pointers, columns = w.indptr.astype(np.int32), w.indices.astype(np.int32)
    b, r = problem.b.ravel().copy(), np.zeros(2 * problem.n_contacts)
    best, done, changes, newton = np.zeros((problem.n_contacts, 2)), 0, 0, 0.0
    least = _natural_map(problem, best, coulomb)
    while least > options.tolerance and done < limit and not clock.over:
        begin, last = clock.seconds, min(2 * done + FIRST_SWEEPS, limit)
        while done < limit and not clock.over and (done < last or clock.seconds - begin < newton):
            count = min(FIRST_SWEEPS, limit - done)
            kernels.sweep_matrix(pointers, columns, w.data, b, problem.mu, blocks, coulomb, count, r)
            done += count
        begin, swept = clock.seconds, r.reshape(-1, 2).copy()
        settled, steps = _newton(problem, swept, coulomb, options.tolerance, clock)
        newton, changes = clock.seconds - begin, changes + steps
        for forces in (swept, settled):
            error = _natural_map(problem, forces, coulomb)
            if error < least:
                best, least = forces, error
        r[:] = best.ravel()
        if least <= _floor(problem, best):
            break
    return MatrixSolution(best, least, done + changes, clock.seconds)


def bodies_of(m: Matrix, h: Matrix, f: ArrayLike, g: ArrayLike, mu: ArrayLike) -> Rigid:
    """The rigid bodies in the plane that mass matrix and Jacobian are of: ``M v = f + H' r``, ``u = H v + g``.

    M must be diagonal, and three unknowns in a row those of a body: x, y, rotation. A contact may touch two of them, with ``-l n``
    and ``l n`` as entries of its normal row and these turned by a right angle, to either side, in its tangential row.

    Parameters
    ----------
    m, h : matrix, shapes (3 b, 3 b) and (2 c, 3 b)
    f, g, mu : array_like, shapes (3 b,), (c, 2) and (c,)

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed, or these are no such bodies; `DelassusProblem.reduced` takes them all the same.
    """
    mass, rows, load, offset, friction_of = _checked(m, h, f, g, mu)
    n, c = mass.shape[0], len(friction_of)
    if n % 3 or (mass - sp.diags_array(mass.diagonal())).count_nonzero():
        raise InvalidSceneError("M is not diagonal with three entries for each body")
    bodies, normal, arms, length = np.full((c, 2), -1), np.empty((c, 2)), np.zeros((c, 4)), np.empty((c, 2))
    for k in range(c):
        ends = rows.indptr[2 * k : 2 * k + 3].tolist()
        columns, values = rows.indices[ends[0] : ends[2]], rows.data[ends[0] : ends[2]]
        touched = np.unique(columns[values != 0.0] // 3)
        if not 1 <= len(touched) <= 2:
            raise InvalidSceneError(f"contact {k} touches {len(touched)} bodies; one or two can be")
        parts = np.zeros((len(touched), 2, 3))  # body, row, unknown
        held, of_row = values != 0.0, np.arange(ends[0], ends[2]) >= ends[1]
        parts[np.searchsorted(touched, columns[held] // 3), of_row[held].astype(int), columns[held] % 3] = values[held]
        size = float(np.hypot(*parts[0, 0, :2]))
        turned = np.array([-parts[0, 0, 1], parts[0, 0, 0]])
        side = -1.0 if turned @ parts[0, 1, :2] > 0.0 else 1.0
        wrong = [parts[0, 1, :2] + side * turned, *(parts[1:, :, :2] + parts[:1, :, :2])]
        if not size > TINY or max(float(np.abs(each).max()) for each in wrong) > PARALLEL * size:
            raise InvalidSceneError(f"the rows of contact {k} are not those of rigid bodies in the plane")
        bodies[k, : len(touched)], normal[k], length[k] = touched, -parts[0, 0, :2] / size, (size, side * size)
        arms[k, : len(touched)], arms[k, 2 : 2 + len(touched)] = parts[:, 0, 2] / size, side * parts[:, 1, 2] / size
    problem = ContactProblem(
        mass=mass.diagonal().reshape(-1, 3),
        force=load.reshape(-1, 3),
        bodies=bodies,
        normal=normal,
        arms=arms,
        offset=offset / length,
        mu=friction_of,
    )
    return Rigid(problem, 1.0 / length)


def friction(name: str, value: ArrayLike) -> FloatArray:
    """Friction coefficients, shape (c,); raises `InvalidSceneError` unless all lie in [0, 1e150]."""
    mu = np.atleast_1d(numbers(name, value))
    mu = finite(name, mu, (mu.size,), most=LARGEST)
    if mu.size and mu.min() < 0.0:
        raise InvalidSceneError(f"{name}[{int(np.argmin(mu))}] = {mu.min():g} is not allowed: it must be >= 0")
    return mu


def sparse(name: str, value: Matrix, shape: tuple[int, int]) -> sp.csr_array:
    """A matrix in compressed rows, in order, none twice; raises `InvalidSceneError` if its shape or a value is not allowed."""
    given: Any = value if sp.issparse(value) else np.atleast_2d(numbers(name, value))
    matrix: Any = sp.csr_array(given, dtype=np.float64)
    if matrix.shape != shape:
        raise InvalidSceneError(f"{name} has shape {matrix.shape}; it must have shape {shape}")
    matrix.sum_duplicates()
    if not (np.abs(matrix.data) <= LARGEST).all():
        bad = matrix.data[~(np.abs(matrix.data) <= LARGEST)][0]
        raise InvalidSceneError(f"{name} must be finite and at most {LARGEST:g} in size; it holds {bad:g}")
    return cast(sp.csr_array, matrix)


def _checked(
    m: Matrix, h: Matrix, f: ArrayLike, g: ArrayLike, mu: ArrayLike
) -> tuple[sp.csr_array, sp.csr_array, FloatArray, FloatArray, FloatArray]:
    load, friction_of = np.atleast_1d(numbers("f", f)), friction("mu", mu)
    n, c = load.size, len(friction_of)
    offset = numbers("g", g)
    if offset.size != 2 * c:
        raise InvalidSceneError(f"g has shape {offset.shape}; it must have shape ({c}, 2): mu tells of {c} contacts")
    offset = finite("g", offset.reshape(c, 2), (c, 2), most=LARGEST)
    return (
        sparse("M", m, (n, n)),
        sparse("H", h, (2 * c, n)),
        finite("f", load, (n,), most=LARGEST),
        offset,
        friction_of,
    )


def _solved(solve: Callable[[FloatArray], FloatArray], mass: sp.csr_array, rows: sp.csr_array) -> sp.csc_array:
    """``M^-1 H'`` without its zeros, some columns at a time where M is not diagonal."""
    if not (mass - sp.diags_array(mass.diagonal())).count_nonzero():
        return sp.csc_array(sp.diags_array(1.0 / mass.diagonal()) @ rows.T)
    turned, pieces = sp.csc_array(rows.T), []
    for begin in range(0, turned.shape[1], 256):
        pieces.append(sp.csc_array(solve(turned[:, begin : begin + 256].toarray())))
    return sp.csc_array(sp.hstack(pieces)) if pieces else turned


def _project(z: FloatArray, mu: FloatArray) -> FloatArray:
    """The nearest forces inside the cones."""
    side = np.abs(z[:, 1])
    foot = np.maximum(z[:, 0] + mu * side, 0.0) / (1.0 + mu * mu)
    inside = (side <= mu * z[:, 0]) & (z[:, 0] >= 0.0)
    return np.where(inside[:, None], z, np.column_stack([foot, np.sign(z[:, 1]) * mu * foot]))


def _natural_map(problem: DelassusProblem, r: FloatArray, coulomb: bool) -> float:
    """As `Residuals.natural_map` has it."""
    u = problem.velocity(r)
    if coulomb:
        u[:, 0] += problem.mu * np.abs(u[:, 1])
    rho = problem.rho[:, None]
    step = np.linalg.norm(r - _project(r - rho * u, problem.mu))
    size = max(np.linalg.norm(r), np.linalg.norm(_project(-rho * problem.b, problem.mu)))
    return float(step / size) if step else 0.0


def _floor(problem: DelassusProblem, r: FloatArray) -> float:
    """Natural map that the rounding of u explains."""
    terms = np.asarray(abs(problem.w) @ np.abs(r.ravel())).reshape(-1, 2) + np.abs(problem.b)
    size = max(float(np.linalg.norm(r)), TINY)
    return float(ROUND_OFF * np.linalg.norm(problem.rho[:, None] * terms) / size)


def _newton(
    problem: DelassusProblem, start: FloatArray, coulomb: bool, tolerance: float, clock: Stopwatch
) -> tuple[FloatArray, int]:
    """The best forces of Newton's method from ``start``, inside the cones, and the number of its steps.

    With the statuses of ``z = r - rho u`` the unknowns are p and q of a contact that sticks, p of one that slips; the equations u = 0,
    or ``u_n = 0`` under Coulomb's law, ``u_n + s mu u_t = 0`` under the associated rule, s the sign of q.
    """
    mu, rho, c = problem.mu, problem.rho, problem.n_contacts
    r, best, least, at, seen = start, start, np.inf, 0, set[bytes]()
    for step in range(NEWTON_STEPS):
        z = r - rho[:, None] * problem.velocity(r)
        status = _statuses(z, mu, coulomb)
        if status.tobytes() in seen or step - at > PATIENCE or clock.over:
            return best, step
        seen.add(status.tobytes())
        closed, stick = np.flatnonzero(status), np.flatnonzero(status == 2)
        m = len(closed)
        slope = np.where(status == 2, 0.0, status * mu)[closed]
        rows = np.concatenate([2 * closed, 2 * closed + 1, 2 * stick + 1])
        columns = np.concatenate([np.arange(m), np.arange(m), m + np.arange(len(stick))])
        shape = (2 * c, m + len(stick))
        d = sp.csc_array((np.concatenate([np.ones(m), slope, np.ones(len(stick))]), (rows, columns)), shape=shape)
        flat = np.concatenate([np.ones(m), np.zeros(m) if coulomb else slope, np.ones(len(stick))])
        t = sp.csr_array(sp.csc_array((flat, (rows, columns)), shape=shape).T)
        matrix, right = sp.csc_array(t @ problem.w @ d), -(t @ problem.b.ravel())
        x = np.concatenate([r[closed, 0], r[stick, 1]])
        shift = PROXIMAL / rho[np.concatenate([closed, stick])]
        try:
            factors = splu(
                sp.csc_matrix(matrix + sp.diags_array(shift)),
                permc_spec="MMD_AT_PLUS_A",
                options={"SymmetricMode": True},
            )
            for _ in range(REFINEMENTS):
                x = x + factors.solve(right - matrix @ x)
        except (RuntimeError, MemoryError):
            return best, step
        if not np.isfinite(x).all():
            return best, step
        r = np.asarray(d @ x).reshape(-1, 2)
        inside = _project(r, mu)
        error = _natural_map(problem, inside, coulomb)
        if error < least:
            best, least, at = inside, error, step
        if least <= tolerance:
            return best, step + 1
    return best, NEWTON_STEPS


def _statuses(z: FloatArray, mu: FloatArray, coulomb: bool) -> NDArray[np.int8]:
    """0 open, 2 sticks, 1 and -1 slip with q = mu p and q = -mu p, shape (c,)."""
    side = np.where(z[:, 1] < 0.0, -1, 1)
    inside = (np.abs(z[:, 1]) <= mu * z[:, 0]) & (mu > 0.0)
    is_open = z[:, 0] <= 0.0 if coulomb else z[:, 0] + mu * np.abs(z[:, 1]) <= 0.0
    return np.where(is_open, 0, np.where(inside, 2, side)).astype(np.int8)
