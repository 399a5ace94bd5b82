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
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import TINY, ContactProblem
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, finite, numbers

Matrix = sp.csr_array | sp.csc_array | sp.coo_array | ArrayLike
ROUND_OFF = 16.0 * np.finfo(np.float64).eps
UNSYMMETRIC = 1e-3
"""Difference of a mass matrix from its transpose, of its largest entry: files of six digits have less."""
PARALLEL = 1e-12
"""Relative error of a Jacobian's entries up to which its rows are those of rigid bodies: some thousand roundings."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DelassusProblem:
    """Frictional contact of c contacts in d = 2 or 3 dimensions, ``u = W r + b``, under the laws of `ContactProblem`.

    Normal comes first in each ``r_k = (p, q)`` and ``u_k = (u_n, u_t)``: ``u_n > 0`` opens the contact, ``p >= 0`` presses, and
    friction opposes the slip, ``q . u_t <= 0``; q and u_t have one component in 2D and two in 3D, where ``|q| <= mu p`` is a circular
    cone. Units are the caller's, such that ``r . u`` is a work or a power: forces and velocities, impulses and velocities, forces and
    displacements. The directions of the tangents are the caller's, too.

    Parameters
    ----------
    w : sparse or dense matrix, shape (d c, d c)
        Delassus matrix W; rows and columns for normal and tangential unknowns of each contact in turn. Its shape decides d.
    b : array_like, shape (c, d)
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
        b, rows = numbers("b", self.b), self.w.shape[0] if sp.issparse(self.w) else len(np.atleast_2d(self.w))
        d = 3 if c and rows == 3 * c else 2
        if b.size != d * c:
            raise InvalidSceneError(
                f"b has shape {b.shape}; it must have shape ({c}, {d}): there are {c} contacts, one for each mu"
            )
        object.__setattr__(self, "b", finite("b", b.reshape(c, d), (c, d), most=LARGEST))
        object.__setattr__(self, "w", sparse("W", self.w, (d * c, d * c)))
        diagonal = self.w.diagonal()[::d]
        if c and not diagonal.min() > 0.0:
            k = int(np.argmin(diagonal))
            raise InvalidSceneError(
                f"W[{d * k}, {d * k}] = {diagonal[k]:g} is not allowed: contact {k} can neither open nor close unless it is > 0; "
                f"drop the contact"
            )

    @property
    def n_contacts(self) -> int:
        """Number of contacts, c."""
        return len(self.mu)

    @property
    def dimension(self) -> int:
        """Number of unknowns of a contact, d: 2 or 3."""
        return int(self.b.shape[1])

    @cached_property
    def blocks(self) -> FloatArray:
        """Diagonal blocks of W, shape (c, d, d); where W is not quite symmetric, neither are they."""
        d = self.dimension
        blocks = np.zeros((self.n_contacts, d, d))
        for i in range(d):
            for j in range(d):
                band = self.w.diagonal(j - i)
                blocks[:, i, j] = band[min(i, j) :: d][: self.n_contacts]
        return blocks

    @cached_property
    def rho(self) -> FloatArray:
        """1 / largest diagonal entry of each contact's block, shape (c,); of W_nn alone without friction."""
        diagonal = self.w.diagonal().reshape(-1, self.dimension)
        return np.asarray(1.0 / np.where(self.mu > 0.0, diagonal.max(axis=1, initial=0.0), diagonal[:, 0]))

    def velocity(self, r: FloatArray) -> FloatArray:
        """``u = W r + b``, shape (c, d)."""
        return np.asarray(self.w @ r.ravel()).reshape(self.b.shape) + self.b

    @classmethod
    def reduced(cls, m: Matrix, h: Matrix, f: ArrayLike, g: ArrayLike, mu: ArrayLike) -> DelassusProblem:
        """The problem in which the bodies of ``M v = f + H' r``, ``u = H v + g`` are eliminated: ``W = H M^-1 H'``, ``b = H M^-1 f + g``.

        Parameters
        ----------
        m, h : matrix, shapes (n, n) and (d c, n)
            Mass matrix, of any blocks, and Jacobian.
        f, g, mu : array_like, shapes (n,), (c, d) and (c,)

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
            return cls(w=sp.csr_array((rows.shape[0],) * 2), b=offset, mu=friction_of)
        columns = _solved(inverse.solve, mass, rows)
        b = np.asarray(rows @ inverse.solve(load)).reshape(offset.shape) + offset
        return cls(w=sp.csr_array(rows @ columns), b=b, mu=friction_of)


class Rigid(NamedTuple):
    """A problem of rigid bodies, and the ratio, shape (c, 2), of the forces that were asked for to those of this problem."""

    problem: ContactProblem
    scale: FloatArray


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
    if offset.shape[1] != 2:
        raise InvalidSceneError("these contacts are not of the plane")
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
    d = 3 if c and offset.size == 3 * c else 2
    if offset.size != d * c:
        raise InvalidSceneError(
            f"g has shape {offset.shape}; it must have shape ({c}, {d}): there are {c} contacts, one for each mu"
        )
    offset = finite("g", offset.reshape(c, d), (c, d), most=LARGEST)
    return (
        _positive(sparse("M", m, (n, n))),
        sparse("H", h, (d * c, n)),
        finite("f", load, (n,), most=LARGEST),
        offset,
        friction_of,
    )


def _positive(mass: sp.csr_array) -> sp.csr_array:
    """A mass matrix; raises `InvalidSceneError` if a diagonal entry is not > 0, or it is far from symmetric."""
    diagonal = mass.diagonal()
    if mass.shape[0] and not diagonal.min() > 0.0:
        i = int(np.argmin(diagonal))
        raise InvalidSceneError(f"M[{i}, {i}] = {diagonal[i]:g} is not allowed: every unknown needs a mass > 0")
    lost = float(abs(mass - mass.T).max()) if mass.nnz else 0.0
    if lost > UNSYMMETRIC * float(diagonal.max(initial=0.0)):
        raise InvalidSceneError(f"M is not symmetric: entries differ by up to {lost:g} from those across the diagonal")
    return mass


def _solved(solve: Callable[[FloatArray], FloatArray], mass: sp.csr_array, rows: sp.csr_array) -> sp.csc_array:
    """``M^-1 H'`` without its zeros, some columns at a time where M is not diagonal."""
    if not (mass - sp.diags_array(mass.diagonal())).count_nonzero():
        return sp.csc_array(sp.diags_array(1.0 / mass.diagonal()) @ rows.T)
    turned, pieces = sp.csc_array(rows.T), []
    for begin in range(0, turned.shape[1], 256):
        pieces.append(sp.csc_array(solve(turned[:, begin : begin + 256].toarray())))
    return sp.csc_array(sp.hstack(pieces)) if pieces else turned


