"""The page of a test of a contact law: returned forces beside their closed forms, the worst motion first."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ninedisk.reports import pages
from ninedisk.reports.audit import SHADE, SYMBOL
from ninedisk.reports.drawing.charts import Dots, Look, PointChart, numbered_look, on_page
from ninedisk.reports.folder import fresh_folder

MARKER = ".ninedisk-law-test"
DASH = (3.0, 5.0)
"""Of a closed form, so that what lies below it is seen."""
SHOWN = 1e-6
"""Share of the largest force below which a component is not drawn."""


def write_law_page(record: Mapping[str, Any], out: Path) -> Path:
    """Write the page, one file that holds its style sheet and scripts, and the record beside it.

    Parameters
    ----------
    record : mapping
        What ``ninedisk law-test judge --json`` writes.
    out : Path
        Folder, replaced as a whole.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ReportError
        If the folder is a foreign one or cannot be written.
    """
    order = {"violated": 0, "holds": 1, "not decidable": 2}
    checks = sorted(record["checks"], key=lambda check: (order[check["verdict"]], -_ratio(check)))
    motions = [
        {
            **motion,
            "verdict": "violated"
            if any(check["verdict"] == "violated" for check in _of(record, motion["id"]))
            else "holds",
            "said": [check["said"] for check in _of(record, motion["id"]) if check["verdict"] == "violated"],
            "chart": on_page(_chart(motion)),
        }
        for motion in record["motions"]
    ]
    page = pages.environment().get_template("law_test.html").render(
        record=record,
        checks=[{**check, "ratio": _ratio(check)} for check in checks],
        counts={verdict: sum(check["verdict"] == verdict for check in checks) for verdict in SHADE},
        motions=motions,
        shades_of=SHADE,
        symbols=SYMBOL,
        **pages.single_file(),
    )  # fmt: skip
    with fresh_folder(out, MARKER, "page of a law test") as fresh:
        (fresh / "index.html").write_text(page, encoding="utf-8")
        (fresh / "law-test.json").write_text(json.dumps(record, allow_nan=False), encoding="utf-8")
    return out / "index.html"


def _of(record: Mapping[str, Any], motion: str) -> list[Mapping[str, Any]]:
    """Checks of a motion."""
    return [check for check in record["checks"] if check["id"].partition("/")[0] == motion]


def _ratio(check: Mapping[str, Any]) -> float:
    return float(check["value"] / check["allowance"]) if check["allowance"] > 0.0 else 0.0


def _chart(motion: Mapping[str, Any]) -> PointChart:
    """Components of the force on the first sphere, returned and by the closed form; those that are zero are left out."""
    curves = motion["curves"]
    t = tuple(curves["t"])
    largest = max(abs(each) for axis in "xyz" for curve in curves[f"f{axis}"] for each in curve) or 1.0
    dots = []
    for k, axis in enumerate("xyz"):
        returned, expected = curves[f"f{axis}"]
        if max(map(abs, [*returned, *expected])) < SHOWN * largest:
            continue
        colour, _, width, _ = numbered_look(k)
        for name, curve, dash in ((f"f{axis} returned", returned, ()), (f"f{axis} closed form", expected, DASH)):
            dots.append(Dots(name, Look(name, colour, dash, 2.0 * width if dash else width), t, tuple(curve)))
    return PointChart(
        motion["id"], "t [s]", "force on the first sphere [N]", tuple(dots), x_log=False, y_log=False, bare=True
    )
