"""Drawing of all figures, in parallel where that helps."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ninedisk.reports.draw import HistoryPanel, draw_history
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

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    count = min(workers or cores, MOST_WORKERS)
    left = dict(enumerate(jobs))
    if count > 1 and len(jobs) >= FEW and "fork" in multiprocessing.get_all_start_methods():
        try:
            context = multiprocessing.get_context("fork")
            with ProcessPoolExecutor(count, context, initializer=_end_with, initargs=(os.getpid(),)) as pool:
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


def _end_with(parent: int) -> None:
    """In a worker: end it by the usual signals, and when its parent is gone, whose pipes its siblings hold open."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _draw(job: Job) -> None:
    _DRAW[type(job.picture)](job.picture, job.path)
