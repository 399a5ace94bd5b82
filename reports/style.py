"""Looks of the figures: one colour, dash and marker for each engine, the same in the SVG and in the HTML legend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

INK = "#24292f"
"""Colour of text and axes; `ninedisk.reports.svg` turns it light on dark pages."""

SOFT = "#8a9099"
"""Colour of grids and hatches, readable on white and on black."""

PALETTE = (
    "#1f77d0", "#e0701a", "#1a9a6a", "#c44e9a", "#8a63d2", "#a8871a", "#d64545", "#2aa7b8", "#9c6a3c", "#6f8f2a",
    "#5a62c9", "#b8456b", "#3f8a8a",
)  # fmt: skip
DASHES = ((), (7.0, 2.5), (2.0, 2.0), (7.0, 2.0, 2.0, 2.0), (11.0, 3.0), (4.0, 1.5), (1.0, 2.5), (9.0, 2.0, 1.0, 2.0))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
REFERENCE_DASHES = {
    "exact-step": ((), 4.5),
    "analytic": ((2.5, 1.0), 3.6),
    "converged": ((1.0, 1.0), 3.6),
    "published": ((5.0, 1.0, 1.0, 1.0), 3.0),
    "consensus": ((5.0, 1.0, 1.0, 1.0), 2.4),
}
"""Dash and width of a reference by the kind of its truth."""

SHAPES = {
    "o": "M13 5a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z",
    "s": "M13 2h6v6h-6z",
    "^": "M16 1.5l3.5 6.5h-7z",
    "D": "M16 1.2l3.8 3.8l-3.8 3.8l-3.8 -3.8z",
    "v": "M16 8.5l3.5 -6.5h-7z",
    "P": "M15 1.5h2v2.5h2.5v2h-2.5v2.5h-2v-2.5h-2.5v-2h2.5z",
    "X": "M13 3.3l1.4 -1.4l1.6 1.7l1.6 -1.7l1.4 1.4l-1.7 1.7l1.7 1.7l-1.4 1.4l-1.6 -1.7l-1.6 1.7l-1.4 -1.4l1.7 -1.7z",
    "p": "M16 1.3l3.6 2.6l-1.4 4.2h-4.4l-1.4 -4.2z",
}
"""Markers of matplotlib as SVG paths in a 32 x 10 box."""


@dataclass(frozen=True)
class Look:
    """How one engine or reference is drawn; ``phase`` staggers the markers of coinciding curves."""

    label: str
    colour: str
    dash: tuple[float, ...]
    width: float
    marker: str = ""
    phase: float = 0.0

    @property
    def shape(self) -> str:
        """SVG path of the marker in a 32 x 10 box; empty for references."""
        return SHAPES.get(self.marker, "")


def engine_looks(names: dict[str, str]) -> dict[str, Look]:
    """Looks by engine id, given the engines' display names by id."""
    many = len(PALETTE)
    return {
        engine: Look(
            name,
            PALETTE[k % many],
            DASHES[(k + k // 8) % 8],
            1.3,
            MARKERS[(k + k // many) % 8],
            (k % many + 0.5) / many,
        )
        for k, (engine, name) in enumerate(names.items())
    }


def reference_looks(labels: dict[str, str]) -> dict[str, Look]:
    """Looks of reference curves by label, given their truth kinds: wide and grey, drawn beneath the engines.

    Several of one kind differ in the length of their dashes.
    """
    looks: dict[str, Look] = {}
    for label, truth in labels.items():
        dash, width = REFERENCE_DASHES.get(truth, REFERENCE_DASHES["consensus"])
        alike = sum(labels[other] == truth for other in looks)
        looks[label] = Look(label, SOFT, tuple(length * (1.0 + 0.8 * alike) for length in dash), width)
    return looks


def rc_params() -> Any:
    """Settings of matplotlib: transparent, text as text, no mathematics in labels, and the same bytes every time."""
    return {
        "font.family": "DejaVu Sans",
        "font.size": 8.5,
        "axes.titlesize": 9.0,
        "axes.titley": 1.0,
        "axes.titlelocation": "left",
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.titlecolor": INK,
        "axes.facecolor": "none",
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.formatter.use_mathtext": False,
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-3, 4),
        "axes.unicode_minus": True,
        "grid.color": SOFT,
        "grid.alpha": 0.25,
        "grid.linewidth": 0.6,
        "xtick.color": INK,
        "ytick.color": INK,
        "text.color": INK,
        "text.parse_math": False,
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "svg.fonttype": "none",
        "svg.hashsalt": "ninedisk",
        "path.simplify": True,
        "path.simplify_threshold": 0.15,
    }
