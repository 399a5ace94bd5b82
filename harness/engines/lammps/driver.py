"""Driver of LAMMPS, which it holds as a library, under the harness' Python.

LAMMPS integrates by velocity Verlet: between two runs its state is (positions t_n, forces t_n, velocities t_n), and forces see
``v_{n-1/2}`` where they depend on velocities. Derivations used below, a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: ``fix viscous`` with ``xi m`` is this very scheme;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a) = v- + dt (F - xi m v-)/(m (1 + a))`` is the lagged one with all masses
  and moments of inertia, but not the drag, multiplied by ``1 + a``; ``fix gravity``, an acceleration, is divided by it;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: LAMMPS' own half kick, but for the factor ``1 + a``, which ``v_0`` makes up
  for;
- rotation: LAMMPS keeps no angles of round particles. It averages the spins over the steps of one sampling interval
  (``fix ave/atom``), and as ``w_n`` is the mean of ``w_{n-1/2}`` and ``w_{n+1/2}``, the sum of ``w_{n+1/2} dt`` follows from it.

Dashpots of 3D: LAMMPS' ``coeff_restitution`` is ``c = 2 sqrt(5/6) beta sqrt(m 2 E* a)`` for Hertz' law and ``c = 2 beta sqrt(m kn)`` for
the linear one, ``beta = -ln e/sqrt(pi^2 + ln^2 e)``: the law's own, with ``e = exp(-pi beta/sqrt(1 - beta^2))``.

Prescribed wall motion is given as formulas of the step, which LAMMPS evaluates itself, see `motion_parts`.
"""

import contextlib
import glob
import math
import os
import sys
from importlib import metadata

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps folders off the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import numpy as np
from driver_parts import SpringRun, carries_shear, clock, ids, in_3d, length, number, numbers, serve
from lammps_parts import Arrays, load
from motion_parts import MOTIONS

MINDLIN = {"none": "mindlin", "force": "mindlin/force", "rescale": "mindlin_rescale"}

PRELOAD_ROUND_OFF = 1e-9
"""Of the largest preload: round-off of the velocities that stretch the springs."""


