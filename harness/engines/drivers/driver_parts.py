"""What the drivers of several engines share: the request, the samples, the arrays of the wire format, the answer.

Drivers run inside other programs, some under the system's Python: plain Python and numpy here, nothing of an engine or of the harness.
"""

import json
import math
import os
import sys
import time

import numpy as np


def serve(make):
    """Read the request, run it, write the answer; any exception becomes an ``error`` answer.

    ``make(request)`` gives the run: a `Run`, or what has its ``start``, ``advance``, ``version``, ``settings`` and ``history``.
    ``advance`` returns a difference of `clock`, or seconds on the wall where other processes do the work.
    """
    begin = time.perf_counter()
    request = json.load(sys.stdin)
    try:
        run = make(request)
        run.start()
        setup = time.perf_counter() - begin
        spent = np.atleast_1d(run.advance(request["sampled_steps"]))
        cpu = {"cpu": float(spent[1])} if len(spent) == 2 else {}
        answer = {
            "wire_version": 1,
            "engine_version": run.version(),
            "timings": {"setup": setup, "warm_up": 0.0, "advance": float(spent[0]), **cpu},
            "settings": run.settings(),
            "history": encoded_history(run.history(), request["answer_file"]),
        }
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"wire_version": 1, "error": f"{type(error).__name__}: {error}"}
    write(request, answer)


MANY = 5000
"""Numbers of a history from which a file of arrays takes less time than text."""


def encoded_history(history, answer_file):
    """A history of arrays as the answer has it: as lists or, with `MANY` numbers, in a file beside the answer."""
    meaning, energy = history.pop("force_meaning"), history.pop("energy")
    if sum(np.size(values) for values in history.values()) < MANY:
        lists = {name: without_nan(values) for name, values in history.items()}
        return {
            **lists,
            "force_meaning": meaning,
            "energy": {name: without_nan(values) for name, values in energy.items()},
        }
    name = os.path.basename(answer_file) + ".npz"
    path = os.path.join(os.path.dirname(answer_file), name)
    np.savez(path, **history, **{f"energy.{kind}": values for kind, values in energy.items()})
    return {"file": name, "force_meaning": meaning}


def clock():
    """Seconds on the wall and CPU seconds of this process, as an array: differences of two are what lay between."""
    return np.array((time.perf_counter(), time.process_time()))


def write(request, answer):
    """Write an answer file."""
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))  # dump() would take the slow encoder


