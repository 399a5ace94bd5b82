"""Settled packings, which take minutes to make, kept between runs."""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Callable
from pathlib import Path

from ninedisk.core import packings
from ninedisk.core.compile import source_hash
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.scene import Scene

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
