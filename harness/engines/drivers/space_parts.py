"""What the drivers of spheres in space share; as `driver_parts`, plain Python and numpy."""

import math

import numpy as np
from driver_parts import Bodies

LAW = {
    "kn": 0.0,
    "ks": 0.0,
    "e_star": 0.0,
    "g_star": 0.0,
    "mu": 0.0,
    "beta": 0.0,
    "unloading": "force",
    "rolling": None,
    "twisting": None,
    "surface_energy": 0.0,
    "surface": "dmt",
    "friction_pull": 1.0,
}
"""What the wire leaves out of a law."""


class SpaceRun(Bodies):
    """One simulation of spheres with contact springs: what the request says, and the samples.

    Velocities are those of half steps, forces at positions of t_n; ``start`` reaches ``v_{1/2} = v_0 + dt/2 F_0/m``. A subclass gives
    `start`, `advance`, `version` and `settings`, and calls `sample`.

    Attributes
    ----------
    x0, v0, omega0 : arrays, shape (n, 3)
    radius, mass, inertia, rotating, fixed : arrays, shape (n,)
    held : array of bool, shape (n, 3)
    path : array, shape (steps, m, 12)
        Point, normal, velocity and spin of each wall at each step, see `ninedisk.harness.engines.spring.plane_path`; the last row lasts.
    """

    name = ""
    """The engine's, for messages."""
    force_meaning = "instantaneous"

    def __init__(self, request):
        scene, extra = request["scene"], request["extra"]
        spheres = scene["spheres"]
        self.n = n = len(spheres["radius"])
        self.x0, self.v0, self.omega0 = (
            np.array(spheres[key], dtype=float).reshape(n, 3) for key in ("x", "v", "omega")
        )
        self.radius, self.mass, self.inertia = (
            np.array(spheres[key], dtype=float) for key in ("radius", "mass", "inertia")
        )
        self.rotating = np.array(spheres["rotating"], dtype=bool)
        self.held = np.array(spheres["held"], dtype=bool).reshape(n, 3)
        moving = self.v0.any(axis=1) | self.omega0.any(axis=1)
        self.fixed = self.held.all(axis=1) & ~self.rotating & ~moving
        if not n:
            raise ValueError(f"there is no sphere: {self.name} needs at least one")
        self.gravity = np.array(scene["gravity"])
        turning = bool(self.rotating.any())
        self.law = completed(scene["sphere_sphere"], turning)
        self.walls = [{**wall, "law": completed(wall["law"], turning)} for wall in scene["walls"]]
        self.material = spheres.get("material", [""] * n)
        self.laws = {frozenset((one, two)): completed(law, turning) for one, two, law in scene.get("laws", [])}
        self.all_laws = [self.law, *(wall["law"] for wall in self.walls), *self.laws.values()]
        self.damped = any(law["beta"] > 0.0 for law in self.all_laws)
        self.dt, self.substeps = extra["contact_dt"], extra["substeps"]
        self.path = np.load(extra["wall_path"])
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.samples = []

    def reduced(self, i, j):
        """Reduced mass [kg] and radius [m] of a contact."""
        if j >= self.n:
            return self.mass[i], self.radius[i]
        return tuple(1.0 / (1.0 / values[i] + 1.0 / values[j]) for values in (self.mass, self.radius))

    def check_in_front(self, x, pose):
        """Raise if a sphere's centre is behind a wall."""
        for w, row in enumerate(pose):
            height = (x - row[0:3]) @ row[3:6]
            height[self.fixed] = math.inf
            if (height < 0.0).any():
                raise RuntimeError(
                    f"sphere {int(np.argmin(height))} is {-height.min():g} m behind wall {self.walls[w]['name']!r}, where {self.name} "
                    "no longer pushes it back: a smaller contact_dt or a stiffer wall is the way out"
                )

    def sample(self, step, x, v, omega, angle, contacts, wall_force):
        """Append one sample; ``contacts`` are ``{(i, j): (fn [N], shear force on i [N])}``, an absent pair does not touch."""
        none = (0.0, (0.0, 0.0, 0.0))
        found = [contacts.get(pair, none) for pair in self.pairs]
        pose = self.pose(step * self.substeps)
        self.check_in_front(x, pose)
        self.samples.append(
            (step, x, v, omega, angle, [fn for fn, _ in found], [list(fs) for _, fs in found], pose, wall_force)
        )

    def history(self):
        """All samples as arrays, named as in the wire format."""
        steps, n, m, c = len(self.samples), self.n, len(self.walls), len(self.pairs)
        step, *columns = zip(*self.samples)  # noqa: B905
        shapes = ((n, 3), (n, 3), (n, 3), (n, 3), (c,), (c, 3), (m, 12), (m, 3))
        x, v, omega, angle, fn, fs, pose, wall_force = (
            np.array(column, dtype=float).reshape((steps, *shape))
            for column, shape in zip(columns, shapes, strict=True)
        )
        point, normal = pose[:, :, 0:3], pose[:, :, 3:6]
        gap = np.empty((steps, c))
        for k, (i, j) in enumerate(self.pairs):
            if j < n:
                gap[:, k] = np.linalg.norm(x[:, j] - x[:, i], axis=1) - self.radius[i] - self.radius[j]
            else:
                gap[:, k] = ((x[:, i] - point[:, j - n]) * normal[:, j - n]).sum(axis=1) - self.radius[i]
        translation = 0.5 * ((v**2).sum(axis=2) * self.mass).sum(axis=1)
        rotation = 0.5 * ((omega**2).sum(axis=2) * self.inertia).sum(axis=1)
        return {
            "step": np.array(step),
            "t": np.array(step) * (self.substeps * self.dt),
            "x": x,
            "v": v,
            "angle": angle,
            "omega": omega,
            "gap": gap,
            "fn": fn,
            "fs": fs,
            "force_meaning": self.force_meaning,
            "wall_point": point,
            "wall_angle": normal,
            "wall_force": wall_force,
            "energy": {
                "translation": translation,
                "rotation": rotation,
                "kinetic": translation + rotation,
                "gravity": -((x * self.gravity).sum(axis=2) * self.mass).sum(axis=1),
            },
        }


def completed(law, turning):
    """A law with the fields that the wire leaves out; without resistance to spins where no sphere can turn."""
    full = {**LAW, **law}
    return full if turning else {**full, "rolling": None, "twisting": None}


def rough(law):
    """Whether a contact can carry shear."""
    return law["mu"] > 0.0 and (law["ks"] > 0.0 or law["g_star"] > 0.0)
