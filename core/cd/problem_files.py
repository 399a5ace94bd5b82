"""Contact problems in files: our own ``.npz``, Siconos' text (fc2d, gfc2d, fc3d, gfc3d) and FCLIB's HDF5, distinguished by their content.

All of them have the normal before the tangential unknown, ``u_n > 0`` opening and ``p >= 0`` pressing, as `ContactProblem` does.
FCLIB and Siconos write ``u = W r + q`` (local, fc2d, fc3d) or ``M v = f + H r``, ``u = H' v + w`` (global, gfc2d, gfc3d): their H is the
transpose of ours, their q and w are our b and g. They leave units and the tangent's direction to the author; Siconos turns it the
other way than we do.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.archive import read_arrays, whole_file
from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.delassus import DelassusProblem, bodies_of, friction, sparse
from ninedisk.core.cd.problem import TINY, ContactProblem
from ninedisk.core.cd.problem_text import TextProblem, parse, reduced_text, text_of
from ninedisk.core.errors import CoreError, InvalidSceneError
from ninedisk.core.validate import finite, short_repr

Form = Literal["npz", "fc2d", "fc3d", "fclib"]
Problem = ContactProblem | DelassusProblem
HDF5 = b"\x89HDF\r\n\x1a\n"
INSTALL = "HDF5 files need h5py, which is not installed: pip install 'ninedisk[fclib]'"
MOST_BYTES = 2**33
_FIELDS = ("mass", "force", "bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0")


class MissingH5pyError(CoreError):
    """An HDF5 file is asked for, and h5py is not installed."""


class Reduced(NamedTuple):
    """``u = W r + q``, shapes (2 c, 2 c), (2 c,) and (c,)."""

    w: sp.csr_array
    q: FloatArray
    mu: FloatArray


class Bodies(NamedTuple):
    """``M v = f + H r``, ``u = H' v + w``, shapes (n, n), (n, 2 c), (n,), (2 c,) and (c,)."""

    m: sp.csr_array
    h: sp.csr_array
    f: FloatArray
    w: FloatArray
    mu: FloatArray


class Answer(NamedTuple):
    """Forces, contact velocities, shape (2 c,), and velocities of bodies or None, in the signs and units of a file."""

    r: FloatArray
    u: FloatArray
    v: FloatArray | None = None


