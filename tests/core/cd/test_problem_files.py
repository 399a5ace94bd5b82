"""Files of other codes: the same bytes again, the same problem whatever the form, and names for all that is wrong."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache

import numpy as np
import problems
import pytest
import scipy.sparse as sp

from ninedisk.core.cd.delassus import DelassusProblem, bodies_of
from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.problem_files import Answer, Bodies, MissingH5pyError, read_problem, write_problem
from ninedisk.core.cd.problem_text import COLUMNS, DENSE, ROWS, SPARSE, TRIPLET, TextMatrix, TextProblem, parse, text_of
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix.solve import solve_matrix
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.errors import InvalidSceneError

FIELDS = ("mass", "force", "bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0", "resolution", "notes")
KINDS = [builder.__name__ for builder in problems.BUILDERS]
VERSION = "CSparse Version 3.1.9, May 4, 2016.  Copyright (c) Timothy A. Davis, 2006-2016"


@cache
def small(kind):
    return problems.of_kind(getattr(problems, kind), 5)


@pytest.mark.parametrize("form", ["npz", "fc2d", "fclib"])
@pytest.mark.parametrize("kind", KINDS)
def test_read_and_written_again_a_file_is_the_same_to_the_byte(kind, form, tmp_path):
    problem = replace(small(kind), notes={"scene": "ä"}, resolution=1e-12)
    write_problem(tmp_path / "a", problem, form)
    found = read_problem(tmp_path / "a")
    found.save(tmp_path / "b")
    assert (tmp_path / "b").read_bytes() == (tmp_path / "a").read_bytes()
    if form != "fc2d":
        assert all(np.array_equal(getattr(problem, name), getattr(found.problem, name)) for name in FIELDS)
    else:
        assert (found.problem.w != problem.delassus()).nnz == 0
        np.testing.assert_array_equal(found.problem.b, problem.b)
    # With a solution, too, and when that is replaced by itself.
    r = np.ones((problem.n_contacts, 2))
    answer = found.answer_of(r)
    u = problem.contact_velocity(problem.body_velocity(r), r).ravel()
    np.testing.assert_allclose(answer.u, u, rtol=1e-9, atol=1e-12 * np.abs(u).max())
    replace(found, answer=answer).save(tmp_path / "c")
    again = read_problem(tmp_path / "c")
    for mine, theirs in zip(again.answer, answer, strict=True):
        assert form == "fc2d" or mine is not None or theirs is None
        assert mine is None or np.array_equal(mine, theirs)
    again.save(tmp_path / "d")
    assert (tmp_path / "d").read_bytes() == (tmp_path / "c").read_bytes()


def sparse_text(origin: int, dense: np.ndarray) -> TextMatrix:
    """As CSparse prints it; numbers of at most six digits."""
    matrix = sp.csr_array(dense)
    entries = sp.coo_array(matrix)
    i, j = (each.tolist() for each in entries.coords)
    if origin == COLUMNS:
        order = np.lexsort((i, j))
        i, j, x = np.array(i)[order].tolist(), np.array(j)[order].tolist(), entries.data[order].tolist()
    else:
        x = entries.data.tolist()
    if origin == ROWS:
        i, j = j, i
    norm = None if origin == TRIPLET else "7"
    return TextMatrix(SPARSE, matrix, (origin, VERSION, dense.shape, str(len(x)), norm, i, j, x))


W = np.array([[2.0, 0.5, 0.0, 0.25], [0.75, 3.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0], [0.25, 0.0, 0.0, 4.0]])


@pytest.mark.parametrize("origin", [None, TRIPLET, COLUMNS, ROWS])
def test_every_storage_of_siconos_is_the_same_matrix(origin):
    w = TextMatrix(DENSE, sp.csr_array(W), (W,)) if origin is None else sparse_text(origin, W)
    problem = TextProblem(2, w, None, np.arange(4.0), None, np.array([0.5, 0.25]))
    text = text_of(problem)
    found = parse(text)
    np.testing.assert_array_equal(found.m.matrix.toarray(), W)
    np.testing.assert_array_equal(found.q, np.arange(4.0))
    assert text_of(found) == text
    if origin is None:  # the file's own numbers, by columns, 24 digits
        assert text.splitlines()[5:7] == ["4\t4", "".join(f"{x:32.24e} " for x in (2.0, 0.75, 0.0, 0.25))]


W_3 = np.diag([2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + 0.25 * np.eye(6, k=3) + 0.5 * np.eye(6, k=-3)


@pytest.mark.parametrize("form", ["npz", "fc3d", "fclib"])
def test_a_problem_in_space_is_the_same_in_every_form(form, tmp_path):
    problem = DelassusProblem(w=W_3, b=np.arange(6.0), mu=[0.5, 0.25])
    write_problem(tmp_path / "a", problem, form)
    found = read_problem(tmp_path / "a")
    assert (found.form, found.problem.dimension) == (form, 3)
    np.testing.assert_array_equal(found.problem.w.toarray(), W_3)
    np.testing.assert_array_equal(found.problem.b, np.arange(6.0).reshape(2, 3))
    answer = found.answer_of(np.ones((2, 3)))
    np.testing.assert_allclose(answer.u, W_3.sum(axis=1) + np.arange(6.0))
    replace(found, answer=answer).save(tmp_path / "b")
    again = read_problem(tmp_path / "b")
    np.testing.assert_array_equal(again.answer.u, answer.u)
    np.testing.assert_array_equal(again.problem.w.toarray(), W_3)


def test_bodies_in_space_are_eliminated(tmp_path):
    """FCLIB's global form and Siconos' gfc3d, mass matrix with blocks."""
    rng = np.random.default_rng(2)
    factor, h = rng.normal(size=(7, 7)), rng.normal(size=(6, 7))
    m, f, g = factor @ factor.T + np.eye(7), rng.normal(size=7), rng.normal(size=(2, 3))
    dense = (TextMatrix(DENSE, sp.csr_array(each), (each,)) for each in (m, h.T))
    text = text_of(TextProblem(3, *dense, f, g.ravel(), np.array([0.5, 0.25])))
    (tmp_path / "p").write_text(text, encoding="ascii")
    found = read_problem(tmp_path / "p")
    assert isinstance(found.problem, DelassusProblem)
    np.testing.assert_allclose(found.problem.w.toarray(), h @ np.linalg.solve(m, h.T), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.problem.b, (h @ np.linalg.solve(m, f)).reshape(2, 3) + g, rtol=1e-10)


def test_texts_of_other_releases_are_read():
    """Blank lines, sizes below each other, vectors in one line, and a single figure after mu, which is kept."""
    wanted = parse(TEXT)
    lines = TEXT.splitlines()
    spread = "\n\n".join([*lines[:5], "4", "4", *lines[6:], "0"]) + "\n"
    found = parse(spread)
    assert found.flag == "0"
    for mine, theirs in (
        (found.m.matrix.toarray(), wanted.m.matrix.toarray()),
        (found.q, wanted.q),
        (found.mu, wanted.mu),
    ):
        np.testing.assert_array_equal(mine, theirs)
    assert parse(text_of(found)).flag == "0"
    solved = replace(found, r=np.ones(4), u=np.zeros(4))
    np.testing.assert_array_equal(parse(text_of(solved)).r, np.ones(4))
    h = TextMatrix(DENSE, sp.csr_array(W), (W,))
    bodies = TextProblem(2, h, h, np.arange(4.0), 5.0 + np.arange(4.0), np.array([0.5, 0.25]))
    lines = text_of(bodies).splitlines()
    joined = parse("\n".join([*lines[:-3], lines[-3] + lines[-2], lines[-1], ""]))
    np.testing.assert_array_equal(joined.q, bodies.q)
    np.testing.assert_array_equal(joined.b, bodies.b)


def test_sparse_numbers_keep_their_digits():
    matrix = sp.csr_array(np.diag([1.23456789012, 2.5]))
    text = TextMatrix(SPARSE, matrix, (TRIPLET, VERSION, (2, 2), "2", None, [0, 1], [0, 1], [1.23456789012, 2.5]))
    again = parse(text_of(TextProblem(2, text, None, np.zeros(2), None, np.array([0.5]))))
    np.testing.assert_array_equal(again.m.matrix.toarray(), matrix.toarray())


def test_a_text_without_contacts_is_a_problem_without_contacts(tmp_path):
    (tmp_path / "p").write_text("3\n0\n0\n0\n0\n0\t0\n\n\n", encoding="ascii")
    assert read_problem(tmp_path / "p").problem.n_contacts == 0


@pytest.mark.parametrize(
    ("m", "said"),
    [(np.diag([1.0, -1.0]), r"M\[1, 1\] = -1 is not allowed"), ([[1.0, 0.9], [0.0, 1.0]], "M is not symmetric")],
)
def test_a_mass_matrix_that_is_none_is_named(m, said):
    with pytest.raises(InvalidSceneError, match=said):
        DelassusProblem.reduced(m, np.eye(2), [1.0, 1.0], [[0.0, 0.0]], [0.5])


def test_bodies_are_found_behind_rows_of_any_length_and_either_tangent():
    """Rows rounded to length 1 - 1e-6, tangents turned the other way, as Siconos prints them; solved, they solve the file's matrices."""
    problem = small("hyperstatic")
    rng = np.random.default_rng(1)
    length = 1.0 + 1e-6 * rng.uniform(-1.0, 1.0, problem.n_contacts)
    turn = np.column_stack([length, -length]).ravel()
    h = sp.csr_array(sp.diags_array(turn) @ problem.jacobian())
    matrices = (sp.diags_array(problem.mass.ravel()).tocsr(), h, problem.force.ravel(), problem.offset, problem.mu)
    found = bodies_of(*matrices)
    np.testing.assert_allclose(found.problem.normal, problem.normal, atol=1e-15)
    np.testing.assert_allclose(found.scale, 1.0 / turn.reshape(-1, 2), rtol=1e-15)
    reduced = DelassusProblem.reduced(*matrices)
    result = ContactSolver("auto", SolverOptions(tolerance=1e-12), "coulomb").solve(found.problem)
    u = reduced.velocity(found.scale * result.r)
    np.testing.assert_allclose(u, found.problem.contact_velocity(result.v, result.r) / found.scale, atol=1e-12)
    # A row that is no rigid body's, or a mass matrix with blocks, leaves the reduced problem.
    bent = h.tolil()
    bent[1, h.indices[h.indptr[1]]] *= 1.5
    with pytest.raises(InvalidSceneError, match="rows of contact 0 are not those of rigid bodies"):
        bodies_of(matrices[0], bent.tocsr(), *matrices[2:])


