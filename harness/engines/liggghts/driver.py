"""Driver of LIGGGHTS, which it holds as a library, under the harness' Python.

LIGGGHTS integrates by velocity Verlet: between two runs its state is (positions t_n, forces t_n, velocities t_n), and forces see
``v_{n-1/2}`` where they depend on velocities. With a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: ``fix viscous`` with ``xi m`` is this very scheme;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)``: the lagged one with all masses, but not the drag, multiplied by ``1 + a``;
  ``fix gravity``, an acceleration, is divided by it;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: the engine's own half kick, but for the factor ``1 + a``, which ``v_0`` makes up.

The particles are spheres in the plane z = 0; nothing here lets a disk's spin change (the adapter sees to that). A wall is one
triangle that crosses this plane, large enough for the whole run, so that no contact is near an edge.
"""

import ctypes
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps folders off the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import numpy as np
from driver_parts import SpringRun, clock, number, rough, serve

NOT_BUFFERED = 2
"""``_IONBF`` of the C library."""

SCALAR, LOCAL, ARRAY = 0, 2, 2
"""Of ``lammps_extract_compute``: type of a scalar; style of local data, and type of an array of them."""

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
        self.engine = Liggghts(extra["library"])
        self._atoms()
        self._contacts()
        self._walls()

    def version(self):
        return self.known_version

    def settings(self):
        return {"contact model": self.model + self.limit, "plate half-length [m]": self.reach}

    def _atoms(self):
        """Atom types are the distinct masses, then the walls."""
        self.kinds, kind = np.unique(self.mass, return_inverse=True)
        self.types = len(self.kinds) + len(self.walls)
        self.middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        self.depth = max(4.0 * self.radius.max(), 0.02 * self.reach)  # along z; much flatter triangles are refused
        half = 3.0 * self.reach  # a triangle reaches 1.5 of it from its foot, which is within one of the middle
        bounds = " ".join(f"{number(c - half)} {number(c + half)}" for c in self.middle)
        skin = 0.3 * float(self.radius.mean())
        volume = (2.0 * half) ** 2 * 4.0 * self.depth
        width = max(0.5 * (2.0 * self.radius.max() + skin), (volume / BINS) ** (1.0 / 3.0))
        do = self.engine.do
        do(
            "units si",
            "atom_style granular",
            "atom_modify map array sort 0 0.0",
            "boundary m m m",
            "newton off",
            "communicate single vel yes",
            f"region box block {bounds} {number(-1.5 * self.depth)} {number(2.5 * self.depth)} units box",
            f"create_box {self.types} box",
            f"neighbor {number(skin)} bin",
            f"neigh_modify delay 0 every 1 check yes binsize {number(width)}",
        )
        for i, (x, y) in enumerate(self.x0):
            do(f"create_atoms {int(kind.reshape(-1)[i]) + 1} single {number(x)} {number(y)} 0.0 units box")
        # Diameters must be set by command: the neighbour lists are made for the largest one known.
        do(*(f"set atom {i + 1} diameter {number(2.0 * radius)}" for i, radius in enumerate(self.radius)))
        self.engine.look(self.n)
        self.engine.set("rmass", self.mass * self.inflate)

    def _contacts(self):
        """Pairwise constants, a matrix over types: dashpots are rates of the (inflated) reduced mass."""
        kinds = len(self.kinds)
        laws = [[self.law] * kinds + [wall["law"] for wall in self.walls]] * kinds
        table = {name: np.zeros((self.types, self.types)) for name in ("kn", "kt", "gamman", "gammat", "mu")}
        for a, row in enumerate(laws):
            for b, law in enumerate(row):
                reduced = 1.0 / (1.0 / self.kinds[a] + (1.0 / self.kinds[b] if b < kinds else 0.0))
                rate = 2.0 * law["beta"] * math.sqrt(law["kn"] / reduced) / self.inflate
                values = {"kn": law["kn"], "kt": law["ks"] if rough(law) else law["kn"], "gamman": rate}
                for name, value in {**values, "mu": law["mu"] if rough(law) else 0.0}.items():
                    table[name][a, b] = table[name][b, a] = value
        for wall in range(kinds, self.types):  # no two walls meet, but a stiffness of zero is refused
            table["kn"][wall, kinds:] = table["kt"][wall, kinds:] = 1.0
        table["coefficientFriction"] = table.pop("mu")
        self.model, self.limit = "model hooke/stiffness tangential history", " limitForce on" if self.damped else ""
        self.engine.contact_model(self.model + self.limit, table, self.dt)

    def _walls(self):
        texts = [self._triangle(np.array(wall["point"]), np.array(wall["normal"])) for wall in self.walls]
        self.engine.meshes(texts, len(self.kinds))
        if self.walls:
            self.engine.contacts_at_walls("all", len(texts), self.model, self.limit)

    def _triangle(self, point, normal):
        """STL text of a wall: a triangle opposite the middle of the disks, ``reach`` to either side in the plane z = 0."""
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
            self.engine.move(w, [(origin + first, origin + last, (*velocity, 0.0)) for first, last, velocity in legs])
        for name, style, chosen in (("turning", "nve/sphere", self.rotating), ("still", "nve", ~self.rotating)):
            if chosen.any():
                do(f"group {name} id {' '.join(str(i + 1) for i in np.flatnonzero(chosen))}")
                do(f"fix {name} {name} {style}")
        if self.gravity.any():
            size = float(np.hypot(*self.gravity))
            direction = " ".join(number(value / size) for value in self.gravity)
            do(f"fix gravity all gravity {number(size / self.inflate)} vector {direction} 0.0")
        if self.xi:
            scale = " ".join(f"scale {k + 1} {number(mass)}" for k, mass in enumerate(self.kinds))
            do(f"fix drag all viscous {number(self.xi)} {scale}")
        do("fix plane all setforce NULL NULL 0.0")

    def start(self):
        """Preload, forces at time 0, first sample, and the velocities of the first half kick."""
        if self.preload:
            self._load_shear()
        self._integrators()
        self.engine.set("v", self.v0)
        self.engine.set("omega", np.column_stack([np.zeros((self.n, 2)), self.omega0]))
        self.engine.do("run 0 post no")
        self._sample(0)
        kick = 0.5 * self.dt * (1.0 - 1.0 / self.inflate)
        self.engine.set("v", self.v0 + kick * self.engine.get("f")[:, :2] / self.mass[:, None])

    def _load_shear(self):
        """One step in which nothing moves but slip accumulates, from velocities that stretch the shear springs as asked."""
        v = np.zeros((self.n, 2))
        for i, j, force in self.preload:
            wall = self.walls[j - self.n]
            tangent = np.array([wall["normal"][1], -wall["normal"][0]])
            v[i] = -force / (wall["law"]["ks"] * self.dt) * tangent
        self.engine.set("v", v)
        self.engine.do("run 1 post no")
        found = self.contacts()
        for i, j, force in self.preload:
            held = found.get((i, j), (0.0, 0.0, 0.0))[1]
            if not abs(held - force) <= PRELOAD_ROUND_OFF * abs(force):
                raise RuntimeError(
                    f"initial_shear of pair ({i}, {j}) should be {force:g} N, but LIGGGHTS holds {held:g} N: the bodies do "
                    f"not overlap at time 0, or it exceeds the friction limit"
                )

    def advance(self, sampled):
        """All steps; returns the seconds that LIGGGHTS spends on them, see `clock`."""
        spent, done = 0.0, 0
        for step in sampled:
            if step == 0:
                continue
            begin = clock()
            self.engine.do(f"run {(step - done) * self.substeps} pre no post no")
            spent += clock() - begin
            done = step
            self._sample(step)
        return spent

    def contacts(self):
        """Touching pairs: ``{(i, j): (fn [N], fs [N], overlap [m])}``, walls after the disks."""
        engine, found = self.engine, {}
        x = engine.get("x")[:, :2]
        for i, j, row in engine.touching():
            d = x[j] - x[i]
            found[i, j] = self._components(row, d / np.hypot(*d))
        for i, wall, row in engine.touching_walls() if self.walls else ():
            found[i, self.n + wall] = self._components(row, -np.array(self.walls[wall]["normal"]))
        return found

    @staticmethod
    def _components(row, normal):
        """(fn, fs, overlap) from forces on the first body and the normal that points to the second one."""
        tangent = np.array([-normal[1], normal[0]])
        return float(-row[0:2] @ normal), float(row[3:5] @ tangent), float(abs(row[6]))

    def _sample(self, step):
        """Append one sample of the state at ``t_n``; what contacts report depends on the velocities that LIGGGHTS holds just then."""
        engine = self.engine
        v, late = engine.get("v")[:, :2], self.damped and step > 0  # dashpots saw v_{n-1/2}
        if late:
            engine.set("v", v - 0.5 * self.dt * engine.get("f")[:, :2] / (self.mass * self.inflate)[:, None])
        found = self.contacts()
        if late:
            engine.set("v", v)
        x, omega = engine.get("x")[:, :2], engine.get("omega")[:, 2]
        pose = self.pose(step * self.substeps)
        for w, (px, py, nx, ny) in enumerate(pose[:, :4]):
            self.check_in_front((x - (px, py)) @ (nx, ny), w, "LIGGGHTS' mesh pushes it the wrong way")
        loads, elastic = self.sums(found, pose)
        angle = omega * (step * self.substeps * self.dt)  # no spin changes: see the adapter
        self.sample(step, x, v, omega, angle, self.watched(found), pose, loads, elastic)


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

    def contact_model(self, style, table, dt):
        """Constants by pairs of types, the step [s], and what contacts between disks tell."""
        for name, matrix in table.items():
            values = " ".join(number(value) for value in matrix.ravel())
            self.do(f"fix {name} all property/global {name} peratomtypepair {len(matrix)} {values}")
        self.do(f"pair_style gran {style}", "pair_coeff * *", f"timestep {number(dt)}")
        self._tell("pairs", "pair", 2)

    def _tell(self, name, kind, column):
        self.do(
            f"compute {name} all {kind}/gran/local id force_normal force_tangential delta",
            f"compute {name}_sum all reduce sum c_{name}[{column}]",
            f"compute {name}_ave all reduce ave c_{name}[{column}]",
        )

    def meshes(self, texts, kinds):
        """Walls of these facets, whose types follow those of the disks."""
        for w, text in enumerate(texts):
            with open(f"wall{w}.stl", "w", encoding="ascii") as file:
                file.write(text)
            self.do(f"fix mesh{w} all mesh/surface file wall{w}.stl type {kinds + w + 1}")

    def contacts_at_walls(self, group, walls, model, options):
        """Contacts of a group with all walls, and what they tell."""
        meshes = " ".join(f"mesh{w}" for w in range(walls))
        self.do(f"fix walls {group} wall/gran {model} mesh n_meshes {walls} meshes {meshes}{options}")
        self._tell("walls", "wall", 3)

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
        """The same of disks and walls: ``(disk, wall, row)``."""
        for wall, _, one, *row in self.local("walls", self.count("walls_sum", "walls_ave"), COLUMNS):
            yield int(one) - 1, int(wall), np.array(row)

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


def make(request):
    """The run."""
    if request["scene"].get("dimension") == 3:
        import space_driver

        return space_driver.Run(request)
    return Run(request)


if __name__ == "__main__":
    serve(make)
    sys.stderr.flush()
    os._exit(0)  # MPI's own exit would complain that it was not finalised