@dataclass(frozen=True, kw_only=True)
class ProblemFile:
    """What a file holds.

    Attributes
    ----------
    form : {"npz", "fc2d", "fc3d", "fclib"}
    problem : ContactProblem or DelassusProblem
        With bodies, where the file has any that are rigid in the plane.
    scale : ndarray, shape (c, d)
        Forces of the file over those of ``problem``: another direction of the tangent, rows that are not of unit length.
    matrices : Reduced or Bodies or None
        The problem as other codes' files state it; None in our own.
    answer : Answer or None
        The solution in the file, if there is one.
    """

    form: Form
    problem: Problem
    scale: FloatArray
    matrices: Reduced | Bodies | None
    answer: Answer | None
    source: TextProblem | bytes | None = None

    def answer_of(self, r: FloatArray, v: FloatArray | None = None) -> Answer:
        """The solution that forces ``r``, shape (c, d), of `problem` and the velocities v of its bodies are, as the file would state it."""
        forces = (self.scale * r).ravel()
        if isinstance(self.matrices, Bodies):
            from scipy.sparse.linalg import spsolve

            m, h, f, w, _ = self.matrices
            load = f + h @ forces
            diagonal = not (m - sp.diags_array(m.diagonal())).count_nonzero()
            motion = load / m.diagonal() if diagonal else np.atleast_1d(spsolve(sp.csc_matrix(m), load))
            return Answer(forces, h.T @ motion + w, motion)
        if isinstance(self.matrices, Reduced):
            return Answer(forces, self.matrices.w @ forces + self.matrices.q)
        if isinstance(self.problem, DelassusProblem):
            return Answer(forces, self.problem.velocity(r).ravel())
        motion = self.problem.body_velocity(r) if v is None else v
        return Answer(forces, self.problem.contact_velocity(motion, r).ravel(), motion.ravel())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file again, in its form, with `answer`: where nothing has changed, the same bytes.

        Raises
        ------
        UnwritableFileError, MissingH5pyError
        """
        if self.form == "npz":
            with whole_file(path) as stream:
                _write_npz(stream, self.problem, self.answer)
            return
        r, u, v = (None, None, None) if self.answer is None else self.answer
        if isinstance(self.source, TextProblem):
            with whole_file(path) as stream:
                stream.write(text_of(replace(self.source, r=r, u=u)).encode())
            return
        assert isinstance(self.source, bytes)
        content = self.source
        if self.answer is not None:
            buffer = io.BytesIO(self.source)
            with _h5py().File(buffer, "r+") as file:
                if "solution" in file:
                    del file["solution"]
                _write_group(file, "solution", {"v": v, "u": u, "r": r})
            content = buffer.getvalue()
        with whole_file(path) as stream:
            stream.write(content)


def read_problem(path: str | os.PathLike[str]) -> ProblemFile:
    """The problem of a file, whatever its form.

    Raises
    ------
    InvalidSceneError
        If the file is missing or damaged, or holds something else.
    MissingH5pyError
    """
    try:
        with open(path, "rb") as stream:
            head = stream.read(len(HDF5))
            content = b"" if head.startswith(b"PK") else head + stream.read()
    except (OSError, TypeError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InvalidSceneError(
            f"{short_repr(path)} cannot be read ({why}): give a file with a contact problem"
        ) from error
    try:
        if head.startswith(b"PK"):
            return _read_npz(path)
        return _read_fclib(content) if head == HDF5 else _read_text(content)
    except MissingH5pyError:
        raise
    except CoreError as error:
        raise InvalidSceneError(f"{os.fspath(path)} holds no contact problem that can be solved: {error}") from error


def write_problem(path: str | os.PathLike[str], problem: Problem, form: Form) -> None:
    """Write a problem in a form of choice.

    FCLIB's receives the bodies (``fclib_global``), a compliance C as an unknown of the mass 1/C, and, in its own group, what these
    matrices cannot decide, so that `read_problem` gives back the same problem bit for bit. Siconos' text receives W by blocks.

    Raises
    ------
    UnwritableFileError, MissingH5pyError
    """
    content = io.BytesIO()
    if form == "npz":
        _write_npz(content, problem, None)
    elif form in ("fc2d", "fc3d"):
        text = text_of(reduced_text(*_reduced(problem)))
        content.write(text.encode())
    else:
        _write_fclib(content, problem)
    with whole_file(path) as stream:
        stream.write(content.getvalue())


def _reduced(problem: Problem) -> Reduced:
    if isinstance(problem, ContactProblem):
        return Reduced(problem.delassus(), problem.b.ravel(), problem.mu)
    return Reduced(problem.w, problem.b.ravel(), problem.mu)


def _of_matrices(form: Form, matrices: Reduced | Bodies, answer: Answer | None, source: Any) -> ProblemFile:
    problem: Problem
    scale = np.ones_like(_by_contact(matrices))
    if isinstance(matrices, Bodies):
        m, h, f, w, mu = matrices
        try:
            problem, scale = bodies_of(m, h.T, f, w, mu)
        except InvalidSceneError:  # what is wrong with the numbers themselves, the reduced problem reports, too
            problem = DelassusProblem.reduced(m, h.T, f, w, mu)
    else:
        problem = DelassusProblem(w=matrices.w, b=matrices.q, mu=matrices.mu)
    return ProblemFile(form=form, problem=problem, scale=scale, matrices=matrices, answer=answer, source=source)


def _by_contact(matrices: Reduced | Bodies) -> FloatArray:
    """``q`` or ``w``, shape (c, d)."""
    part = matrices.q if isinstance(matrices, Reduced) else matrices.w
    c = len(matrices.mu)
    return part.reshape(c, part.size // c if c else 2)


def _read_text(content: bytes) -> ProblemFile:
    try:
        text = content.decode("ascii")
    except UnicodeDecodeError as error:
        raise InvalidSceneError(f"it is no text, and no .npz or HDF5 file either ({error.reason})") from error
    found = parse(text)
    matrices: Reduced | Bodies
    if found.h is None:
        matrices = Reduced(found.m.matrix, found.q, found.mu)
    else:
        assert found.b is not None
        matrices = Bodies(found.m.matrix, found.h.matrix, found.q, found.b, found.mu)
    answer = None if found.r is None or found.u is None else Answer(found.r, found.u)
    return _of_matrices("fc2d" if found.dimension == 2 else "fc3d", matrices, answer, found)


def _read_npz(path: str | os.PathLike[str]) -> ProblemFile:
    data = read_arrays(path, "contact problem")
    problem: Problem
    if "bodies" in data or "W_indptr" not in data:
        problem = ContactProblem.load(path)
    else:
        missing = [name for name in ("W_data", "W_indices", "q", "mu") if name not in data]
        if missing:
            raise InvalidSceneError(f"it lacks {', '.join(missing)}")
        mu = friction("mu", data["mu"])
        size = len(data["W_indptr"]) - 1 if data["W_indptr"].ndim == 1 else 0
        if len(mu) and size not in (2 * len(mu), 3 * len(mu)):
            raise InvalidSceneError(
                f"W has {size} rows; with {len(mu)} coefficients in mu it must have {2 * len(mu)} or {3 * len(mu)}"
            )
        w = _compressed("W", [data[f"W_{name}"] for name in ("data", "indices", "indptr")], size, size, rows=True)
        problem = DelassusProblem(w=w, b=data["q"], mu=mu)
    answer = None
    if "solution_r" in data:
        r, u = (finite(f"solution_{name}", data.get(f"solution_{name}", ()), (problem.b.size,)) for name in ("r", "u"))
        v = data.get("solution_v")
        size = 3 * problem.n_bodies if isinstance(problem, ContactProblem) else 0
        answer = Answer(r, u, None if v is None else finite("solution_v", v, (size,)))
    return ProblemFile(form="npz", problem=problem, scale=np.ones_like(problem.b), matrices=None, answer=answer)


def _write_npz(stream: Any, problem: Problem, answer: Answer | None) -> None:
    w, q, mu = _reduced(problem)
    arrays: dict[str, NDArray[Any]] = {"W_data": w.data, "W_indices": w.indices, "W_indptr": w.indptr, "q": q, "mu": mu}
    if isinstance(problem, ContactProblem):
        arrays = problem.arrays()
    if answer is not None:
        arrays |= {f"solution_{name}": x for name, x in answer._asdict().items() if x is not None}
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def _compressed(name: str, parts: list[NDArray[Any]], m: int, n: int, *, rows: bool) -> sp.csr_array:
    """A matrix of compressed rows or columns; raises `InvalidSceneError` if its pointers or indices are not those of one."""
    x, i, p = parts
    lines, width = (m, n) if rows else (n, m)
    whole = i.dtype.kind in "iu" and p.dtype.kind in "iu" and i.ndim == p.ndim == x.ndim == 1 and x.dtype.kind == "f"
    if not (
        whole
        and len(p) == lines + 1
        and p[0] == 0
        and (np.diff(p) >= 0).all()
        and p[-1] <= min(len(i), len(x))
        and (not p[-1] or (i[: p[-1]].min() >= 0 and i[: p[-1]].max() < width))
    ):
        raise InvalidSceneError(
            f"{name} is no matrix in compressed {'rows' if rows else 'columns'} of shape ({m}, {n})"
        )
    return _matrix(name, x[: p[-1]], i[: p[-1]], np.repeat(np.arange(lines), np.diff(p)), (m, n), swap=rows)


def _matrix(
    name: str, x: NDArray[Any], i: NDArray[Any], j: NDArray[Any], shape: tuple[int, int], *, swap: bool = False
) -> sp.csr_array:
    rows, columns = (j, i) if swap else (i, j)
    return sparse(name, sp.coo_array((x, (rows.astype(np.int64), columns.astype(np.int64))), shape=shape), shape)


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise MissingH5pyError(INSTALL) from error
    return h5py


@contextmanager
def _named_faults(what: str) -> Iterator[None]:
    """Whatever HDF5 says of a damaged file, as an `InvalidSceneError`."""
    try:
        yield
    except CoreError:
        raise
    except (
        OSError, ValueError, KeyError, TypeError, RuntimeError, MemoryError, OverflowError, AttributeError, UnicodeError,
        IndexError,
    ) as error:  # fmt: skip
        raise InvalidSceneError(f"{what} is damaged or not as FCLIB has it: {error}") from error


def _read_fclib(content: bytes) -> ProblemFile:
    h5py = _h5py()
    with _named_faults("the HDF5 file"), h5py.File(io.BytesIO(content), "r") as file:
        kind = next((each for each in ("fclib_global", "fclib_local") if each in file), None)
        if kind is None:
            held = ", ".join(short_repr(str(each)) for each in list(file)[:10]) or "nothing"
            raise InvalidSceneError(f"neither fclib_global nor fclib_local is in it, but {held}")
        group = file[kind]
        dimension = int(_array(group, "spacedim", "iu")[0])
        if dimension not in (2, 3):
            raise InvalidSceneError(f"spacedim = {dimension} is not allowed: it must be 2 or 3")
        extra = [each for each in ("G", "V", "R") if each in group]
        if extra:
            raise InvalidSceneError(f"it has equality constraints ({', '.join(extra)}), which no solver here takes")
        mu = friction("mu", _array(group, "vectors/mu", "f"))
        c, d = len(mu), dimension
        matrices: Reduced | Bodies
        if kind == "fclib_local":
            matrices = Reduced(_read_matrix(group, "W"), _array(group, "vectors/q", "f"), mu)
            sizes = {"W": (matrices.w.shape, (d * c, d * c)), "q": (matrices.q.shape, (d * c,))}
        else:
            vectors = [_array(group, f"vectors/{name}", "f") for name in ("f", "w")]
            matrices = Bodies(_read_matrix(group, "M"), _read_matrix(group, "H"), vectors[0], vectors[1], mu)
            n = len(matrices.f)
            sizes = {
                "M": (matrices.m.shape, (n, n)),
                "H": (matrices.h.shape, (n, d * c)),
                "w": (matrices.w.shape, (d * c,)),
            }
        for name, (found, wanted) in sizes.items():
            if found != wanted:
                raise InvalidSceneError(f"{name} has shape {found}; with {c} coefficients in mu it must have {wanted}")
        answer = None
        if "solution" in file:
            r, u = (finite(name, _array(file, f"solution/{name}", "f"), (d * c,)) for name in ("r", "u"))
            v = (
                finite("v", _array(file, "solution/v", "f"), (len(matrices.f),))
                if isinstance(matrices, Bodies)
                else None
            )
            answer = Answer(r, u, v)
        if "ninedisk" in file:
            problem = _own_problem(file["ninedisk"])
            mine: tuple[Any, ...] = _bodies(problem)
            same = isinstance(matrices, Bodies) and all(
                abs(a - b).count_nonzero() == 0 if sp.issparse(a) else np.array_equal(a, b)
                for a, b in zip(mine, cast(tuple[Any, ...], matrices), strict=True)
            )
            if not same:
                raise InvalidSceneError(
                    "its group ninedisk holds another problem than fclib_global: delete one of them"
                )
            ones = np.ones((c, 2))
            return ProblemFile(
                form="fclib", problem=problem, scale=ones, matrices=matrices, answer=answer, source=content
            )
    return _of_matrices("fclib", matrices, answer, content)


def _own_problem(group: Any) -> ContactProblem:
    fields = {name: _array(group, name, "iuf") for name in _FIELDS}
    notes = {str(key): bytes(data[()]).decode() for key, data in group["notes"].items()}
    return ContactProblem(**fields, resolution=float(_array(group, "resolution", "f")[0]), notes=notes)


def _array(group: Any, name: str, kinds: str) -> NDArray[Any]:
    data = group.get(name)
    if (
        data is None
        or not hasattr(data, "dtype")
        or data.dtype.kind not in kinds
        or data.shape is None
        or not data.shape
    ):
        raise InvalidSceneError(f"{name} is missing, or no array of {'numbers' if 'f' in kinds else 'whole numbers'}")
    if data.size * data.dtype.itemsize > MOST_BYTES:
        raise InvalidSceneError(f"{name} has the shape {data.shape}: too large")
    return np.asarray(data[()])


def _read_matrix(group: Any, name: str) -> sp.csr_array:
    m, n, nz = (int(_array(group, f"{name}/{each}", "iu")[0]) for each in ("m", "n", "nz"))
    parts = [_array(group, f"{name}/{each}", kinds) for each, kinds in (("x", "f"), ("i", "iu"), ("p", "iu"))]
    if min(m, n) < 0 or nz < -2:
        raise InvalidSceneError(
            f"{name} has m = {m}, n = {n}, nz = {nz}; nz is -1 (columns), -2 (rows) or the number of triplets"
        )
    if nz < 0:
        return _compressed(name, parts, m, n, rows=nz == -2)
    x, i, p = parts
    if min(len(each) for each in parts) < nz or any(each.ndim != 1 for each in parts):
        raise InvalidSceneError(f"{name} has less than nz = {nz} triplets")
    if nz and (min(i[:nz].min(), p[:nz].min()) < 0 or i[:nz].max() >= m or p[:nz].max() >= n):
        raise InvalidSceneError(f"{name} has a triplet outside its shape ({m}, {n})")
    return _matrix(name, x[:nz], i[:nz], p[:nz], (m, n))


def _bodies(problem: ContactProblem) -> Bodies:
    """The matrices of a problem's free unknowns, and those of its compliances."""
    free, soft = np.flatnonzero(problem.free.ravel()), np.flatnonzero(problem.compliance.ravel() > TINY)
    c = problem.n_contacts
    springs = sp.csr_array((np.ones(len(soft)), (np.arange(len(soft)), soft)), shape=(len(soft), 2 * c))
    w = problem.offset - problem.compliance * np.column_stack([np.zeros(c), problem.shear_0])
    mass = np.concatenate([problem.mass.ravel()[free], 1.0 / problem.compliance.ravel()[soft]])
    h = sp.csr_array(sp.vstack([sp.csr_array(problem.jacobian().T)[free], springs]))
    return Bodies(
        m=sp.csr_array(sp.diags_array(mass)) if len(mass) else sp.csr_array((0, 0)),
        h=sparse("H", h, (len(mass), 2 * c)),
        f=np.concatenate([problem.force.ravel()[free], np.zeros(len(soft))]),
        w=w.ravel(),
        mu=problem.mu,
    )


