"""Spheres in space in LIGGGHTS: hooke/stiffness or hertz with tangential history; the scheme is that of the plane's driver.

A plane is one triangle, opposite the middle of the spheres and large enough for the whole run.
"""

import ctypes

import numpy as np
from driver import BINS, Liggghts, facet
from driver_parts import clock, number
from space_parts import SpaceRun, rough

PER_ATOM, ARRAY = 1, 2
"""Style and type of ``lammps_extract_fix``."""


class Run(SpaceRun):
    """One simulation."""

    name = "LIGGGHTS"

    def __init__(self, request):
        super().__init__(request)
        extra = request["extra"]
        self.reach, self.legs, self.known_version = extra["reach"], extra["wall_legs"], extra["version"]
        self.elastic = extra["elastic"]  # E and nu of each material, then of each wall
        self.angle = np.zeros((self.n, 3))
        self.engine = Liggghts(extra["library"])
        self._atoms()
        self._contacts()
        self._walls()
        self._integrators()

    def version(self):
        return self.known_version

    def settings(self):
        return {"contact model": self.model, "plate inradius [m]": self.reach}

    def _atoms(self):
        """Atom types are the kinds of spheres, then the walls: equal material, and equal mass where linear dashpots ask for rates."""
        self.hertz = bool(self.law["e_star"])
        material = np.unique(self.material, return_inverse=True)[1]
        by_mass = self.mass if self.damped and not self.hertz else np.zeros(self.n)
        rows = np.column_stack([material, by_mass])
        _, self.first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        self.material_of = [int(material[i]) for i in self.first]
        self.types = len(self.first) + len(self.walls)
        self.middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        half = (
            3.0 * self.reach
        )  # a triangle's corners are twice its inradius from its foot, which is within one of the middle
        bounds = " ".join(f"{number(c - half)} {number(c + half)}" for c in self.middle)
        skin = 0.3 * float(self.radius.mean())
        width = max(0.5 * (2.0 * self.radius.max() + skin), 2.0 * half / BINS ** (1.0 / 3.0))
        do = self.engine.do
        do(
            "units lj",  # those of the scene: elsewhere soft materials are refused
            "atom_style granular",
            "atom_modify map array sort 0 0.0",
            "boundary m m m",
            "newton off",
            "communicate single vel yes",
            f"region box block {bounds} units box",
            f"create_box {self.types} box",
            f"neighbor {number(skin)} bin",
            f"neigh_modify delay 0 every 1 check yes binsize {number(width)}",
        )
        for place, k in zip(self.x0, kind.reshape(-1), strict=True):
            do(f"create_atoms {k + 1} single {' '.join(map(number, place))} units box")
        # Diameters must be set by command: the neighbour lists are made for the largest one known.
        do(*(f"set atom {i + 1} diameter {number(2.0 * radius)}" for i, radius in enumerate(self.radius)))
        self.engine.look(self.n)
        self.engine.set("rmass", self.mass)
        for name, members in (
            ("turning", self.rotating),
            ("still", ~self.rotating),
            ("fixed", self.fixed),
            ("free", ~self.fixed),
        ):
            if members.any():
                do(f"group {name} id {' '.join(str(i + 1) for i in np.flatnonzero(members))}")
        if self.fixed.any():
            do("neigh_modify exclude group fixed fixed")

    def _contacts(self):
        """Constants, by types and by pairs of them."""
        kinds, do = len(self.first), self.engine.do
        table = {name: np.zeros((self.types, self.types)) for name in ("kn", "kt", "gamman", "rebound", "mu")}
        table["kn"] += 1.0  # walls never meet, but a stiffness of zero is refused
        table["kt"] += 1.0
        table["rebound"] += 1.0
        for a, i in enumerate(self.first):
            for b in range(self.types):
                j = int(self.first[b]) if b < kinds else self.n + b - kinds
                law = self.law_of(i, j)
                beta = law["beta"]
                values = {
                    "kn": law["kn"],
                    "kt": law["ks"] if rough(law) else law["kn"],
                    "gamman": 2.0 * beta * np.sqrt(law["kn"] / self.reduced(i, j)[0]),
                    "rebound": np.exp(-np.pi * beta / np.sqrt(1.0 - beta**2)) if beta < 1.0 else 0.0,
                    "mu": law["mu"] if rough(law) else 0.0,
                }
                for name, value in values.items():
                    table[name][a, b] = table[name][b, a] = value
        pairs = {"coefficientFriction": table["mu"]}
        if self.hertz:
            pairs["coefficientRestitution"] = table["rebound"]
            walls = range(len(self.elastic) - len(self.walls), len(self.elastic))
            own = [self.elastic[k] for k in (*self.material_of, *walls)]
            for k, name in enumerate(("youngsModulus", "poissonsRatio")):
                do(f"fix {name} all property/global {name} peratomtype {' '.join(number(each[k]) for each in own)}")
        else:
            pairs |= {"kn": table["kn"], "kt": table["kt"], "gamman": table["gamman"], "gammat": 0.0 * table["gamman"]}
        self.model = f"model {'hertz' if self.hertz else 'hooke/stiffness'} tangential history"
        self.options = "tangential_damping off limitForce off"
        self.engine.contact_model(f"{self.model} {self.options}", pairs, self.dt)

    def _walls(self):
        texts = [self._triangle(np.array(wall["point"]), np.array(wall["normal"])) for wall in self.walls]
        self.engine.meshes(texts, len(self.first))
        if self.walls and not self.fixed.all():
            self.engine.contacts_at_walls("free", len(texts), self.model, f" {self.options}")

    def _triangle(self, point, normal):
        """STL text of a wall: an equilateral triangle about the foot of the spheres' middle."""
        foot = self.middle - ((self.middle - point) @ normal) * normal
        one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        one /= np.linalg.norm(one)
        two = np.cross(normal, one)
        angles = 2.0 * np.pi / 3.0 * np.arange(3)
        corners = [foot + 2.0 * self.reach * (np.cos(a) * one + np.sin(a) * two) for a in angles]
        return facet(normal, corners)

    def _integrators(self):
        do = self.engine.do
        for w, legs in enumerate(self.legs):
            self.engine.move(w, legs)
        for name, style, chosen in (("turning", "nve/sphere", self.rotating), ("still", "nve", ~self.rotating)):
            if chosen.any():
                do(f"fix {name} {name} {style}")
        if self.gravity.any():
            size = float(np.linalg.norm(self.gravity))
            do(f"fix gravity all gravity {number(size)} vector {' '.join(map(number, self.gravity / size))}")
        if self.fixed.any():
            do("fix fixed fixed setforce 0.0 0.0 0.0")
        for k, axis in enumerate("xyz"):
            do(f"compute spin{k} all property/atom omega{axis}")
        do(f"fix spin all ave/atom 1 {self.substeps} {self.substeps} c_spin0 c_spin1 c_spin2")

    def start(self):
        """Forces at time 0 and the first sample."""
        self.engine.set("v", self.v0)
        self.engine.set("omega", self.omega0)
        self.engine.do("run 0 post no")
        self._sample(0)
        self.half_spin = self._spin_ahead()

    def _spin_ahead(self):
        """``w_{n+1/2}`` from the state at ``t_n`` [rad/s]."""
        turning = 0.5 * self.dt * self.engine.get("torque") / self.inertia[:, None]
        return self.engine.get("omega") + np.where(self.rotating[:, None], turning, 0.0)

    def advance(self, sampled):
        """All steps; returns the seconds that LIGGGHTS spends on them, see `clock`."""
        wanted, spent = set(sampled), 0.0
        for step in range(1, max(wanted) + 1):
            begin = clock()
            self.engine.do(f"run {self.substeps} pre no post no")
            spent += clock() - begin
            # The integral of the spin is the sum of w_{n+1/2} dt; w_n, which the fix averages, is the mean of two of them.
            ahead = self._spin_ahead()
            self.angle = self.angle + self.dt * (self.substeps * self._mean_spin() - 0.5 * (ahead - self.half_spin))
            self.half_spin = ahead
            if step in wanted:
                self._sample(step)
        return spent

    def _mean_spin(self):
        """Mean of the spins over the last sampling interval, shape (n, 3)."""
        extract = self.engine.library.lammps_extract_fix
        extract.restype = ctypes.c_void_p
        pointer = extract(self.engine.handle, b"spin", PER_ATOM, ARRAY, 0, 0)
        rows = ctypes.cast(pointer, ctypes.POINTER(ctypes.POINTER(ctypes.c_double)))
        return np.array(np.ctypeslib.as_array(rows[0], (self.n, 3)))[self.engine.order]

    def _sample(self, step):
        """Append one sample of the state at ``t_n``; what contacts report depends on the velocities that LIGGGHTS holds just then."""
        engine = self.engine
        v, late = engine.get("v"), self.damped and step > 0  # dashpots saw v_{n-1/2}
        if late:
            force = np.where(self.fixed[:, None], 0.0, engine.get("f"))
            engine.set("v", v - 0.5 * self.dt * force / self.mass[:, None])
        found, loads = {}, np.zeros((len(self.walls), 3))
        x = engine.get("x")
        for i, j, row in engine.touching():
            d = x[j] - x[i]
            found[i, j] = float(-row[0:3] @ d / np.linalg.norm(d)), row[3:6]
        for i, w, row in engine.touching_walls() if self.walls and not self.fixed.all() else ():
            found[i, self.n + w] = float(row[0:3] @ self.walls[w]["normal"]), row[3:6]
            loads[w] -= row[0:3] + row[3:6]
        if late:
            engine.set("v", v)
        self.sample(step, x, v, engine.get("omega"), self.angle.copy(), found, loads)