class Run(SpringRun):
    """One simulation."""

    name = "LAMMPS"

    def __init__(self, request):
        super().__init__(request)
        self.classic = request["extra"].get("classic_pairs", False)
        self.motions = [MOTIONS[self.dimension](wall) for wall in self.walls]
        self.origin = self.substeps if self.preload else 0  # LAMMPS' number of the step at time 0
        self.n_steps, self.run_words = request["numerics"]["n_steps"], ""
        if self.cell is not None:
            self.origin = 1
        self.angle = np.zeros_like(self.omega0)
        self.engine = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        kinds = (lammps.LMP_STYLE_ATOM, lammps.LMP_TYPE_VECTOR, lammps.LMP_TYPE_ARRAY)
        self.arrays, self._order = Arrays(self.engine, self.n, *kinds), None
        self._atoms()
        self._contacts()

    def version(self):
        return metadata.version("lammps")

    def settings(self):
        return {"pair_style": self.pair_style, "release": self.engine.version()}

    def do(self, *commands):
        self._order = None
        for command in commands:
            self.engine.command(command)

    def group(self, name, members):
        """A group of LAMMPS of these bodies, where there are any."""
        if members.any():
            self.do(f"group {name} id {ids(members)}")

    def _atoms(self):
        """Atom types are the kinds of bodies.

        Of disks: equal mass, inertia, freedom to turn, radius and material; of spheres: equal material, and equal radius where a resistance
        to spins needs the reduced one.
        """
        material = np.unique(self.material, return_inverse=True)[1]
        resisted = any(law["rolling"] or law["twisting"] for law in self.all_laws)
        if self.dimension == 2:
            rows = [self.mass, self.inertia, self.rotating, self.radius, material]
        else:
            rows = [material, self.radius if resisted else np.zeros(self.n)]
        self.kinds, self.first, kind = np.unique(np.column_stack(rows), axis=0, return_index=True, return_inverse=True)
        largest = self.radius.max()
        low, high = (self.x0.min(axis=0) - largest).tolist(), (self.x0.max(axis=0) + largest).tolist()
        if self.dimension == 2:  # as deep as the disks: a depth far below the cutoff is refused
            low, high = [*low, -largest], [*high, largest]
        bounds = " ".join(f"{number(a)} {number(b)}" for a, b in zip(low, high, strict=True))
        boundary = "p p p" if self.cell else "m m p" if self.dimension == 2 else "m m m"
        self.do(
            "units lj",
            "atom_style sphere",
            "atom_modify map array sort 0 0.0",
            f"dimension {self.dimension}",
            f"boundary {boundary}",
            "newton off",
            "comm_modify vel yes",
            f"region box {self._box(largest) if self.cell else f'block {bounds}'} units box",
            f"create_box {len(self.kinds)} box",
            f"neighbor {number(0.3 * self.radius.mean())} bin",
            "neigh_modify delay 0 every 1 check yes",
        )
        types = (kind.reshape(-1) + 1).tolist()
        made = self.engine.create_atoms(self.n, list(range(1, self.n + 1)), types, in_3d(self.x0).ravel().tolist())
        if made != self.n:
            raise RuntimeError(f"LAMMPS took {made} of {self.n} {self.noun}s")
        if self.cell is not None:  # LAMMPS puts disks back into the box, and does not count how far
            put = self.arrays.atom("x")[self.order(), :2]
            self.put_back = np.round((self.x0 - put) / self.cell.size)
        self.set("radius", self.radius)
        self.set("rmass", self.mass * self.inflate)
        self.group("fixed", self.fixed)
        if self.fixed.any():
            self.do("neigh_modify exclude group fixed fixed")

    def _box(self, depth):
        """The periodic cell at time 0, as deep as the disks, as LAMMPS' prism."""
        width, height = (number(size) for size in self.cell.size)
        return f"prism 0 {width} 0 {height} {number(-depth)} {number(depth)} 0 0 0"

    def _deform(self):
        """The deforming cell, and words that every ``run`` then needs.

        LAMMPS deforms at the end of a step, to what its step number says: forces at ``t_n`` would see the cell of ``t_{n-1}``. So the
        deformation is set to have begun a step before time 0, and its first step is made by hand, see `start`.
        """
        if self.cell is None:
            return
        (xx, xy), (_, yy) = self.cell.rate
        parts = [f"{name} erate {number(rate)}" for name, rate in (("x", xx), ("y", yy), ("xy", xy)) if rate]
        if parts:
            self.do(f"fix deform all deform 1 {' '.join(parts)} remap v")
            self.run_words = f"start {self.origin - 1} stop {self.origin + self.substeps * self.n_steps + 1}"

    def _first_deformation(self):
        """The cell of ``t_1``, in which LAMMPS keeps the box about its centre."""
        if self.cell is None or not self.cell.rate.any():
            return
        x, v, h = self.get("x"), self.get("v"), self.cell.edges(self.dt)
        low, high = 0.5 * (self.cell.size - np.diag(h)), 0.5 * (self.cell.size + np.diag(h))
        bounds = " ".join(f"{name} final {number(a)} {number(b)}" for name, a, b in zip("xy", low, high, strict=True))
        self.do(f"change_box all {bounds} xy final {number(h[0, 1])} units box")
        self.set("x", x)  # of disks that were put on the other side, by the edges of another time
        self.set("v", v)
        self.do("neigh_modify check no")  # `change_box` forgets the number of images: the first step finds them anew

    def images(self):
        """Whole edges by which each disk is out of the box that LAMMPS has it in, shape (n, 2).

        LAMMPS flips a box that leans far: its second edge is then the cell's and some of the first, ``k e_1``. The box is that of the
        next step; a rate of the first edge together with a shear, for which k would not be whole, is refused.
        """
        packed = np.array(self.engine.numpy.extract_atom("image"))[self.order()]
        if packed.ndim == 1:
            packed = np.array([self.engine.decode_image_flags(int(flag)) for flag in packed])
        images = packed[:, :2].astype(float)
        low, high, lean = self.engine.extract_box()[:3]
        step = self.engine.extract_global("ntimestep") - self.origin + 1
        flips = (
            round((lean - self.cell.edges(step * self.dt)[0, 1]) / (high[0] - low[0])) if self.cell.rate.any() else 0
        )
        images[:, 0] += flips * images[:, 1]
        return images + self.put_back

    def _per_edge(self, name):
        """What an image is displaced by, or moves faster by, as columns."""
        if name == "v":
            return self.cell.motion
        return self.cell.edges((self.engine.extract_global("ntimestep") - self.origin) * self.dt)

    def order(self):
        """Index of each body among LAMMPS' atoms, which commands alone change."""
        if self._order is None:
            self._order = np.argsort(self.arrays.atom("id"))
        return self._order

    def set(self, name, values):
        """Write a per-atom array by body: a number each, a vector, or the z component of a spin."""
        array, order = self.arrays.atom(name), self.order()
        if name in ("x", "v") and self.cell is not None:
            values = values - self.images() @ self._per_edge(name).T
        if array.ndim == 1:
            array[order] = values
        elif values.ndim == 1:
            array[order, 2] = values
        else:
            array[order, : self.dimension] = values

    def get(self, name):
        """Copy of a per-atom array by body, of a vector the scene's components."""
        array = self.arrays.atom(name)[self.order()]
        if name in ("x", "v") and self.cell is not None:
            array[:, :2] += self.images() @ self._per_edge(name).T
        if array.ndim == 1 or self.dimension == 3:
            return array
        return array[:, 2] if name in ("omega", "torque") else array[:, :2]

    def _contacts(self):
        pairs = pair_commands(self)
        self.pair_style = pairs[0].split()[1]
        self.do(*pairs)
        # A neck holds spheres that no longer overlap; elsewhere pairs that do are all that there is.
        cutoff = "type" if any(law["surface_energy"] and law["surface"] == "jkr" for law in self.all_laws) else "radius"
        self.do(
            f"timestep {number(self.dt)}",
            f"compute force all pair/local dist force p1 p2 p3 cutoff {cutoff}",
            f"compute atoms all property/local patom1 patom2 cutoff {cutoff}",
            f"reset_timestep {self.origin if self.cell else max(self.origin - 1, 0)}",
            f"variable t equal ternary(step>{self.origin},(step-{self.origin})*{number(self.dt)},0.0)",
        )
        self.wall_fixes = [self._wall(w, wall, self.motions[w]) for w, wall in enumerate(self.walls)]

    def _wall(self, w, wall, motion):
        """Region and contacts of a wall; returns the names of its fixes, one for each law and dashpot."""
        moves = ""
        if motion.moves:
            for name, formula in zip(motion.names, motion.formulas, strict=True):
                self.do(f'variable {name}{w} equal "{formula}"')
            moves = f"move v_x{w} v_y{w} {'NULL' if self.dimension == 2 else f'v_z{w}'}"
            if motion.turns:
                moves += f" rotate v_a{w} {numbers(in_3d(motion.pivot))} {numbers(motion.axis)}"
        flat = numbers((*in_3d(wall["point"]), *in_3d(wall["normal"])))
        self.do(f"region wall{w} plane {flat} side in units box {moves}")
        models, kind, fixes = [granular(self, i, self.n + w) for i in self.first], self.get("type"), []
        for model in dict.fromkeys(models):
            kinds = [k + 1 for k, each in enumerate(models) if each == model]
            members = np.isin(kind, kinds) & ~self.fixed
            if members.any():
                fix, group = f"wall{w}_kind{kinds[0]}", "all"
                if not members.all():
                    group = f"kinds{'_'.join(map(str, kinds))}"
                    self.group(group, members)
                self.do(f"fix {fix} {group} wall/gran/region granular {model} region wall{w} contacts")
                fixes.append(fix)
        return fixes

    def _integrators(self):
        if self.dimension == 2:
            self.do("fix flat all enforce2d")
        self.group("turning", self.rotating)
        self.group("still", ~self.rotating)
        if self.rotating.any():
            self.do(f"fix turning turning nve/sphere{' disc' if self.dimension == 2 else ''}")
        if not self.rotating.all():
            self.do("fix still still nve")
        if self.gravity.any():
            size = length(self.gravity)
            direction = numbers(in_3d(self.gravity / size))
            self.do(f"fix gravity all gravity {number(size / self.inflate)} vector {direction}")
        if self.xi:
            for name, style, values in (
                ("drag", "viscous", self.mass),
                ("spin_drag", "viscous/sphere", self.inertia),
            ):
                scale = " ".join(f"scale {k + 1} {number(values[i])}" for k, i in enumerate(self.first))
                self.do(f"fix {name} all {style} {number(self.xi)} {scale}")
        if self.forces_on:
            self.do("fix loads all external pf/callback 1 1")
            self.engine.set_fix_external_callback("loads", apply_loads, self)
        for axis in range(self.dimension):
            self.group(f"held{axis}", self.held[:, axis])
            if self.held[:, axis].any():
                force = ["NULL"] * 3
                force[axis] = "0.0"
                self.do(f"fix held{axis} held{axis} setforce {' '.join(force)}")
        self.do(
            "compute spin all property/atom omegax omegay omegaz",
            f"fix spin all ave/atom 1 {self.substeps} {self.substeps} c_spin[1] c_spin[2] c_spin[3]",
        )

    def start(self):
        """Preload, forces at time 0, first sample, and the velocities of the first half kick."""
        if self.preload:
            load_shear(self)
        self._integrators()
        self._deform()
        self.set("v", self.v0)
        self.set("omega", self.omega0)
        self.do(f"run 0 post no {self.run_words}")
        self._sample(0, self.v0, self.omega0)
        kick = 0.5 * self.dt * (1.0 - 1.0 / self.inflate)
        self.set("v", self.v0 + kick * self.get("f") / self.mass[:, None])
        turned = self.omega0 + kick * self.get("torque") / self._of_spins(self.inertia)
        self.set("omega", np.where(self._of_spins(self.rotating), turned, self.omega0))
        self.half_spin = self._spin_ahead()
        self._first_deformation()

    def _of_spins(self, values):
        """A number of each body as it is combined with spins."""
        return values if self.dimension == 2 else values[:, None]

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.get("torque") / self._of_spins(self.inertia * self.inflate)
        return self.get("omega") + np.where(self._of_spins(self.rotating), turning, 0.0)

    def advance(self, sampled):
        """All steps; returns the seconds that LAMMPS spends on them, see `clock`."""
        wanted, spent = set(sampled), 0.0
        for step in range(1, max(wanted) + 1):
            begin = clock()
            self.do(f"run {self.substeps} pre no post no {self.run_words}")
            spent += clock() - begin
            if step == 1:
                self.do("neigh_modify check yes")
            mean = self.arrays.fix("spin", True)[self.order()]
            if self.dimension == 2:
                mean = mean[:, 2]
            ahead = self._spin_ahead()
            self.angle = self.angle + self.dt * (self.substeps * mean - 0.5 * (ahead - self.half_spin))
            self.half_spin = ahead
            if step in wanted:
                self._sample(step, self.get("v"), self.get("omega"))
        return spent

    def _sample(self, step, v, omega):
        """Append one sample of the state at ``t_n``; what pairs report depends on the velocities that LAMMPS holds just then."""
        late = self.damped and step > 0  # dashpots saw v_{n-1/2}
        if late:
            force = np.where(self.held, 0.0, self.get("f"))
            self.set("v", v - 0.5 * self.dt * force / (self.mass * self.inflate)[:, None])
        x, pose = self.get("x"), self.poses(step)
        contacts, elastic, loads = self.forces(x, pose)
        if late:
            self.set("v", v)
        if self.dimension == 2:
            self.check_in_front(x, pose)
        self.sample(step, x, v, omega, self.angle, contacts, loads, elastic, pose)

    def forces(self, x, pose):
        """Contacts as `sample` wants them, the elastic energy of disks [J], and the force on each wall [N]."""
        found, energy, moment, d = {}, 0.0, np.zeros((2, 2)), self.dimension
        for (i, j), (distance, fn, shear) in self._pairs().items():
            if d == 3:
                found[i, j] = fn, shear
                continue
            apart = x[j] - x[i]
            if self.cell is not None:
                now = (self.engine.extract_global("ntimestep") - self.origin) * self.dt
                apart = self.cell.nearest(now, apart)
            fs = float((apart[0] * shear[1] - apart[1] * shear[0]) / distance)
            energy += stored(self.law_of(i, j), self.radius[i] + self.radius[j] - distance, fs)
            moment += np.outer(shear - fn * apart / distance, apart)
            found[i, j] = fn, fs
        if self.cell is not None:
            self.observe_stress(moment)
        loads = np.zeros((len(self.walls), d))
        for w, row in enumerate(pose):
            point, normal = row[:d], row[d:]
            for i, force in self._at_wall(w):
                fn = float(force @ normal)
                fs = force - fn * normal if d == 3 else float(force[0] * normal[1] - force[1] * normal[0])
                found[i, self.n + w] = fn, fs
                loads[w] -= force
                if d == 2:
                    overlap = self.radius[i] - (x[i] - point) @ normal
                    energy += stored(self.law_of(i, self.n + w), overlap, fs)
        return found, energy if d == 2 else None, loads

    def _pairs(self):
        """Touching pairs of bodies: ``{(i, j): (distance of the centres [m], fn [N], shear force on i [N])}``, ``i < j``."""
        rows = self.engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_SIZE_ROWS)
        if not rows:
            return {}
        force = self.engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        atoms = self.engine.extract_compute("atoms", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        found = {}
        for k in range(rows):
            (distance, fn, *shear), (one, two) = force[k][: 2 + self.dimension], atoms[k][:2]
            i, j = int(one) - 1, int(two) - 1
            found[min(i, j), max(i, j)] = distance, fn, np.array(shear) if i < j else -np.array(shear)
        return found

    def _at_wall(self, w):
        """Bodies that touch a wall, and its force on each [N]."""
        found = []
        for fix in self.wall_fixes[w]:
            table = self.arrays.fix(fix, True)[self.order()]
            found += [(int(i), table[i, 1 : 1 + self.dimension]) for i in np.flatnonzero(table[:, 0])]
        return sorted(found, key=lambda each: each[0]) if self.dimension == 2 else found

    def poses(self, step):
        """Point and normal of each wall as a row, of 2D where LAMMPS has it now, of 3D of the path."""
        if self.dimension == 3:
            return self.pose(step * self.substeps)[:, :6]
        found = np.empty((len(self.walls), 4))
        for w, motion in enumerate(self.motions):
            found[w] = *motion.point, *motion.normal
            if motion.moves:
                x, y, angle = (self.engine.extract_variable(f"{name}{w}") for name in motion.names)
                found[w] = *motion.place(x, y, angle), *motion.turned_normal(angle)
        return found


def apply_loads(run, step, _count, tags, _x, force):
    """LAMMPS' callback in every step: forces in an array that it adds, torques added here."""
    load = run.loads_at(step - run.origin)[np.asarray(tags) - 1]
    force[:, :2] = load[:, :2]
    run.engine.numpy.extract_atom("torque")[: len(load), 2] += load[:, 2]


def dashpot(law, mass, other=math.inf):
    """``c = 2 beta sqrt(m_eff kn)`` [N s/m] of a disk and another one or a wall."""
    return 2.0 * law["beta"] * math.sqrt(law["kn"] / (1.0 / mass + 1.0 / other))


def granular(run, i, j):
    """Words of the ``granular`` model of the contact of a body and another one or a wall."""
    return (disk_words if run.dimension == 2 else sphere_words)(run, i, j)


def disk_words(run, i, j):
    """Of a disk: a dashpot that never pulls, or, with cohesion, may.

    Linear cohesion is a softer spring. Where there is no dashpot beside it, the repulsive part that friction sees is kn/(kn - cohesion)
    times the spring's force. The rolling spring of the way ``R q``, with R the reduced radius, has the stiffness ``kr/R^2``.
    """
    law, bodies = run.law_of(i, j), (i, j) if j < run.n else (i,)
    c = dashpot(law, *(run.mass[k] for k in bodies))
    soft = law["kn"] - law["cohesion"]
    repulsive = law["kn"] / soft
    shear, resisted = "linear_nohistory 0.0 0.0", ""
    if carries_shear(law):
        shear = f"linear_history {number(law['ks'])} 0.0 {number(law['mu'] * repulsive)}"
    if law["rolling"] is not None:
        curvature = sum(1.0 / run.radius[k] for k in bodies)
        stiffness, cap = law["rolling"]["kr"] * curvature**2, law["rolling"]["mu"] * repulsive
        resisted = f" rolling sds {number(stiffness)} 0.0 {number(cap)}"
    words = f"hooke {number(soft)} {number(c)} tangential {shear}{resisted} damping velocity"
    return words + " limit_damping" if c and not law["cohesion"] else words


def sphere_words(run, i, j):
    """Of a sphere: a linear spring, Hertz' or an adhesive one, whose dashpot may pull."""
    law, radius = run.law_of(i, j), run.reduced(i, j)[1]
    rebound = run.rebound(law) if law["beta"] else 0.0
    if law["surface_energy"]:  # with Poisson's ratio 0 and the same material on both sides E is 2 E*
        normal = f"{law['surface']} {number(2.0 * law['e_star'])} 0.0 0.0 {number(law['surface_energy'])}"
    elif law["e_star"]:
        normal = f"hertz {number(4.0 / 3.0 * law['e_star'])} {number(rebound)}"
    else:
        normal = f"hooke {number(law['kn'])} {number(rebound)}"
    shear, resisted = "linear_nohistory 0.0 0.0", ""
    if carries_shear(law):
        model = MINDLIN[law["unloading"]] if law["e_star"] else "linear_history"
        stiffness = 8.0 * law["g_star"] if law["e_star"] else law["ks"]
        shear = f"{model} {number(stiffness)} 0.0 {number(law['mu'])}"
    if law["rolling"]:  # a spring of the way R q
        resisted += f" rolling sds {number(law['rolling']['kr'] / radius**2)} 0.0 {number(law['rolling']['mu'])}"
    if law["twisting"]:
        twisting = law["twisting"]
        resisted += f" twisting sds {number(twisting['kr'])} 0.0 {number(twisting['mu'] * radius)}"
    return f"{normal} tangential {shear}{resisted} damping {'coeff_restitution' if law['beta'] else 'velocity'}"


def pair_commands(run):
    """Commands of the contacts between bodies."""
    first, kinds = run.first, range(len(run.first))
    if run.classic:  # all equal where there is a dashpot; LAMMPS multiplies the rate by its own reduced mass
        law, mass = run.law_of(0, 1), run.mass[first[0]]
        rate = dashpot(law, mass, mass) / (0.5 * mass * run.inflate)
        limit = " limit_damping" if rate else ""
        stiffness = f"{number(law['kn'])} {number(law['ks'])}"
        style = f"gran/hooke/history {stiffness} {number(rate)} 0.0 {number(law['mu'])} 0{limit}"
        return [f"pair_style {style}", "pair_coeff * *"]
    words = {(a + 1, b + 1): granular(run, first[a], first[b]) for a in kinds for b in kinds if a <= b}
    if len(set(words.values())) == 1:
        words = {("*", "*"): words[1, 1]}
    return ["pair_style granular", *(f"pair_coeff {a} {b} {model}" for (a, b), model in words.items())]


def stored(law, overlap, fs):
    """Elastic energy of a contact's springs [J]; NaN with a rolling spring, whose torque LAMMPS reports of no wall."""
    if law["rolling"] is not None:
        return math.nan
    shear = 0.5 * fs * fs / law["ks"] if carries_shear(law) else 0.0
    return float(0.5 * (law["kn"] - law["cohesion"]) * overlap * overlap + shear)


def load_shear(run):
    """One step in which nothing moves but slip accumulates, from velocities that stretch every shear spring as asked.

    Every touching contact gets an equation for its slip, and one with a dashpot another for a normal velocity of zero. What no
    velocities can do, and what the friction limit cuts off, is refused.
    """
    wanted = {(i, j): force for i, j, force in run.preload}
    touching = dict(_touching(run))
    for (i, j), force in wanted.items():
        if (i, j) not in touching:
            raise RuntimeError(
                f"initial_shear of pair ({i}, {j}) is {force:g} N, but the two bodies do not overlap at time 0: a contact "
                f"that carries shear needs an initial overlap"
            )
    rows, values = [], []
    for (i, j), (law, normal) in touching.items():
        slip, approach = np.zeros((2, run.n, 3))
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body < run.n:
                slip[body] = (-sign * normal[1], sign * normal[0], run.radius[body])
                approach[body, :2] = sign * normal[0], sign * normal[1]
        shear = wanted.get((i, j), 0.0)
        if carries_shear(law):
            rows.append(slip.ravel())
            values.append(-shear / (law["ks"] * run.dt))
        elif shear:
            raise RuntimeError(f"initial_shear of pair ({i}, {j}) is {shear:g} N, but this contact has no shear spring")
        if law["beta"] > 0.0:  # else the friction limit does not depend on velocities
            rows.append(approach.ravel())
            values.append(0.0)
    state = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0].reshape(run.n, 3)
    run.set("v", state[:, :2])
    run.set("omega", state[:, 2])
    run.do("run 1 post no")
    largest = max(map(abs, wanted.values()))
    found = run.forces(run.get("x"), run.poses(0))[0]
    for pair in touching:
        asked, fs = wanted.get(pair, 0.0), found.get(pair, (0.0, 0.0))[1]
        if not abs(fs - asked) <= PRELOAD_ROUND_OFF * largest:
            raise RuntimeError(
                f"initial_shear of pair {pair} should be {asked:g} N, but LAMMPS holds {fs:g} N: it exceeds the friction "
                f"limit, or contacts that form a loop cannot be stretched independently"
            )


