"""What a DEM run begins with, for a scene and its numerics: contact step, law rows, scalars of the scheme, arrays; and its errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.critical import NEAR, critical_time_step, normal_arms, packed_time_step, stiffening
from ninedisk.core.dem.levels import no_levels, size_of_skins
from ninedisk.core.dem.neighbours import PAIRS_PER_DISK, empty_cells, empty_list
from ninedisk.core.dem.plane.force_kernels import CHUNK, PAIR_KN, SCRATCH, note_pairs
from ninedisk.core.dem.state import (
    COHESION,
    CONSTANT,
    KN,
    KR,
    KS,
    LAW_COLUMNS,
    MODEL,
    MU,
    SLIP_MIDDLE,
    SLIP_OVERLAP,
    SPRING,
    TORQUE_OVERLAP,
    VISCOUS,
    DiskArrays,
    Kick,
    Laws,
    Levels,
    Lists,
    Loads,
    Losses,
    Samples,
    StepConstants,
    Team,
    Views,
    WallArrays,
    Watch,
)
from ninedisk.core.errors import BehindWallError, NonFiniteStateError, UnstableTimeStepError
from ninedisk.core.law import RollingModel
from ninedisk.core.numerics import Numerics
from ninedisk.core.nurbs.mass import nearest
from ninedisk.core.scene import ContactLaw, Rolling, Scene
from ninedisk.core.scene.motion import wall_poses
from ninedisk.core.scene.motion_kernels import WallMotion
from ninedisk.core.thread_kernels import PAD

SORT_FROM = 2_000
"""Number of disks from which they are kept in the order of the cells: a smaller scene fits into the fast caches anyway, and the
order of its disks stays the scene's."""

STRIPES = 64
"""Most stripes of a sorted run, whatever the number of threads."""

LINE = 64
"""Bytes of a line of the caches."""

SAFETY = 0.1
"""Fraction of the critical step that ``contact_dt = None`` represents, unless contacts that form later ask for less."""

FIRST_SKIN, LEAST_SKIN, MOST_SKIN = 0.05, 0.02, 0.4
"""Skin of the first lists and limits of later ones as fractions of the mean radius."""

ENERGIES = (
    *(
        "translation",
        "rotation",
        "elastic_normal",
        "elastic_shear",
        "gravity",
        "elastic_rolling",
        "wall_work",
        "force_work",
    ),
    *("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss"),
)
"""Columns of `Samples.energy`; the last five only where the energy budget is asked for."""

MODELS: dict[RollingModel, int] = {"constant": CONSTANT, "viscous": VISCOUS, "elastic-plastic": SPRING}


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """Copy that begins with a line of the caches, so that no vector of numbers lies across two of them."""
    capacity = np.zeros(values.nbytes + LINE, dtype=np.uint8)
    first = -capacity.ctypes.data % LINE
    found = capacity[first : first + values.nbytes].view(values.dtype).reshape(values.shape)
    found[...] = values
    return found


def disk_arrays(scene: Scene, lagged: bool, budget: bool = False) -> DiskArrays:
    """State of the disks at time 0, in the scene's order.

    ``lagged``: dashpots see the velocity of half a step before; ``budget``: energies are asked for.
    """
    disks, n = scene.disks, len(scene.disks)
    laws = (scene.disk_disk, *(wall.law for wall in scene.walls), *scene.laws.values())
    rolls = [law.rolling for law in laws if law.rolling is not None]
    drags = any(rolling.model == "viscous" or rolling.beta > 0.0 for rolling in rolls)
    damped = not lagged and (drags or any(law.beta > 0.0 for law in laws))
    moved = disks.held.any(axis=1) & ~disks.fixed
    arrays = DiskArrays(
        x=disks.x,
        v=disks.v,
        angle=np.zeros(n),
        omega=disks.omega,
        radius=disks.radius,
        inv_mass=np.where(disks.held.all(axis=1), 0.0, 1.0 / disks.mass),
        inv_inertia=np.where(disks.rotating, 1.0 / disks.inertia, 0.0),
        force=np.zeros((n, 2)),
        torque=np.zeros(n),
        v_now=disks.v if damped else np.zeros((0, 2)),
        omega_now=disks.omega if damped and has_laws(scene) else np.zeros(0),
        braked=np.zeros(n if budget and scene.xi > 0.0 else 0),
        built=disks.x,
        name=np.arange(n, dtype=np.uint32),
        place=np.arange(n, dtype=np.uint32),
        listed=np.arange(n, dtype=np.uint32),
        free=np.column_stack([~disks.held, np.where(disks.fixed, 0.0, disks.mass)])
        if moved.any()
        else np.zeros((0, 3)),
    )
    return DiskArrays(*(aligned(array) for array in arrays))