def _write_fclib(stream: io.BytesIO, problem: Problem) -> None:
    with _h5py().File(stream, "w") as file:
        text = {"title": "contact problem of ninedisk", "description": "", "math_info": ""}
        if isinstance(problem, DelassusProblem):
            group = file.create_group("fclib_local")
            matrices, vectors = {"W": problem.w}, {"q": problem.b.ravel(), "mu": problem.mu}
        else:
            group, found = file.create_group("fclib_global"), _bodies(problem)
            matrices, vectors = {"M": found.m, "H": found.h}, {"f": found.f, "w": found.w, "mu": found.mu}
            own = {name: getattr(problem, name) for name in _FIELDS} | {"resolution": np.array([problem.resolution])}
            _write_group(file, "ninedisk", own)
            _write_group(file, "ninedisk/notes", dict(problem.notes))
        group["spacedim"] = np.array([problem.b.shape[1]], dtype=np.int32)
        for name, matrix in matrices.items():
            entries = sp.coo_array(matrix)
            i, p = entries.coords
            whole = {"nzmax": entries.nnz, "m": entries.shape[0], "n": entries.shape[1], "nz": entries.nnz}
            sizes = {key: np.array([value], dtype=np.int32) for key, value in whole.items()}
            _write_group(group, name, {**sizes, "p": p.astype(np.int32), "i": i.astype(np.int32), "x": entries.data})
        _write_group(group, "vectors", vectors)
        _write_group(group, "info", text)


def _write_group(parent: Any, name: str, items: dict[str, Any]) -> None:
    """Arrays and texts, these as C does, closed by a zero."""
    group = parent.create_group(name)
    for key, value in items.items():
        if isinstance(value, str):
            group[key] = np.array(value.encode(), dtype=f"S{len(value.encode()) + 1}")
        elif value is not None:
            group[key] = value
