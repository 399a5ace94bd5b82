"""Drawing of all figures, in parallel where that helps."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ninedisk.reports.draw_history import HistoryPanel, draw_history
from ninedisk.reports.draw_points import PointChart, draw_points
from ninedisk.reports.draw_scene import Configuration, draw_configuration, draw_sketch
from ninedisk.reports.scene_view import SceneView

MOST_WORKERS = 4
FEW = 12
"""Below this number of figures the start of the workers costs more than it saves."""

Picture = HistoryPanel | SceneView | Configuration | PointChart

_DRAW: dict[type, Callable[[Any, Path], None]] = {
    HistoryPanel: draw_history,
    SceneView: draw_sketch,
    Configuration: draw_configuration,
    PointChart: draw_points,
}


@dataclass(frozen=True)
class Job:
    """A picture and the file that it goes to."""

    picture: Picture
    path: Path


def render(jobs: Sequence[Job], progress: Callable[[int, int], None], workers: int | None = None) -> None:
    """Draw every job; ``progress`` hears how many are done and how many there are.

    Workers are forked, so that they neither load matplotlib again nor import the caller's main module; without fork, or
    if a worker dies, the rest is drawn here.
    """
    import matplotlib.backends.backend_svg
    import matplotlib.figure  # noqa: F401

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    count = min(workers or cores, MOST_WORKERS)
    left = dict(enumerate(jobs))
    if count > 1 and len(jobs) >= FEW and "fork" in multiprocessing.get_all_start_methods():
        try:
            with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("fork")) as pool:
                waiting = {pool.submit(_draw, job): number for number, job in left.items()}
                for future in as_completed(waiting):
                    future.result()
                    del left[waiting[future]]
                    progress(len(jobs) - len(left), len(jobs))
        except BrokenProcessPool:
            pass
    for number in list(left):
        _draw(left.pop(number))
        progress(len(jobs) - len(left), len(jobs))


def _draw(job: Job) -> None:
    _DRAW[type(job.picture)](job.picture, job.path)
