"""A DEM run: what it takes on, its progress (calls of the kernels, growth of the lists, checkpoints), what it gives back and counts."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import kernel
from ninedisk.core.dem import state
from ninedisk.core.dem.arrays import (
    ENERGIES,
    SAFETY,
    SORT_FROM,
    STRIPES,
    aligned,
    behind_wall,
    contact_step,
    disk_arrays,
    disk_views,
    first_lists,
    law_arrays,
    law_row,
    load_arrays,
    loss_arrays,
    not_finite,
    sample_arrays,
    step_constants,
    team_arrays,
    wall_arrays,
    watch_arrays,
    with_law_capacity,
)
from ninedisk.core.dem.counts import Counts
from ninedisk.core.dem.critical import Place, present_time_step
from ninedisk.core.dem.files import read_checkpoint, restore, saved_list, state_arrays, write_checkpoint
from ninedisk.core.dem.leaps import leaping_pair
from ninedisk.core.dem.levels import levels_of
from ninedisk.core.dem.neighbours import check_crowd, enlarged_list
from ninedisk.core.dem.plane.force_kernels import SCRATCH
from ninedisk.core.dem.plane.grains import (
    first_outlines,
    needs_outlines,
    restored_outlines,
    shear_of_grains,
    with_more_capacity,
)
from ninedisk.core.dem.plane.image_kernels import CELL_SCRATCH, image_contacts
from ninedisk.core.dem.plane.images import check_cell, enter_image_preload, first_images, with_more_pairs
from ninedisk.core.dem.plane.rebuild_kernels import rebuild, rebuild_images
from ninedisk.core.dem.plane.step_kernels import advance
from ninedisk.core.dem.preload import enter_grain_preload, enter_preload, shear_by_pair
from ninedisk.core.dem.state import (
    COUNT,
    NOT_FINITE,
    OK,
    PAIRS_FULL,
    SIDE,
    WALL_PAIRS_FULL,
    DiskArrays,
    Images,
    Lists,
    NeighbourList,
    Outlines,
    Progress,
    Samples,
    System,
    WallArrays,
)
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.history import History, Pair
from ninedisk.core.law import check_shear_springs
from ninedisk.core.numerics import (
    MOST_STEPS,
    Numerics,
    check_memory,
    check_progress,
    check_run,
    chosen_particles,
    watched_pairs,
)
from ninedisk.core.options import read_options
from ninedisk.core.pose import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from ninedisk.core.scene import Scene
from ninedisk.core.scene.motion import compile_motion
from ninedisk.core.threads import check_threads, run_in_threads
from ninedisk.core.validate import whole

if TYPE_CHECKING:
    from ninedisk.core.dem.disks_as_spheres import DisksAsSpheres

STEPS_TIMES_DISKS = 16_000_000
"""Particle-steps in one call of the kernel: a fraction of a second, so that progress and Ctrl-C work."""

LACKS = ("adhesion",)
"""What scenes may ask for and the DEM lacks (`check_run`)."""

OUTLINES_LACK = CELL_LACKS = ("materials", "cohesion", "rolling resistance", "Hertz' law")
"""What it lacks as well where contacts are those of outlines, and in a periodic cell."""


class DemSession:
    """The in-house DEM on one scene.

    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) is a separate session that goes on from the present state, to the same bits.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    watch : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    particles : sequence of int or None
        Disks whose motion is recorded; None: all.
    threads : int
        Threads that share the work, 1..64; the results are the same to the last bit. Small scenes use one, contacts of outlines too.

    Attributes
    ----------
    contact_dt, critical_dt : float
        Contact step and critical step of the initial state [s].
    substeps : int
        Contact steps in one ``numerics.dt``.

    Raises
    ------
    InvalidSceneError
        If the scene has no disk, or a preloaded pair does not touch.
    InvalidNumericsError
        If the numerics ask for the static limit, or for the energy budget of a scene with a disk that is held in a motion, or the number
        of threads is not allowed.
    UnstableTimeStepError
        If the contact step exceeds the critical one and ``numerics.allow_unstable`` is False; also on the way, as contacts form.
    """

    def __init__(
        self,
        scene: Scene,
        numerics: Numerics,
        watch: Sequence[Pair] = (),
        particles: Sequence[int] | None = None,
        *,
        threads: int = 1,
    ) -> None:
        check_admission(scene, numerics, threads)
        n, m = len(scene.disks), len(scene.walls)
        self.scene, self.numerics = scene, numerics
        self.pairs = watched_pairs(scene, watch)
        self.chosen = chosen_particles(scene, particles)
        check_memory(numerics, len(self.chosen), m, len(self.pairs))
        self._spheres: DisksAsSpheres | None = None
        if has_hertz(scene):
            from ninedisk.core.dem.disks_as_spheres import DisksAsSpheres

            self._spheres = DisksAsSpheres(scene, numerics, self.pairs, self.chosen, threads=threads)
            self.contact_dt, self.critical_dt, self.substeps = self._spheres.steps
            return
        self.contact_dt, self.critical_dt = contact_step(scene, numerics)
        self.substeps = numerics.substeps(self.contact_dt)
        in_order = n >= SORT_FROM
        stripes = STRIPES if in_order else 1
        self._threads = threads if in_order else 1
        levels = levels_of(scene.disks.radius, 2) if in_order and not needs_outlines(scene) else None
        self._step = step_constants(scene, numerics, self.contact_dt, in_order, levels)
        self._disks = disk_arrays(scene, self._step.lagged, numerics.energy_budget)
        self._motion = compile_motion(scene.walls)
        self._walls = wall_arrays(scene, self._motion, stripes)
        self._law, self._laws, self._loads = np.array(law_row(scene.disk_disk)), law_arrays(scene), load_arrays(scene)
        periodic = scene.cell is not None
        self._team = team_arrays(stripes, self._threads, self._laws, CELL_SCRATCH if periodic else SCRATCH)
        self._losses = loss_arrays(stripes) if numerics.energy_budget else None
        self._lists = first_lists(n, m, self._laws is not None, levels)
        self._progress = Progress(
            clock=np.array([0, 1, 0, 0, 0], dtype=np.int64), work=np.zeros(2), skin=np.array([self._step.first_skin])
        )
        self._watch = watch_arrays(scene)
        self._least = float(self._watch.size.min())
        self._outlines = first_outlines(scene)
        self._images: Images | None = None
        if scene.cell is not None:
            self._images = first_images(scene.cell, n, self._lists.pairs.other.shape[0], stripes)
        self._first_lists()
        self._note_lists()
        if self._images is not None:
            enter_image_preload(scene, self._disks, self._lists.pairs, self._images)
        elif self._outlines is None:
            enter_preload(scene, self._disks, self._lists.pairs, self._lists.wall_pairs)
        else:
            enter_grain_preload(scene, self._outlines)
        pairs = np.array(self.pairs, dtype=np.int64).reshape(len(self.pairs), 2)
        self._samples = sample_arrays(numerics.sampled_steps() * self.substeps, self.chosen, pairs, m, periodic)

    def __getstate__(self) -> dict[str, Any]:
        # Views share the memory of other arrays, which a copy of theirs would not.
        return {name: value for name, value in self.__dict__.items() if name != "_views"}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self.__dict__.update(saved)
        if self._spheres is not None:
            return
        self._disks = DiskArrays(*(aligned(array) for array in self._disks))
        self._note_lists()

    def __copy__(self) -> DemSession:
        return copy.deepcopy(self)

    def run(self, progress: Callable[[int, int], None] | None = None) -> History:
        """Run to the last step.

        Parameters
        ----------
        progress : callable, optional
            Called with (steps done, steps in all), in steps ``numerics.dt``.

        Returns
        -------
        History

        Raises
        ------
        NonFiniteStateError
            If the state stops being finite.
        BehindWallError
            If the centre of a disk gets behind a wall.
        TooFastError
            If disks that meet move by more than the smaller radius relative to each other in a contact step (`ninedisk.core.dem.leaps`).
            Of an outline the smallest distance from the centre counts. In a periodic cell no two disks may, whether they meet or not,
            the cell's flow apart.
        UnstableTimeStepError
            If contacts have formed for which the contact step is too long, and ``numerics.allow_unstable`` is False.
        """
        check_progress(progress)
        if self._spheres is not None:
            return self._spheres.run(progress)
        target = self.numerics.n_steps * self.substeps
        stride = max(1, STEPS_TIMES_DISKS // len(self.scene.disks))
        while self._progress.clock[state.STEP] < target or self._progress.clock[state.PENDING]:
            self._advance(min(target, int(self._progress.clock[state.STEP]) + stride))
            if progress is not None:
                progress(int(self._progress.clock[state.STEP]) // self.substeps, self.numerics.n_steps)
        return self.history()

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` steps ``numerics.dt``, at most to the last one; raises as `run`."""
        count = whole("steps", steps, 0, MOST_STEPS)
        if self._spheres is not None:
            self._spheres.advance(count)
            return
        last = self.numerics.n_steps * self.substeps
        self._advance(min(last, int(self._progress.clock[state.STEP]) + count * self.substeps))

    def snapshot(self) -> tuple[float, dict[str, NDArray[np.float64]]]:
        """Time [s] and present state of all disks in the scene's order, for `FrameWriter.write`.

        Positions and angles belong to this time, velocities ``v`` and spins ``omega`` to half a contact step before it.
        """
        if self._spheres is not None:
            return self._spheres.snapshot()
        disks, place = self._disks, self._disks.place
        names = ("x", "v", "angle", "omega", "radius")
        return int(self._progress.clock[state.STEP]) * self.contact_dt, {
            name: getattr(disks, name)[place] for name in names
        }

    def shear_forces(self) -> dict[Pair, float]:
        """Shear forces ``fs`` [N] of all closed contacts that carry one, by body numbers: a scene's ``initial_shear``."""
        if self._spheres is not None:
            return self._spheres.shear_forces()
        if self._outlines is not None:
            return shear_of_grains(self._outlines)
        return shear_by_pair(self._disks, self._lists.pairs, self._lists.wall_pairs)

    @property
    def counts(self) -> Counts:
        """Rebuilds so far, pairs that the present lists hold, contacts at the present positions."""
        if self._spheres is not None:
            return self._spheres.counts
        rebuilds = int(self._progress.clock[state.REBUILDS])
        return count(
            self._disks, self._walls, self._lists.pairs, self._lists.wall_pairs, self._outlines, self._images, rebuilds
        )

    def warm_up(self) -> None:
        """Compile or load the kernels on a copy of the scene; this session's state stays as it is."""
        if self._spheres is not None:
            return  # it has found the forces of time 0, with the kernels of all steps
        once = self.numerics.replace(n_steps=1, sample_every=1, sample_until=None)
        DemSession(self.scene, once, self.pairs, threads=self._threads).run()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint from which `load` goes on bit for bit.

        Parameters
        ----------
        path : path-like
            File in NumPy's ``.npz`` format; it appears whole or not at all.

        Raises
        ------
        UnwritableFileError
            If it cannot be written.
        """
        arrays = self._state() if self._spheres is None else self._spheres.arrays()
        write_checkpoint(path, self.scene, self.numerics, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, n_steps: int | None = None, threads: int = 1) -> DemSession:
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
            If the file is no checkpoint.
        InvalidNumericsError
            If the run is already past ``n_steps``.
        """
        scene, numerics, arrays = read_checkpoint(path, Scene)
        if n_steps is not None:
            numerics = numerics.replace(n_steps=n_steps)
        if has_hertz(scene):
            from ninedisk.core.dem.disks_as_spheres import DisksAsSpheres

            watch, chosen = DisksAsSpheres.asked(arrays)
            session = cls(scene, numerics, watch, chosen, threads=threads)
            if session._spheres is not None:
                session._spheres.restore(arrays)
            return session
        watch = [(int(i), int(j)) for i, j in arrays["samples.pairs"]]
        session = cls(scene, numerics, watch, arrays["samples.chosen"].tolist(), threads=threads)
        done = int(arrays["clock"][state.STEP])
        if done > numerics.n_steps * session.substeps:
            raise InvalidNumericsError(
                f"n_steps = {numerics.n_steps} is not allowed: the checkpoint has done {done // session.substeps} steps"
            )
        # A spare list need not hold anything, but room for as many pairs.
        pairs, wall_pairs = ([saved_list(arrays, name) for _ in range(2)] for name in ("pairs", "wall_pairs"))
        session._lists = Lists(pairs[0], wall_pairs[0], pairs[1], wall_pairs[1], *session._lists[4:])
        session._outlines = restored_outlines(session._outlines, arrays)
        if session._images is not None:
            shift = np.array(arrays["pairs.shift"])
            session._images = session._images._replace(shift=shift, spare=np.zeros(len(shift)))
        session._progress.clock[state.ROW] = restore(session._state(), arrays, int(arrays["clock"][state.ROW]))
        session._note_lists()
        return session

    def _state(self) -> dict[str, NDArray[Any]]:
        single = {**self._progress._asdict(), "stripe": self._team.stripe, "border": self._team.border}
        groups: dict[str, Any] = {
            "disks": self._disks,
            "walls": self._walls,
            "pairs": self._lists.pairs,
            "wall_pairs": self._lists.wall_pairs,
            "samples": self._samples,
        }
        if self._outlines is not None:
            groups["grains"] = self._outlines.memory
        if self._losses is not None:
            groups["losses"] = self._losses
        if self._images is not None:
            single["pairs.shift"] = self._images.shift
            single |= {f"cell.{name}": getattr(self._images, name) for name in ("now", "built", "load", "work")}
        return state_arrays(single, groups)

    def _advance(self, target: int) -> None:
        if self._walls.passed[0]:
            self._fulfil(state.BEHIND_WALL)
        while True:
            arrays = (self._disks, self._views, self._walls, self._lists, self._law, self._step, self._team)
            system = System(*arrays, self._laws, self._losses)
            shared = (
                system,
                self._motion,
                self._loads,
                self._outlines,
                self._images,
                self._samples,
                self._progress,
                self._watch,
                self._least,
                target,
            )
            code = run_in_threads(advance, self._threads, shared)
            if code == OK and not (np.isfinite(self._disks.x).all() and np.isfinite(self._disks.v).all()):
                code = NOT_FINITE
            if code == OK:
                return
            self._fulfil(code)

    def _fulfil(self, code: int) -> None:
        """Grow what was too small for the step to go on, or raise what has stopped it for good."""
        lists, step = self._lists, int(self._progress.clock[state.STEP])
        if code == PAIRS_FULL:
            check_crowd(lists.pairs)
            self._lists = lists._replace(pairs=enlarged_list(lists.pairs), spare=enlarged_list(lists.spare))
            if self._images is not None:
                room, used = self._lists.pairs.other.shape[0], int(self._lists.pairs.start[-1])
                self._images = with_more_pairs(self._images, room, used)
            self._note_lists()
        elif code == WALL_PAIRS_FULL:
            self._lists = lists._replace(
                wall_pairs=enlarged_list(lists.wall_pairs), wall_spare=enlarged_list(lists.wall_spare)
            )
        elif code == state.GRAINS_STOPPED and self._outlines is not None:
            self._outlines = with_more_capacity(self._outlines, self.scene, step, self.contact_dt)
        elif code == state.LOOK:
            self._check_critical_step()
        elif code == state.BEHIND_WALL:
            raise behind_wall(self.scene, self._walls, step, self.contact_dt, self.critical_dt)
        else:
            raise not_finite(self._disks, step, self.contact_dt, self.critical_dt)

    def _check_critical_step(self) -> None:
        """Raise if the contact step is too long for the present state."""
        disks, place, scene, dt = self._disks, self._disks.place, self.scene, self.contact_dt
        x, v, t = disks.x[place], disks.v[place], int(self._progress.clock[state.STEP]) * dt
        if scene.cell is not None:
            self._check_relative_speed(x, v, t)
        elif pair := leaping_pair(
            x, dt * v, self._watch.size, scene.disks.radius, scene.disks.fixed, float(self._progress.skin[0])
        ):
            i, j = pair
            travel, limit = dt * float(np.hypot(*(v[i] - v[j]))), float(self._watch.size[[i, j]].min())
            raise scene.too_fast(i, scene.body_name(j), travel, limit, t, dt)
        if not self._step.watched:
            return
        angle = scene.disks.angle + disks.angle[place]
        try:
            critical, body = present_time_step(scene, Place(x, angle, self._walls.now, t), self.numerics.damping_form)
        except InvalidSceneError:
            return  # centres that coincide, or outlines that no chord cuts: the forces have their own error
        if dt > critical * (1.0 + 1e-9):  # the round-off of two ways to the same number
            raise scene.unstable(body, dt, critical, t, SAFETY)

    def _check_relative_speed(self, x: NDArray[np.float64], v: NDArray[np.float64], t: float) -> None:
        """Raise if two disks of a cell move farther relative to each other in a step than they may, the cell's flow apart."""
        cell, dt = self.scene.cell, self.contact_dt
        if cell is None:
            return
        flow = np.array(cell.rate) @ np.diag(cell.size) @ np.linalg.inv(cell.edges(t))
        step = dt * (v - x @ flow.T)
        travel = np.hypot(*(step - 0.5 * (step.min(axis=0) + step.max(axis=0))).T)
        if 2.0 * travel.max() > self._least:
            raise self.scene.too_fast(
                int(np.argmax(travel)), "the cell's flow", float(travel.max()), 0.5 * self._least, t, dt
            )

    def _note_lists(self) -> None:
        """Views of the present arrays, and what the kernels note of each listed pair."""
        self._laws = with_law_capacity(self._laws, self._lists)
        self._views = disk_views(self._disks, self._lists, self._law, self._laws)

    def _first_lists(self) -> None:
        while True:
            skin = float(self._progress.skin[0])
            lists, team, step = self._lists, self._team, self._step
            if self._images is None:
                code = rebuild(self._disks, self._walls, lists, team, step, skin)
            else:
                code = rebuild_images(self._disks, self._walls, lists, self._images, team, step, skin)
            if code == OK:
                return
            self._fulfil(code)

    def history(self) -> History:
        """What has been sampled so far."""
        if self._spheres is not None:
            return self._spheres.history()
        rows = int(self._progress.clock[state.ROW])
        numerics = self.numerics
        left_out = set() if numerics.energy_budget else set(ENERGIES[8:])
        if not (numerics.energy_budget or any(law.rolling is not None for law in self.scene.laws_in_use)):
            left_out.add("elastic_rolling")
        if not (numerics.energy_budget or self.scene.forces):
            left_out.add("force_work")
        return history_of(self._samples, rows, self.substeps, self.contact_dt, self.pairs, left_out)


