"""The contact problem of one step, which can be saved, loaded and given to any solver; and how far a solution is from it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.archive import read_arrays, whole_file
from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd import problem_kernels as kernels
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, at_least, kind_of, numbers, real, short_repr

Sliding = Literal["associated", "coulomb"]
TINY = float(np.finfo(np.float64).tiny)
"""Smallest normal double."""
_FIELDS = ("mass", "force", "bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0")


@dataclass(frozen=True, kw_only=True)
class ContactProblem:
    """Frictional contact of b bodies through c contacts in two dimensions, as a convex program or with Coulomb friction.

    With velocities ``v`` (or displacements: the unit is the caller's), contact forces ``r = (p, q)`` and contact
    velocities ``u``::

        M v = f + H' r,      u = H v + g + C (r - (0, q0)),      |q| <= mu p

    and either the associated rule, ``r`` minimises ``1/2 r' W r + b' r`` over the cones, or Coulomb's law,
    ``0 <= u_n  complementary to  p >= 0`` and ``q`` opposing ``u_t`` (De Saxce 1992: the same optimality conditions with
    ``u_n + mu |u_t|`` in the place of ``u_n``). ``W = H M^-1 H' + C`` is the Delassus operator and
    ``b = H M^-1 f + g - C (0, q0)``.

    Parameters
    ----------
    mass : array_like, shape (b, 3)
        Diagonal of M for ``(x, y, rotation)`` of each body, > 0; ``inf`` blocks an unknown (its prescribed motion belongs
        to ``offset``).
    force : array_like, shape (b, 3)
        Load ``f``.
    bodies : array_like of int, shape (c, 2)
        Bodies i, j of each contact; -1 for a body whose motion is prescribed.
    normal : array_like, shape (c, 2)
        Unit normals from i to j.
    arms : array_like, shape (c, 4)
        Rotation columns ``(a_ni, a_nj, a_ti, a_tj)`` of the Jacobian (see `ninedisk.core.cd.problem_kernels.contact_velocity`);
        friction between two disks has ``(0, 0, R_i, R_j)``.
    offset : array_like, shape (c, 2)
        ``g``: normal and tangential part; in the displacement form the gap at the start and the obstacle's motion.
    mu : array_like, shape (c,)
        Friction coefficients, >= 0; with 0 the contact has no tangential unknown.
    compliance : array_like, shape (c, 2), optional
        Normal and tangential compliance, >= 0; 0 is the rigid contact.
    shear_0 : array_like, shape (c,), optional
        Shear forces ``q0`` at the start of the step; they matter with tangential compliance only.
    resolution : float
        Uncertainty of the offsets, in the unit of ``u``, >= 0, for instance the rounding of the coordinates that a gap is the
        difference of: no solution can be judged more finely.
    notes : mapping from str to str
        Anything that is to be kept with the saved problem, for instance the scene as JSON.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.
    """

    mass: FloatArray
    force: FloatArray
    bodies: NDArray[np.int32]
    normal: FloatArray
    arms: FloatArray
    offset: FloatArray
    mu: FloatArray
    compliance: FloatArray = None  # type: ignore[assignment]
    shear_0: FloatArray = None  # type: ignore[assignment]
    resolution: float = 0.0
    notes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        bodies = numbers("bodies", self.bodies)
        b, c = len(np.atleast_1d(numbers("mass", self.mass))), len(np.atleast_1d(bodies))
        shapes: dict[str, tuple[int, ...]] = {
            "mass": (b, 3),
            "force": (b, 3),
            "normal": (c, 2),
            "arms": (c, 4),
            "offset": (c, 2),
            "mu": (c,),
            "compliance": (c, 2),
            "shear_0": (c,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            absent = value is None and name in ("compliance", "shear_0")
            try:
                object.__setattr__(self, name, _array(name, np.zeros(shape) if absent else value, shape))
            except InvalidSceneError as error:
                raise InvalidSceneError(f"{error} (mass is of {b} bodies, bodies of {c} contacts)") from error
        object.__setattr__(self, "bodies", _body_rows(bodies, c, b))
        object.__setattr__(self, "resolution", at_least("resolution", self.resolution, 0.0))
        kind_of("notes", self.notes, Mapping)  # type: ignore[type-abstract]
        for key, text in self.notes.items():
            if not (isinstance(key, str) and isinstance(text, str)):
                raise InvalidSceneError(
                    f"notes[{short_repr(key)}] = {short_repr(text)} is not allowed: notes are strings by names"
                )
        self._check()

    def _check(self) -> None:
        if self.mass.size and not self.mass.min() >= TINY:
            body, axis = np.unravel_index(int(np.argmin(self.mass)), self.mass.shape)
            raise InvalidSceneError(
                f"mass[{body}, {axis}] = {self.mass[body, axis]:g} is not allowed: it must be > 0 (inf blocks an unknown), and at least "
                f"{TINY:g}, whose inverse is a finite number"
            )
        if self.n_contacts == 0:
            return
        length = np.hypot(self.normal[:, 0], self.normal[:, 1])
        if np.abs(length - 1.0).max() > 1e-12:
            k = int(np.argmax(np.abs(length - 1.0)))
            raise InvalidSceneError(f"normal[{k}] has the length {length[k]:.17g}; normals must have length 1")
        if self.mu.max() > LARGEST:
            k = int(np.argmax(self.mu))
            raise InvalidSceneError(f"mu[{k}] = {self.mu[k]:g} is not allowed: it must be at most {LARGEST:g}")
        for name, value in (("mu", self.mu), ("compliance", self.compliance)):
            if value.min() < 0.0:
                k = int(np.argmin(value if value.ndim == 1 else value.min(axis=1)))
                raise InvalidSceneError(f"{name}[{k}] = {value[k]} is not allowed: it must be >= 0")
        with np.errstate(over="ignore", invalid="ignore"):
            representable = np.isfinite(self.blocks).all() and np.isfinite(self.b).all()
        if not representable:
            raise InvalidSceneError(
                "the problem's numbers overflow: mass, force, arms, offset, compliance or shear_0 are too small or too large"
            )
        stuck = self.blocks[:, 0] <= 0.0
        if stuck.any():
            k = int(np.argmax(stuck))
            raise InvalidSceneError(
                f"contact {k} of bodies {tuple(self.bodies[k])} can neither open nor close (both motions are prescribed "
                f"along its normal and it is rigid): drop it, or give it compliance"
            )

    @property
    def n_bodies(self) -> int:
        """Number of bodies, b."""
        return int(self.mass.shape[0])

    @property
    def n_contacts(self) -> int:
        """Number of contacts, c."""
        return int(self.bodies.shape[0])

    @cached_property
    def inverse_mass(self) -> FloatArray:
        """``M^-1`` per unknown, shape (b, 3); 0 where the unknown is blocked."""
        return 1.0 / self.mass

    @cached_property
    def free(self) -> FloatArray:
        """1 for unknowns that are free, 0 for blocked ones, shape (b, 3)."""
        return np.isfinite(self.mass).astype(np.float64)

    @cached_property
    def blocks(self) -> FloatArray:
        """Diagonal blocks ``(W_nn, W_nt, W_tt)`` of the Delassus operator, shape (c, 3)."""
        blocks = np.empty((self.n_contacts, 3))
        kernels.delassus_blocks(self.bodies, self.normal, self.arms, self.inverse_mass, self.compliance, blocks)
        return blocks

    @cached_property
    def rho(self) -> FloatArray:
        """Scale [force/velocity] of each contact, shape (c,): 1 / largest diagonal entry of its Delassus block."""
        rho = np.empty(self.n_contacts)
        kernels.contact_scales(self.blocks, self.mu, rho)
        return rho

    @cached_property
    def b(self) -> FloatArray:
        """Contact velocities without contact forces, ``b = H M^-1 f + g - C (0, q0)``, shape (c, 2)."""
        return self.contact_velocity(self.body_velocity(np.zeros((self.n_contacts, 2))), np.zeros((self.n_contacts, 2)))

    @cached_property
    def contacts(self) -> kernels.Contacts:
        """The contacts as the kernels read them."""
        return kernels.Contacts(self.bodies, self.normal, self.arms, self.mu, self.compliance)

    def body_velocity(self, r: FloatArray) -> FloatArray:
        """``v = M^-1 (f + H' r)``, shape (b, 3), of the contact forces ``r``, shape (c, 2)."""
        r = _of_shape("r", r, (self.n_contacts, 2))
        v = np.empty((self.n_bodies, 3))
        kernels.body_velocities(self.bodies, self.normal, self.arms, self.inverse_mass, self.force, r, v)
        return v

    def contact_velocity(self, v: FloatArray, r: FloatArray) -> FloatArray:
        """``u = H v + g + C (r - (0, q0))``, shape (c, 2)."""
        v, r = _of_shape("v", v, (self.n_bodies, 3)), _of_shape("r", r, (self.n_contacts, 2))
        u = np.empty((self.n_contacts, 2))
        kernels.contact_velocities(self.bodies, self.normal, self.arms, v, u)
        u += self.offset + self.compliance * r
        u[:, 1] -= self.compliance[:, 1] * self.shear_0
        return u

    def objective(self, r: FloatArray) -> float:
        """Value ``1/2 r' W r + b' r`` of the convex program."""
        dv = self.body_velocity(r) - self.body_velocity(np.zeros_like(r))
        mass = np.where(self.free > 0.0, self.mass, 0.0)
        quadratic = float((mass * dv * dv).sum() + (self.compliance * r * r).sum())
        return 0.5 * quadratic + float((self.b * r).sum())

    def rows(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """Normal and tangential row of each contact over the unknowns of its bodies, shape (c, 2, 6), and these unknowns, shape (c, 6).

        Unknowns that are not free have zeros, and those of a prescribed body the number of some unknown.
        """
        n, a = self.normal, self.arms
        normal_row = np.column_stack([-n[:, 0], -n[:, 1], a[:, 0], n[:, 0], n[:, 1], a[:, 1]])
        shear_row = np.column_stack([-n[:, 1], n[:, 0], a[:, 2], n[:, 1], -n[:, 0], a[:, 3]])
        body = np.repeat(np.maximum(self.bodies, 0).astype(np.int64), 3, axis=1)
        unknowns = 3 * body + np.tile(np.arange(3), 2)
        free = np.repeat(self.bodies >= 0, 3, axis=1) * self.free.ravel()[unknowns]
        return np.stack([normal_row, shear_row], axis=1) * free[:, None, :], unknowns

    def jacobian(self) -> sp.csr_array:
        """``H``, shape (2 c, 3 b), on the free unknowns; rows ``2 k`` normal, ``2 k + 1`` tangential."""
        data, unknowns = self.rows()
        columns = np.repeat(unknowns[:, None, :], 2, axis=1)
        rows = np.broadcast_to(np.arange(2 * self.n_contacts).reshape(-1, 2, 1), data.shape)
        shape, held = (2 * self.n_contacts, 3 * self.n_bodies), data != 0.0
        return sp.csr_array((data[held], (rows[held], columns[held])), shape=shape)

    def delassus(self) -> sp.csr_array:
        """``W = H M^-1 H' + C``, shape (2 c, 2 c), as a sparse matrix."""
        h = self.jacobian()
        w = h @ sp.diags_array(self.inverse_mass.ravel()) @ h.T + sp.diags_array(self.compliance.ravel())
        return sp.csr_array(w)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the problem to an ``.npz`` file: the fields of this class, and ``(W, q, mu)`` for other codes.

        ``W_data, W_indices, W_indptr`` are the Delassus matrix in compressed sparse rows and ``q`` is ``b`` flattened,
        in Siconos' notation. The file appears whole or not at all.

        Raises
        ------
        UnwritableFileError
            If it cannot be written.
        """
        with whole_file(path) as stream:
            np.savez_compressed(stream, **self.arrays())  # type: ignore[arg-type]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What `save` writes, by name."""
        w = self.delassus()
        arrays: dict[str, NDArray[Any]] = {name: getattr(self, name) for name in _FIELDS}
        arrays |= {"W_data": w.data, "W_indices": w.indices, "W_indptr": w.indptr, "q": self.b.ravel()}
        arrays["resolution"] = np.array(self.resolution)
        return arrays | {f"note_{key}": np.array(text) for key, text in self.notes.items()}

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ContactProblem:
        """Read what `save` wrote.

        Raises
        ------
        InvalidSceneError
            If the file holds no contact problem.
        """
        data = read_arrays(path, "contact problem")
        missing = [name for name in _FIELDS if name not in data]
        if missing:
            raise InvalidSceneError(f"{os.fspath(path)} holds no contact problem: it lacks {', '.join(missing)}")
        notes = {key[5:]: str(array) for key, array in data.items() if key.startswith("note_")}
        return cls(**{name: data[name] for name in _FIELDS}, resolution=real(data.get("resolution", 0.0)), notes=notes)


def _body_rows(bodies: FloatArray, c: int, b: int) -> NDArray[np.int32]:
    """Read-only body numbers of c contacts; raises `InvalidSceneError` unless each joins two of the b bodies."""
    pairs = bodies.reshape(c, 2) if bodies.size == 0 else bodies
    if pairs.shape != (c, 2):
        raise InvalidSceneError(f"bodies has shape {pairs.shape}; it must have shape ({c}, 2)")
    odd = ~((pairs == np.floor(pairs)) & (pairs >= -1) & (pairs < b))
    if odd.any():
        k = int(np.argmax(odd.any(axis=1)))
        raise InvalidSceneError(
            f"bodies[{k}] = ({pairs[k, 0]:g}, {pairs[k, 1]:g}) is not allowed: bodies are numbered 0..{b - 1}; -1 is prescribed"
        )
    own = (pairs[:, 0] == pairs[:, 1]) & (pairs[:, 0] >= 0)
    if own.any():
        k = int(np.argmax(own))
        raise InvalidSceneError(
            f"bodies[{k}] = ({pairs[k, 0]:g}, {pairs[k, 1]:g}) is not allowed: a body has no contact with itself"
        )
    rows = pairs.astype(np.int32)
    rows.setflags(write=False)
    return rows


def _of_shape(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """``value`` as the kernels read it, who do not look for the ends of arrays; raises `InvalidSceneError` if its shape is another."""
    array = value if type(value) is np.ndarray and value.dtype == np.float64 else numbers(name, value)
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    return array


def _array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    array = numbers(name, value)
    if array.size == 0 == np.prod(shape):
        array = array.reshape(shape)
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    bad = np.isnan(array) if name == "mass" else ~np.isfinite(array)
    if bad.any():
        raise InvalidSceneError(f"{name} must be finite; it holds {array[bad][0]}")
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Residuals:
    """Figures of merit of a pair ``(v, r)``; all are relative and independent of the units.

    Let ``u = H v + g + C (r - (0, q0))`` (for Coulomb with ``mu |u_t|`` added to ``u_n``), ``rho_k`` the inverse of the
    largest diagonal entry of contact k's Delassus block, P the projection on the friction cones and
    ``E = (|r' W r| + |b' r|) / 2``, which equals ``r' W r`` at the solution: twice the optimum's absolute value.

    Attributes
    ----------
    natural_map : float
        ``|r - P(r - rho u)| / max(|r|, |P(-rho b)|)`` in the Euclidean norm over all contacts.
    complementarity : float
        ``sum_k |r_k . u_k| / E``.
    duality_gap : float
        ``(|r . u| + p_max sum_k max(0, mu |u_t| - u_n) + 1/2 |M v - f - H' r|^2_{M^-1}) / E``. For the convex program
        this bounds the relative error of the objective, provided that no normal force of the solution exceeds
        ``p_max``, the largest one found; u need not be feasible. For Coulomb it is the same figure of the
        program that holds ``mu |u_t|`` fixed.
    stationarity : float
        ``|M v - f - H' r|_{M^-1} / sqrt(E)``: error of the bodies' balance of momentum.
    floor_map, floor_gap : float
        Values of ``natural_map`` and ``duality_gap`` that the round-off error of v and of evaluating u alone explains; where the offsets'
        resolution explains more than `UNRESOLVED` of a problem, that too.
    """

    natural_map: float
    complementarity: float
    duality_gap: float
    stationarity: float
    floor_map: float
    floor_gap: float

    def reached(self, tolerance: float) -> bool:
        """Whether natural map and duality gap are below ``tolerance`` or at the floor of round-off."""
        return self.natural_map <= max(tolerance, self.floor_map) and self.duality_gap <= max(tolerance, self.floor_gap)

    @property
    def worst(self) -> float:
        """The larger one of natural map and duality gap."""
        return max(self.natural_map, self.duality_gap)


def measure(problem: ContactProblem, v: FloatArray, r: FloatArray, *, sliding: Sliding = "associated") -> Residuals:
    """Residuals of the velocities ``v``, shape (b, 3), and contact forces ``r``, shape (c, 2), inside the cones."""
    sums, figures = np.empty(kernels.SUMS), np.empty(6)
    load = (problem.offset, problem.shear_0, problem.rho, problem.b)
    kernels.sum_residuals(problem.contacts, *load, v, r, sliding == "coulomb", sums)
    kernels.sum_kinetic(problem.inverse_mass, v, problem.body_velocity(r), sums)
    kernels.figures_of(sums, problem.n_contacts, problem.resolution, figures)
    return Residuals(*figures.tolist())