def has_laws(scene: Scene) -> bool:
    """Whether contacts need `Laws`: of materials, with cohesion or with rolling resistance."""
    return bool(scene.laws) or any(law.cohesion > 0.0 or law.rolling is not None for law in scene.laws_in_use)


def law_arrays(scene: Scene) -> Laws | None:
    """Laws by pairs of materials; None where disks and each wall have one, without cohesion and rolling resistance."""
    if not has_laws(scene):
        return None
    disks, walls = scene.disks, scene.walls
    names = sorted({*disks.material, *(wall.material for wall in walls)})
    number = {name: k for k, name in enumerate(names)}
    laws = [scene.disk_disk, *(wall.law for wall in walls), *scene.laws.values()]
    of_pair = np.zeros((len(names), len(names)), dtype=np.uint32)
    of_wall = np.repeat(1 + np.arange(len(walls), dtype=np.uint32), len(names)).reshape(len(walls), len(names))
    for k, (one, two) in enumerate(scene.laws):
        row, a, b = 1 + len(walls) + k, number[one], number[two]
        of_pair[a, b] = of_pair[b, a] = row
        for w, wall in enumerate(walls):
            if wall.material in (one, two):
                of_wall[w, b if wall.material == one else a] = row
    rows = np.array([law_row(law) for law in laws])
    halves = [0.5 * rows[:, TORQUE_OVERLAP], 0.5 * rows[:, SLIP_OVERLAP]]
    models = [rows[:, MODEL] == SPRING, rows[:, MODEL] == VISCOUS]
    columns = np.array([*rows[:, [KN, COHESION, KS, MU]].T, *halves, rows[:, SLIP_MIDDLE], rows[:, KR], *models])
    between = columns[:, np.unique(of_pair)]
    return Laws(
        rows=rows,
        material=np.array([number[name] for name in disks.material], dtype=np.uint32),
        of_pair=of_pair,
        of_wall=of_wall,
        columns=columns,
        varying=np.flatnonzero((between != between[:, :1]).any(axis=1)),
        noted=np.zeros((0, 0)),
        reach=np.zeros(0),
        drag=np.zeros(0),
    )


def with_law_capacity(laws: Laws | None, lists: Lists) -> Laws | None:
    """The same with room to note the law of every listed pair."""
    if laws is None:
        return None
    capacity = len(lists.pairs.other)
    return laws._replace(
        noted=np.zeros((len(laws.varying), capacity)), reach=np.zeros(capacity), drag=np.zeros(capacity)
    )


def load_arrays(scene: Scene) -> Loads:
    """Forces and torques on single disks."""
    return Loads(
        disk=np.array([force.disk for force in scene.forces], dtype=np.int64),
        load=np.array([[*force.force, force.torque] for force in scene.forces]).reshape(-1, 3),
        time=np.array([[force.begin, force.end] for force in scene.forces]).reshape(-1, 2),
    )


def loss_arrays(stripes: int) -> Losses:
    """Sums of what contacts lose."""
    return Losses(contacts=np.zeros((stripes, 5)), before=np.zeros(5))


def disk_views(disks: DiskArrays, lists: Lists, law: FloatArray, laws: Laws | None = None) -> Views:
    """Views of the disks, and rows, dashpots and laws of the listed pairs.

    These stay where a rebuild puts the new list until it copies it: it notes them anew afterwards.
    """
    dashpot_v = disks.v_now if len(disks.v_now) else disks.v
    views = Views(
        x=disks.x.reshape(-1),
        v=disks.v.reshape(-1),
        dashpot_v=dashpot_v.reshape(-1),
        force=disks.force.reshape(-1),
        built=disks.built.reshape(-1),
        row=lists.spare.other,
        damping=lists.spare.shear,
    )
    note_pairs(disks, views, lists.pairs, law, laws)
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
        law=np.array([law_row(wall.law) for wall in scene.walls]).reshape(m, LAW_COLUMNS),
        load=np.zeros((m, 3)),
        load_before=np.zeros((m, 3)),
        share=np.zeros((stripes, m, 3)),
        behind=np.zeros((stripes, 3)),
        passed=np.zeros(1, dtype=np.int64),
    )