def test_blocks_of_mass_are_eliminated():
    rng = np.random.default_rng(2)
    factor, h = rng.normal(size=(5, 5)), rng.normal(size=(4, 5))
    m, f, g = factor @ factor.T + np.eye(5), rng.normal(size=5), rng.normal(size=(2, 2))
    found = DelassusProblem.reduced(m, h, f, g, [0.3, 0.4])
    np.testing.assert_allclose(found.w.toarray(), h @ np.linalg.solve(m, h.T), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.b.ravel(), h @ np.linalg.solve(m, f) + g.ravel(), rtol=1e-10)


@pytest.mark.parametrize("sliding", ["coulomb", "associated"])
@pytest.mark.parametrize("kind", ["loose", "hyperstatic", "mixed", "blocked", "driven"])
def test_a_matrix_alone_is_solved_as_its_bodies_are(kind, sliding):
    problem = small(kind)
    matrix = DelassusProblem(w=problem.delassus(), b=problem.b, mu=problem.mu)
    found = solve_matrix(matrix, SolverOptions(tolerance=1e-11), sliding=sliding)
    assert measure(problem, problem.body_velocity(found.r), found.r, sliding=sliding).natural_map <= 2e-11
    n, t, across = matrix.blocks[:, 0, 0], matrix.blocks[:, 1, 1], matrix.blocks[:, 0, 1]
    np.testing.assert_allclose(np.column_stack([n, across, t]), problem.blocks, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(matrix.blocks[:, 1, 0], across, atol=1e-13)
    np.testing.assert_allclose(matrix.rho, problem.rho, rtol=1e-13)


@pytest.mark.parametrize("kind", ["column", "hyperstatic"])
def test_statuses_finish_what_fifty_sweeps_begin(kind):
    problem = small(kind) if kind == "column" else problems.of_kind(problems.hyperstatic, 60)
    matrix = DelassusProblem(w=problem.delassus(), b=problem.b, mu=problem.mu)
    assert solve_matrix(matrix, SolverOptions(tolerance=1e-12, max_iterations=50), sliding="coulomb").error <= 1e-12


def hdf5(path, change):
    import h5py

    write_problem(path, DelassusProblem(w=sp.csr_array(W), b=np.arange(4.0), mu=[0.5, 0.25]), "fclib")
    with h5py.File(path, "r+") as file:
        change(file)


def put(file, name, value):
    del file[name]
    file[name] = value


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda file: file.move("fclib_local", "else"), "neither fclib_global nor fclib_local is in it, but 'else'"),
        (
            lambda file: put(file, "fclib_local/spacedim", np.array([4])),
            "spacedim = 4 is not allowed: it must be 2 or 3",
        ),
        (
            lambda file: put(file, "fclib_local/spacedim", np.array([3])),
            r"W has shape \(4, 4\); with 2 .* must have \(6, 6\)",
        ),
        (lambda file: file.create_group("fclib_local/V"), "equality constraints"),
        (lambda file: put(file, "fclib_local/W/i", np.full(9, 7)), "W has a triplet outside its shape"),
        (lambda file: put(file, "fclib_local/W/nz", np.array([-2])), "W is no matrix in compressed rows"),
        (lambda file: put(file, "fclib_local/vectors/mu", np.array([0.5, -1.0])), r"mu\[1\] = -1 is not allowed"),
        (lambda file: put(file, "fclib_local/vectors/q", np.zeros(3)), "q has shape"),
        (lambda file: put(file, "fclib_local/W/x", "text"), "x is missing, or no array of numbers"),
        (lambda file: put(file, "fclib_local/W/m", np.array([], dtype=int)), "damaged"),
    ],
)
def test_what_is_wrong_with_an_fclib_file_is_named(change, said, tmp_path):
    hdf5(tmp_path / "p.hdf5", change)
    with pytest.raises(InvalidSceneError, match=said):
        read_problem(tmp_path / "p.hdf5")