def _touching(run):
    """Pairs that overlap at time 0: ``(i, j)``, law and normal from the first body to the second."""
    for i in range(run.n):
        for j in range(i + 1, run.n):
            d = run.x0[j] - run.x0[i]
            distance = float(np.hypot(*d))
            if distance < run.radius[i] + run.radius[j]:
                yield (i, j), (run.law_of(i, j), d / distance)
        for w, wall in enumerate(run.walls):
            normal = np.array(wall["normal"])
            if (run.x0[i] - np.array(wall["point"])) @ normal < run.radius[i]:
                yield (i, run.n + w), (run.law_of(i, run.n + w), -normal)


def preload():
    """Load the library, in a process of which runs are copies; the command names the MPI library."""
    load(sys.argv[1])


def make(request):
    """The run, with LAMMPS' library."""
    global lammps
    lammps = load(request["extra"]["libmpi"])
    try:
        return Run(request)
    finally:
        free_shared_memory()


def free_shared_memory():
    """Take its name off MPICH's shared memory, 1 MB that nobody else uses: it would outlive a process that ends without finalising MPI."""
    for path in glob.glob(f"/dev/shm/mpich_shm_{os.getpid():x}_*"):
        with contextlib.suppress(OSError):
            os.unlink(path)


if __name__ == "__main__":
    serve(make)
