"""LIGGGHTS as a library: commands in, copies of its arrays out."""

import ctypes
import os

import numpy as np

NOT_BUFFERED = 2
"""``_IONBF`` of the C library."""

SCALAR, LOCAL, ARRAY = 0, 2, 2
"""Of ``lammps_extract_compute``: type of a scalar; style of local data, and type of an array of them."""

PER_ATOM = {"x": 3, "v": 3, "f": 3, "omega": 3, "torque": 3, "radius": 1, "rmass": 1}
"""Numbers per atom of the arrays that are read or written."""


class Liggghts:
    """One instance; its messages and errors go to standard error, and an error ends the process."""

    def __init__(self, path):
        # Open MPI loads its plug-ins against symbols that must be global.
        self.library = ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL)
        library, words = self.library, ctypes.POINTER(ctypes.c_char_p)
        library.lammps_open_no_mpi.argtypes = [ctypes.c_int, words, ctypes.POINTER(ctypes.c_void_p)]
        library.lammps_command.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        library.lammps_get_natoms.argtypes = [ctypes.c_void_p]
        library.lammps_extract_atom.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        library.lammps_extract_atom.restype = ctypes.c_void_p
        library.lammps_extract_compute.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_int]
        library.lammps_extract_compute.restype = ctypes.c_void_p
        # With "-screen none" reading a mesh crashes: it prints to a file that is not there. Its standard output goes to standard error,
        # unbuffered: an error aborts the process at once.
        libc = ctypes.CDLL(None)
        os.dup2(2, 1)
        libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, NOT_BUFFERED, 0)
        given = [b"liggghts", b"-log", b"none"]
        self.handle, self.atoms, self.order = ctypes.c_void_p(), 0, None
        library.lammps_open_no_mpi(len(given), (ctypes.c_char_p * len(given))(*given), ctypes.byref(self.handle))

    def do(self, *commands):
        """Run commands."""
        for command in commands:
            self.library.lammps_command(self.handle, command.encode())

    def look(self, count):
        """Note the number of atoms and their order, which stays as it is: sorting is off and there is one process."""
        self.atoms, made = count, self.library.lammps_get_natoms(self.handle)
        if made != count:
            raise RuntimeError(f"LIGGGHTS took {made} of {count} disks")
        pointer = self.library.lammps_extract_atom(self.handle, b"id")
        ids = np.ctypeslib.as_array(ctypes.cast(pointer, ctypes.POINTER(ctypes.c_int)), (count,))
        self.order = np.argsort(ids)

    def _view(self, name):
        pointer = self.library.lammps_extract_atom(self.handle, name.encode())
        if PER_ATOM[name] == 1:
            return np.ctypeslib.as_array(ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double)), (self.atoms, 1))
        rows = ctypes.cast(pointer, ctypes.POINTER(ctypes.POINTER(ctypes.c_double)))
        return np.ctypeslib.as_array(rows[0], (self.atoms, PER_ATOM[name]))

    def get(self, name):
        """Copy of a per-atom array by disk, shape (n, numbers)."""
        return np.array(self._view(name)[self.order])

    def set(self, name, values):
        """Write the first columns of a per-atom array, by disk."""
        values = np.reshape(values, (self.atoms, -1))
        self._view(name)[self.order, : values.shape[1]] = values

    def count(self, *names):
        """Number of rows of local data: the sum of a column over its average, which computes ``names`` give."""
        total, average = (
            ctypes.cast(
                self.library.lammps_extract_compute(self.handle, name.encode(), SCALAR, SCALAR),
                ctypes.POINTER(ctypes.c_double),
            )[0]
            for name in names
        )
        return round(total / average) if total else 0

    def local(self, name, rows, columns):
        """Copy of local data, shape (rows, columns)."""
        if not rows:
            return np.empty((0, columns))
        pointer = self.library.lammps_extract_compute(self.handle, name.encode(), LOCAL, ARRAY)
        table = ctypes.cast(pointer, ctypes.POINTER(ctypes.POINTER(ctypes.c_double)))
        return np.array(np.ctypeslib.as_array(table[0], (rows, columns)))
