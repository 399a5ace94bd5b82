"""Contact problems as files: an open set made from seeds, and those of the steps of a run.

The set does not depend on any contact solver: the states come from the in-house DEM, and each problem is one step of contact dynamics
from such a state, with another friction coefficient and with rigid or elastic contacts. Whether a problem has a solution is for the
solvers to find out.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk import core
from ninedisk.core import packings
from ninedisk.core.archive import make_folder, whole_file
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.problem_files import Form, read_problem, write_problem
from ninedisk.core.cd.session import CdSession
from ninedisk.core.compile import source_hash
from ninedisk.core.errors import CoreError, InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.bench.cd import lattice, step_problem
from ninedisk.harness.bench.dem import packing_folder
from ninedisk.harness.bench.flow import OPEN, OUTLET, advanced_scene

SIZES = (10, 30, 100, 300, 1_000, 3_000)
"""Disks of the states; a packing has about two contacts for each."""
FRICTION = (0.0, 0.1, 0.3, 0.5, 1.0, 2.0)
"""Of the problems made of each state, each second one with elastic contacts."""
STIFF = ContactLaw(kn=1e9, ks=1e9, mu=0.5)
"""Contacts of the regular piles where they are elastic: the weight of a hundred rows indents a disk by a thousandth."""
SUFFIX = {"npz": "npz", "fclib": "hdf5", "fc2d": "dat"}
MANIFEST = "problems.json"
Steps = Callable[[int, int], None]


@dataclass(frozen=True)
class Family:
    """Where states come from: ``make(disks, seed, progress)``, and whether they move."""

    make: Callable[[int, int, Steps | None], Scene]
    moving: bool


def pyramid(n: int, seed: int, notify: Steps | None = None) -> Scene:
    """Equal disks piled up on a floor, each row shorter by one: more forces than equations of balance. The seed chooses the slope's cut."""
    del notify
    rows = max(2, round(math.sqrt(2.0 * n)))
    keep = max(1, rows - seed % 3)  # a pyramid, or one without its top rows
    x = np.array([(i + 0.5 * j, 0.5 + math.sqrt(0.75) * j) for j in range(keep) for i in range(rows - j)])
    floor = Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=STIFF)
    disks = Disks(x=x, radius=np.full(len(x), 0.5), mass=np.full(len(x), packings.DENSITY * math.pi / 4.0))
    return Scene(disks=disks, disk_disk=STIFF, walls=(floor,), gravity=(0.0, -packings.GRAVITY))


def _fall(scene: Scene) -> float:
    """Seconds of a free fall from the highest disk to the lowest."""
    return math.sqrt(2.0 * max(float(np.ptp(scene.disks.x[:, 1])), 1.0) / packings.GRAVITY)


def _box(n: int) -> tuple[int, int]:
    columns = max(2, round(math.sqrt(n)))
    return columns, max(1, round(n / columns))


def _settling(n: int, seed: int, notify: Steps | None) -> Scene:
    scene = packings.poured(*_box(n), seed=seed)
    return advanced_scene(1.5 * _fall(scene), scene, notify)


def _packing(n: int, seed: int, notify: Steps | None) -> Scene:
    return packings.settled_packing(n, seed=seed, progress=notify)


def _column(n: int, seed: int, notify: Steps | None) -> Scene:
    return packings.settled_packing(n, seed=seed, aspect=min(10.0, float(n)), progress=notify)


def _collapse(n: int, seed: int, notify: Steps | None) -> Scene:
    scene = packings.settled_packing(n, seed=seed, aspect=min(2.0, float(n)), progress=notify)
    return advanced_scene(0.7 * _fall(scene), packings.collapse(scene), notify)


def _drum(n: int, seed: int, notify: Steps | None) -> Scene:
    scene = packings.drum(n, seed=seed, turns_per_second=0.05, fill=0.3)
    return advanced_scene(2.0 * _fall(scene), scene, notify)


def _hopper(n: int, seed: int, notify: Steps | None) -> Scene:
    full = packings.settle(packings.hopper(n, outlet=min(OUTLET, 1.5 + 0.2 * math.sqrt(n)), seed=seed), progress=notify)
    return advanced_scene(OPEN, packings.discharge(full), notify)


def _biaxial(n: int, seed: int, notify: Steps | None) -> Scene:
    return advanced_scene(9.0, packings.biaxial(*_box(n), seed=seed, strain=0.2, duration=10.0), notify)


def _lattice(n: int, seed: int, notify: Steps | None) -> Scene:
    del notify
    rows, columns = _box(n)
    scene = lattice(rows + seed % 3, columns)
    return scene.replace(disk_disk=STIFF, walls=tuple(replace(wall, law=STIFF) for wall in scene.walls))


FAMILIES = {
    "settling": Family(_settling, moving=True),
    "packing": Family(_packing, moving=False),
    "column": Family(_column, moving=False),
    "collapse": Family(_collapse, moving=True),
    "drum": Family(_drum, moving=True),
    "hopper": Family(_hopper, moving=True),
    "biaxial": Family(_biaxial, moving=True),
    "pyramid": Family(pyramid, moving=False),
    "lattice": Family(_lattice, moving=False),
}


