"""Stored configurations (frames) of a case as pictures, every engine's outlines overlaid."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.reports.chains import contact_forces, ends, springs
from ninedisk.reports.draw_scene import Configuration
from ninedisk.reports.figures import varying
from ninedisk.reports.model import CaseData
from ninedisk.reports.plans import PLANS, FigurePlan
from ninedisk.reports.scene_view import WallView, read_scene
from ninedisk.reports.scenes import read_frames
from ninedisk.reports.style import Look
from ninedisk.reports.text import decoded, parameters

MOST_GROUPS = 8
"""Variants whose configurations are drawn on one page."""

UNPLANNED = FigurePlan(
    number="",
    title="Configurations",
    kind="configuration",
    shows="Disks and walls at the stored steps; each spoke turns with its disk.",
    allows="Whether the engines move the bodies alike.",
)


def case_configurations(
    case: CaseData, looks: dict[str, Look]
) -> tuple[FigurePlan, list[tuple[str, list[Configuration]]]]:
    """Plan of the configuration figure and, for each variant that has frames, heading and one picture a stored step."""
    plan = next((p for p in PLANS.get(case.id, ()) if p.kind == "configuration"), UNPLANNED)
    cells = [cell for cell in case.cells if decoded(cell["frames"], dict).get("x")]
    chosen = [cell for cell in cells if plan.matches(case.variants[cell["variant"]])] or cells
    most = 1 if plan is UNPLANNED else MOST_GROUPS
    variants = list(dict.fromkeys(cell["variant"] for cell in chosen))[:most]
    names = varying(case.variants[variant] for variant in variants)
    groups = []
    for variant in variants:
        pictures = _pictures([cell for cell in chosen if cell["variant"] == variant], looks, plan.last)
        if pictures:
            groups.append((parameters(case.variants[variant], names), pictures))
    return plan, groups


def _pictures(cells: list[dict[str, Any]], looks: dict[str, Look], last: int | None) -> list[Configuration]:
    """The last stored step and the one that begins the last ``last`` steps, with every engine that has them.

    The force chains are those of the first engine whose contacts are plain springs.
    """
    scene = next((view for cell in cells if (view := read_scene(decoded(cell["setup"], dict)))), None)
    if scene is None:
        return []
    bodies: dict[int, list[Any]] = {}
    chains: dict[int, tuple[str, tuple[tuple[Any, float], ...]]] = {}
    for cell in cells:
        frames = read_frames(cell)
        if frames is None or frames.x.shape[1] != len(scene.radius):
            continue
        look, held = looks[cell["engine"]], springs(decoded(cell["setup"], dict))
        for k, step in enumerate(frames.step.astype(int).tolist()):
            walls = _walls(frames.wall_point[k], frames.wall_angle[k])
            bodies.setdefault(step, []).append((look, frames.x[k], frames.angle[k], walls))
        if held is not None and not chains and len(held.walls) == frames.wall_point.shape[1]:
            pairs, forces = contact_forces(held, frames.x, frames.wall_point, frames.wall_angle)
            for k, step in enumerate(frames.step.astype(int).tolist()):
                place = frames.x[k], frames.wall_point[k], frames.wall_angle[k]
                links = tuple((ends(pair, *place), float(f)) for pair, f in zip(pairs, forces[k], strict=True))
                chains[step] = (look.label, links)
    if not bodies:
        return []
    final = max(bodies)
    begin = min(bodies, key=lambda step: (abs(step - (final - last if last else 0)), step))
    return [
        Configuration(f"cycle {step}", scene.radius, tuple(bodies[step]), *chains.get(step, ("", ())), scene.edges)
        for step in sorted({begin, final})
    ]


def _walls(points: Any, angles: Any) -> tuple[WallView, ...]:
    return tuple(
        WallView("", point, np.array([np.cos(angle), np.sin(angle)]))
        for point, angle in zip(points, angles, strict=True)
        if np.isfinite(point).all() and np.isfinite(angle)
    )
