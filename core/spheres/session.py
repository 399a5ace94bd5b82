"""A DEM run of spheres: what it takes on, its lists of neighbours, its progress, what it gives back."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ninedisk.core.dem.files import read_checkpoint, restore, state_arrays, write_checkpoint
from ninedisk.core.errors import (
    InvalidNumericsError,
    InvalidSceneError,
    NonFiniteStateError,
    UnstableTimeStepError,
)
from ninedisk.core.history import History, Pair
from ninedisk.core.law import Rolling
from ninedisk.core.numerics import MOST_STEPS, Numerics, check_progress, check_room, chosen_particles, watched_pairs
from ninedisk.core.spheres import kernels
from ninedisk.core.spheres.kernels import Contacts, Motion, State
from ninedisk.core.spheres.law import SphereLaw
from ninedisk.core.spheres.scene import PlaneSegment, PlaneWall, SphereScene
from ninedisk.core.threads import check_threads
from ninedisk.core.validate import kind_of, whole

STEPS_TIMES_SPHERES = 4_000_000
"""Particle-steps in one call of the kernel: a fraction of a second, so that progress and Ctrl-C work."""

SKIN = 0.2
"""Distance over which neighbours are looked for, over the smallest radius."""

SAFETY = 0.1
"""Contact step over the critical one where the numerics leave it open."""

RULES = {"none": kernels.KEEPS, "force": kernels.FORCE, "rescale": kernels.RESCALE}
MODELS = {"constant": kernels.CONSTANT, "elastic-plastic": kernels.SPRING}


class SphereSession:
    """The in-house DEM on one scene in space.

    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) is a session of its own that goes on from the present state, to the same bits.

    Parameters
    ----------
    scene : SphereScene
    numerics : Numerics
    watch : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    particles : sequence of int or None
        Spheres whose motion is recorded; None: all.
    threads : int
        1..64; a run of spheres uses one of them, whatever the number.

    Attributes
    ----------
    contact_dt, critical_dt : float
        Contact step and critical step of the initial state [s].
    substeps : int
        Contact steps in one ``numerics.dt``.

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
        If the scene has no sphere, or they ask for what this engine lacks.
    UnstableTimeStepError
        If the contact step exceeds the critical one and ``numerics.allow_unstable`` is False; also on the way, as contacts stiffen.
    """

    def __init__(
        self,
        scene: SphereScene,
        numerics: Numerics,
        watch: Sequence[Pair] = (),
        particles: Sequence[int] | None = None,
        *,
        threads: int = 1,
    ) -> None:
        kind_of("scene", scene, SphereScene)
        kind_of("numerics", numerics, Numerics, error=InvalidNumericsError)
        check_threads(threads)
        _check(scene, numerics)
        n, m = len(scene.spheres), len(scene.walls)
        self.scene, self.numerics = scene, numerics
        self.pairs = watched_pairs(scene, watch)
        self.chosen = chosen_particles(scene, particles)
        check_room(numerics, 2 * len(self.chosen), 2 * m, 2 * len(self.pairs))
        self.contact_dt, self.critical_dt = contact_step(scene, numerics)
        self.substeps = numerics.substeps(self.contact_dt)
        self._central = numerics.damping_form == "central"
        spheres = scene.spheres
        turning = spheres.rotating
        free = (~spheres.held).astype(np.float64)
        self._state = State(
            x=np.array(spheres.x),
            v=np.array(spheres.v),
            omega=np.array(spheres.omega),
            angle=np.zeros((n, 3)),
            v_now=np.array(spheres.v),
            omega_now=np.array(spheres.omega),
            force=np.zeros((n, 3)),
            torque=np.zeros((n, 3)),
            inv_mass=np.where(free.any(axis=1), 1.0 / spheres.mass, 0.0),
            inv_inertia=np.where(turning, 1.0 / spheres.inertia, 0.0),
            free=free,
            radius=np.array(spheres.radius),
            now=np.zeros((m, kernels.POSE_WIDTH)),
            middle=np.zeros((m, kernels.POSE_WIDTH)),
            load=np.zeros((m, 3)),
            built=np.array(spheres.x),
        )
        self._motion = compile_motion(scene.walls)
        self._tables = _law_tables(scene)
        self._laws = self._tables.rows
        self._skin = SKIN * float(spheres.radius.min())
        self._contacts = Contacts(
            bodies=np.zeros((0, 2), dtype=np.int64),
            law=np.zeros(0, dtype=np.int64),
            memory=np.zeros((0, kernels.MEMORY_WIDTH)),
            force=np.zeros((0, 4)),
        )
        self._clock = np.zeros(2, dtype=np.int64)
        self._samples = numerics.sampled_steps()
        self._row = 0
        self._history = History.empty(
            self._samples,
            np.asarray(self._samples * numerics.dt, dtype=np.float64),
            n_disks=len(self.chosen),
            n_walls=m,
            pairs=self.pairs,
            energies=(
                "translation",
                "rotation",
                "kinetic",
                "elastic_normal",
                "elastic_shear",
                "elastic_rolling",
                "elastic",
                "gravity",
            ),
            dimension=3,
        )
        self._rebuild()
        self._forces(0.0)

    def __copy__(self) -> SphereSession:
        return copy.deepcopy(self)

    def run(self, progress: Callable[[int, int], None] | None = None) -> History:
        """Run to the last step.

        Raises
        ------
        NonFiniteStateError
            If the state stops being finite.
        BehindWallError
            If the centre of a sphere gets behind a wall.
        """
        check_progress(progress)
        stride = max(1, STEPS_TIMES_SPHERES // (len(self.scene.spheres) * self.substeps))
        while self._row < len(self._samples):
            self.advance(min(stride, self.numerics.n_steps))
            if progress is not None:
                progress(int(self._clock[0]) // self.substeps, self.numerics.n_steps)
        return self.history()

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` steps ``numerics.dt``, at most to the last one; raises as `run`."""
        count = whole("steps", steps, 0, MOST_STEPS)
        last = min(int(self._clock[0]) // self.substeps + count, self.numerics.n_steps)
        while True:
            done = int(self._clock[0])
            if self._row < len(self._samples) and done == self._samples[self._row] * self.substeps:
                self._sample(self._row)
                self._row += 1
            goal = last * self.substeps
            if self._row < len(self._samples):
                goal = min(goal, int(self._samples[self._row]) * self.substeps)
            if done >= goal:
                return
            self._to(goal)

    def history(self) -> History:
        """What has been sampled so far; rows to come are NaN."""
        chosen = None if len(self.chosen) == len(self.scene.spheres) else tuple(self.chosen.tolist())
        fields = {**vars(self._history), "particles": chosen}
        return History(**fields)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint, an ``.npz`` file from which `load` goes on bit for bit; `UnwritableFileError` if it cannot be written."""
        write_checkpoint(path, self.scene, self.numerics, self._arrays())

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, n_steps: int | None = None, threads: int = 1) -> SphereSession:
        """The session that `save` wrote, as if it had never stopped.

        Parameters
        ----------
        path : path-like
        n_steps : int, optional
            New last step; None: the one it was begun with.
        threads : int
            Need not be that of the session that was saved.

        Raises
        ------
        InvalidSceneError
            If the file is no checkpoint of spheres.
        InvalidNumericsError
            If the run is already past ``n_steps``.
        """
        scene, numerics, arrays = read_checkpoint(path, SphereScene)
        if n_steps is not None:
            numerics = numerics.replace(n_steps=n_steps)
        watch = [(int(i), int(j)) for i, j in arrays["samples.pairs"]]
        session = cls(scene, numerics, watch, arrays["samples.chosen"].tolist(), threads=threads)
        done = int(arrays["clock"][0])
        if done > numerics.n_steps * session.substeps:
            raise InvalidNumericsError(
                f"n_steps = {numerics.n_steps} is not allowed: the checkpoint has done {done // session.substeps} steps"
            )
        session._contacts = Contacts(*(arrays[f"pairs.{name}"] for name in Contacts._fields))
        session._row = restore(session._arrays(), arrays, int(arrays["row"][0]))
        return session

    def _arrays(self) -> dict[str, NDArray[Any]]:
        single = {"clock": self._clock, "row": np.array([self._row])}
        samples = {name: array for name, array in vars(self._history).items() if isinstance(array, np.ndarray)}
        samples |= {f"energy.{name}": array for name, array in self._history.energy.items()}
        pairs = np.array(self.pairs, dtype=np.int64).reshape(len(self.pairs), 2)
        samples |= {"at": self._samples, "pairs": pairs, "chosen": self.chosen}
        single |= {f"samples.{name}": array for name, array in samples.items()}
        return state_arrays(single, {"spheres": self._state, "pairs": self._contacts})

    def _to(self, goal: int) -> None:
        while self._clock[0] < goal:
            status = kernels.advance(
                self._state, self._contacts, self._laws, self._motion, self.scene.gravity, self._clock, goal, self.contact_dt,
                self._skin, self._central,
            )  # fmt: skip
            if status == kernels.BEHIND:
                self._behind()
            if status == kernels.FAR:
                if not np.isfinite(self._state.x).all():
                    bad = int(np.argmin(np.isfinite(self._state.x).all(axis=1)))
                    raise NonFiniteStateError(
                        f"the state of sphere {bad} stopped being finite at t = {self._clock[0] * self.contact_dt:g} s: reduce contact_dt"
                    )
                self._rebuild()
                self._forces(self.contact_dt)

    def _forces(self, slip_dt: float) -> None:
        time = int(self._clock[0]) * self.contact_dt
        behind = kernels.forces(
            self._state,
            self._contacts,
            self._laws,
            self._motion,
            self.scene.gravity,
            time,
            self.contact_dt,
            slip_dt,
            self._central,
        )
        if behind >= 0:
            self._clock[1] = behind
            self._behind()

    def _behind(self) -> None:
        i, j = self._contacts.bodies[self._clock[1]]
        pose = self._state.now[j - len(self.scene.spheres)]
        height = float((self._state.x[i] - pose[:3]) @ pose[3:6])
        raise self.scene.behind_wall(
            int(i),
            int(j) - len(self.scene.spheres),
            height,
            f"t = {self._clock[0] * self.contact_dt:g} s",
            "contact_dt",
        )

    def _rebuild(self) -> None:
        """New list of neighbours in the order of their numbers; what contacts remember goes along."""
        self._check_step()
        state, n, m = self._state, len(self.scene.spheres), len(self.scene.walls)
        state.built[:] = state.x
        fixed = self.scene.spheres.fixed
        reach = 2.0 * float(state.radius.max()) + self._skin
        pairs = cKDTree(state.x).query_pairs(reach, output_type="ndarray").reshape(-1, 2)
        apart = np.linalg.norm(state.x[pairs[:, 0]] - state.x[pairs[:, 1]], axis=1)
        near = apart < state.radius[pairs].sum(axis=1) + self._skin
        pairs = pairs[near & ~fixed[pairs].all(axis=1)]
        movable = np.flatnonzero(~fixed)
        walls = np.column_stack([np.repeat(movable, m), np.tile(np.arange(n, n + m), len(movable))])
        bodies = np.concatenate([pairs, walls]).astype(np.int64)
        key = bodies[:, 0] * (n + m) + bodies[:, 1]
        order = np.argsort(key)
        bodies, key = bodies[order], key[order]
        old = self._contacts
        old_key = old.bodies[:, 0] * (n + m) + old.bodies[:, 1]
        memory = np.zeros((len(bodies), kernels.MEMORY_WIDTH))
        if len(old_key):
            place = np.minimum(np.searchsorted(old_key, key), len(old_key) - 1)
            kept = old_key[place] == key
            memory[kept] = old.memory[place[kept]]
        one, two = bodies.T
        name = self._tables.name
        law = self._tables.pair[name[one], name[np.minimum(two, n - 1)]]
        at_wall = two >= n
        law[at_wall] = self._tables.wall[two[at_wall] - n, name[one[at_wall]]]
        self._contacts = Contacts(bodies=bodies, law=law, memory=memory, force=np.zeros((len(bodies), 4)))

    def _check_step(self) -> None:
        """Hold the contact step against the critical one of the present contacts, each with its present stiffness."""
        closed = self._contacts.memory[:, kernels.RADIUS] > 0.0
        if self.numerics.allow_unstable or not closed.any():
            return
        state, law = self._state, self._laws[self._contacts.law[closed]]
        one, two = self._contacts.bodies[closed].T
        among, other = two < len(state.x), np.minimum(two, len(state.x) - 1)
        inv_mass = state.inv_mass[one] + among * state.inv_mass[other]
        turn = state.inv_inertia * state.radius**2
        hertz, radius = law[:, kernels.HERTZ] > 0.0, self._contacts.memory[closed, kernels.RADIUS]
        kn = np.where(hertz, 1.5 * radius, 1.0) * law[:, kernels.KN]
        ks = np.where(hertz, radius, 1.0) * law[:, kernels.KS] * (law[:, kernels.MU] > 0.0)
        rate = np.sqrt(np.maximum(kn * inv_mass, ks * (inv_mass + turn[one] + among * turn[other])))
        beta = law[:, kernels.BETA]
        critical = 2.0 / float(np.max(rate / (np.sqrt(1.0 + beta**2) - beta)))
        if self.contact_dt > critical * (1.0 + 1e-9):  # the round-off of two ways to the same number
            raise UnstableTimeStepError(
                f"contact_dt = {self.contact_dt:g} s exceeds the critical step {critical:g} s that the contacts have at t = "
                f"{self._clock[0] * self.contact_dt:g} s: use at most {SAFETY * critical:g} s (a tenth of it) for accurate results, or set "
                "allow_unstable=True to run all the same"
            )

    def _sample(self, k: int) -> None:
        """Write the present state into row k: positions at t, velocities brought to t by half a kick."""
        self._check_step()
        state, history, chosen = self._state, self._history, self.chosen
        spheres, half = self.scene.spheres, 0.5 * self.contact_dt if self._clock[0] else 0.0
        v = state.v + half * state.free * state.inv_mass[:, None] * state.force
        omega = state.omega + half * state.inv_inertia[:, None] * state.torque
        if not (np.isfinite(state.x).all() and np.isfinite(v).all()):
            bad = int(np.argmin(np.isfinite(v).all(axis=1)))
            raise NonFiniteStateError(
                f"the state of sphere {bad} stopped being finite at t = {self._clock[0] * self.contact_dt:g} s: reduce contact_dt"
            )
        history.x[k], history.v[k] = state.x[chosen], v[chosen]
        history.angle[k], history.omega[k] = state.angle[chosen], omega[chosen]
        history.wall_point[k], history.wall_angle[k], history.wall_force[k] = (
            state.now[:, :3],
            state.now[:, 3:6],
            state.load,
        )
        listed = {(int(i), int(j)): place for place, (i, j) in enumerate(self._contacts.bodies)} if self.pairs else {}
        for column, (i, j) in enumerate(self.pairs):
            history.gap[k, column] = self._gap(i, j)
            place = listed.get((i, j))
            found = np.zeros(4) if place is None else self._contacts.force[place]
            history.fn[k, column], history.fs[k, column] = found[0], found[1:]
        energy = history.energy
        energy["translation"][k] = 0.5 * float(np.sum(spheres.mass * np.sum(v**2, axis=1)))
        energy["rotation"][k] = 0.5 * float(np.sum(spheres.inertia * np.sum(omega**2, axis=1)))
        energy["kinetic"][k] = energy["translation"][k] + energy["rotation"][k]
        energy["gravity"][k] = -float(np.sum(spheres.mass * (state.x @ np.array(self.scene.gravity))))
        parts = self._elastic()
        for name, part in zip(("normal", "shear", "rolling"), parts, strict=True):
            energy[f"elastic_{name}"][k] = part
        energy["elastic"][k] = sum(parts)

    def _gap(self, i: int, j: int) -> float:
        state, n = self._state, len(self.scene.spheres)
        if j < n:
            return float(np.linalg.norm(state.x[j] - state.x[i]) - state.radius[i] - state.radius[j])
        pose = state.now[j - n]
        return float((state.x[i] - pose[:3]) @ pose[3:6] - state.radius[i])

    def _elastic(self) -> tuple[float, float, float]:
        """Energies [J] of the normal springs, the shear springs, and those of rolling and twisting."""
        contacts, memory = self._contacts, self._contacts.memory
        law = self._laws[contacts.law]
        radius, overlap = memory[:, kernels.RADIUS], memory[:, kernels.OVERLAP] * (memory[:, kernels.RADIUS] > 0.0)
        hertz = law[:, kernels.HERTZ] > 0.0
        normal = np.where(hertz, 0.4 * radius, 0.5) * law[:, kernels.KN] * overlap**2
        stiff = np.where(hertz, radius, 1.0) * law[:, kernels.KS]
        force = np.sum(contacts.force[:, 1:] ** 2, axis=1)
        shear = np.where(stiff > 0.0, 0.5 * force / np.where(stiff > 0.0, stiff, 1.0), 0.0)
        turned = np.zeros(len(law))
        for first, column, width in ((kernels.ROLL, kernels.ROLLING, 3), (kernels.TWIST, kernels.TWISTING, 1)):
            sprung = (law[:, first] == kernels.SPRING) & (radius > 0.0)
            moment = np.sum(memory[:, column : column + width] ** 2, axis=1)
            turned[sprung] += 0.5 * moment[sprung] / law[sprung, first + 2]
        return float(np.sum(normal)), float(np.sum(shear)), float(np.sum(turned))


class LawTables(NamedTuple):
    """Laws as rows; number of each sphere's material; law of two materials, and of a wall (first index) and a material."""

    rows: NDArray[np.float64]
    name: NDArray[np.int64]
    pair: NDArray[np.int64]
    wall: NDArray[np.int64]


def _law_tables(scene: SphereScene) -> LawTables:
    names = sorted(set(scene.spheres.material))
    name = np.array([names.index(each) for each in scene.spheres.material], dtype=np.int64)
    first = {each: scene.spheres.material.index(each) for each in names}
    known: list[SphereLaw] = []

    def number(law: SphereLaw) -> int:
        if law not in known:
            known.append(law)
        return known.index(law)

    pair = np.zeros((len(names), len(names)), dtype=np.int64)
    for a, one in enumerate(names):
        for b, two in enumerate(names):
            low, high = sorted((one, two))
            pair[a, b] = number(scene.laws.get((low, high), scene.sphere_sphere))
    n = len(scene.spheres)
    wall = np.array(
        [[number(scene.law((first[each], n + w))) for each in names] for w in range(len(scene.walls))], dtype=np.int64
    ).reshape(len(scene.walls), len(names))
    return LawTables(np.array([_law_row(law) for law in known]), name, pair, wall)


def _law_row(law: SphereLaw) -> list[float]:
    row = [
        float(law.hertz),
        4.0 / 3.0 * law.e_star if law.hertz else law.kn,
        8.0 * law.g_star if law.hertz else law.ks,
        law.mu,
        law.beta,
        float(law.lever_arm != "radius"),
        float(law.lever_arm == "overlap"),
        float(law.slip_at == "middle"),
        float(RULES[law.unloading]),
        4.0 * pi * law.surface_energy,
    ]
    for resistance in (law.rolling, law.twisting):
        given = resistance or Rolling(model="constant", mu=0.0)
        row += [float(MODELS[given.model]) if resistance else 0.0, given.mu, given.kr, given.beta]
    return row


def compile_motion(walls: Sequence[PlaneWall]) -> Motion:
    """Table of all segments, each plane closed by an endless segment of rest that begins exactly where the last one ends."""
    first, rows = [0], []
    for wall in walls:
        begin, point, normal = 0.0, np.array(wall.point), np.array(wall.normal)
        for segment in (*wall.motion, PlaneSegment()):
            pivot = point if segment.pivot is None else np.array(segment.pivot)
            row = [
                *(begin, *point, *normal, *pivot, *segment.velocity, *segment.angular_velocity, *segment.amplitude),
                *(segment.frequency, segment.phase),
            ]
            rows.append(row)
            if not np.isfinite(segment.duration):
                break
            begin += segment.duration
            pose = np.empty((1, kernels.POSE_WIDTH))
            kernels.place_planes(Motion(np.array([0, 1]), np.array([row])), begin, pose)
            point, normal = pose[0, :3].copy(), pose[0, 3:6].copy()
        first.append(len(rows))
    return Motion(
        np.array(first, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(len(rows), kernels.SEGMENT_WIDTH)
    )


def contact_step(scene: SphereScene, numerics: Numerics) -> tuple[float, float]:
    """Contact step that a run will use and the critical step of a single contact at the largest overlap to be expected [s].

    The critical step of central differences is ``(2/omega)(sqrt(1 + beta^2) - beta)`` with the larger of the contact's frequencies:
    ``omega^2 = k/m`` along the normal and ``ks (1/m + sum R^2/I)`` along the surface. Hertz' stiffness is that of the overlap at which the
    largest relative speed, that of a fall through the scene included, is spent.

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.
    """
    spheres = scene.spheres
    movable = ~spheres.held.all(axis=1)
    lightest = float(spheres.mass[movable].min()) if movable.any() else np.inf
    radius = float(spheres.radius.min())
    extent = float(np.ptp(spheres.x, axis=0).max()) + 2.0 * float(spheres.radius.max())
    wall = max((_wall_speed(each) for each in scene.walls), default=0.0)
    speed = (
        2.0 * float(np.linalg.norm(spheres.v, axis=1).max())
        + wall
        + sqrt(2.0 * float(np.linalg.norm(scene.gravity)) * extent)
    )
    critical = np.inf
    for law, alone in (
        [(scene.sphere_sphere, False)] * (len(spheres) > 1)
        + [(w.law, True) for w in scene.walls]
        + [(law, False) for law in scene.laws.values()]
    ):
        reduced = radius if alone else 0.5 * radius
        mass = lightest if alone else 0.5 * lightest
        if not np.isfinite(mass):
            continue
        kn, ks = law.kn, law.ks if law.mu > 0.0 else 0.0
        if law.hertz:
            overlap = (15.0 * mass * speed**2 / (16.0 * law.e_star * sqrt(reduced))) ** 0.4
            a = sqrt(reduced * overlap)
            kn, ks = 2.0 * law.e_star * a, 8.0 * law.g_star * a if law.mu > 0.0 else 0.0
        turning = np.where(spheres.rotating, spheres.mass * spheres.radius**2 / spheres.inertia, 0.0).max()
        omega = sqrt(max(kn, ks * (1.0 + turning)) / mass)
        if omega > 0.0:
            critical = min(critical, 2.0 / omega * (sqrt(1.0 + law.beta**2) - law.beta))
    if numerics.contact_dt is None:
        wanted = SAFETY * critical
        return numerics.dt / max(1, int(np.ceil(numerics.dt / wanted))), critical
    if numerics.contact_dt > critical and not numerics.allow_unstable:
        raise UnstableTimeStepError(
            f"contact_dt = {numerics.contact_dt:g} s exceeds the critical step {critical:g} s of the explicit scheme on this scene: use at "
            f"most {SAFETY * critical:g} s (a tenth of it) for accurate results, or set allow_unstable=True to run all the same"
        )
    return numerics.contact_dt, critical


def _wall_speed(wall: PlaneWall) -> float:
    return max(
        (
            float(np.linalg.norm(each.velocity)) + abs(each.frequency) * float(np.linalg.norm(each.amplitude))
            for each in wall.motion
        ),
        default=0.0,
    )


def _check(scene: SphereScene, numerics: Numerics) -> None:
    if len(scene.spheres) == 0:
        raise InvalidSceneError("the scene has no sphere: there is nothing to simulate")
    if any(law.surface == "jkr" and law.surface_energy > 0.0 for law in scene.laws_in_use):
        raise InvalidSceneError("surface = 'jkr' is not allowed: the in-house engine has the pull-off 'dmt' alone")
    if numerics.regime == "quasi-static":
        raise InvalidNumericsError("regime = 'quasi-static' is not allowed for spheres: use 'dynamic'")
    if numerics.energy_budget:
        raise InvalidNumericsError("energy_budget = True is not allowed for spheres: leave it out")
