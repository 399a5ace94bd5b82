"""Driver that gives saved contact problems to Siconos' two-dimensional friction solvers, under the system's Python.

Request on standard input: ``{"jobs": [{"problem": path, "solver": name or null, "reaction": [...]}], "tolerance": ...,
"max_iterations": ..., "answer_file": path}``; a job without a solver only evaluates its reaction. Answer: a list with an
object for each job, or ``{"error": text}``.
"""

import ctypes
import json
import math
import os
import sys
import time

import numpy as np
import siconos.numerics as sn

SOLVERS = {"nsgs": sn.SICONOS_FRICTION_2D_NSGS, "lemke": sn.SICONOS_FRICTION_2D_LEMKE}
DOUBLES = ctypes.POINTER(ctypes.c_double)
FUNCTION = ctypes.CDLL(sn._numerics.__file__).fc2d_compute_error  # the extension module is linked with the library
FUNCTION.restype = ctypes.c_int
FUNCTION.argtypes = [ctypes.c_void_p, DOUBLES, DOUBLES, ctypes.c_double, ctypes.c_double, DOUBLES]


def natural_map(problem, r):
    """Error of the reactions ``r`` (2 c), relative, and the velocities ``u = W r + q`` (2 c).

    The error is ``|r - P(r - (u_n + mu |u_t|, u_t))| / max(|r|, |u|)`` with the projection P on the friction cones, in the
    Euclidean norm over all contacts; it mixes the units of reactions and velocities.
    """
    r = np.array(r, dtype=np.float64)
    u, error = np.zeros_like(r), ctypes.c_double(0.0)
    FUNCTION(int(problem.this), r.ctypes.data_as(DOUBLES), u.ctypes.data_as(DOUBLES), 0.0, 0.0, ctypes.byref(error))
    return error.value, u


def load(path):
    """Delassus matrix as a dense array, q and mu of a saved problem."""
    with np.load(path, allow_pickle=False) as data:
        q, mu, pointers = data["q"], data["mu"], data["W_indptr"]
        w = np.zeros((len(q), len(q)), order="F")
        w[np.repeat(np.arange(len(q)), np.diff(pointers)), data["W_indices"]] = data["W_data"]
    return w, q, mu


def solve(w, q, mu, solver, tolerance, max_iterations):
    """Reaction and figures of one solver.

    Forces are measured in a unit, a power of two, in which the largest diagonal entry of W is near 1: Gauss-Seidel takes
    1e-12 for 0, whatever the units. Velocities do not change by that.

    Lemke's method gets each friction force in units of ``mu``, and each slip in units of ``1/mu``, so that all coefficients
    are 1: `fc2d_tolcp`, which sets up its complementarity problem, takes the coefficient of the row's contact where that of
    the column's belongs, and is right only where they are equal.
    """
    unit = 2.0 ** round(math.log2(float(np.diag(w).max())))
    scale = np.full(len(q), 1.0)
    if solver == "lemke":
        scale[1::2], mu = mu, np.ones_like(mu)
    matrix = np.asfortranarray(scale[:, None] * (w / unit) * scale)
    problem = sn.FrictionContactProblem(2, len(mu), matrix, scale * q, mu)
    options = sn.SolverOptions(SOLVERS[solver])
    options.dparam[sn.SICONOS_DPARAM_TOL] = tolerance
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = max_iterations
    r, u = np.zeros_like(q), np.zeros_like(q)
    begin = time.perf_counter()
    status = sn.fc2d_driver(problem, r, u, options)
    seconds = time.perf_counter() - begin
    reported = float(options.dparam[sn.SICONOS_DPARAM_RESIDU])
    return scale * r / unit, {
        "status": int(status),
        "iterations": int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE]),
        "reported_residual": reported if math.isfinite(reported) else None,
        "seconds": seconds,
    }


def errors(w, q, mu, r):
    """Siconos' error function at ``r``, and its numerator for the problem whose rows are multiplied by each contact's rho.

    With rho_k = 1/max(W_nn, W_tt) of contact k the numerator is ``|r - P(r - rho u)|``, a force whatever the units are.
    """
    diagonal = np.diag(w).reshape(-1, 2)
    rho = np.repeat(1.0 / np.maximum(diagonal[:, 0], np.where(mu > 0.0, diagonal[:, 1], 0.0)), 2)
    error, u = natural_map(sn.FrictionContactProblem(2, len(mu), w, q, mu), r)
    scaled, v = natural_map(sn.FrictionContactProblem(2, len(mu), np.asfortranarray(rho[:, None] * w), rho * q, mu), r)
    numerator = scaled * max(np.linalg.norm(r), np.linalg.norm(v))
    return {"u": u.tolist(), "error": error, "scaled_error": numerator}


def run(job, request):
    """Answer of one job."""
    w, q, mu = load(job["problem"])
    if job["solver"] is None:
        r, figures = np.array(job["reaction"], dtype=np.float64), {}
    else:
        r, figures = solve(w, q, mu, job["solver"], request["tolerance"], request["max_iterations"])
    return {**figures, "r": r.tolist(), **errors(w, q, mu, r)}


def main():
    """Read the request, do all jobs, write the answer; any exception becomes an ``error`` answer."""
    request = json.load(sys.stdin)
    try:
        answer = [run(job, request) for job in request["jobs"]]
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"error": f"{type(error).__name__}: {error}"}
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))
    sys.stdout.flush()
    os._exit(0)  # Siconos' objects and Python's may be destroyed in an order that crashes


if __name__ == "__main__":
    main()
