"""Siconos' solvers on saved contact problems: Gauss-Seidel with the Delassus matrix in sparse blocks, others in 2D with a dense one, in
3D with a sparse one."""

import json
import math
import os
import sys
import time

import numpy as np
import scipy.sparse as sp
import siconos.numerics as sn
from ladder import climb


def solve(request):
    """Contact forces and figures of its solver ``solver``: NSGS, LEMKE or CPG in 2D; NSGS, NSN_AC or ADMM in 3D.

    Forces are measured in a unit, a power of two, in which the largest diagonal entry of W is near 1: Gauss-Seidel takes
    1e-12 for 0, whatever the units.
    """
    with np.load(request["problem"], allow_pickle=False) as data:
        q, mu = data["q"].copy(), data["mu"].copy()
        w = sp.csr_matrix((data["W_data"], data["W_indices"], data["W_indptr"])).tocsc()
    unit = 2.0 ** round(math.log2(float(w.diagonal().max())))
    w = w / unit
    name, dimension = request.get("solver", "NSGS"), request.get("dimension", 2)
    matrix = _blocks(w, dimension) if name == "NSGS" else w.toarray(order="F") if dimension == 2 else _long(w)
    problem = sn.FrictionContactProblem(dimension, len(mu), matrix, q, mu)
    options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_{dimension}D_{name}"))
    options.dparam[sn.SICONOS_DPARAM_TOL] = request["tolerance"]
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = request["max_iterations"]
    r, u = np.zeros_like(q), np.zeros_like(q)
    begin = time.perf_counter()
    word = (sn.fc2d_driver if dimension == 2 else sn.fc3d_driver)(problem, r, u, options)
    seconds = time.perf_counter() - begin
    return {
        "r": (r / unit).reshape(-1, dimension),
        "seconds": seconds,
        "iterations": int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE]),
        "word": str(int(word)),
        "good": int(word) == 0,
    }


def _long(w):
    """The matrix with long indices, which its sparse matrices have."""
    w.sort_indices()
    w.indices, w.indptr = w.indices.astype(np.int64), w.indptr.astype(np.int64)
    return w


def _blocks(w, dimension):
    """The matrix in sparse blocks, a row of them for each contact."""
    failed, blocks = sn.SBM_from_csparse(dimension, _long(w))
    if failed:
        raise RuntimeError(f"Siconos did not take the matrix in blocks of {dimension} x {dimension}")
    return blocks


def main():
    """Solve one request, where an exception becomes an ``error`` answer, or climb the ladders of the race."""
    if "--race" in sys.argv:
        climb(solve)
    else:
        request = json.load(sys.stdin)
        try:
            answer = solve(request)
        except Exception as error:  # the harness shows the text; a traceback would only bury it
            answer = {"error": f"{type(error).__name__}: {error}"}
        with open(request["answer"], "wb") as file:
            np.savez(file, **answer)
    sys.stdout.flush()
    os._exit(0)  # Siconos' objects and Python's may be destroyed in an order that crashes


main()