def make_set(
    folder: Path,
    *,
    seed: int,
    largest: int,
    form: Form,
    families: tuple[str, ...],
    notify: Callable[[int, int, str], None],
) -> tuple[int, list[str]]:
    """Write the open set of a seed, and `MANIFEST`; the number of problems, and the states that could not be made.

    Parameters
    ----------
    folder : Path
    seed : int
        Of radii and places of the disks.
    largest : int
        Disks of the largest states.
    form : {"npz", "fc2d", "fclib"}
    families : tuple of str
        Names of `FAMILIES`.
    notify : callable
        ``notify(done, total, what)``.
    """
    states = [(name, n) for n in SIZES if n <= largest for name in families]
    rows: list[dict[str, Any]] = []
    left_out: list[str] = []
    for k, (name, n) in enumerate(states):
        notify(k, len(states), f"{name} of {n} disks")
        try:
            rows += _problems_of_state(folder, name, n, seed=seed, form=form)
        except InvalidSceneError as error:  # a rattler, for instance, that does not come to rest
            left_out.append(f"{name} of {n} disks: {error}")
    _write_manifest(folder, rows)
    return len(rows), left_out


def _problems_of_state(folder: Path, name: str, n: int, *, seed: int, form: Form) -> list[dict[str, Any]]:
    """Write the problems of a state; their rows of the manifest."""
    scene = FAMILIES[name].make(n, seed, None)
    rows = []
    for m, mu in enumerate(FRICTION):
        elastic = (SIZES.index(n) + m) % 2 == 1  # from size to size the other way round
        problem = step_problem(scene, mu=mu, elastic=elastic, moving=FAMILIES[name].moving)
        if problem.n_contacts == 0:
            continue
        facts = {"family": name, "disks": n, "seed": seed, "mu": mu, "elastic": elastic}
        named = f"{name}-{n}-{seed}-mu{mu:g}-{'elastic' if elastic else 'rigid'}"
        rows.append(_store_state(folder, named, problem, form, facts))
    return rows


def stored_state(name: str, n: int, *, seed: int) -> list[tuple[Path, dict[str, Any]]]:
    """Files of the problems of a state and what the manifest says of them, from the user's cache folder.

    They are made there unless the same sources have made them before and every file still holds the numbers of its hash.

    Raises
    ------
    InvalidSceneError
        If the state cannot be made.
    """
    folder = problem_folder() / f"{source_hash(Path(core.__file__).parent)}-{source_hash(Path(__file__).parent)}"
    folder /= f"{name}-{n}-{seed}"
    try:
        rows = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        good = all(_file_matches(folder / row["file"], row["sha256"]) for row in rows)
    except (OSError, ValueError, TypeError, KeyError):
        good = False
    if not good:
        rows = _problems_of_state(make_folder(folder), name, n, seed=seed, form="npz")
        _write_manifest(folder, rows)
    return [(folder / row["file"], row) for row in rows]


def _file_matches(file: Path, sha256: str) -> bool:
    """Whether a file holds the problem of a hash."""
    try:
        problem = read_problem(file).problem
    except CoreError:
        return False
    return isinstance(problem, ContactProblem) and content_hash(problem) == sha256


def problem_folder() -> Path:
    """Where the problems of `stored_state` are."""
    return packing_folder().parent / "problems"


def collect(
    scene: Scene,
    numerics: Numerics,
    folder: Path,
    *,
    every: int,
    form: Form,
    facts: dict[str, Any],
    progress: Steps | None,
) -> int:
    """Run contact dynamics step by step and write the contact problem of each ``every``-th step; their number.

    The problem of a step that fails is written, too, before its error goes on.
    """
    rows: list[dict[str, Any]] = []

    def keep(step: int, problem: ContactProblem | None, failed: bool) -> None:
        if problem is not None and problem.n_contacts and (failed or step % every == 0):
            rows.append(
                _store_state(folder, f"step-{step:06d}", problem, form, {**facts, "step": step, "failed": failed})
            )

    try:
        _Collecting(scene, numerics, keep).run(progress)
    finally:
        _write_manifest(folder, rows)
    return len(rows)


def content_hash(problem: ContactProblem) -> str:
    """SHA-256 of the numbers of a problem, whatever the form of its file."""
    digest = hashlib.sha256()
    for name, array in sorted(problem.arrays().items()):
        if not name.startswith(("W_", "note_")) and name != "q":
            digest.update(f"{name}{array.shape}".encode())
            digest.update(np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes())
    return digest.hexdigest()


class _Collecting(CdSession):
    """A run whose steps are taken one by one, and that shows the problem of each."""

    def __init__(
        self, scene: Scene, numerics: Numerics, keep: Callable[[int, ContactProblem | None, bool], None]
    ) -> None:
        self._keep = keep
        super().__init__(scene, numerics)

    def _batches_if_dynamic(self) -> None:
        return None

    def _advance(self, step: int) -> None:
        self._solver.problem = None
        failed = True
        try:
            super()._advance(step)
            failed = False
        finally:
            self._keep(step, self._solver.problem, failed)


def _store_state(folder: Path, name: str, problem: ContactProblem, form: Form, facts: dict[str, Any]) -> dict[str, Any]:
    noted = replace(problem, notes={key: str(value) for key, value in facts.items()})
    file = f"{name}.{SUFFIX[form]}"
    write_problem(make_folder(folder) / file, noted, form)
    size = {"contacts": problem.n_contacts, "bodies": problem.n_bodies}
    return {"file": file, **facts, **size, "sha256": content_hash(problem)}


def _write_manifest(folder: Path, rows: list[dict[str, Any]]) -> None:
    with whole_file(make_folder(folder) / MANIFEST) as stream:
        stream.write((json.dumps(rows, indent=1) + "\n").encode())
