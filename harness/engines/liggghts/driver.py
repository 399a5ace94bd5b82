"""Driver of LIGGGHTS, which it holds as a library, under the harness' Python.

LIGGGHTS integrates by velocity Verlet: between two runs its state is (positions t_n, forces t_n, velocities t_n), and forces see
``v_{n-1/2}`` where they depend on velocities. With a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: ``fix viscous`` with ``xi m`` is this very scheme;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)``: the lagged one with all masses, but not the drag, multiplied by ``1 + a``;
  ``fix gravity``, an acceleration, is divided by it;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: the engine's own half kick, but for the factor ``1 + a``, which ``v_0`` makes up.

A wall is one triangle, opposite the middle of the bodies and large enough for the whole run, so that no contact is near an edge. In 2D the
particles are spheres at z = 0, nothing lets a disk's spin change (the adapter sees to that), and the triangles cross z = 0. In 3D
there is no global damping; contacts are hooke/stiffness or hertz.
"""

import ctypes
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps folders off the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import numpy as np
from driver_parts import (
    SpringRun,
    carries_shear,
    clock,
    ids,
    in_3d,
    length,
    number,
    numbers,
    serve,
    spin_in_3d,
    triangle,
)

NOT_BUFFERED = 2
"""``_IONBF`` of the C library."""

SCALAR, ATOM, LOCAL, ARRAY = 0, 1, 2, 2
"""Of ``lammps_extract_compute`` and ``..._fix``: type of a scalar; styles of data by atom and local, type of an array of them."""

PER_ATOM = {"x": 3, "v": 3, "f": 3, "omega": 3, "torque": 3, "radius": 1, "rmass": 1}
"""Numbers per atom of the arrays that are read or written."""

BINS = 1e6
"""Largest number of bins of the neighbour search: walls make the box large, memory should not follow."""

COLUMNS = 10
"""Of the contact computes: three ids, normal force, shear force, overlap."""

PRELOAD_ROUND_OFF = 1e-9
"""Of the preload: round-off of the velocity that stretches a spring in one step."""


