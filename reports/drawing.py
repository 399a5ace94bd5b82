"""Everything drawn of one case: what goes to which file, and what the page says beside it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ninedisk.reports.compare_engines import engine_differences
from ninedisk.reports.configurations import case_configurations
from ninedisk.reports.draw_history import HistoryPanel
from ninedisk.reports.draw_scene import Configuration, numeral
from ninedisk.reports.figures import case_figures, looks_of
from ninedisk.reports.panel import CaseData, Panel
from ninedisk.reports.render import Job
from ninedisk.reports.scene_view import SceneView, read_scene
from ninedisk.reports.text import decoded

MOST_SKETCHES = 4
"""Set-ups of one case that are drawn; those that look alike are drawn once."""

GRIDS = {1: "", 2: "two", 3: "three", 4: "four"}
_POINTS_TO_PIXELS = 4.0 / 3.0


@dataclass(frozen=True)
class Image:
    """An image of a page: address from the report's folder, text alternative, caption, and size in CSS pixels."""

    src: str
    alt: str
    width: int
    height: int
    caption: str = ""


class CaseDrawing:
    """Plans the pictures of a case (`jobs`); once they are drawn, `values` is what the page's template asks for."""

    def __init__(self, panel: Panel, case: CaseData, folder: Path) -> None:
        self.panel, self.case, self.folder = panel, case, folder
        self.jobs: list[Job] = []
        self.looks = looks_of(panel, case)
        self.sketches = [(scene, variant, self._file(scene, "setup")) for variant, scene in self._scenes()]
        self.blocks = case_figures(panel, case)
        self.panels = {
            id(shown): self._file(shown.picture, "history")
            for block in self.blocks
            for group in block.groups
            for shown in group.panels
        }
        self.plan, self.groups = case_configurations(case, self.looks.engines)
        self.frames = {id(picture): self._file(picture, "frame") for _, pictures in self.groups for picture in pictures}

    def _file(self, picture: HistoryPanel | SceneView | Configuration, kind: str) -> Path:
        path = self.folder / "figures" / f"{self.case.slug}-{kind}-{len(self.jobs) + 1}.svg"
        self.jobs.append(Job(picture, path))
        return path

    def _scenes(self) -> list[tuple[str, SceneView]]:
        """Set-ups that look different, by the first variant that has them."""
        found: dict[Any, tuple[str, SceneView]] = {}
        for cell in self.case.cells:
            scene = read_scene(decoded(cell["setup"], dict))
            if scene is not None:
                found.setdefault(scene.signature, (cell["variant"], scene))
        return list(found.values())[:MOST_SKETCHES]

    def values(self) -> dict[str, Any]:
        """Images, legends and difference tables for the template."""
        quantities, pairs = engine_differences(self.panel.stored.series, self.case.id)
        blocks = [
            {
                "plan": block.plan,
                "legend": block.legend,
                "left_out": block.left_out,
                "has_error": any(s.picture.error_limits for group in block.groups for s in group.panels),
                "groups": [
                    {
                        "heading": group.heading,
                        "grid": GRIDS.get(group.columns, ""),
                        "panels": [self._image(self.panels[id(shown)], shown.alt) for shown in group.panels],
                    }
                    for group in block.groups
                ],
            }
            for block in self.blocks
        ]
        used = {id(body[0]): body[0] for _, pictures in self.groups for p in pictures for body in p.bodies}
        return {
            "sketches": [self._sketch(scene, variant, path) for scene, variant, path in self.sketches],
            "blocks": blocks,
            "configuration_plan": self.plan,
            "configuration_looks": list(used.values()),
            "configurations": [
                (heading, [self._image(self.frames[id(p)], self._alt(p, heading)) for p in pictures])
                for heading, pictures in self.groups
            ],
            "pairs": pairs,
            "quantities": quantities,
        }

    def _alt(self, picture: Configuration, heading: str) -> str:
        engines = ", ".join(body[0].label for body in picture.bodies)
        where = f" ({heading})" if heading else ""
        return f"Configuration at {picture.title}{where}: {len(picture.radius)} disks and their walls, by {engines}."

    def _sketch(self, scene: SceneView, variant: str, path: Path) -> Image:
        moving = [f"{wall.name} {'turns' if wall.spin else 'moves'}" for wall in scene.walls if wall.spin or wall.moves]
        walls = ", ".join(moving) or ("walls at rest" if scene.walls else "no walls")
        alt = f"Set-up {variant}: {len(scene.x)} disks and {len(scene.walls)} walls; {walls}."
        marks = "; ".join(f"{numeral(k)} = {label.replace('_', ' ')}" for k, (label, _) in enumerate(scene.marks))
        caption = f"Set-up of {variant.replace(',', ', ') or 'the case'}." + (
            f" Watched contacts: {marks}." if marks else ""
        )
        return self._image(path, alt, caption)

    def _image(self, path: Path, alt: str, caption: str = "") -> Image:
        """Image with the size that its SVG states, so that the page does not jump while it loads."""
        with path.open(encoding="utf-8") as file:
            head = file.read(600)
        sizes = [re.search(rf'\b{name}="([0-9.]+)pt"', head) for name in ("width", "height")]
        width, height = (round(float(size[1]) * _POINTS_TO_PIXELS) if size else 0 for size in sizes)
        return Image(f"figures/{path.name}", alt, width, height, caption)
