"""What a DEM run begins with, for a scene and its numerics: contact step, law rows, scalars of the scheme, arrays; and its errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.critical import critical_time_step, packed_time_step
from ninedisk.core.dem.force_kernels import SCRATCH, note_pairs
from ninedisk.core.dem.neighbours import PAIRS_PER_DISK, empty_cells, empty_list
from ninedisk.core.dem.state import DiskArrays, Kick, Lists, Samples, StepConstants, Team, Views, WallArrays
from ninedisk.core.errors import BehindWallError, NonFiniteStateError, UnstableTimeStepError
from ninedisk.core.motion import wall_poses
from ninedisk.core.motion_kernels import WallMotion
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.core.thread_kernels import PAD

SORT_FROM = 2_000
"""Number of disks from which they are kept in the order of the cells: a smaller scene fits into the fast caches anyway, and the
order of its disks stays the scene's."""

STRIPES = 64
"""Most stripes of a sorted run, whatever the number of threads."""

LINE = 64
"""Bytes of a line of the caches."""

SAFETY = 0.1
"""Fraction of the critical step that ``contact_dt = None`` stands for, unless contacts that form later ask for less."""

FIRST_SKIN, LEAST_SKIN, MOST_SKIN = 0.05, 0.02, 0.4
"""Skin of the first lists and limits of later ones as fractions of the mean radius."""

ENERGIES = ("translation", "rotation", "elastic_normal", "elastic_shear", "gravity")


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """Copy that begins with a line of the caches, so that no vector of numbers lies across two of them."""
    room = np.zeros(values.nbytes + LINE, dtype=np.uint8)
    first = -room.ctypes.data % LINE
    found = room[first : first + values.nbytes].view(values.dtype).reshape(values.shape)
    found[...] = values
    return found


def disk_arrays(scene: Scene, lagged: bool) -> DiskArrays:
    """State of the disks at time 0, in the scene's order; ``lagged``: dashpots see the velocity of half a step before."""
    disks, n = scene.disks, len(scene.disks)
    damped = not lagged and any(law.beta > 0.0 for law in (scene.disk_disk, *(wall.law for wall in scene.walls)))
    arrays = DiskArrays(
        x=disks.x,
        v=disks.v,
        angle=np.zeros(n),
        omega=disks.omega,
        radius=disks.radius,
        inv_mass=np.where(disks.fixed, 0.0, 1.0 / disks.mass),
        inv_inertia=np.where(disks.rotating, 1.0 / disks.inertia, 0.0),
        force=np.zeros((n, 2)),
        torque=np.zeros(n),
        v_now=disks.v if damped else np.zeros((0, 2)),
        moved=np.zeros((n, 2), dtype=np.float32),
        name=np.arange(n, dtype=np.uint32),
        place=np.arange(n, dtype=np.uint32),
        listed=np.arange(n, dtype=np.uint32),
    )
    return DiskArrays(*(aligned(array) for array in arrays))


def disk_views(disks: DiskArrays, lists: Lists, law: FloatArray) -> Views:
    """Views of the disks, and rows and dashpots of the listed pairs.

    These stay where a rebuild puts the new list until it copies it: it notes them anew afterwards.
    """
    dashpot_v = disks.v_now if len(disks.v_now) else disks.v
    views = Views(
        x=disks.x.reshape(-1),
        v=disks.v.reshape(-1),
        dashpot_v=dashpot_v.reshape(-1),
        force=disks.force.reshape(-1),
        moved=disks.moved.reshape(-1),
        row=lists.spare.other,
        damping=lists.spare.shear,
    )
    note_pairs(disks, views, lists.pairs, law)
    return views


def wall_arrays(scene: Scene, motion: WallMotion, stripes: int) -> WallArrays:
    """State of the walls at time 0."""
    m = len(scene.walls)
    poses = wall_poses(motion, 0.0)
    return WallArrays(
        now=poses,
        built=poses.copy(),
        middle=poses.copy(),
        extent=np.zeros(m),
        law=np.array([law_row(wall.law) for wall in scene.walls]).reshape(m, 8),
        load=np.zeros((m, 3)),
        load_before=np.zeros((m, 3)),
        share=np.zeros((stripes, m, 3)),
        behind=np.zeros((stripes, 3)),
        passed=np.zeros(1, dtype=np.int64),
    )


def team_arrays(stripes: int, threads: int, scratch: int = SCRATCH) -> Team:
    """Shared arrays of the threads; the stripes are set by the first rebuild."""
    return Team(
        stripe=np.zeros(stripes + 1, dtype=np.int64),
        border=np.zeros(stripes, dtype=np.int64),
        flags=np.zeros(threads * PAD, dtype=np.int64),
        far=np.zeros(threads * PAD),
        code=np.zeros(1, dtype=np.int64),
        scratch=np.zeros((threads, scratch + 2 * PAD)),
    )


