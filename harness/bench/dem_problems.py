"""Problems of the suite ``dem``: many disks, one contact law, walls at rest, a fixed number of steps.

Settled packings, which take minutes to make, kept between runs.
"""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ninedisk.core import packings
from ninedisk.core.compile import source_hash
from ninedisk.core.disks import Disks
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw, LeverArm, SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.cases.matched import with_slip_at

SIZES = (100, 1_000, 10_000)
LARGE = (100_000, 1_000_000)
WORK, WORK_SHORT = 20_000_000, 5_000_000
"""Particle-steps of a problem; the short ones are for engines that need seconds for as many. 500 steps of 10,000 disks are enough for
steady rates: our lists are built once in them, as often as on average in the long run (4 times in 2,000 steps), and the packing that
has lost its shear forces has the contacts of the long run from step 200 on, 3 % fewer than at first. Positions in YADE are 6e-4 off by
then, of the 3e-3 that its check allows."""
MOST_STEPS, MOST_STEPS_FLOWING, MOST_STEPS_SHORT, FEWEST_STEPS = 20_000, 4_000, 1_000, 60
"""Fewer steps would time the first and the last. Flowing runs are over before the chaos of collisions makes round-off visible, short
runs are over before the dashpots of the few contacts that YADE has to guess show in the positions."""
FLOWS_FROM = 1_000
"""Disks from which there is a flowing problem: fewer are all boundary."""
STEP = 0.1
"""Contact step over the critical one."""
SKIN, SKIN_FLOWING = 0.05, 0.2
"""Skin over the mean radius for peers, which keep one: the smaller the better where nothing moves. Ours adapts its own."""
SPEED = 20.0
"""Of the top of the packing in the flowing problem [m/s]; the speed grows linearly with height."""


@dataclass(frozen=True, kw_only=True)
class DemProblem:
    """A scene, its contact step [s], the number of steps and the skin of neighbour lists [m].

    Contacts start without shear force: no engine has to take over another one's history, and the packing that loses it moves,
    so that there is something to compare.
    """

    name: str
    scene: Scene
    contact_dt: float
    steps: int
    skin: float
    short: bool = False

    @property
    def n(self) -> int:
        """Number of disks."""
        return len(self.scene.disks)

    def numerics(self) -> Numerics:
        """The whole run as one sampling interval; dashpots see the velocity of half a step before, as in all the engines."""
        return Numerics(dt=self.contact_dt * self.steps, n_steps=1, contact_dt=self.contact_dt, damping_form="lagged")

    def with_conventions(self, disks: LeverArm, walls: LeverArm, slip_at: SlipAt) -> DemProblem:
        """The same with the lever arms of one engine, and slip measured where in the step it has it."""
        scene = with_slip_at(self.scene, slip_at)
        turned = [replace(wall, law=replace(wall.law, lever_arm=walls)) for wall in scene.walls]
        law = replace(scene.disk_disk, lever_arm=disks)
        return replace(self, scene=scene.replace(disk_disk=law, walls=tuple(turned)))


def makers(
    sizes: list[int], wanted: Callable[[str], bool], tell: Callable[[int, int], None] | None = None
) -> dict[str, Callable[[], list[DemProblem]]]:
    """A maker of the wanted problems of each size, by the first one's name: one size at a time is held in memory."""
    return {
        names[0]: partial(_of_size, n, names, tell)
        for n in dict.fromkeys(sizes)
        if (names := [name for name in _names(n) if wanted(name)])
    }


def _names(n: int) -> list[str]:
    names = [f"settled-{n}"]
    names += [f"settled-{n}-short"] if n <= SIZES[-1] else []
    return [*names, *([f"flowing-{n}"] if FLOWS_FROM <= n <= SIZES[-1] else [])]


def _of_size(n: int, names: list[str], tell: Callable[[int, int], None] | None) -> list[DemProblem]:
    from ninedisk.core.dem.critical import critical_time_step

    settled = packing(n, progress=tell)
    scene = settled.replace(disk_disk=_law(settled), initial_shear={})
    dt = STEP * critical_time_step(scene)
    found = []
    for name in names:
        short = name.endswith("-short")
        flows = name.startswith("flowing")
        work = WORK_SHORT if short else WORK
        most = MOST_STEPS_SHORT if short else MOST_STEPS_FLOWING if flows else MOST_STEPS
        steps = min(most, max(FEWEST_STEPS, work // len(scene.disks)))
        chosen = flowing(scene) if flows else scene
        skin = (SKIN_FLOWING if flows else SKIN) * float(scene.disks.radius.mean())
        found.append(DemProblem(name=name, scene=chosen, contact_dt=dt, steps=steps, skin=skin, short=short))
    return found


def _law(scene: Scene) -> ContactLaw:
    """The disks' law; a restitution would be a second, contradicting word about the damping that ``beta`` gives."""
    return replace(scene.disk_disk, restitution=None)


def flowing(scene: Scene) -> Scene:
    """The packing without its right wall and sheared from the start: lists have to be built again and again."""
    disks = scene.disks
    v = np.column_stack([SPEED * disks.x[:, 1] / disks.x[:, 1].max(), np.zeros(len(disks))])
    moving = Disks(x=disks.x, v=v, radius=disks.radius, mass=disks.mass)
    return scene.replace(disks=moving, walls=tuple(wall for wall in scene.walls if wall.name != "right"))


LARGEST_SETTLED = 10_000
"""Disks from which a packing is made of copies of a smaller one, side by side."""


def packing(n: int, *, aspect: float = 1.0, progress: Callable[[int, int], None] | None = None) -> Scene:
    """A settled packing of about ``n`` disks; above `LARGEST_SETTLED` copies of one of that size.

    Parameters
    ----------
    n : int
        Disks, >= 1.
    aspect : float
        Height over width.
    progress : callable, optional
        Called with (steps done, at most to do) while one settles.

    Returns
    -------
    Scene
        At rest, with the shear forces of its contacts unless it is made of copies. It comes from the user's cache folder if it
        has been made before by the same gallery.
    """
    if n > LARGEST_SETTLED:
        one = packing(LARGEST_SETTLED, aspect=aspect, progress=progress).replace(initial_shear={})
        return packings.side_by_side(one, n // LARGEST_SETTLED)
    return kept(f"packing-{n}-{aspect:g}", lambda: packings.settled_packing(n, aspect=aspect, progress=progress))


def kept(name: str, make: Callable[[], Scene]) -> Scene:
    """A scene that takes long to make: from the user's cache folder if the same gallery has made it before."""
    path = _folder() / f"{name}-{_recipe()}.json.gz"
    try:
        with gzip.open(path, "rt", encoding="utf-8") as file:
            return Scene.from_dict(json.load(file))
    except (OSError, EOFError, ValueError, InvalidSceneError):
        pass  # not there, or cut off: made anew
    scene = make()
    _keep(scene, path)
    return scene


def _keep(scene: Scene, path: Path) -> None:
    half = path.with_name(f".tmp-{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with gzip.open(half, "wt", encoding="utf-8", compresslevel=4) as file:
            file.write(json.dumps(scene.to_dict()))
        half.replace(path)
    except OSError:
        half.unlink(missing_ok=True)  # no room or no right to write: the next run settles it again


def _folder() -> Path:
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "ninedisk" / "packings"


def _recipe() -> str:
    """Hash of the gallery's sources: another recipe makes another packing."""
    return source_hash(Path(packings.__file__).parent)[:12]