def has_hertz(scene: Scene) -> bool:
    """Whether a law in use is Hertz'."""
    return any(law.hertz for law in scene.laws_in_use)


def check_admission(scene: Scene, numerics: Numerics, threads: int) -> None:
    """Refuse what the DEM cannot run.

    Raises
    ------
    InvalidSceneError
        If the scene has no disk, or friction without a shear spring.
    InvalidNumericsError
        If the numerics ask for the static limit, for the energy budget of a scene with a disk that is held in a motion, or have options
        for the DEM, which has none, or the number of threads is not allowed.
    """
    check_run(scene, numerics, "the DEM", LACKS)
    check_shear_springs(scene.laws_in_use)
    if needs_outlines(scene):
        check_run(scene, numerics, "the DEM of outlines", OUTLINES_LACK)
    if scene.cell is not None:
        check_run(scene, numerics, "the DEM in a periodic cell", CELL_LACKS)
        check_cell(scene, numerics)
    if numerics.energy_budget and (needs_outlines(scene) or scene.cell is not None):
        where = "in a periodic cell" if scene.cell is not None else "for outlines"
        raise InvalidNumericsError(
            f"energy_budget is not allowed {where}: the DEM has it for disks between walls; leave it out"
        )
    driven = (scene.disks.held & (scene.disks.v != 0.0)).any(axis=1)
    if numerics.energy_budget and driven.any():
        raise InvalidNumericsError(
            f"energy_budget = True is not allowed with disk {int(np.argmax(driven))} held in a motion, whose work is not counted: hold "
            "it at rest, or let a wall move"
        )
    if numerics.regime != "dynamic":
        raise InvalidNumericsError(f"regime = {numerics.regime!r} needs contact dynamics: the DEM has inertia")
    check_threads(threads)
    read_options("dem", {}, numerics)


