"""Siconos' own measure of a contact solution, which its Python interface does not show: `fc2d_compute_error` of its library."""

import ctypes

import numpy as np
import siconos.numerics as sn

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