class Run:
    """One simulation of disks in 2D or of spheres in 3D: what the request says, and the samples.

    A subclass gives `start`, which ends at time 0 with everything but the first step done, `advance`, `version` and `settings`, and
    calls `sample`.

    Attributes
    ----------
    dimension : int
        2 or 3; vectors have so many components.
    x0, v0 : arrays, shape (n, dimension)
        Positions [m] and velocities [m/s] at time 0.
    omega0 : array, shape (n,) in 2D, (n, 3) in 3D
        Spins [rad/s].
    radius, mass, inertia, rotating, fixed : arrays, shape (n,)
    held : array of bool, shape (n, dimension)
        Components of the velocity that are prescribed; in 2D no engine here has them.
    dt : float
        Step [s]; ``substeps`` of them lie between two steps of the request.
    path : array or None
        Point, normal and more of each wall at each step; the last row lasts. In 2D see `ninedisk.harness.api.wall_path`, in 3D
        `ninedisk.harness.engines.spring.plane_path`.
    """

    name = ""
    """The engine's, for messages."""
    force_meaning = "instantaneous"
    needs_a_disk = True
    """Whether a scene of no disks is an error."""

    def __init__(self, request):
        scene, extra = request["scene"], request["extra"]
        self.dimension = scene.get("dimension", 2)
        self.noun = "disk" if self.dimension == 2 else "sphere"
        bodies = scene[f"{self.noun}s"]
        self.n = n = len(bodies["radius"])
        if not n and (self.needs_a_disk or self.dimension == 3):
            raise ValueError(f"there is no {self.noun}: {self.name} needs at least one")
        self.x0, self.v0 = (np.array(bodies[key], dtype=float).reshape(n, self.dimension) for key in ("x", "v"))
        self.omega0 = np.array(bodies["omega"], dtype=float).reshape((n,) if self.dimension == 2 else (n, 3))
        self.radius, self.mass, self.inertia = (
            np.array(bodies[key], dtype=float) for key in ("radius", "mass", "inertia")
        )
        self.rotating = np.array(bodies["rotating"], dtype=bool)
        held = bodies["held"] if self.dimension == 3 else np.zeros((n, 2))
        self.held = np.array(held, dtype=bool).reshape(n, self.dimension)
        moving = self.v0.any(axis=1) | self.omega0.reshape(n, -1).any(axis=1)
        self.fixed = self.held.all(axis=1) & ~self.rotating & ~moving
        self.gravity, self.xi = np.array(scene["gravity"]), scene.get("xi", 0.0)
        turning = bool(self.rotating.any())
        self.law = completed_law(scene[f"{self.noun}_{self.noun}"], turning)
        self.walls = [{**wall, "law": completed_law(wall["law"], turning)} for wall in scene["walls"]]
        self.material = bodies.get("material", [""] * n)
        self.laws = {frozenset((one, two)): completed_law(law, turning) for one, two, law in scene.get("laws", [])}
        self.all_laws = [self.law, *(wall["law"] for wall in self.walls), *self.laws.values()]
        self.damped = any(law["beta"] > 0.0 for law in self.all_laws)
        self.forces_on = [{**force, "end": float(force["end"])} for force in scene.get("forces", [])]
        self.dt, self.substeps = extra["contact_dt"], extra["substeps"]
        self.path = np.load(extra["wall_path"]) if "wall_path" in extra else None
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.cell = Cell(scene["cell"]) if "cell" in scene else None
        self.samples, self.static = [], []

    def law_of(self, i, j):
        """Law of the contact of two bodies, which the table of their materials has or their kinds."""
        if j < self.n:
            return self.laws.get(frozenset((self.material[i], self.material[j])), self.law)
        wall = self.walls[j - self.n]
        return self.laws.get(frozenset((self.material[i], wall.get("material", ""))), wall["law"])

    def reduced(self, i, j):
        """Reduced mass [kg] and radius [m] of a contact."""
        if j >= self.n and self.dimension == 3:
            return self.mass[i], self.radius[i]
        bodies = (i, j) if j < self.n else (i,)
        return tuple(1.0 / sum(1.0 / values[k] for k in bodies) for values in (self.mass, self.radius))

    def pose(self, step):
        """The walls' row of the path at a contact step: points and normals of the walls and more, shape (m, columns)."""
        return self.path[min(step, len(self.path) - 1)]

    def loads(self, begin, end):
        """Mean force [N] on each disk and torque [N m] on it between two times [s], shape (n, 3)."""
        mean = [[0.0, 0.0, 0.0] for _ in range(self.n)]
        for force in self.forces_on:
            part = max(0.0, min(end, force["end"]) - max(begin, force["begin"])) / (end - begin)
            row = mean[force["disk"]]
            for k, value in enumerate((*force["force"], force["torque"])):
                row[k] += part * value
        return np.array(mean).reshape(self.n, 3)

    def check_in_front(self, x, pose):
        """Raise if a body's centre is behind a wall, where the engine no longer pushes it back."""
        d = self.dimension
        for w, row in enumerate(pose):
            height = (x - row[:d]) @ row[d : 2 * d]
            height[self.fixed] = math.inf
            if (height < 0.0).any():
                raise RuntimeError(
                    f"{self.noun} {int(np.argmin(height))} is {-height.min():g} m behind wall {self.walls[w]['name']!r}, where "
                    f"{self.name} no longer pushes it back: a smaller contact_dt or a stiffer wall is the way out"
                )

    def sample(self, step, x, v, omega, angle, contacts, wall_force, elastic=None, pose=None):
        """Append one sample.

        Parameters
        ----------
        step : int
            Of the request.
        x, v, omega, angle : arrays by body
        contacts : mapping
            ``{(i, j): (fn [N], fs [N], ...)}`` with i < j, ``fs`` along the tangent in 2D, the shear force on ``i`` in 3D; a pair that is
            not there does not touch, NaN cannot be observed.
        wall_force : array, shape (m, dimension)
            Force on each wall [N].
        elastic : float or None
            Energy of the springs [J]; None: there are none, or they are not observed.
        pose : sequence or None
            Point and normal of each wall; None: those of the path.
        """
        pose = self.pose(step * self.substeps) if pose is None else np.array(pose)
        if self.dimension == 3:
            self.check_in_front(x, pose)
        none = (0.0, np.zeros(3) if self.dimension == 3 else 0.0)
        fn, fs = zip(*(contacts.get(pair, none)[:2] for pair in self.pairs)) if self.pairs else ((), ())  # noqa: B905
        self.samples.append((step, x, v, omega, angle, fn, fs, pose[..., : 2 * self.dimension], wall_force, elastic))

    def observe_stress(self, moment):
        """Keep the stress by contacts of a sample in a periodic cell, from the sum of forces on first disks times branches [N m]."""
        self.static.append(moment)

    def history(self):
        """All samples as arrays, named as in the wire format."""
        steps, n, m, c, d = len(self.samples), self.n, len(self.walls), len(self.pairs), self.dimension
        step, *columns, elastic = zip(*self.samples)  # noqa: B905
        spin = (3,) if d == 3 else ()
        shapes = ((n, d), (n, d), (n, *spin), (n, *spin), (c,), (c, *spin), (m, 2 * d), (m, d))
        x, v, omega, angle, fn, fs, pose, wall_force = (
            np.array(column, dtype=float).reshape((steps, *shape))
            for column, shape in zip(columns, shapes, strict=True)
        )
        point, normal = pose[:, :, :d], pose[:, :, d:]
        t = np.array(step) * (self.substeps * self.dt)
        energy = self._energy(x, v, omega)
        if elastic[0] is not None:
            energy["elastic"] = np.array(elastic, dtype=float)
        stress = {"stress": self.cell.stress(t, x, v, self.mass, self.static)} if self.static else {}
        return {
            **stress,
            "step": np.array(step),
            "t": t,
            "x": x,
            "v": v,
            "angle": angle,
            "omega": omega,
            "gap": self._gaps(t, x, point, normal),
            "fn": fn,
            "fs": fs,
            "force_meaning": self.force_meaning,
            "wall_point": point,
            "wall_angle": normal if d == 3 else np.arctan2(normal[:, :, 1], normal[:, :, 0]),
            "wall_force": wall_force,
            "energy": energy,
        }

    def _energy(self, x, v, omega):
        """Energies [J] of each sample: sums over its bodies alone, as BLAS rounds those of a sample by how many samples there are."""
        gravity = {"gravity": -((x * self.gravity).sum(axis=2) * self.mass).sum(axis=1)}
        if self.dimension == 2:
            # A blocked spin is prescribed: it exchanges no energy with the scene and is not counted, as in the in-house DEM.
            inertia = np.where(self.rotating, self.inertia, 0.0)
            return {"kinetic": 0.5 * ((v**2).sum(axis=2) * self.mass + omega**2 * inertia).sum(axis=1), **gravity}
        translation = 0.5 * ((v**2).sum(axis=2) * self.mass).sum(axis=1)
        rotation = 0.5 * ((omega**2).sum(axis=2) * self.inertia).sum(axis=1)
        return {"translation": translation, "rotation": rotation, "kinetic": translation + rotation, **gravity}

    def _gaps(self, t, x, point, normal):
        """Gaps of the watched pairs, shape (samples, pairs)."""
        gaps = np.empty((len(x), len(self.pairs)))
        for c, (i, j) in enumerate(self.pairs):
            if j < self.n:
                d = x[:, j] - x[:, i]
                if self.cell is not None:
                    d = np.array([self.cell.nearest(*row) for row in zip(t, d)])  # noqa: B905
                gaps[:, c] = np.linalg.norm(d, axis=1) - self.radius[i] - self.radius[j]
            else:
                w = j - self.n
                gaps[:, c] = ((x[:, i] - point[:, w]) * normal[:, w]).sum(axis=1) - self.radius[i]
        return gaps