def history_of(
    samples: Samples, rows: int, substeps: int, contact_dt: float, pairs: tuple[Pair, ...], left_out: Collection[str]
) -> History:
    """The first ``rows`` samples, taken in steps of ``substeps`` contact steps [s], without the energies ``left_out``."""
    data: dict[str, Any] = {name: array[:rows] for name, array in samples._asdict().items()}
    energy = {name: data["energy"][:, k] for k, name in enumerate(ENERGIES) if name not in left_out}
    energy["kinetic"] = energy["translation"] + energy["rotation"]
    energy["elastic"] = energy["elastic_normal"] + energy["elastic_shear"]
    if "elastic_rolling" in energy:
        energy["elastic"] += energy["elastic_rolling"]
    periodic = len(samples.stress) > 0
    if periodic:
        energy["cell_work"] = data["cell_work"]
    # Times are products of the step number and the contact step, as the kernels form them.
    fields = ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force")
    return History(
        step=data["at"] // substeps,
        t=data["at"] * contact_dt,
        pairs=pairs,
        particles=tuple(int(i) for i in samples.chosen),
        force_meaning="instantaneous",
        energy=energy,
        stress=data["stress"] if periodic else None,
        **{name: data[name] for name in fields},
    )


@kernel
def touching(disks: DiskArrays, pairs: NeighbourList) -> int:
    """Listed pairs of disks that overlap."""
    found = 0
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = pairs.other[k]
            dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
            reach = disks.radius[i] + disks.radius[j]
            if dx * dx + dy * dy < reach * reach:
                found += 1
    return found