class Run(SpringRun):
    """One simulation."""

    name = "LIGGGHTS"

    def __init__(self, request):
        super().__init__(request)
        extra = request["extra"]
        self.reach, self.legs, self.known_version = extra["reach"], extra["wall_legs"], extra["version"]
        self.elastic = extra.get("elastic", [])  # E and nu of each material, then of each wall
        self.hertz = bool(self.law["e_star"])
        self.angle = np.zeros((self.n, 3))
        self.engine = Liggghts(extra["library"])
        self._atoms()
        self._contacts()
        self._walls()

    def version(self):
        return self.known_version

    def settings(self):
        if self.dimension == 2:
            return {"contact model": self.model + self.options, "plate half-length [m]": self.reach}
        return {"contact model": self.model, "plate inradius [m]": self.reach}

    def _atoms(self):
        """Atom types are the kinds of bodies, then the walls: equal material, and equal mass where damping asks for rates."""
        material = np.unique(self.material, return_inverse=True)[1]
        by_mass = self.dimension == 2 or (self.damped and not self.hertz)
        rows = np.column_stack([material, self.mass if by_mass else np.zeros(self.n)])
        _, self.first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        self.material_of = [int(material[i]) for i in self.first]
        self.types = len(self.first) + len(self.walls)
        self.middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        half = (
            3.0 * self.reach
        )  # a triangle's corners are at most twice its reach from its foot, which is within one of the middle
        sides = [f"{number(c - half)} {number(c + half)}" for c in self.middle]
        skin = 0.3 * float(self.radius.mean())
        if self.dimension == 2:
            self.depth = max(4.0 * self.radius.max(), 0.02 * self.reach)  # along z; much flatter triangles are refused
            sides.append(f"{number(-1.5 * self.depth)} {number(2.5 * self.depth)}")
            widest = ((2.0 * half) ** 2 * 4.0 * self.depth / BINS) ** (1.0 / 3.0)
        else:
            widest = 2.0 * half / BINS ** (1.0 / 3.0)
        width = max(0.5 * (2.0 * self.radius.max() + skin), widest)
        do = self.engine.do
        do(
            f"units {'si' if self.dimension == 2 else 'lj'}",  # with si soft materials of Hertz' law are refused
            "atom_style granular",
            "atom_modify map array sort 0 0.0",
            "boundary m m m",
            "newton off",
            "communicate single vel yes",
            f"region box block {' '.join(sides)} units box",
            f"create_box {self.types} box",
            f"neighbor {number(skin)} bin",
            f"neigh_modify delay 0 every 1 check yes binsize {number(width)}",
        )
        for place, k in zip(in_3d(self.x0), kind.reshape(-1), strict=True):
            do(f"create_atoms {k + 1} single {numbers(place)} units box")
        # Diameters must be set by command: the neighbour lists are made for the largest one known.
        do(*(f"set atom {i + 1} diameter {number(2.0 * radius)}" for i, radius in enumerate(self.radius)))
        self.engine.note_atoms(self.n, self.noun)
        self.engine.set("rmass", self.mass * self.inflate)
        groups = {"turning": self.rotating, "still": ~self.rotating, "fixed": self.fixed, "free": ~self.fixed}
        do(*(f"group {name} id {ids(members)}" for name, members in groups.items() if members.any()))
        if self.fixed.any():
            do("neigh_modify exclude group fixed fixed")

    def _contacts(self):
        """Constants, by types and by pairs of them; dashpots of the linear law are rates of the (inflated) reduced mass."""
        kinds, do = len(self.first), self.engine.do
        table = {name: np.zeros((self.types, self.types)) for name in ("kn", "kt", "gamman", "rebound", "mu")}
        for name in ("kn", "kt", "rebound"):
            table[name] += 1.0  # walls never meet, but a stiffness of zero is refused
        for a, i in enumerate(self.first):
            for b in range(self.types):
                j = int(self.first[b]) if b < kinds else self.n + b - kinds
                law = self.law_of(i, j)
                values = {
                    "kn": law["kn"],
                    "kt": law["ks"] if carries_shear(law) else law["kn"],
                    "gamman": 2.0 * law["beta"] * math.sqrt(law["kn"] / self.reduced(i, j)[0]) / self.inflate,
                    "rebound": self.rebound(law),
                    "mu": law["mu"] if carries_shear(law) else 0.0,
                }
                for name, value in values.items():
                    table[name][a, b] = table[name][b, a] = value
        pairs = {"coefficientFriction": table["mu"]}
        if self.hertz:
            pairs["coefficientRestitution"] = table["rebound"]
            walls = range(len(self.elastic) - len(self.walls), len(self.elastic))
            own = [self.elastic[k] for k in (*self.material_of, *walls)]
            for k, name in enumerate(("youngsModulus", "poissonsRatio")):
                do(f"fix {name} all property/global {name} peratomtype {numbers(each[k] for each in own)}")
        else:
            pairs |= {"kn": table["kn"], "kt": table["kt"], "gamman": table["gamman"], "gammat": 0.0 * table["gamman"]}
        self.model = f"model {'hertz' if self.hertz else 'hooke/stiffness'} tangential history"
        if self.dimension == 2:
            self.options = " limitForce on" if self.damped else ""
        else:
            self.options = " tangential_damping off limitForce off"
        self.engine.contact_model(self.model + self.options, pairs, self.dt)

    def _walls(self):
        texts = [self._facet(np.array(wall["point"]), np.array(wall["normal"])) for wall in self.walls]
        self.engine.meshes(texts, len(self.first))
        self.touched = bool(self.walls) and not self.fixed.all()
        if self.touched:
            self.engine.contacts_at_walls("free", len(texts), self.model, self.options)

    def _facet(self, point, normal):
        """STL text of a wall: a triangle opposite the middle of the bodies, in 2D ``reach`` to either side at z = 0."""
        if self.dimension == 3:
            return facet(normal, triangle(self.middle, point, normal, self.reach))
        along = np.array([-normal[1], normal[0]])
        foot = point + ((self.middle - point) @ along) * along
        ends = [(*(foot + side * 1.5 * self.reach * along), -self.depth) for side in (-1.0, 1.0)]
        corners = [*ends, (*foot, 2.0 * self.depth)]
        if np.cross(np.subtract(corners[1], corners[0]), np.subtract(corners[2], corners[0])) @ [*normal, 0.0] < 0.0:
            corners.reverse()
        return facet((*normal, 0.0), corners)

    def _integrators(self):
        do = self.engine.do
        origin = 1 if self.preload else 0
        for w, legs in enumerate(self.legs):
            self.engine.move(w, [(origin + first, origin + last, in_3d(velocity)) for first, last, velocity in legs])
        for name, style, chosen in (("turning", "nve/sphere", self.rotating), ("still", "nve", ~self.rotating)):
            if chosen.any():
                do(f"fix {name} {name} {style}")
        if self.gravity.any():
            size = length(self.gravity)
            do(f"fix gravity all gravity {number(size / self.inflate)} vector {numbers(in_3d(self.gravity / size))}")
        if self.xi:
            scale = " ".join(f"scale {k + 1} {number(self.mass[i])}" for k, i in enumerate(self.first))
            do(f"fix drag all viscous {number(self.xi)} {scale}")
        if self.dimension == 2:
            do("fix flat all setforce NULL NULL 0.0")
            return
        if self.fixed.any():
            do("fix fixed fixed setforce 0.0 0.0 0.0")
        for k, axis in enumerate("xyz"):
            do(f"compute spin{k} all property/atom omega{axis}")
        do(f"fix spin all ave/atom 1 {self.substeps} {self.substeps} c_spin0 c_spin1 c_spin2")

    def get(self, name):
        """Copy of a vector of each body, with the scene's components."""
        return self.engine.get(name)[:, : self.dimension]

    def start(self):
        """Preload, forces at time 0, first sample, and the velocities of the first half kick."""
        if self.preload:
            self._load_shear()
        self._integrators()
        self.engine.set("v", self.v0)
        self.engine.set("omega", spin_in_3d(self.omega0))
        self.engine.do("run 0 post no")
        self._sample(0)
        if self.inflate != 1.0:
            kick = 0.5 * self.dt * (1.0 - 1.0 / self.inflate)
            self.engine.set("v", self.v0 + kick * self.get("f") / self.mass[:, None])
        if self.dimension == 3:
            self.half_spin = self._spin_ahead()

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.engine.get("torque") / self.inertia[:, None]
        return self.engine.get("omega") + np.where(self.rotating[:, None], turning, 0.0)

    def _load_shear(self):
        """One step in which nothing moves but slip accumulates, from velocities that stretch the shear springs as asked."""
        v = np.zeros((self.n, 2))
        for i, j, force in self.preload:
            wall = self.walls[j - self.n]
            tangent = np.array([wall["normal"][1], -wall["normal"][0]])
            v[i] = -force / (wall["law"]["ks"] * self.dt) * tangent
        self.engine.set("v", v)
        self.engine.do("run 1 post no")
        found, _ = self.contacts()
        for i, j, force in self.preload:
            held = found.get((i, j), (0.0, 0.0, 0.0))[1]
            if not abs(held - force) <= PRELOAD_ROUND_OFF * abs(force):
                raise RuntimeError(
                    f"initial_shear of pair ({i}, {j}) should be {force:g} N, but LIGGGHTS holds {held:g} N: the bodies do "
                    f"not overlap at time 0, or it exceeds the friction limit"
                )

    def advance(self, sampled):
        """All steps; returns the seconds that LIGGGHTS spends on them, see `clock`."""
        wanted, spent, done = set(sampled), 0.0, 0
        for step in sampled if self.dimension == 2 else range(1, max(wanted) + 1):  # in 3D angles are followed
            if step == 0:
                continue
            begin = clock()
            self.engine.do(f"run {(step - done) * self.substeps} pre no post no")
            spent += clock() - begin
            done = step
            if self.dimension == 3:
                # The integral of the spin is the sum of w_{n+1/2} dt; w_n, which the fix averages, is the mean of two of them.
                ahead, mean = self._spin_ahead(), self.engine.fix("spin", 3)
                self.angle = self.angle + self.dt * (self.substeps * mean - 0.5 * (ahead - self.half_spin))
                self.half_spin = ahead
            if step in wanted:
                self._sample(step)
        return spent

    def contacts(self):
        """Touching pairs, ``{(i, j): (fn [N], fs [N], overlap [m])}``, walls after the bodies, and the force on each wall in 3D [N]."""
        engine, found, loads = self.engine, {}, np.zeros((len(self.walls), 3))
        x = self.get("x")
        for i, j, row in engine.touching():
            d = x[j] - x[i]
            found[i, j] = self._components(row, d, length(d))
        for i, w, row in engine.touching_walls() if self.touched else ():
            found[i, self.n + w] = self._components(row, -np.array(self.walls[w]["normal"]), 1.0)
            loads[w] -= row[0:3] + row[3:6]
        return found, loads

    def _components(self, row, d, size):
        """(fn, fs, overlap) from forces on the first body and the vector ``d`` of this size that points to the second one."""
        if self.dimension == 3:
            return float(-row[0:3] @ d / size), row[3:6], float(abs(row[6]))
        normal = d / size
        return float(-row[0:2] @ normal), float(row[3:5] @ (-normal[1], normal[0])), float(abs(row[6]))

    def _sample(self, step):
        """Append one sample of the state at ``t_n``; what contacts report depends on the velocities that LIGGGHTS holds just then."""
        v, late = self.get("v"), self.damped and step > 0  # dashpots saw v_{n-1/2}
        if late:
            force = np.where(self.fixed[:, None], 0.0, self.get("f"))
            self.engine.set("v", v - 0.5 * self.dt * force / (self.mass * self.inflate)[:, None])
        found, loads = self.contacts()
        if late:
            self.engine.set("v", v)
        x, omega, angle, elastic = self.get("x"), self.engine.get("omega"), self.angle, None
        if self.dimension == 2:
            pose = self.pose(step * self.substeps)
            self.check_in_front(x, pose)
            loads, elastic = self.sums(found, pose)
            omega = omega[:, 2]
            angle = omega * (step * self.substeps * self.dt)  # no spin changes: see the adapter
        self.sample(step, x, v, omega, angle, found, loads, elastic)