class Cell:
    """A periodic cell: edges ``(I + t rate) diag(size)`` as columns [m], their rate ``motion`` [m/s]."""

    def __init__(self, cell):
        self.size, self.rate = np.array(cell["size"]), np.array(cell["rate"])
        self.motion = self.rate @ np.diag(self.size)

    def edges(self, t):
        return np.diag(self.size) + t * self.motion

    def nearest(self, t, d):
        """The shortest of all images of a vector [m] at time ``t``."""
        h = self.edges(t)
        h[0, 1] -= np.round(h[0, 1] / h[0, 0]) * h[0, 0]  # the same images, edges that lean least
        about = d - h @ np.round(np.linalg.solve(h, d))
        images = [about + h @ (p, q) for p in (-1, 0, 1) for q in (-1, 0, 1)]
        return min(images, key=lambda image: float(image @ image))

    def stress(self, times, x, v, mass, moments):
        """By contacts and by velocities beside the flow and their mean [N/m], compression positive, shape (s, 2, 2, 2)."""
        found = np.empty((len(times), 2, 2, 2))
        for k, t in enumerate(times):
            h = self.edges(t)
            beside = v[k] - x[k] @ (self.motion @ np.linalg.inv(h)).T
            beside = beside - mass @ beside / mass.sum()
            found[k] = np.array([-moments[k], (beside * mass[:, None]).T @ beside]) / np.linalg.det(h)
        return found


def without_nan(values):
    """Nested lists with null for NaN, which JSON does not have."""
    return np.where(np.isnan(values), None, values).tolist()


