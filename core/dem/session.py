"""A DEM run in progress: allocates the arrays, calls the kernels, grows the lists."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.contacts.lists import PAIRS_PER_DISK, empty_cells, empty_list, grown
from ninedisk.core.contacts.search_kernels import NOT_FINITE, OK, PAIRS_FULL, WALL_PAIRS_FULL, NeighbourList
from ninedisk.core.dem import state
from ninedisk.core.dem.constants import contact_step, law_row, step_constants
from ninedisk.core.dem.state import DiskArrays, Samples, WallArrays
from ninedisk.core.dem.step_kernels import advance, rebuild
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError, NonFiniteStateError
from ninedisk.core.geometry.motion import compile_motion, wall_poses
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.core.watch import chosen_particles

STEPS_TIMES_DISKS = 2_000_000
"""Particle-steps in one call of the kernel: a fraction of a second, so that progress and Ctrl-C work."""

ENERGIES = ("translation", "rotation", "elastic_normal", "elastic_shear", "gravity")


class DemSession:
    """The in-house DEM on one scene.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    watch : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    particles : sequence of int or None
        Disks whose motion is recorded; None: all.

    Raises
    ------
    InvalidSceneError
        If the scene has no disk, or a preloaded pair does not touch.
    UnstableTimeStepError
        If the contact step exceeds the critical one and ``numerics.allow_unstable`` is False.
    """

    _list: NeighbourList
    _spare: NeighbourList
    _wall_list: NeighbourList
    _wall_spare: NeighbourList

    def __init__(
        self, scene: Scene, numerics: Numerics, watch: Sequence[Pair] = (), particles: Sequence[int] | None = None
    ) -> None:
        if len(scene.disks) == 0:
            raise InvalidSceneError("the scene has no disk: there is nothing to simulate")
        if scene.disks.held.any():
            i = int(np.argmax(scene.disks.held.any(axis=1)))
            raise InvalidSceneError(f"disk {i} is held, which the DEM cannot express: free it, or use contact dynamics")
        if numerics.regime != "dynamic":
            raise InvalidNumericsError(f"regime = {numerics.regime!r} needs contact dynamics: the DEM has inertia")
        self.scene, self.numerics = scene, numerics
        self.pairs = tuple(scene.check_pair(pair) for pair in watch)
        self.chosen = chosen_particles(scene, particles)
        self.contact_dt, self.critical_dt = contact_step(scene, numerics)
        self.substeps = numerics.substeps(self.contact_dt)
        self._allocate()
        self._preload()
        self._samples = self._sample_arrays()

    def run(self, progress: Callable[[int, int], None] | None = None) -> History:
        """Run to the last step.

        Parameters
        ----------
        progress : callable, optional
            Called with (steps done, steps in all), in steps ``numerics.dt``.

        Returns
        -------
        History
        """
        target = self.numerics.n_steps * self.substeps
        stride = max(1, STEPS_TIMES_DISKS // len(self.scene.disks))
        while self._clock[state.STEP] < target or self._clock[state.PENDING]:
            self._advance(min(target, int(self._clock[state.STEP]) + stride))
            if progress is not None:
                progress(int(self._clock[state.STEP]) // self.substeps, self.numerics.n_steps)
        return self.history()

    def warm_up(self) -> None:
        """Compile or load the kernels on a copy of the scene; this session's state stays as it is."""
        DemSession(self.scene, self.numerics.replace(n_steps=1, sample_every=1, sample_until=None), self.pairs).run()

    def _advance(self, target: int) -> None:
        while True:
            code = advance(
                self._disks,
                self._walls,
                self._motion,
                self._list,
                self._wall_list,
                self._spare,
                self._wall_spare,
                self._cells,
                self._law,
                self._step,
                self._samples,
                self._clock,
                self._work,
                self._widest,
                target,
            )
            if code == OK:
                self._check_finite()
                return
            self._mend(code)

    def _check_finite(self) -> None:
        if not (np.isfinite(self._disks.x).all() and np.isfinite(self._disks.v).all()):
            self._mend(NOT_FINITE)

    def _mend(self, code: int) -> None:
        if code == PAIRS_FULL:
            self._list, self._spare = grown(self._list), grown(self._spare)
        elif code == WALL_PAIRS_FULL:
            self._wall_list, self._wall_spare = grown(self._wall_list), grown(self._wall_spare)
        else:
            bad = np.flatnonzero(~np.isfinite(self._disks.x).all(axis=1))
            step = int(self._clock[state.STEP])
            named = f"disk {bad[0]}" if len(bad) else "a disk"
            raise NonFiniteStateError(
                f"the position of {named} is no finite number at contact step {step} (t = {step * self.contact_dt:g} s): "
                f"contact_dt = {self.contact_dt:g} s is unstable here, or two centres coincide; reduce contact_dt (critical "
                f"step of the initial state: {self.critical_dt:g} s)"
            )

    def _allocate(self) -> None:
        scene, disks, n = self.scene, self.scene.disks, len(self.scene.disks)
        inv_inertia = np.where(disks.rotating, 1.0 / disks.inertia, 0.0)
        self._disks = DiskArrays(
            x=disks.x.copy(),
            v=disks.v.copy(),
            angle=np.zeros(n),
            omega=disks.omega.copy(),
            radius=disks.radius.copy(),
            inv_mass=1.0 / disks.mass,
            inv_inertia=inv_inertia,
            force=np.zeros((n, 2)),
            torque=np.zeros(n),
            v_now=disks.v.copy(),
            x_built=disks.x.copy(),
        )
        m = len(scene.walls)
        self._motion = compile_motion(scene.walls)
        poses = wall_poses(self._motion, 0.0)
        self._walls = WallArrays(
            now=poses,
            built=poses.copy(),
            extent=np.zeros(m),
            law=np.array([law_row(wall.law) for wall in scene.walls]).reshape(m, 7),
            load=np.zeros((m, 3)),
            load_before=np.zeros((m, 3)),
        )
        self._law = np.array(law_row(scene.disk_disk))
        self._step = step_constants(scene, self.numerics, self.contact_dt)
        self._list = empty_list(n, PAIRS_PER_DISK * n + 16)
        self._spare = empty_list(n, PAIRS_PER_DISK * n + 16)
        self._wall_list = empty_list(m, n // 4 + 16)
        self._wall_spare = empty_list(m, n // 4 + 16)
        self._cells = empty_cells(n)
        self._widest = float(disks.radius.max())
        self._clock: NDArray[np.int64] = np.array([0, 1, 0, 0], dtype=np.int64)
        self._work = np.zeros(1)

    def _preload(self) -> None:
        """Build the lists once and enter the shear forces that contacts carry at time 0."""
        while True:
            code = rebuild(
                self._disks,
                self._walls,
                self._list,
                self._wall_list,
                self._spare,
                self._wall_spare,
                self._cells,
                self._step.skin,
                self._widest,
            )
            if code == OK:
                break
            self._mend(code)
        n = len(self.scene.disks)
        for (i, j), force in self.scene.initial_shear.items():
            self._check_preload(i, j, force)
            pairs, row, other = (self._list, i, j) if j < n else (self._wall_list, j - n, i)
            _enter_shear(pairs, row, other, force)

    def _check_preload(self, i: int, j: int, force: float) -> None:
        scene, x, n = self.scene, self.scene.disks.x, len(self.scene.disks)
        if j < n:
            gap = float(np.hypot(*(x[j] - x[i])) - scene.disks.radius[i] - scene.disks.radius[j])
        else:
            wall = scene.walls[j - n]
            gap = float((x[i] - np.array(wall.point)) @ np.array(wall.normal) - scene.disks.radius[i])
        names = f"{scene.body_name(i)} and {scene.body_name(j)}"
        if gap >= 0.0:
            raise InvalidSceneError(
                f"the initial shear force {force:g} N belongs to {names}, which do not touch (gap {gap:g} m): give them an "
                f"overlap or drop the entry"
            )
        law = scene.law((i, j))
        if force != 0.0 and (law.mu == 0.0 or law.ks == 0.0):
            raise InvalidSceneError(
                f"the initial shear force {force:g} N belongs to {names}, whose contact is smooth (mu = {law.mu:g}, "
                f"ks = {law.ks:g}): give it mu > 0 and ks > 0 or drop the entry"
            )

    def _sample_arrays(self) -> Samples:
        at = self.numerics.sampled_steps() * self.substeps
        s, k, c, m = len(at), len(self.chosen), len(self.pairs), len(self.scene.walls)
        return Samples(
            at=at,
            chosen=self.chosen,
            pairs=np.array(self.pairs, dtype=np.int64).reshape(c, 2),
            x=np.empty((s, k, 2)),
            v=np.empty((s, k, 2)),
            angle=np.empty((s, k)),
            omega=np.empty((s, k)),
            gap=np.empty((s, c)),
            fn=np.empty((s, c)),
            fs=np.empty((s, c)),
            wall_point=np.empty((s, m, 2)),
            wall_angle=np.empty((s, m)),
            wall_force=np.empty((s, m, 2)),
            energy=np.empty((s, len(ENERGIES))),
            wall_work=np.empty(s),
        )

    def history(self) -> History:
        """What has been sampled so far."""
        rows = int(self._clock[state.ROW])
        data: dict[str, Any] = {name: array[:rows] for name, array in self._samples._asdict().items()}
        energy = {name: data["energy"][:, k] for k, name in enumerate(ENERGIES)}
        energy["kinetic"] = energy["translation"] + energy["rotation"]
        energy["elastic"] = energy["elastic_normal"] + energy["elastic_shear"]
        energy["wall_work"] = data["wall_work"]
        # Times are products of the step number and the contact step, as the kernels form them.
        fields = ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force")
        return History(
            step=data["at"] // self.substeps,
            t=data["at"] * self.contact_dt,
            pairs=self.pairs,
            particles=tuple(int(i) for i in self.chosen),
            force_meaning="instantaneous",
            energy=energy,
            **{name: data[name] for name in fields},
        )


def _enter_shear(pairs: NeighbourList, row: int, other: int, force: float) -> None:
    for k in range(int(pairs.start[row]), int(pairs.start[row + 1])):
        if pairs.other[k] == other:
            pairs.shear[k] = force