@kernel
def touching_walls(disks: DiskArrays, walls: WallArrays, pairs: NeighbourList) -> int:
    """Listed pairs of a disk and a wall that overlap."""
    found = 0
    for w in range(walls.now.shape[0]):
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        for k in range(pairs.start[w], pairs.start[w + 1]):
            i = pairs.other[k]
            height = (disks.x[i, 0] - px) * ux + (disks.x[i, 1] - py) * uy
            if disks.radius[i] - height > 0.0:
                found += 1
    return found


def count(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    outlines: Outlines | None,
    images: Images | None,
    rebuilds: int,
) -> Counts:
    """Counts of the present state; ``rebuilds`` is taken over."""
    if images is not None:
        contacts, wall_contacts = int(image_contacts(disks, pairs, images)[0]), 0
    elif outlines is None:
        contacts, wall_contacts = int(touching(disks, pairs)), int(touching_walls(disks, walls, wall_pairs))
    else:
        contacts, wall_contacts = _outline_counts(outlines, len(disks.x))
    return Counts(rebuilds, int(pairs.start[-1]), int(wall_pairs.start[-1]), contacts, wall_contacts)


def _outline_counts(outlines: Outlines, n: int) -> tuple[int, int]:
    """Contacts in the memory of the last finished step, between bodies and with walls, which are bodies ``n`` and beyond."""
    memory = outlines.memory
    side = int(memory.mark[SIDE])
    second = memory.body[side, : int(memory.mark[COUNT + side]), 1]
    at_walls = int(np.count_nonzero(second >= n))
    return len(second) - at_walls, at_walls