class SpringRun(Run):
    """One simulation with contact springs by central differences: velocities at half steps, forces at positions of t_n.

    With a = xi dt/2 and a ``central`` form of damping, ``v+ = ((1 - a) v- + dt F/m)/(1 + a)``, masses and inertias times
    ``1 + a`` make the step an undamped one (or one with the lagged drag, ``v+ = v- + dt (F/m - xi v-)``): ``inflate``. Each
    driver derives what its engine makes of that. ``start`` reaches ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``. In 3D there is no global
    damping: xi and a are 0, ``inflate`` and ``decay`` are 1.
    """

    def __init__(self, request):
        super().__init__(request)
        self.central = request["numerics"]["damping_form"] == "central"
        self.a = 0.5 * self.xi * self.dt
        self.inflate = 1.0 + self.a if self.central else 1.0
        self.decay = (1.0 - self.a) / (1.0 + self.a) if self.central else 1.0 - 2.0 * self.a
        self.preload = [tuple(entry) for entry in request["scene"].get("initial_shear", []) if entry[2]]

    def loads_at(self, step):
        """`loads` of a contact step: over the time between the half steps beside it, in the first from time 0."""
        return self.loads(max(step - 0.5, 0.0) * self.dt, (step + 0.5) * self.dt)

    def sums(self, contacts, pose):
        """Force on each wall [N], shape (m, 2), and elastic energy [J] of contacts ``{(i, j): (fn, fs, overlap)}`` of disks."""
        loads, elastic = np.zeros((len(self.walls), 2)), 0.0
        for (i, j), (fn, fs, overlap) in contacts.items():
            law = self.law_of(i, j)
            elastic += 0.5 * (law["kn"] - law["cohesion"]) * overlap**2 + (
                0.5 * fs**2 / law["ks"] if fs and law["ks"] else 0.0
            )
            if j >= self.n:
                normal = -pose[j - self.n, 2:4]
                loads[j - self.n] += fn * normal - fs * np.array([-normal[1], normal[0]])
        return loads, elastic

    def rebound(self, law):
        """``exp(-pi beta/sqrt(1 - beta^2))``, the restitution by which engines know a dashpot; 0 where it is overdamped."""
        beta = law["beta"]
        return math.exp(-math.pi * beta / math.sqrt(1.0 - beta**2)) if beta < 1.0 else 0.0


LAW = {
    "kn": 0.0,
    "ks": 0.0,
    "e_star": 0.0,
    "g_star": 0.0,
    "mu": 0.0,
    "beta": 0.0,
    "restitution": None,
    "cohesion": 0.0,
    "unloading": "force",
    "rolling": None,
    "twisting": None,
    "surface_energy": 0.0,
    "surface": "dmt",
    "friction_pull": 1.0,
}
"""What the wire leaves out of a law."""


def completed_law(law, turning):
    """A law with the fields that the wire leaves out; without resistance to spins where no body can turn."""
    full = {**LAW, **law}
    return full if turning else {**full, "rolling": None, "twisting": None}


def carries_shear(law):
    """Whether a contact can carry shear."""
    return law["mu"] > 0.0 and (law["ks"] > 0.0 or law["g_star"] > 0.0)


def number(value):
    """Shortest text that gives the same double back."""
    return repr(float(value))


def numbers(values):
    """Texts of several, with blanks between them."""
    return " ".join(map(number, values))


def ids(members):
    """Numbers of the bodies of a mask as text, counted from 1."""
    return " ".join(str(i + 1) for i in np.flatnonzero(members))


def in_3d(vectors):
    """Vectors, or one, with three components: those of 2D get z = 0."""
    vectors = np.asarray(vectors)
    if vectors.shape[-1] == 3:
        return vectors
    return np.concatenate([vectors, np.zeros((*vectors.shape[:-1], 1))], axis=-1)


def spin_in_3d(omega):
    """Spins as vectors: those of 2D, numbers, are about z."""
    omega = np.asarray(omega)
    return omega if omega.ndim == 2 else np.column_stack([np.zeros((len(omega), 2)), omega])


def length(vector):
    """Length of a vector."""
    return float(np.hypot(*vector) if len(vector) == 2 else np.linalg.norm(vector))


def triangle(middle, point, normal, reach):
    """Corners of an equilateral triangle in a wall of 3D, about the foot of ``middle``, with the inradius ``reach``.

    Their order is that of turning about ``normal``.
    """
    foot = middle - ((middle - point) @ normal) * normal
    one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    one /= np.linalg.norm(one)
    two = np.cross(normal, one)
    return [foot + 2.0 * reach * (np.cos(a) * one + np.sin(a) * two) for a in 2.0 * np.pi / 3.0 * np.arange(3)]
