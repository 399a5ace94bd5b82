"""Pages in a browser: no page scrolls sideways at any width, and every image is drawn."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess

import pytest

CHROMIUM = shutil.which("chromium")
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
    "--window-size=1600,1200",
    "--virtual-time-budget=20000",
)


# The page under test tells its widths to the frame around it: pages from disk may not look into each other.
PROBE = """<script>addEventListener("load", () => {
  for (const image of document.images) image.loading = "eager";
  const root = document.documentElement, images = [...document.images];
  const broken = () => images.filter(image => !image.complete || !image.naturalWidth).length;
  setTimeout(() => parent.postMessage([name, root.scrollWidth, root.clientWidth, broken(), images.length], "*"), 1500);
});</script>"""
FRAME = """<!doctype html><meta charset="utf-8"><title>waiting</title><body><script>
const told = [];
addEventListener("message", event => { told.push(event.data); document.title = JSON.stringify(told); });
</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
def test_no_page_scrolls_sideways(panel_report, tmp_path):
    copy = tmp_path / "report"
    shutil.copytree(panel_report, copy)
    names = ["index.html", "case/nine-disk-compression.html", "case/incline-block.html", "engine/box2d.html"]
    frame = FRAME
    for name in names:
        page = copy / name
        page.write_text(page.read_text(encoding="utf-8").replace("</head>", PROBE + "</head>"), encoding="utf-8")
        frame += "".join(
            f'<iframe name="{name} {w}" src="{name}" style="width:{w}px;height:900px;border:0"></iframe>'
            for w in WIDTHS
        )
    (copy / "frame.html").write_text(frame, encoding="utf-8")
    command = [
        CHROMIUM,
        *FLAGS,
        f"--user-data-dir={tmp_path / 'profile'}",
        "--dump-dom",
        (copy / "frame.html").as_uri(),
    ]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    title = re.search(r"<title>(.*?)</title>", dom, re.DOTALL)
    assert title, dom[:500]
    told = {entry[0]: entry[1:] for entry in json.loads(html.unescape(title[1]))}
    assert set(told) == {f"{name} {width}" for name in names for width in WIDTHS}
    for name, (scroll, client, broken, images) in told.items():
        assert client == int(name.rsplit(" ", 1)[1]), name
        assert scroll <= client, name
        assert broken == 0, name
        assert images > 0 or not name.startswith("case"), name