def team_arrays(stripes: int, threads: int, laws: Laws | None = None, capacity: int = SCRATCH) -> Team:
    """Shared arrays of the threads; the stripes are set by the first rebuild.

    Columns that all ``laws`` between disks share are written to the scratch here, where they stay.
    """
    scratch = np.zeros((threads, capacity + 2 * PAD))
    if laws is not None:
        shared = laws.columns[:, laws.of_pair[0, 0]]
        scratch[:, int(PAIR_KN) : int(PAIR_KN) + len(shared) * CHUNK] = np.repeat(shared, CHUNK)
    return Team(
        stripe=np.zeros(stripes + 1, dtype=np.int64),
        border=np.zeros(stripes, dtype=np.int64),
        flags=np.zeros(threads * PAD, dtype=np.int64),
        far=np.zeros(threads * PAD),
        code=np.zeros(1, dtype=np.int64),
        scratch=scratch,
    )


def first_lists(n: int, m: int, bends: bool = False, levels: Levels | None = None) -> Lists:
    """Empty lists for n disks and m walls, and what their rebuild works with; ``bends``: with torques of rolling resistance.

    ``levels`` are those of disks of many sizes (`ninedisk.core.dem.levels`).
    """
    capacity, wall_room = int(PAIRS_PER_DISK * n) + 16, n // 64 + 16
    pairs, spare = (empty_list(n, capacity, bends) for _ in range(2))
    wall_pairs, wall_spare = (empty_list(m, wall_room, bends) for _ in range(2))
    return Lists(pairs, wall_pairs, spare, wall_spare, empty_cells(n), levels or no_levels())


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
        energy=np.zeros((s, len(ENERGIES))),
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
        wanted = max(wanted, 1e-16 * numerics.dt)  # refused as too many substeps
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
    rolling = law.rolling or Rolling(model="constant", mu=0.0)
    return [
        *(law.kn, law.ks, law.mu, law.beta, float(torque), float(slip), float(wall_mid), float(middle), law.cohesion),
        *(float(MODELS[rolling.model]), rolling.mu, rolling.kr, rolling.beta),
    ]


def watch_arrays(scene: Scene) -> Watch:
    """What the contact step is held against on the way."""
    size = scene.disks.radius.copy()
    for k in np.unique(scene.disks.outline[scene.disks.outline >= 0]):
        size[scene.disks.outline == k] = nearest(scene.outlines[k])
    return Watch(
        size=size,
        arm=normal_arms(scene),
        stiff=np.array([stiffening(scene, law) for law in (scene.disk_disk, *(wall.law for wall in scene.walls))]),
        near=np.array([NEAR * float(scene.disks.radius.min())]),
        sums=np.zeros((len(size), 2)),
        checked=np.zeros(1, dtype=np.int64),
        verdict=np.zeros(1, dtype=np.int64),
    )


def step_constants(
    scene: Scene, numerics: Numerics, dt: float, in_order: bool, levels: Levels | None = None
) -> StepConstants:
    """Scalars of the scheme for contact step ``dt`` [s]; ``in_order``: disks are kept in the order of the cells."""
    a = 0.5 * scene.xi * dt
    central = numerics.damping_form == "central"
    shared = {"dt": dt, "gravity_x": scene.gravity[0], "gravity_y": scene.gravity[1]}
    radius = size_of_skins(scene.disks.radius, levels)
    return StepConstants(
        # Half the kick is still missing at t_n, or all of it after the half kick.
        first=Kick(keep=1.0 - a, gain=0.5 * dt, ahead=1.0, drag=a, seen=0.0, mean=1.0, **shared),
        kick=Kick(
            keep=(1.0 - a) / (1.0 + a) if central else 1.0 - 2.0 * a,
            gain=dt / (1.0 + a) if central else dt,
            ahead=0.5,
            drag=2.0 * a,
            seen=0.5 if central else 0.0,
            mean=0.5,
            **shared,
        ),
        radius=radius,
        widest=float(scene.disks.radius.max()),
        first_skin=FIRST_SKIN * radius,
        least_skin=LEAST_SKIN * radius,
        most_skin=MOST_SKIN * radius,
        lagged=not central,
        sorted=in_order,
        watched=not numerics.allow_unstable and dt > packed_time_step(scene, damping_form=numerics.damping_form),
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
