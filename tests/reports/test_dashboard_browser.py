"""The dashboard in a browser, from disk: no sideways scrolling, no console message, exact values by keyboard."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ninedisk.harness.results.compare import compare, side
from ninedisk.harness.results.history import history
from ninedisk.reports.dashboard import build_dashboard
from ninedisk.reports.studies import write_comparison

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
WIDTHS = (390, 1024, 1440)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--enable-logging=stderr",
    "--window-size=1600,1200",
    "--virtual-time-budget=15000",
)

# The page under test tells its widths, and what its first chart says at its last point, to the frame around it.
PROBE = """<script>addEventListener("load", () => {
  const root = document.documentElement, chart = document.querySelector("svg[data-points]");
  let said = "";
  if (chart) {
    chart.focus();
    chart.dispatchEvent(new KeyboardEvent("keydown", { key: "End" }));
    said = document.getElementById("tip").textContent;
    chart.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
    if (!document.getElementById("tip").hidden) said = "it stays";
  }
  const drawn = [...document.querySelectorAll("svg.line")].filter(svg => svg.getBoundingClientRect().height > 10).length;
  setTimeout(() => parent.postMessage([name, root.scrollWidth, root.clientWidth, drawn, said], "*"), 800);
});</script>"""
FRAME = """<!doctype html><meta charset="utf-8"><title>waiting</title><body><script>
const told = [];
addEventListener("message", event => { told.push(event.data); document.title = JSON.stringify(told); });
</script>"""
LONG = "an-engine-with-a-name-that-goes-on-and-on-without-a-single-blank-or-anything-else-to-break-a-line-at"


def test_pages_in_a_browser(synthetic: ModuleType, tmp_path: Path) -> None:
    key = ("nine-disk/distortion", "k=1", "dem", "energy_final")
    plan = synthetic.Plan(
        runs=40,
        errors={key: (30, 10.0)},
        timings={("slip-to-roll", "k=0", "dem"): (20, 2.0)},
        cells={("incline-block", "k=1", LONG): (20, "error", LONG * 3)},
        engines={"dem": "ninedisk DEM", "yade": "YADE", LONG: LONG, **{f"e{k}": f"Engine {k}" for k in range(6)}},
    )
    runs = synthetic.snapshots(plan)
    found = history(runs)
    folder = build_dashboard(found, tmp_path / "out", lambda *_: None).parent
    write_comparison(compare(side(runs[:30]), side(runs[30:])), folder / "compare" / "alone.html")
    around = next(iter((folder / "compare").glob("2026*.html"))).name
    names = ["index.html", "lines/nine-disk-distortion-dem.html", f"compare/{around}", "compare/alone.html"]
    told, console = _visit(folder, names, tmp_path)
    assert set(told) == {f"{name} {width}" for name in names for width in WIDTHS}
    assert console == []
    for name, (scroll, client, drawn, said) in told.items():
        assert client == int(name.rsplit(" ", 1)[1]), name
        assert scroll <= client, name
        assert drawn > 0 or name.startswith("compare"), name
        if name.startswith("lines"):
            # The marked line of the first machine comes first; its last point, as the records have it.
            line = next(line for line in found.lines if line.shifts and line.case == key[0] and line.quantity == key[3])
            value, _, when, versions = said.splitlines()[:4]
            assert value.startswith(f"{line.points[-1].value:.6g} J = ")
            assert float(value.split()[0]) == pytest.approx(line.points[-1].value, rel=1e-5)
            assert found.runs[line.points[-1].run].commit[:12] in when
            assert versions == "ninedisk 0.1.0, engine 1.0"


def test_an_error_on_the_console_is_seen(tmp_path: Path) -> None:
    """The probe of the test above would notice."""
    page = "<!doctype html><html><head></head><body><script>undefinedFunction();</script></body></html>"
    (tmp_path / "bad.html").write_text(page, encoding="utf-8")
    _, console = _visit(tmp_path, ["bad.html"], tmp_path)
    assert console


def _visit(folder: Path, names: list[str], tmp_path: Path) -> tuple[dict[str, Any], list[str]]:
    """What each page told at each width, and what the browser's console said."""
    frame = FRAME
    for name in names:
        page = folder / name
        page.write_text(page.read_text(encoding="utf-8").replace("</head>", PROBE + "</head>"), encoding="utf-8")
        frame += "".join(
            f'<iframe name="{name} {w}" src="{name}" style="width:{w}px;height:900px;border:0"></iframe>'
            for w in WIDTHS
        )
    (folder / "frame.html").write_text(frame, encoding="utf-8")
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    command = [str(CHROMIUM), *FLAGS, profile, "--dump-dom", (folder / "frame.html").as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    title = re.search(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    assert title, done.stdout[:500]
    told = {entry[0]: entry[1:] for entry in json.loads(html.unescape(title[1]))}
    return told, [line for line in done.stderr.splitlines() if "CONSOLE" in line]