def project(z: FloatArray, mu: FloatArray) -> FloatArray:
    """The nearest forces inside the cones ``|q| <= mu p``, shape (c, d) as ``z``."""
    side = np.linalg.norm(z[:, 1:], axis=1)
    foot = np.maximum(z[:, 0] + mu * side, 0.0) / (1.0 + mu * mu)
    inside = (side <= mu * z[:, 0]) & (z[:, 0] >= 0.0)
    along = z[:, 1:] / np.where(side > 0.0, side, 1.0)[:, None] * (mu * foot)[:, None]
    return np.where(inside[:, None], z, np.column_stack([foot, along]))


def natural_map(problem: DelassusProblem, r: FloatArray, *, coulomb: bool) -> float:
    """``|r - P(r - rho u*)|`` over the size of the forces, P `project`; ``u* = u``, with ``mu |u_t|`` added to u_n under Coulomb's law."""
    u = problem.velocity(r)
    if coulomb:
        u[:, 0] += problem.mu * np.linalg.norm(u[:, 1:], axis=1)
    rho = problem.rho[:, None]
    step = np.linalg.norm(r - project(r - rho * u, problem.mu))
    size = max(np.linalg.norm(r), np.linalg.norm(project(-rho * problem.b, problem.mu)))
    return float(step / size) if step else 0.0


def rounding_floor(problem: DelassusProblem, r: FloatArray) -> float:
    """`natural_map` that the rounding of u explains."""
    terms = np.asarray(abs(problem.w) @ np.abs(r.ravel())).reshape(r.shape) + np.abs(problem.b)
    size = max(float(np.linalg.norm(r)), TINY)
    return float(ROUND_OFF * np.linalg.norm(problem.rho[:, None] * terms) / size)