def first_lists(n: int, m: int) -> Lists:
    """Empty lists for n disks and m walls, and what their rebuild works with."""
    room, wall_room = int(PAIRS_PER_DISK * n) + 16, n // 64 + 16
    return Lists(
        empty_list(n, room), empty_list(m, wall_room), empty_list(n, room), empty_list(m, wall_room), empty_cells(n)
    )


def sample_arrays(
    at: NDArray[np.int64], chosen: NDArray[np.int64], pairs: NDArray[np.int64], n_walls: int, periodic: bool = False
) -> Samples:
    """Room for the samples at the contact steps ``at``."""
    s, k, c, m = len(at), len(chosen), len(pairs), n_walls
    return Samples(
        at=at,
        chosen=chosen,
        pairs=pairs,
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
        stress=np.empty((s if periodic else 0, 2, 2, 2)),
        cell_work=np.empty(s if periodic else 0),
    )


def contact_step(scene: Scene, numerics: Numerics) -> tuple[float, float]:
    """Contact step that a run will use and the critical step of the scene [s].

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.
    """
    critical = critical_time_step(scene, damping_form=numerics.damping_form)
    if numerics.contact_dt is None:
        wanted = min(SAFETY * critical, packed_time_step(scene, damping_form=numerics.damping_form))
        return numerics.dt / max(1, int(np.ceil(numerics.dt / wanted))), critical
    if numerics.contact_dt > critical and not numerics.allow_unstable:
        raise UnstableTimeStepError(
            f"contact_dt = {numerics.contact_dt:g} s exceeds the critical step {critical:g} s of the explicit scheme on "
            f"this scene: use at most {SAFETY * critical:g} s (a tenth of it) for accurate results, or set "
            f"allow_unstable=True to run all the same"
        )
    return numerics.contact_dt, critical


def law_row(law: ContactLaw) -> list[float]:
    """Law as the kernels read it (columns of `ninedisk.core.dem.state`)."""
    torque, slip = law.lever_arm != "radius", law.lever_arm == "overlap"
    wall_mid, middle = law.wall_velocity_at == "mid-overlap", law.slip_at == "middle"
    return [law.kn, law.ks, law.mu, law.beta, float(torque), float(slip), float(wall_mid), float(middle)]


def step_constants(scene: Scene, numerics: Numerics, dt: float, in_order: bool) -> StepConstants:
    """Scalars of the scheme for contact step ``dt`` [s]; ``in_order``: disks are kept in the order of the cells."""
    a = 0.5 * scene.xi * dt
    central = numerics.damping_form == "central"
    shared = {"dt": dt, "gravity_x": scene.gravity[0], "gravity_y": scene.gravity[1]}
    radius = float(scene.disks.radius.mean())
    return StepConstants(
        # Half the kick is still missing at t_n, or all of it after the half kick.
        first=Kick(keep=1.0 - a, gain=0.5 * dt, ahead=1.0, **shared),
        kick=Kick(
            keep=(1.0 - a) / (1.0 + a) if central else 1.0 - 2.0 * a,
            gain=dt / (1.0 + a) if central else dt,
            ahead=0.5,
            **shared,
        ),
        radius=radius,
        widest=float(scene.disks.radius.max()),
        first_skin=FIRST_SKIN * radius,
        least_skin=LEAST_SKIN * radius,
        most_skin=MOST_SKIN * radius,
        lagged=not central,
        sorted=in_order,
    )


def behind_wall(scene: Scene, walls: WallArrays, step: int, contact_dt: float, critical: float) -> BehindWallError:
    """The error of the disk that `WallArrays.behind` holds at contact step ``step``; steps in s."""
    disk, wall, height = walls.behind[np.argmax(walls.behind[:, 0] > 0.0)].tolist()
    when = f"contact step {step} (t = {step * contact_dt:g} s)"
    name = f"contact_dt = {contact_dt:g} s (critical step of the initial state: {critical:g} s)"
    return scene.behind_wall(int(disk) - 1, int(wall), height, when, name)


def not_finite(disks: DiskArrays, step: int, contact_dt: float, critical: float) -> NonFiniteStateError:
    """The error of a position that stopped being finite by contact step ``step``; steps in s."""
    bad = np.sort(disks.name[~np.isfinite(disks.x).all(axis=1)])
    some = "a disk" if len(bad) == 0 else f"disk {bad[0]}" if len(bad) == 1 else f"disks {bad[0]} and {bad[1]}"
    named = some if len(bad) <= 2 else f"{some} and {len(bad) - 2} more"
    return NonFiniteStateError(
        f"the position of {named} is no finite number at contact step {step} (t = {step * contact_dt:g} s): two centres coincided "
        f"at the step before, so that their contact had no normal, or contact_dt = {contact_dt:g} s is unstable here; reduce "
        f"contact_dt (critical step of the initial state: {critical:g} s)"
    )
