"""One simulation in LIGGGHTS, held as a library.

LIGGGHTS integrates by velocity Verlet: between two runs its state is (positions t_n, forces t_n, velocities t_n), and forces see
``v_{n-1/2}`` where they depend on velocities. With a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: ``fix viscous`` with ``xi m`` is this very scheme;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)``: the lagged one with all masses, but not the drag, multiplied by ``1 + a``;
  ``fix gravity``, an acceleration, is divided by it;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: the engine's own half kick, but for the factor ``1 + a``, which ``v_0`` makes up.

The particles are spheres in the plane z = 0; nothing here lets a disk's spin change (the adapter sees to that). A wall is one
triangle that crosses this plane, large enough for the whole run, so that no contact is near an edge.
"""

import math
import time

import numpy as np
from liggghts_library import Liggghts

BINS = 1e6
"""Largest number of bins of the neighbour search: walls make the box large, memory should not follow."""

COLUMNS = 10
"""Of the contact computes: three ids, normal force, shear force, overlap."""

PRELOAD_ROUND_OFF = 1e-9
"""Of the preload: round-off of the velocity that stretches a spring in one step."""


def number(value):
    """Shortest text that gives the same double back."""
    return repr(float(value))


class Run:
    """One simulation."""

    def __init__(self, request):
        scene, extra = request["scene"], request["extra"]
        disks = scene["disks"]
        self.n = len(disks["radius"])
        if not self.n:
            raise ValueError("there is no disk: LIGGGHTS needs at least one")
        self.x0, self.v0 = (np.array(disks[key]).reshape(self.n, 2) for key in ("x", "v"))
        self.omega0, self.radius, self.mass, self.inertia, self.rotating = (
            np.array(disks[key]) for key in ("omega", "radius", "mass", "inertia", "rotating")
        )
        self.gravity, self.xi = np.array(scene["gravity"]), scene["xi"]
        self.substeps, self.dt, self.reach = extra["substeps"], extra["contact_dt"], extra["reach"]
        central = request["numerics"]["damping_form"] == "central"
        self.inflate = 1.0 + 0.5 * self.xi * self.dt if central else 1.0
        self.law, self.walls, self.legs = scene["disk_disk"], scene["walls"], extra["wall_legs"]
        self.path = np.load(extra["wall_path"])
        self.damped = any(law["beta"] > 0.0 for law in [self.law, *(wall["law"] for wall in self.walls)])
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.preload = [tuple(entry) for entry in scene["initial_shear"] if entry[2]]
        self.samples = []
        self.engine = Liggghts(extra["library"])
        self._atoms()
        self._contacts()
        self._walls()

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
                rough = law["mu"] > 0.0 and law["ks"] > 0.0
                reduced = 1.0 / (1.0 / self.kinds[a] + (1.0 / self.kinds[b] if b < kinds else 0.0))
                rate = 2.0 * law["beta"] * math.sqrt(law["kn"] / reduced) / self.inflate
                values = {"kn": law["kn"], "kt": law["ks"] if rough else law["kn"], "gamman": rate}
                for name, value in {**values, "mu": law["mu"] if rough else 0.0}.items():
                    table[name][a, b] = table[name][b, a] = value
        for wall in range(kinds, self.types):  # no two walls meet, but a stiffness of zero is refused
            table["kn"][wall, kinds:] = table["kt"][wall, kinds:] = 1.0
        table["coefficientFriction"] = table.pop("mu")
        self.model, self.limit = "model hooke/stiffness tangential history", " limitForce on" if self.damped else ""
        for name, matrix in table.items():
            values = " ".join(number(value) for value in matrix.ravel())
            self.engine.do(f"fix {name} all property/global {name} peratomtypepair {self.types} {values}")
        self.engine.do(
            f"pair_style gran {self.model}{self.limit}",
            "pair_coeff * *",
            f"timestep {number(self.dt)}",
            "compute pairs all pair/gran/local id force_normal force_tangential delta",
            "compute pairs_sum all reduce sum c_pairs[2]",
            "compute pairs_ave all reduce ave c_pairs[2]",
        )

    def _walls(self):
        for w, wall in enumerate(self.walls):
            name = f"wall{w}.stl"
            with open(name, "w", encoding="ascii") as file:
                file.write(self._triangle(np.array(wall["point"]), np.array(wall["normal"])))
            self.engine.do(f"fix mesh{w} all mesh/surface file {name} type {len(self.kinds) + w + 1}")
        if self.walls:
            meshes = " ".join(f"mesh{w}" for w in range(len(self.walls)))
            self.engine.do(
                f"fix walls all wall/gran {self.model} mesh n_meshes {len(self.walls)} meshes {meshes}{self.limit}",
                "compute walls all wall/gran/local id force_normal force_tangential delta",
                "compute walls_sum all reduce sum c_walls[3]",
                "compute walls_ave all reduce ave c_walls[3]",
            )

    def _triangle(self, point, normal):
        """STL text of a wall: a triangle opposite the middle of the disks, ``reach`` to either side in the plane z = 0."""
        along = np.array([-normal[1], normal[0]])
        foot = point + ((self.middle - point) @ along) * along
        ends = [(*(foot + side * 1.5 * self.reach * along), -self.depth) for side in (-1.0, 1.0)]
        corners = [*ends, (*foot, 2.0 * self.depth)]
        if np.cross(np.subtract(corners[1], corners[0]), np.subtract(corners[2], corners[0])) @ [*normal, 0.0] < 0.0:
            corners.reverse()
        vertices = "\n".join("vertex " + " ".join(number(c) for c in corner) for corner in corners)
        facing = " ".join(number(c) for c in (*normal, 0.0))
        return f"solid wall\nfacet normal {facing}\nouter loop\n{vertices}\nendloop\nendfacet\nendsolid wall\n"

    def _integrators(self):
        do = self.engine.do
        origin = 1 if self.preload else 0
        for w, legs in enumerate(self.legs):
            if not legs:
                continue
            for axis, name in enumerate("xy"):
                terms = (
                    f"(step>{origin + first})*(step<={origin + last})*({number(velocity[axis])})"
                    for first, last, velocity in legs
                )
                do(f"variable v{name}{w} equal {'+'.join(terms)}")
            do(f"variable vz{w} equal 0.0")
            do(f"fix move{w} all move/mesh mesh mesh{w} linear/variable v_vx{w} v_vy{w} v_vz{w}")
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
        """All steps; returns the seconds that LIGGGHTS spends on them."""
        spent, done = 0.0, 0
        for step in sampled:
            if step == 0:
                continue
            begin = time.perf_counter()
            self.engine.do(f"run {(step - done) * self.substeps} pre no post no")
            spent += time.perf_counter() - begin
            done = step
            self._sample(step)
        return spent

    def contacts(self):
        """Touching pairs: ``{(i, j): (fn [N], fs [N], overlap [m])}``, walls after the disks."""
        engine, found = self.engine, {}
        x = engine.get("x")[:, :2]
        for one, two, _, *rest in engine.local("pairs", engine.count("pairs_sum", "pairs_ave"), COLUMNS):
            a, b = int(one) - 1, int(two) - 1
            sign, (i, j) = (1.0, (a, b)) if a < b else (-1.0, (b, a))
            d = x[j] - x[i]
            found[i, j] = self._components(sign * np.array(rest), d / np.hypot(*d))
        rows = engine.count("walls_sum", "walls_ave") if self.walls else 0
        for wall, _, one, *rest in engine.local("walls", rows, COLUMNS):
            normal = -np.array(self.walls[int(wall)]["normal"])
            found[int(one) - 1, self.n + int(wall)] = self._components(np.array(rest), normal)
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
        pose = self.path[min(step * self.substeps, len(self.path) - 1)]
        self._check_behind(x, pose)
        loads, elastic = np.zeros((len(self.walls), 2)), 0.0
        for (_, j), (fn, fs, overlap) in found.items():
            law = self.law
            if j >= self.n:
                law, normal = self.walls[j - self.n]["law"], -pose[j - self.n, 2:4]
                loads[j - self.n] += fn * normal - fs * np.array([-normal[1], normal[0]])
            elastic += 0.5 * law["kn"] * overlap**2 + (0.5 * fs**2 / law["ks"] if law["ks"] else 0.0)
        self.samples.append(
            {
                "step": step,
                "x": x,
                "v": v,
                "omega": omega,
                # No spin changes: see the adapter.
                "angle": omega * (step * self.substeps * self.dt),
                "forces": [found.get(pair, (0.0, 0.0))[:2] for pair in self.pairs],
                "elastic": elastic,
                "wall_point": pose[:, 0:2],
                "wall_normal": pose[:, 2:4],
                "wall_force": loads,
            }
        )

    def _check_behind(self, x, pose):
        for wall, (px, py, nx, ny) in zip(self.walls, pose[:, :4], strict=True):
            height = (x - (px, py)) @ (nx, ny)
            if (height < 0.0).any():
                raise RuntimeError(
                    f"disk {int(np.argmin(height))} is {-height.min():g} m behind wall {wall['name']!r}, where LIGGGHTS' mesh "
                    f"pushes it the wrong way: a smaller contact_dt or a stiffer wall is the way out"
                )