def test_what_our_own_group_says_is_what_the_matrices_say(tmp_path):
    import h5py

    path = tmp_path / "p.hdf5"
    c = small("loose").n_contacts
    write_problem(path, replace(small("loose"), compliance=np.zeros((c, 2))), "fclib")
    assert isinstance(read_problem(path).matrices, Bodies)
    with h5py.File(path, "r+") as file:
        file["fclib_global/vectors/f"][0] += 1e-12
    with pytest.raises(InvalidSceneError, match="group ninedisk holds another problem"):
        read_problem(path)
    with h5py.File(path, "r+") as file:
        del file["ninedisk"]  # then the matrices alone are read
    assert isinstance(read_problem(path).problem, ContactProblem)


TEXT = text_of(
    TextProblem(2, TextMatrix(DENSE, sp.csr_array(W), (W,)), None, np.arange(4.0), None, np.array([0.5, 0.25]))
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it ends after line 0, where the dimension must be"),
        ("4" + TEXT[1:], "line 1 must be the dimension, a whole number 2 .. 3"),
        ("3" + TEXT[1:], "a matrix of shape .4, 4. does not go with 2 contacts"),
        (TEXT.replace("2\n2\n", "2\n3\n", 1), "a matrix of shape .4, 4. does not go with 3 contacts"),
        (TEXT.replace("4\t4", "4\t5"), "line 6 must be the sizes of M again"),
        (TEXT.replace("2.5", "2.x", 1), "line 7 must be M, 16 numbers"),
        (TEXT[: TEXT.rindex("2.5")], "it ends after line 12, where mu must be"),
        (TEXT + "1.0\n", "it ends after line 13, where r must be"),
        (TEXT.rstrip()[:-1], "it ends inside a number"),
        (TEXT.replace("2.500000000000000000000000e-01", "2_5", 1), "line 7 must be M, 16 numbers"),
        (TEXT.replace("2.000000000000000000000000e+00", "0.000000000000000000000000e+00", 1), "contact 0 can neither open nor close"),
        (TEXT.replace("3.000000000000000000000000e+00", "nan", 1), "W must be finite"),
        ("\xff", "it is no text"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_text_is_named_with_its_line(text, said, tmp_path):
    (tmp_path / "p.dat").write_bytes(text.encode("latin-1"))
    with pytest.raises(InvalidSceneError, match=said):
        read_problem(tmp_path / "p.dat")


def test_without_h5py_the_message_says_how_to_get_it(tmp_path, monkeypatch):
    write_problem(tmp_path / "p.hdf5", small("loose"), "fclib")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingH5pyError, match="pip install 'ninedisk\\[fclib\\]'"):
        read_problem(tmp_path / "p.hdf5")
    write_problem(tmp_path / "p.npz", small("loose"), "npz")
    assert read_problem(tmp_path / "p.npz").answer is None


def test_a_file_that_is_refused_leaves_the_old_one(tmp_path):
    write_problem(tmp_path / "p", small("loose"), "npz")
    before = (tmp_path / "p").read_bytes()
    found = read_problem(tmp_path / "p")
    with pytest.raises(Exception, match=r"cannot be written|Is a directory"):
        replace(found, answer=Answer(np.zeros(2), np.zeros(2))).save(tmp_path)
    assert (tmp_path / "p").read_bytes() == before
