"""A DEM run of spheres: what it takes on, its lists of neighbours, its progress, what it gives back."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.arrays import aligned
from ninedisk.core.dem.counts import Counts
from ninedisk.core.dem.files import read_checkpoint, restore, state_arrays, write_checkpoint
from ninedisk.core.dem.leaps import leaping_pair
from ninedisk.core.dem.levels import levels_of, size_of_skins
from ninedisk.core.dem.plane.images import check_cell
from ninedisk.core.dem.space import state as columns
from ninedisk.core.dem.space.arrays import (
    batch_arrays,
    compile_motion,
    dampings,
    empty_list,
    enlarged_list,
    image_arrays,
    in_rows,
    law_tables,
    list_of,
    nearest,
    no_losses,
    push_arrays,
    vector_rows,
    xyz_rows,
)
from ninedisk.core.dem.space.critical import Network, critical_time_step
from ninedisk.core.dem.space.image_kernels import POWER, list_images, place_cell, sort_into_images
from ninedisk.core.dem.space.level_kernels import (
    begin_level_lists,
    list_image_levels,
    list_level_pairs,
    sort_into_image_levels,
)
from ninedisk.core.dem.space.neighbour_kernels import (
    REBUILD_COST,
    begin_lists,
    list_pairs,
    list_planes,
    stiffest,
    widen_by_necks,
)
from ninedisk.core.dem.space.plane_kernels import place_planes
from ninedisk.core.dem.space.preload import enter_preload, shear_by_pair
from ninedisk.core.dem.space.registers import WIDE
from ninedisk.core.dem.space.scratch_kernels import SCRATCH, SCRATCH_COUNTED
from ninedisk.core.dem.space.state import Contacts, Images, State
from ninedisk.core.dem.space.step_kernels import (
    AGAIN,
    BATCH,
    BEHIND,
    BLOCK,
    BUILT,
    DUE,
    FAR,
    PENDING,
    REBUILDS,
    STEP,
    Assembly,
    Damping,
    Plan,
    Scheme,
    advance,
)
from ninedisk.core.dem.state import Cells
from ninedisk.core.errors import (
    InvalidNumericsError,
    InvalidSceneError,
    NonFiniteStateError,
    UnstableTimeStepError,
)
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import MOST_STEPS, Numerics, check_memory, check_progress, chosen_particles, watched_pairs
from ninedisk.core.scene import PlaneWall, SphereScene
from ninedisk.core.threads import check_threads, run_in_threads
from ninedisk.core.validate import kind_of, whole

NEVER = 2**62
"""Step at which nothing is foreseen."""

STEPS_TIMES_SPHERES = 4_000_000
"""Particle-steps in one call of the kernel: a fraction of a second, so that progress and Ctrl-C work."""

FIRST_SKIN, LEAST_SKIN, MOST_SKIN = 0.05, 0.02, 0.4
"""Gap up to which pairs are listed, over the mean radius: of the first lists, and limits of later ones."""

SORT_FROM = 2_000
"""Spheres from which a run keeps them in the order of their places, and shares them out to threads: neighbours in space are then
neighbours in memory."""

STRIPES = 128
"""Most stripes of a run that keeps the spheres in order."""

FRONT, FRONT_FROM = 4, 30_000
"""Steps that threads together take through the stripes side by side, and spheres from which they do: fewer stay in the caches anyway."""

PAIRS_PER_SPHERE = 4
"""First guess of the listed pairs."""

SAFETY = 0.1
"""Contact step over the critical one where the numerics leave it open."""

LOSSES = ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss", "wall_work", "force_work")
"""Energies that are sampled with `Numerics.energy_budget`."""


class SphereSession:
    """The in-house DEM on one scene in space.

    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) is a separate session that goes on from the present state, to the same bits.

    Parameters
    ----------
    scene : SphereScene
    numerics : Numerics
    watch : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    particles : sequence of int or None
        Spheres whose motion is recorded; None: all.
    threads : int
        Threads that share the work, 1..64; the results are the same to the last bit. Small scenes use one.

    Attributes
    ----------
    contact_dt : float
        Contact step [s].
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
        check_memory(numerics, 2 * len(self.chosen), 2 * m, 2 * len(self.pairs))
        self.contact_dt, self._alone = contact_step(scene, numerics)
        self.substeps = numerics.substeps(self.contact_dt)
        self._central = numerics.damping_form == "central"
        # Of the dashpots in the limit of the step, see `ninedisk.core.dem.critical`.
        self._share, self._drag = (1.0, 0.0) if self._central else (0.5, 0.5 * scene.xi)
        self._dampings = dampings(scene.xi, self.contact_dt, central=self._central)
        spheres = scene.spheres
        in_order = n >= SORT_FROM and scene.cell is None
        self._threads, self._in_order = threads if in_order else 1, in_order
        free = ~spheres.held
        inv_mass = np.where(free.any(axis=1), 1.0 / spheres.mass, 0.0)
        stripes = STRIPES if in_order else 1
        resisted = any(law.rolling or law.twisting for law in scene.laws_in_use)
        self._state = State(
            x=vector_rows(spheres.x),
            v=vector_rows(spheres.v),
            omega=vector_rows(spheres.omega),
            angle=aligned(np.zeros(WIDE * n)),
            v_now=vector_rows(spheres.v) if self._central else np.zeros(0),
            omega_now=vector_rows(spheres.omega) if self._central and resisted else np.zeros(0),
            force=aligned(np.zeros(WIDE * n)),
            torque=aligned(np.zeros(WIDE * n)),
            mass=np.where(inv_mass > 0.0, spheres.mass, 0.0),
            mobility=vector_rows(free * inv_mass[:, None]),
            inv_mass=inv_mass,
            inv_inertia=np.where(spheres.rotating, 1.0 / spheres.inertia, 0.0),
            radius=np.array(spheres.radius),
            name=np.arange(n),
            now=np.zeros((m, columns.POSE_WIDTH)),
            load=np.zeros((m, 3)),
            share=np.zeros((BATCH * stripes, m, 3)),
            behind=np.zeros((BATCH * stripes, 2), dtype=np.int64),
            built=vector_rows(spheres.x),
            braked=np.zeros(n if numerics.energy_budget and scene.xi > 0.0 else 0),
        )
        self._pushes = push_arrays(scene)
        self._motion = compile_motion(scene.walls)
        self._laws, self._materials = law_tables(scene)
        # Spheres that are in order are those of a scene large enough for levels; a periodic cell has them in the scene's order.
        self._levels = levels_of(spheres.radius, 3) if in_order or scene.cell is not None else None
        mean = size_of_skins(spheres.radius, self._levels)
        widest = float(spheres.radius.max())
        # A neck must be listed as long as it holds.
        necks = [3.0 * float(law[columns.STICKS]) * widest ** (1.0 / 3.0) for law in self._laws]
        longest, sticky = 1.01 * max(necks), max(necks) > 0.0
        self._sizes = (mean, widest, max(LEAST_SKIN * mean, longest), max(MOST_SKIN * mean, 2.0 * longest))
        self._least = float(spheres.radius.min())
        self._skin = np.array([max(FIRST_SKIN * mean, longest)])
        self._cells = Cells(
            start=np.zeros(n + 65, dtype=np.int32),
            order=np.zeros(n, dtype=np.uint32),
            cell=np.zeros(n, dtype=np.int32),
            grid=np.zeros(6),
        )
        self._listed = np.arange(n)
        self._gravity = vector_rows(np.array([scene.gravity]))
        notes = columns.NOTES_WIDTH_RESISTED if resisted else columns.NOTES_WIDTH
        if sticky:
            notes = columns.NOTES_WIDTH_STICKY
        if scene.cell is not None:
            notes = columns.NOTES_WIDTH_IMAGES
        width = (
            notes,
            columns.MEMORY_WIDTH_RESISTED if resisted else columns.MEMORY_WIDTH,
        )
        self._pairs = [empty_list(n, room, *width) for room in [PAIRS_PER_SPHERE * n + 16] * 2]
        self._at_planes = [empty_list(m, room, *width) for room in [n // 4 + 16] * 2]
        counted = numerics.energy_budget
        self._batch = batch_arrays(stripes, m, self._threads, SCRATCH_COUNTED if counted else SCRATCH)
        self._losses = no_losses(stripes, m) if counted else None
        self._images = None if scene.cell is None else image_arrays(scene.cell, n, widest)
        self._clock = np.array([0, 1, 0, -1, 0])
        self._front = max(1, FRONT // self._threads) if n >= FRONT_FROM else 1
        self._kept: dict[str, NDArray[Any]] = {}
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
                *(LOSSES if counted else ()),
                *(("cell_work",) if scene.cell is not None else ()),
            ),
            dimension=3,
        )
        if scene.cell is not None:
            self._history = replace(self._history, stress=np.full((len(self._samples), 2, 3, 3), np.nan))
        place_planes(self._motion, 0.0, self._state.now)
        self._rebuild()
        self._check_centres()
        enter_preload(scene, self._laws, self._pairs[0], self._at_planes[0], self._state, self._images)
        self._remember()
        self._to(0)

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
        TooFastError
            If spheres that meet move by more than the smaller radius relative to each other in a contact step
            (`ninedisk.core.dem.leaps`).
        UnstableTimeStepError
            If contacts have formed for which the contact step is too long, and ``numerics.allow_unstable`` is False.
        """
        check_progress(progress)
        stride = max(1, STEPS_TIMES_SPHERES // (len(self.scene.spheres) * self.substeps))
        while self._row < len(self._samples):
            self.advance(min(stride, self.numerics.n_steps))
            if progress is not None:
                progress(int(self._clock[STEP]) // self.substeps, self.numerics.n_steps)
        return self.history()

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` steps ``numerics.dt``, at most to the last one; raises as `run`."""
        count = whole("steps", steps, 0, MOST_STEPS)
        last = min(int(self._clock[STEP]) // self.substeps + count, self.numerics.n_steps)
        while True:
            done = int(self._clock[STEP])
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
        chosen = (
            None if np.array_equal(self.chosen, np.arange(len(self.scene.spheres))) else tuple(self.chosen.tolist())
        )
        fields = {**vars(self._history), "particles": chosen}
        return History(**fields)

    def snapshot(self) -> tuple[float, dict[str, NDArray[np.float64]]]:
        """Time [s] and present state of all spheres in the scene's order: ``x, v, angle, omega``, shape (n, 3), and ``radius``.

        Positions and angles belong to this time, velocities and spins to half a contact step before it.
        """
        state, place = self._state, np.argsort(self._state.name)
        found = {name: xyz_rows(getattr(state, name))[place] for name in ("x", "v", "angle", "omega")}
        return int(self._clock[STEP]) * self.contact_dt, {**found, "radius": state.radius[place]}

    def shear_forces(self) -> dict[Pair, tuple[float, ...]]:
        """Shear forces ``fs`` [N] of all closed contacts that carry one, by body numbers: a scene's ``initial_shear``."""
        contacts = self._contacts()
        return shear_by_pair(contacts.bodies, contacts.force, self._state.name)

    @property
    def critical_dt(self) -> float:
        """Critical step [s] of the present contacts together, at most that of the worst single contact (`contact_step`).

        It is found anew at each call, by Lanczos' method on all contacts.
        """
        return min(self._alone, critical_time_step(self._network()))

    @property
    def counts(self) -> Counts:
        """Rebuilds so far, pairs that the present lists hold, contacts at the present positions."""
        contacts, pairs = self._contacts(), int(self._pairs[0].start[-1])
        closed = contacts.radius > 0.0
        return Counts(
            int(self._clock[REBUILDS]), pairs, len(closed) - pairs, int(closed[:pairs].sum()), int(closed[pairs:].sum())
        )

    def warm_up(self) -> None:
        """Nothing: a session has found the forces of time 0, with the kernels of all steps."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint, an ``.npz`` file from which `load` goes on bit for bit; `UnwritableFileError` if it cannot be written."""
        write_checkpoint(path, self.scene, self.numerics, self.arrays())

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
        session.restore(arrays)
        return session

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Go on from the state of another session on the same scene (`arrays`).

        Raises
        ------
        InvalidNumericsError
            If that is already past the last step.
        """
        done = int(arrays["clock"][0])
        if done > self.numerics.n_steps * self.substeps:
            raise InvalidNumericsError(
                f"n_steps = {self.numerics.n_steps} is not allowed: the checkpoint has done {done // self.substeps} steps"
            )
        for lists, name in ((self._pairs, "pairs"), (self._at_planes, "wall_pairs")):
            lists[0] = list_of({field: arrays[f"{name}.{field}"] for field in Contacts._fields})
        self._row = restore(self.arrays(), arrays, int(arrays["row"][0]))
        self._placed = in_rows(self._pushes, self._state.name)
        self._remember()

    @property
    def rows(self) -> int:
        """Samples so far."""
        return self._row

    def plane_normals(self) -> NDArray[np.float64]:
        """Normals of the planes at present, shape (m, 3)."""
        return self._state.now[:, 3:6].copy()

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array that the next step depends on, and the samples so far."""
        single: dict[str, NDArray[Any]] = {"clock": self._clock, "row": np.array([self._row]), "skin": self._skin}
        single["stripe"] = self._batch.stripe
        samples = {name: array for name, array in vars(self._history).items() if isinstance(array, np.ndarray)}
        samples |= {f"energy.{name}": array for name, array in self._history.energy.items()}
        pairs = np.array(self.pairs, dtype=np.int64).reshape(len(self.pairs), 2)
        samples |= {"at": self._samples, "pairs": pairs, "chosen": self.chosen}
        single |= {f"samples.{name}": array for name, array in samples.items()}
        lists = {"pairs": self._pairs[0], "wall_pairs": self._at_planes[0]}
        if self._images is not None:
            single |= {
                f"cell.{name}": getattr(self._images, name) for name in ("now", "built", "share", "power", "work")
            }
        groups = {"spheres": self._state, **lists}
        if self._losses is not None:
            groups["losses"] = self._losses
        return state_arrays(single, groups)

    def _to(self, goal: int) -> None:
        clock = self._clock
        while clock[STEP] < goal or clock[PENDING]:
            bodies = Assembly(self._state, self._pairs[0], self._at_planes[0], self._laws, self._placed)
            scheme = Scheme(
                self._gravity,
                self.contact_dt,
                float(self._skin[0]),
                self._central,
                self.scene.xi > 0.0,
                *self._dampings,
            )
            at_once = 1 if self._one_by_one or self._images is not None else BATCH
            # Rows of pairs of two levels need not ascend in the scene's order: nothing is kicked before all forces are found.
            block = BLOCK if self._levels is None or self._in_order else len(self._listed)
            plan = Plan(goal, at_once, self._front, block)
            shared = (bodies, self._losses, self._images, self._motion, self._batch, clock, scheme, plan)
            status = run_in_threads(advance, self._threads, shared)
            if status == FAR:
                self._rebuild()
            elif status == AGAIN or (status == BEHIND and clock[STEP] < goal):
                # Where a centre gets behind a plane is known of a last step, which kicks nothing.
                goal = int(clock[STEP]) if status == BEHIND else goal
                self._return()
            elif status == BEHIND:
                self._behind()

    def _changing(self) -> dict[str, NDArray[Any]]:
        """What steps change and do not find anew."""
        state = self._state._asdict()
        names = ("x", "v", "omega", "angle", "v_now", "omega_now", "force", "torque", "behind", "braked")
        arrays: dict[str, NDArray[Any]] = {"clock": self._clock, **{name: state[name] for name in names}}
        for name, contacts in (("pairs", self._pairs[0]), ("planes", self._at_planes[0])):
            used = contacts.start[-1]
            arrays |= {f"{name}.notes": contacts.notes[:used], f"{name}.memory": contacts.memory[:used]}
        losses = {} if self._losses is None else self._losses._asdict()
        return {**arrays, **{f"losses.{name}": array for name, array in losses.items()}}

    def _remember(self) -> None:
        """Keep the state, to return to it where several steps at once have gone too far; in memory that has been used before."""
        for name, array in self._changing().items():
            kept = self._kept.get(name)
            if kept is None or len(kept) < len(array):
                kept = self._kept[name] = np.empty((len(array) + len(array) // 8, *array.shape[1:]), dtype=array.dtype)
            kept[: len(array)] = array
        self._one_by_one = False

    def _return(self) -> None:
        """Back to where the lists were new; from there steps are done one by one."""
        for name, array in self._changing().items():
            array[...] = self._kept[name][: len(array)]
        self._one_by_one = True

    def _not_finite(self, finite: NDArray[np.bool_]) -> NonFiniteStateError:
        bad = self._state.name[~finite.reshape(-1, WIDE).all(axis=1)].min()
        return NonFiniteStateError(
            f"the state of {self.scene.noun} {bad} stopped being finite at t = {self._clock[STEP] * self.contact_dt:g} s: reduce contact_dt"
        )

    def _behind(self) -> None:
        sphere, w = (int(each) for each in self._state.behind[np.argmax(self._state.behind[:, 0] > 0)])
        pose, i = self._state.now[w], int(np.flatnonzero(self._state.name == sphere - 1)[0])
        height = float((xyz_rows(self._state.x)[i] - pose[:3]) @ pose[3:6])
        raise self.scene.behind_wall(
            sphere - 1, w, height, f"t = {self._clock[STEP] * self.contact_dt:g} s", "contact_dt"
        )

    def _rebuild(self) -> None:
        """New lists of neighbours, of spheres in their new order; what contacts remember goes along."""
        self._check_leaps()
        self._check_step()
        if self._images is not None:
            self._rebuild_images(self._images)
            return
        state, clock, laws, materials, cells = self._state, self._clock, self._laws, self._materials, self._cells
        steps, listed, old = int(clock[STEP] - clock[BUILT]), self._listed, float(self._skin[0])
        levels, stripe = self._levels, self._batch.stripe
        if levels is None:
            skin = begin_lists(state, listed, cells, stripe, self._in_order, old, steps, self._sizes)
        else:
            skin = begin_level_lists(state, listed, cells, levels, stripe, old, steps, self._sizes)
        if skin < 0.0:
            raise self._not_finite(np.abs(state.x) < np.finfo(np.float64).max / 8.0)
        pairs, planes = self._pairs, self._at_planes
        while not (
            list_pairs(state, listed, cells, materials, laws, self._in_order, skin, *pairs)
            if levels is None
            else list_level_pairs(state, listed, levels, materials, laws, skin, stripe, *pairs)
        ):
            pairs[1] = enlarged_list(pairs[1])
        place = np.empty(len(listed), dtype=np.int64)
        while not list_planes(state, listed, materials, laws, skin, place, *planes):
            planes[1] = enlarged_list(planes[1])
        pairs.reverse()
        planes.reverse()
        state.force[:], state.torque[:] = np.outer(state.mass, self._gravity).ravel(), 0.0
        listed[:] = np.arange(len(listed))
        self._skin[0], clock[BUILT], clock[DUE] = skin, clock[STEP], clock[STEP] + BATCH
        clock[REBUILDS] += 1
        self._placed = in_rows(self._pushes, state.name)
        self._remember()

    def _rebuild_images(self, images: Images) -> None:
        """New lists of spheres and images; spheres stay in the scene's order."""
        state, clock, pairs = self._state, self._clock, self._pairs
        mean, widest, least, most = self._sizes
        steps = int(clock[STEP] - clock[BUILT])
        skin = float(self._skin[0])
        if steps:
            skin = float(np.clip(sqrt(REBUILD_COST * mean * skin / steps), least, most))
        place_cell(images, int(clock[STEP]) * self.contact_dt)
        cells, levels = self._cells, self._levels
        sorted_in = (
            sort_into_images(state, images, 2.0 * widest + skin, cells)
            if levels is None
            else sort_into_image_levels(state, images, skin, levels)
        )
        if not sorted_in:
            raise self._not_finite(np.abs(state.x) < np.finfo(np.float64).max / 8.0)
        while not (
            list_images(state, images, cells, self._materials, self._laws, skin, *pairs)
            if levels is None
            else list_image_levels(state, images, levels, self._materials, self._laws, skin, *pairs)
        ):
            pairs[1] = enlarged_list(pairs[1])
        pairs.reverse()
        state.built[:], images.built[:] = state.x, images.now
        state.force[:], state.torque[:] = np.outer(state.mass, self._gravity).ravel(), 0.0
        self._batch.stripe[:] = 0, len(self._listed)
        self._skin[0], clock[BUILT], clock[DUE] = skin, clock[STEP], NEVER
        clock[REBUILDS] += 1
        self._placed = in_rows(self._pushes, state.name)
        self._remember()

    def _apart(self, listed: Contacts) -> NDArray[np.float64]:
        """Vectors [m] of the listed pairs of spheres, from the first centre to the second one or its image."""
        row, other, notes = (array[: listed.start[-1]] for array in (listed.row, listed.other, listed.notes))
        x = xyz_rows(self._state.x)
        apart = x[other] - x[row]
        if self._images is not None:
            apart = apart + notes[:, columns.IMAGE : columns.IMAGE + 3] @ self._images.now.T
        return apart

    def _contacts(self) -> Listed:
        """Pairs in the lists: bodies by rows of the state and numbers of the planes, and what is known of them."""
        state, parts = self._state, []
        x, n = xyz_rows(state.x), len(self._listed)
        for contacts, at_planes in ((self._pairs[0], False), (self._at_planes[0], True)):
            row, other, law, notes, memory, force = (array[: contacts.start[-1]] for array in contacts[1:])
            if at_planes:
                bodies = np.column_stack([other, n + row.astype(np.int64)])
                height = np.sum((x[other] - state.now[row, :3]) * state.now[row, 3:6], axis=1)
                overlap = state.radius[other] - height
            else:
                bodies = np.column_stack([row, other]).astype(np.int64)
                overlap = state.radius[row] + state.radius[other] - np.linalg.norm(self._apart(contacts), axis=1)
            radius = np.zeros(len(overlap))
            widen_by_necks(contacts, self._laws, overlap, radius)
            parts.append((bodies, law, overlap, radius, notes, memory, force))
        return Listed(*(np.concatenate(both) for both in zip(*parts, strict=True)))

    def _check_step(self) -> None:
        """Hold the contact step against the critical one of the present contacts together, each with its present stiffness."""
        sums = np.zeros((len(self._listed), 2))
        for contacts, at_planes in ((self._pairs[0], False), (self._at_planes[0], True)):
            edges = np.zeros((3, 3)) if self._images is None else self._images.now
            stiffest(self._state, contacts, self._laws, edges, at_planes, self._share, sums)
        bound = (0.25 * self.contact_dt * sums[:, 0] + sums[:, 1] + self._drag) * self.contact_dt
        if self.numerics.allow_unstable or bound.max() <= 1.0:
            return
        critical = critical_time_step(self._network())
        if self.contact_dt > critical * (1.0 + 1e-9):  # the round-off of two ways to the same number
            raise self.scene.unstable(
                int(self._state.name[np.argmax(bound)]),
                self.contact_dt,
                critical,
                float(self._clock[STEP] * self.contact_dt),
                SAFETY,
            )

    def _check_leaps(self) -> None:
        """Raise if spheres that meet move too far in a step."""
        state, scene, dt = self._state, self.scene, self.contact_dt
        v = xyz_rows(state.v)
        if self._images is not None:  # beside the cell's flow, where all may meet
            flow = self._images.rate @ np.linalg.inv(self._images.now)
            v = v - xyz_rows(state.x) @ flow.T
            i = int(np.argmax(np.linalg.norm(v - v.mean(axis=0), axis=1)))
            j = int(np.argmax(np.linalg.norm(v - v[i], axis=1)))
            if self._clock[STEP] > 0 and (travel := dt * float(np.linalg.norm(v[i] - v[j]))) > self._least:
                i, j = sorted((i, j))
                raise scene.too_fast(i, scene.body_name(j), travel, self._least, float(self._clock[STEP] * dt), dt)
            return
        if self._clock[STEP] == 0 or not dt * np.linalg.norm(np.ptp(v, axis=0)) > self._least:
            return
        place = np.argsort(state.name)
        x, v, radius = xyz_rows(state.x)[place], v[place], scene.spheres.radius
        pair = leaping_pair(x, dt * v, radius, radius, scene.spheres.fixed, float(self._skin[0]))
        if pair:
            i, j = pair
            travel, limit = dt * float(np.linalg.norm(v[i] - v[j])), float(radius[[i, j]].min())
            raise scene.too_fast(i, scene.body_name(j), travel, limit, float(self._clock[STEP] * dt), dt)

    def _check_centres(self) -> None:
        """Raise if the centres of two spheres coincide that can touch: `InvalidSceneError`, on the way `NonFiniteStateError`."""
        x, name, pairs = xyz_rows(self._state.x), self._state.name, self._pairs[0]
        row, other = (array[: pairs.start[-1]] for array in (pairs.row, pairs.other))
        same = np.flatnonzero((self._apart(pairs) == 0.0).all(axis=1))
        if len(same):
            i, j = sorted(int(name[rows[same[0]]]) for rows in (row, other))
            place = ", ".join(f"{each:g}" for each in x[row[same[0]]])
            words = f"the centres of {self.scene.noun}s {i} and {j} coincide at ({place})"
            if self._clock[STEP] > 0:
                t = self._clock[STEP] * self.contact_dt
                raise NonFiniteStateError(
                    f"{words} at t = {t:g} s: their contact has no normal; reduce contact_dt, or raise the stiffness"
                )
            raise InvalidSceneError(f"{words}: their contact has no normal; move one")

    def _network(self) -> Network:
        """Springs and dashpots of the contacts that touch."""
        self._check_centres()
        state, contacts, n = self._state, self._contacts(), len(self._listed)
        law, number, radius, notes = (
            values[contacts.radius > 0.0] for values in (contacts.law, contacts.bodies, contacts.radius, contacts.notes)
        )
        laws, at_plane = self._laws[law], number[:, 1] >= n
        hertz = laws[:, columns.HERTZ] > 0.0
        normal = np.empty((len(law), 3))
        normal[at_plane] = -state.now[number[at_plane, 1] - n, 3:6]
        apart = self._apart(self._pairs[0])
        apart = apart[contacts.radius[: len(apart)] > 0.0]
        normal[~at_plane] = apart / np.linalg.norm(apart, axis=1)[:, None]
        springs, dashpots = np.zeros((2, len(law), 4))
        springs[:, 0] = laws[:, columns.KN] * np.where(hertz, 1.5 * radius, 1.0)
        springs[:, 1] = laws[:, columns.KS] * np.where(hertz, radius, 1.0) * (laws[:, columns.MU] > 0.0)
        dashpots[:, 0] = self._share * notes[:, columns.DRAG] * np.where(hertz, np.sqrt(radius), 1.0)
        for k, first in ((2, columns.ROLL), (3, columns.TWIST)):
            sprung = laws[:, first] == columns.SPRING
            springs[sprung, k] = laws[sprung, first + 2]
            if notes.shape[1] > columns.NOTES_WIDTH:
                dashpots[sprung, k] = self._share * notes[sprung, columns.DRAG + k - 1]
        bodies = np.column_stack([number[:, 0], np.minimum(number[:, 1], n)])
        mobility = xyz_rows(state.mobility)
        return Network(bodies, normal, springs, dashpots, mobility, state.inv_inertia, state.radius, self._drag)

    def _sample(self, k: int) -> None:
        """Write the present state into row k: positions at t, velocities brought to t by half a kick."""
        self._check_step()
        state, history, place = self._state, self._history, np.argsort(self._state.name)
        chosen = place[self.chosen]
        mass, inertia = self.scene.spheres.mass[state.name], self.scene.spheres.inertia[state.name]
        x, angle, omega, torque = map(xyz_rows, (state.x, state.angle, state.omega, state.torque))
        damping = self._dampings[1]
        part = 0.5 if self._clock[STEP] else 0.0
        kicked = (damping.keep - 1.0) * (state.mobility > 0.0) * state.v + damping.gain * state.mobility * state.force
        turns = state.inv_inertia[:, None]
        spun = (damping.keep - 1.0) * (turns > 0.0) * omega + damping.gain * turns * torque
        at_sample = state.v + part * kicked
        v = xyz_rows(at_sample)
        braked = self._braked(damping, xyz_rows(kicked), spun) if part else 0.0
        omega = omega + part * spun
        finite = np.isfinite(x) & np.isfinite(v)
        if not finite.all():
            raise self._not_finite(np.isfinite(state.x + at_sample))
        history.x[k], history.v[k] = x[chosen], v[chosen]
        history.angle[k], history.omega[k] = angle[chosen], omega[chosen]
        history.wall_point[k], history.wall_angle[k], history.wall_force[k] = (
            state.now[:, :3],
            state.now[:, 3:6],
            state.load,
        )
        contacts = self._contacts()
        listed: dict[tuple[int, int], int] = {}
        if self.pairs:  # of several images the nearest one
            order = np.argsort(contacts.overlap, kind="stable")
            listed = {(int(i), int(j)): int(k) for k, (i, j) in zip(order, contacts.bodies[order], strict=True)}
        for column, pair in enumerate(self.pairs):
            first, second = (int(place[body]) if body < len(x) else body for body in pair)
            history.gap[k, column] = self._gap(min(first, second), max(first, second))
            turned = (second, first) in listed
            at, side = listed.get((second, first) if turned else (first, second)), -1.0 if turned else 1.0
            found = np.zeros(4) if at is None else contacts.force[at]
            history.fn[k, column], history.fs[k, column] = found[0], side * found[1:]
        energy = history.energy
        if self._images is not None and history.stress is not None:
            volume = float(np.prod(np.diag(self._images.now)))
            flow = self._images.rate @ np.linalg.inv(self._images.now)
            beside = v - x @ flow.T
            if state.mass.any():  # 0 of fixed spheres, which have no part in it
                beside = beside - np.average(beside, axis=0, weights=state.mass)
            history.stress[k, 0] = -self._images.share[:POWER].reshape(3, 3) / volume
            history.stress[k, 1] = (state.mass[:, None] * beside).T @ beside / volume
            energy["cell_work"][k] = self._images.work[0]
        energy["translation"][k] = 0.5 * float(np.sum(mass * np.sum(v**2, axis=1)))
        energy["rotation"][k] = 0.5 * float(np.sum(inertia * np.sum(omega**2, axis=1)))
        energy["kinetic"][k] = energy["translation"][k] + energy["rotation"][k]
        energy["gravity"][k] = -float(np.sum(mass * (x @ np.array(self.scene.gravity))))
        parts = self._elastic(contacts)
        for name, part in zip(("normal", "shear", "rolling"), parts, strict=True):
            energy[f"elastic_{name}"][k] = part
        energy["elastic"][k] = sum(parts)
        if self._losses is not None:
            so_far = self._losses.contacts.sum(axis=0)
            # To the time of a sample belongs but half of a step of forces that depend on velocities.
            now = 0.5 * (self._losses.before.sum(axis=0) + so_far) if self._clock[STEP] else np.zeros(len(so_far))
            energy["friction_loss"][k], energy["dashpot_loss"][k] = so_far[columns.FRICTION], now[columns.DASHPOT]
            energy["rolling_loss"][k] = so_far[columns.ROLLED_ON] + now[columns.ROLLING_DASHPOT]
            energy["damping_loss"][k], energy["law_loss"][k] = (
                float(np.sum(state.braked)) + braked,
                so_far[columns.OF_LAW],
            )
            energy["wall_work"][k], energy["force_work"][k] = self._losses.work[0], self._losses.force_work[0]

    def _braked(self, damping: Damping, kicked: NDArray[np.float64], spun: NDArray[np.float64]) -> float:
        """What global damping takes from the last half step's end to now [J], from the changes that the next kick makes."""
        if len(self._state.braked) == 0:
            return 0.0
        state = self._state
        taken = 0.0
        for before, change, inverse in (
            (xyz_rows(state.v), kicked, xyz_rows(state.mobility)),
            (xyz_rows(state.omega), spun, np.repeat(state.inv_inertia[:, None], 3, axis=1)),
        ):
            free = inverse > 0.0
            taken += float(np.sum((before + damping.seen * change)[free] * before[free] / inverse[free]))
        return 0.5 * damping.drag * taken

    def _gap(self, i: int, j: int) -> float:
        state, n = self._state, len(self.scene.spheres)
        x = xyz_rows(state.x)
        if j < n:
            apart = x[j] - x[i]
            if self._images is not None:
                apart = nearest(apart, self._images.now)
            return float(np.linalg.norm(apart) - state.radius[i] - state.radius[j])
        pose = state.now[j - n]
        return float((x[i] - pose[:3]) @ pose[3:6] - state.radius[i])

    def _elastic(self, contacts: Listed) -> tuple[float, float, float]:
        """Energies [J] of the normal springs, the shear springs, and those of rolling and twisting."""
        memory, law, overlap, radius = contacts.memory, self._laws[contacts.law], contacts.overlap, contacts.radius
        hertz = law[:, columns.HERTZ] > 0.0
        normal = np.where(hertz, 0.4 * radius, 0.5) * law[:, columns.KN] * overlap**2
        reduced = memory[:, columns.REDUCED]
        normal -= law[:, columns.PULL] * np.where(hertz, reduced, 0.5 * overlap) * overlap
        sticks = (law[:, columns.STICKS] > 0.0) & (radius > 0.0)
        if sticks.any():
            # The work of JKR's force from overlap 0, where s^3 = 4: (6 kn a_c^5/R^2) [s^10/15 - 2 s^7/3 + s^4].
            k, r = law[sticks, columns.KN], reduced[sticks]
            a_c = np.sqrt(law[sticks, columns.STICKS] * r ** (4.0 / 3.0))
            s = np.sqrt(radius[sticks] / a_c)
            normal[sticks] = (
                6.0 * k * a_c**5 / r**2 * (s**10 / 15.0 - 2.0 * s**7 / 3.0 + s**4 + 2.4 * 4.0 ** (1.0 / 3.0))
            )
        stiff = np.where(hertz, radius, 1.0) * law[:, columns.KS]
        force = np.sum(contacts.force[:, 1:] ** 2, axis=1)
        shear = np.where(stiff > 0.0, 0.5 * force / np.where(stiff > 0.0, stiff, 1.0), 0.0)
        turned = np.zeros(len(law))
        if memory.shape[1] == columns.MEMORY_WIDTH:
            return float(np.sum(normal)), float(np.sum(shear)), 0.0
        for first, column, width in ((columns.ROLL, columns.ROLLING, 3), (columns.TWIST, columns.TWISTING, 1)):
            sprung = (law[:, first] == columns.SPRING) & (radius > 0.0)
            moment = np.sum(memory[:, column : column + width] ** 2, axis=1)
            turned[sprung] += 0.5 * moment[sprung] / law[sprung, first + 2]
        return float(np.sum(normal)), float(np.sum(shear)), float(np.sum(turned))


class Listed(NamedTuple):
    """Columns of the lists: bodies ``(k, 2)``, law, overlap and contact radius [m], notes, memory and force, see `Contacts`."""

    bodies: NDArray[np.int64]
    law: NDArray[np.uint32]
    overlap: NDArray[np.float64]
    radius: NDArray[np.float64]
    notes: NDArray[np.float64]
    memory: NDArray[np.float64]
    force: NDArray[np.float64]


def contact_step(scene: SphereScene, numerics: Numerics) -> tuple[float, float]:
    """Contact step that a run will use and the critical step of a single contact at the largest overlap to be expected [s].

    The critical step is ``(2/omega)(sqrt(1 + b^2) - b)`` with the larger of the contact's frequencies, ``omega^2 = k/m`` along the normal
    and ``ks (1/m + sum R^2/I)`` along the surface; b is beta where dashpots see the velocity of the last half step, and twice that where
    they see the extrapolated one (`ninedisk.core.dem.critical`). Hertz' stiffness is that of the overlap at which the
    largest relative speed, that of a fall through the scene included, is spent. Rolling springs move the same spins as shear springs do:
    both together have at most ``ks (1/m + sum R^2/I) + kr sum 1/I``; twisting springs have ``kr sum 1/I``.

    Where the numerics leave it open, the contact step is a tenth of this, and no longer than what is stable for as many contacts as a
    sphere has room for: ``z = 2/(1 - cos a)`` neighbours of the smallest radius r, where ``sin a = r/(R + r)``, and all planes. The
    largest eigenvalue of all contacts is at most twice the largest sum of a sphere's own (`ninedisk.core.dem.critical`).

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
    if scene.cell is not None:
        wall = float(np.linalg.norm(np.array(scene.cell.rate) @ np.diag(scene.cell.size)))
    speed = (
        2.0 * float(np.linalg.norm(spheres.v, axis=1).max())
        + wall
        + sqrt(2.0 * (float(np.linalg.norm(scene.gravity)) + _largest_push(scene)) * extent)
    )
    share, slowing = (1.0, 0.0) if numerics.damping_form == "central" else (0.5, 0.5 * scene.xi)
    critical = _limit(0.0, slowing)
    # Of a box, the axis about which it turns most easily; this loop runs no boxes, engines that do ask for its step.
    inertia = spheres.inertia if spheres.inertia.ndim == 1 else spheres.inertia.min(axis=1)
    inverse, spin = np.where(movable, 1.0 / spheres.mass, 0.0), np.where(spheres.rotating, 1.0 / inertia, 0.0)
    about = inverse * spin / np.where(movable, inverse + spheres.radius**2 * spin, 1.0)
    own = np.zeros((2, len(spheres)))
    for law, alone in (
        [(scene.sphere_sphere, False)] * (len(spheres) > 1 or scene.cell is not None)
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
            if law.sticks:  # Hertz' radius with the overlap and more than what the pull adds to both
                overlap += 9.0 * (0.25 * pi * law.surface_energy / law.e_star) ** (2.0 / 3.0) * reduced ** (1.0 / 3.0)
            a = sqrt(reduced * overlap)
            kn, ks = 2.0 * law.e_star * a, 8.0 * law.g_star * a if law.mu > 0.0 else 0.0
        turning = np.where(spheres.rotating, spheres.mass * spheres.radius**2 / inertia, 0.0).max()
        omega = sqrt(max(kn, ks * (1.0 + turning)) / mass)
        if omega > 0.0:
            drag = 2.0 * share * law.beta
            critical = min(
                critical,
                _limit(omega**2, drag * omega + slowing) if slowing else 2.0 / omega * (sqrt(1.0 + drag**2) - drag),
            )
        with np.errstate(over="ignore"):  # an infinite one leaves no step
            ends, shear = 1.0 if alone else 2.0, ks * (inverse + spheres.radius**2 * spin)
            stiff, slowed = np.maximum(kn * inverse, shear), 2.0 * law.beta * np.sqrt(kn * inverse)
            for resistance, across, moment in ((law.rolling, shear, about), (law.twisting, 0.0 * shear, spin)):
                if resistance is not None and resistance.kr > 0.0:
                    # The dashpot is that of the moments about the contact, its effect that on the spins.
                    more = np.where(moment > 0.0, spin / np.sqrt(np.where(moment > 0.0, moment, 1.0)), 0.0)
                    springs, dashpots = (
                        across + resistance.kr * spin,
                        2.0 * resistance.beta * sqrt(resistance.kr) * more,
                    )
                    both = ends * float(springs.max()), share * sqrt(ends) * float(dashpots.max())
                    critical = min(critical, _limit(both[0], both[1] + slowing))
                    stiff, slowed = np.maximum(stiff, springs), np.maximum(slowed, dashpots)
            own = np.maximum(own, [stiff, share * slowed])
    if numerics.contact_dt is None:
        room = np.floor(2.0 / (1.0 - np.cos(np.arcsin(radius / (spheres.radius + radius)))))
        contacts = room if scene.cell is not None else np.minimum(room, len(spheres) - 1.0) + len(scene.walls)
        packed = min(
            (_limit(2.0 * k, 2.0 * c + slowing) for k, c in zip(*(contacts * own).tolist(), strict=True)),
            default=np.inf,
        )
        wanted = max(min(SAFETY * critical, packed), 1e-16 * numerics.dt)  # refused as too many substeps
        return numerics.dt / max(1, int(np.ceil(numerics.dt / wanted))), critical
    if numerics.contact_dt > critical and not numerics.allow_unstable:
        raise UnstableTimeStepError(
            f"contact_dt = {numerics.contact_dt:g} s exceeds the critical step {critical:g} s of the explicit scheme on this scene: use at "
            f"most {SAFETY * critical:g} s (a tenth of it) for accurate results, or set allow_unstable=True to run all the same"
        )
    return numerics.contact_dt, critical


def _limit(stiffness: float, dashpots: float) -> float:
    """Largest stable step [s] for a stiffness [1/s^2] and dashpots in C' [1/s], both over the masses."""
    rate = 0.5 * (dashpots + hypot(dashpots, sqrt(stiffness)))
    return 1.0 / rate if rate > 0.0 else np.inf


def _largest_push(scene: SphereScene) -> float:
    """Largest acceleration [m/s^2] that the forces on one sphere can have together."""
    total = np.zeros(len(scene.spheres))
    for each in scene.forces:
        total[each.disk] += np.linalg.norm(each.force)
    return float(np.max(total / scene.spheres.mass))


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
    if scene.spheres.boxes.any():
        box = int(np.argmax(scene.spheres.boxes))
        raise InvalidSceneError(f"body {box} is a box, which the DEM does not have: use method = 'cd'")
    if numerics.regime == "quasi-static":
        raise InvalidNumericsError("regime = 'quasi-static' is not allowed for spheres: use 'dynamic'")
    for law in scene.laws_in_use:
        if law.mu > 0.0 and law.ks == 0.0 and law.g_star == 0.0:
            name, share = ("g_star", "e_star") if law.hertz else ("ks", "kn")
            raise InvalidSceneError(
                f"mu = {law.mu:g} with {name} = 0 is not allowed: friction acts through a shear spring, which the contact does not have; "
                f"give {name} > 0 (in proportion to {share}), or mu = 0"
            )
    if numerics.energy_budget and any(law.sticks for law in scene.laws_in_use):
        raise InvalidNumericsError(
            "energy_budget = True is not allowed with surface = 'jkr': what a neck takes where it breaks is no channel; leave it out"
        )
    check_cell(scene, numerics)
    if scene.cell is not None and numerics.energy_budget:
        raise InvalidNumericsError("energy_budget = True is not allowed in a periodic cell: leave it out, or the cell")
    if scene.cell is not None and any(law.sticks for law in scene.laws_in_use):
        raise InvalidSceneError("surface = 'jkr' is not allowed in a periodic cell: use 'dmt', or leave out the cell")
    spheres = scene.spheres
    driven = (spheres.held & (spheres.v != 0.0)).any(axis=1) | (~spheres.rotating & spheres.omega.any(axis=1))
    if numerics.energy_budget and driven.any():
        raise InvalidNumericsError(
            f"energy_budget = True is not allowed with sphere {int(np.argmax(driven))} held in a motion, whose work is not counted: hold "
            "it at rest, or let a wall move"
        )