def facet(normal, corners):
    """STL text of one triangle."""
    vertices = "\n".join("vertex " + " ".join(map(number, corner)) for corner in corners)
    facing = " ".join(map(number, normal))
    return f"solid wall\nfacet normal {facing}\nouter loop\n{vertices}\nendloop\nendfacet\nendsolid wall\n"


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
        library.lammps_extract_compute.restype = library.lammps_extract_fix.restype = ctypes.c_void_p
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

    def contact_model(self, style, table, dt):
        """Constants by pairs of types, the step [s], and what contacts between bodies report."""
        for name, matrix in table.items():
            values = " ".join(number(value) for value in matrix.ravel())
            self.do(f"fix {name} all property/global {name} peratomtypepair {len(matrix)} {values}")
        self.do(f"pair_style gran {style}", "pair_coeff * *", f"timestep {number(dt)}")
        self._send_constants("pairs", "pair", 2)

    def _send_constants(self, name, kind, column):
        self.do(
            f"compute {name} all {kind}/gran/local id force_normal force_tangential delta",
            f"compute {name}_sum all reduce sum c_{name}[{column}]",
            f"compute {name}_ave all reduce ave c_{name}[{column}]",
        )

    def meshes(self, texts, kinds):
        """Walls of these facets, whose types follow those of the bodies."""
        for w, text in enumerate(texts):
            with open(f"wall{w}.stl", "w", encoding="ascii") as file:
                file.write(text)
            self.do(f"fix mesh{w} all mesh/surface file wall{w}.stl type {kinds + w + 1}")

    def contacts_at_walls(self, group, walls, model, options):
        """Contacts of a group with all walls, and what they report."""
        meshes = " ".join(f"mesh{w}" for w in range(walls))
        self.do(f"fix walls {group} wall/gran {model} mesh n_meshes {walls} meshes {meshes}{options}")
        self._send_constants("walls", "wall", 3)

    def move(self, w, legs):
        """Velocity [m/s] of a wall between steps, none where it rests: ``(step before the first, last step, velocity)``."""
        if not legs:
            return
        for axis, name in enumerate("xyz"):
            terms = (f"(step>{first})*(step<={last})*({number(velocity[axis])})" for first, last, velocity in legs)
            self.do(f"variable v{name}{w} equal {'+'.join(terms)}")
        self.do(f"fix move{w} all move/mesh mesh mesh{w} linear/variable v_vx{w} v_vy{w} v_vz{w}")

    def touching(self):
        """Touching pairs ``(i, j, row)``, i < j: normal and shear force on the first of them [N], and the overlap [m]."""
        for one, two, _, *row in self.local("pairs", self.count("pairs_sum", "pairs_ave"), COLUMNS):
            a, b = int(one) - 1, int(two) - 1
            yield (a, b, np.array(row)) if a < b else (b, a, -np.array(row))

    def touching_walls(self):
        """The same of bodies and walls: ``(body, wall, row)``."""
        for wall, _, one, *row in self.local("walls", self.count("walls_sum", "walls_ave"), COLUMNS):
            yield int(one) - 1, int(wall), np.array(row)

    def note_atoms(self, count, noun):
        """Note the number of atoms and their order, which stays as it is: sorting is off and there is one process."""
        self.atoms, made = count, self.library.lammps_get_natoms(self.handle)
        if made != count:
            raise RuntimeError(f"LIGGGHTS took {made} of {count} {noun}s")
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
        """Copy of a per-atom array by body, shape (n, numbers)."""
        return np.array(self._view(name)[self.order])

    def set(self, name, values):
        """Write the first columns of a per-atom array, by body."""
        values = np.reshape(values, (self.atoms, -1))
        self._view(name)[self.order, : values.shape[1]] = values

    def fix(self, name, columns):
        """Copy of what a fix has of each body, shape (n, columns)."""
        pointer = self.library.lammps_extract_fix(self.handle, name.encode(), ATOM, ARRAY, 0, 0)
        rows = ctypes.cast(pointer, ctypes.POINTER(ctypes.POINTER(ctypes.c_double)))
        return np.array(np.ctypeslib.as_array(rows[0], (self.atoms, columns)))[self.order]

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


if __name__ == "__main__":
    serve(Run)
    sys.stderr.flush()
    os._exit(0)  # MPI's own exit would complain that it was not finalised
