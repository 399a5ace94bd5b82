"""The report in a browser with the network off: drawn at every width, silent, operable by mouse and by keyboard."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pyarrow.parquet as pq
import pytest

from ninedisk.reports.build import build_report

WIDTHS = (390, 1024, 1440)
SIZES = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
CHART = "figure.chart[data-chart]"
DRAWN = f"document.querySelector('{CHART}').classList.contains('drawn')"


@pytest.fixture
def quiet(tab):
    """The tab; afterwards it must have asked for files only, and must not have complained."""
    yield tab
    assert tab.complaints == []
    assert outside(tab.requests, Path("/")) == []


def outside(requests, folder):
    """Requests that leave a folder; a chart's pictures of itself (data and blob addresses) never leave the page."""
    return [
        url
        for url in requests
        if not url.startswith(("data:", "blob:"))
        and not (url.startswith("file:") and Path(unquote(urlsplit(url).path)).is_relative_to(folder))
    ]


def open_case(tab, report, name="incline-block", **options):
    tab.open(report / "case" / f"{name}.html", **options)
    tab.wait("document.documentElement.dataset.data === 'ready'")
    tab.run(f"document.querySelector('{CHART}').scrollIntoView({{block: 'center'}})")
    tab.wait(DRAWN)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("width", WIDTHS)
def test_every_page_is_drawn_without_horizontal_scroll(quiet, panel_report, width):
    pages = sorted(panel_report.rglob("*.html"))
    assert len(pages) == 15
    for page in pages:
        quiet.open(page, width)
        if page.parent.name == "case":
            quiet.wait("document.documentElement.dataset.data === 'ready'")
        for place in quiet.run(
            f"[...document.querySelectorAll('{CHART}')].filter(c => c.offsetParent).map((c, k) => k)"
        ):
            if place < 4:
                quiet.run(f"document.querySelectorAll('{CHART}')[{place}].scrollIntoView()")
                quiet.wait(f"document.querySelectorAll('{CHART}')[{place}].querySelector('canvas')")
        scroll, client = quiet.run(SIZES)
        assert client == width
        assert scroll <= client, page
        broken = "[...document.images].filter(i => i.offsetParent && i.complete && !i.naturalWidth).map(i => i.src)"
        assert quiet.run(broken) == []
    assert outside(quiet.requests, panel_report.resolve()) == []


def test_charts_hold_ink(quiet, panel_report):
    open_case(quiet, panel_report)
    colours = quiet.run(
        "(c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = new Set();"
        " for (let k = 0; k < d.length; k += 4) if (d[k + 3] > 200) seen.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]);"
        f" return seen.size; }})(document.querySelector('{CHART} canvas'))"
    )
    assert colours > 5


def test_from_the_matrix_to_a_value_of_the_store(quiet, panel_report, panel_store):
    quiet.open(panel_report / "index.html")
    quiet.click('.matrix td a[href="case/incline-block.html"]')
    quiet.wait("location.pathname.endsWith('case/incline-block.html')")
    open_case(quiet, panel_report)
    spec = json.loads(quiet.run(f"document.querySelector('{CHART}').dataset.chart"))

    quiet.click('.legend button[data-key="yade"]')
    assert quiet.run("document.querySelector('.legend button[data-key=\"yade\"]').ariaPressed") == "false"
    quiet.run(f"document.querySelector('{CHART}').scrollIntoView({{block: 'center'}})")
    x, y, width, height = quiet.run(
        f"(r => [r.x, r.y, r.width, r.height])(document.querySelector('{CHART} .u-over').getBoundingClientRect())"
    )
    quiet.mouse(x + 0.3 * width, y + 0.5 * height)
    quiet.mouse(x + 0.37 * width, y + 0.5 * height)
    quiet.wait(f"!document.querySelector('{CHART} .readout').hidden")
    shown = quiet.run(
        f"[...document.querySelectorAll('{CHART} .readout tr')]"
        ".map(r => [r.dataset.key || '', ...[...r.cells].map(c => c.textContent)])"
    )
    time = float(shown[0][1].removeprefix("time [s] "))
    values = {line[0]: (line[2], line[3]) for line in shown[1:]}
    assert "dem" in values
    assert "yade" not in values

    (run,) = (panel_store / "runs").iterdir()
    rows = pq.read_table(run / "series.parquet").to_pylist()
    (row,) = (
        r
        for r in rows
        if (r["case"], r["variant"], r["engine"], r["quantity"], r["t"])
        == ("incline-block", spec["variant"], "box2d", spec["quantity"], time)
    )
    assert 0.3 < time < 0.45
    assert float(values["box2d"][0]) == row["value"]
    assert float(values["box2d"][1]) == pytest.approx(abs(row["value"] - row["expected"]), rel=5e-3)

    quiet.click('.legend button[data-key="yade"]')
    quiet.run(f"document.querySelector('{CHART}').scrollIntoView({{block: 'center'}})")
    quiet.mouse(x + 0.4 * width, y + 0.5 * height)
    quiet.wait(f"document.querySelector('{CHART} .readout tr[data-key=yade]')")


def test_the_matrix_switches_by_keyboard_and_remembers_it(quiet, panel_report):
    shown = "[...new Set([...document.querySelectorAll('.matrix .v')].filter(v => v.checkVisibility()).map(v => v.classList[1]))]"
    seen = "[...document.querySelectorAll('.matrix td')].filter(c => c.checkVisibility()).length"
    cells = "document.querySelectorAll('.matrix td').length"
    page = panel_report / "index.html"
    quiet.open(page)
    assert quiet.run(shown) == ["v-error"]
    quiet.run("document.getElementById('show-error').focus()")
    for mode in ("ratio", "time", "support", "penetration"):
        quiet.key("ArrowRight")
        quiet.wait(f"location.hash === '#show={mode}'")
        assert quiet.run(shown) == [f"v-{mode}"]
    quiet.run(
        "(s => { s.value = [...s.options].find(o => o.text === 'YADE').value; s.dispatchEvent(new Event('change', {bubbles: true})); })"
        "(document.getElementById('only'))"
    )
    assert quiet.run("location.hash") == "#show=penetration&engine=yade"
    assert quiet.run(seen) == 6
    quiet.open(panel_report / "errata.html")
    quiet.open(page, 390, fragment="#show=time&engine=yade")
    assert quiet.run(shown) == ["v-time"]
    assert 0 < quiet.run(seen) == 6 < quiet.run(cells)
    quiet.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        quiet.open(panel_report / "errata.html")
        quiet.open(page, fragment="#show=time")
        assert quiet.run(shown) == ["v-error"]
        quiet.click("label:has(#show-ratio)")
        assert quiet.run(shown) == ["v-ratio"]
    finally:
        quiet.call("Emulation.setScriptExecutionDisabled", value=False)


def test_zoom_by_dragging_and_by_keyboard(quiet, panel_report):
    open_case(quiet, panel_report)
    ticks = f"document.querySelector('{CHART} canvas').toDataURL().length + document.querySelector('{CHART} canvas').toDataURL()"
    whole = quiet.run(ticks)
    x, y, width, height = quiet.run(
        f"(r => [r.x, r.y, r.width, r.height])(document.querySelector('{CHART} .u-over').getBoundingClientRect())"
    )
    quiet.mouse(x + 0.2 * width, y + 0.5 * height)
    quiet.mouse(x + 0.2 * width, y + 0.5 * height, "mousePressed")
    for part in (0.3, 0.4, 0.5):
        quiet.call(
            "Input.dispatchMouseEvent", type="mouseMoved", x=x + part * width, y=y + 0.5 * height, button="left", buttons=1
        )  # fmt: skip
    quiet.mouse(x + 0.5 * width, y + 0.5 * height, "mouseReleased")
    quiet.wait(f"({ticks}) !== {json.dumps(whole)}")
    quiet.run(f"document.querySelector('{CHART}').focus()")
    quiet.key("0")
    quiet.wait(f"({ticks}) === {json.dumps(whole)}")
    quiet.key("ArrowRight")
    quiet.wait(f"!document.querySelector('{CHART} .readout').hidden")
    first = quiet.run(f"document.querySelector('{CHART} .readout').textContent")
    quiet.key("ArrowRight")
    quiet.wait(f"document.querySelector('{CHART} .readout').textContent !== {json.dumps(first)}")
    quiet.key("+")
    quiet.wait(f"({ticks}) !== {json.dumps(whole)}")


def test_the_distortion_plays(quiet, panel_report):
    open_case(quiet, panel_report, "nine-disk-distortion")
    reported = "document.querySelector('figure.player .told').textContent"
    quiet.wait("document.querySelector('figure.player canvas')")
    assert quiet.run(reported).startswith("step 5500")
    quiet.click("figure.player button")
    quiet.wait(f"({reported}).startsWith('between steps')")
    quiet.wait(f"({reported}).startsWith('step 5500')")
    assert "Play" in quiet.run("document.querySelector('figure.player button').textContent")


def test_folded_tables_are_filled_and_filtered(quiet, panel_report):
    open_case(quiet, panel_report, "nine-disk-compression")
    count = "document.querySelectorAll('[data-rows=rows] tbody tr').length"
    quiet.click("details:has([data-rows=rows]) > summary")
    quiet.wait(f"{count} > 100")
    quiet.run(
        "(i => { i.value = 'lammps a1'; i.dispatchEvent(new Event('input')); })"
        "(document.querySelector('[data-rows=rows] input'))"
    )
    texts = quiet.run("[...document.querySelectorAll('[data-rows=rows] tbody tr')].map(r => r.textContent)")
    assert texts
    assert all("LAMMPS" in text and "load_case=a1" in text for text in texts)


def test_print_and_pages_without_script_show_the_pictures(tab, panel_report):
    open_case(tab, panel_report)
    visible = (
        "(c => ['img', '.plot'].map(part => getComputedStyle(c.querySelector(part)).display))"
        f"(document.querySelector('{CHART}.drawn'))"
    )
    assert tab.run(visible) == ["none", "block"]
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.run(visible) == ["block", "none"]
    tab.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        tab.open(panel_report / "case" / "incline-block.html")
        assert tab.run(f"getComputedStyle(document.querySelector('{CHART} img')).display") == "block"
        assert tab.run("document.querySelectorAll('canvas, .legend button').length") == 0
    finally:
        tab.call("Emulation.setScriptExecutionDisabled", value=False)


def test_charts_without_a_picture_are_printed_in_dark_ink(tab, panel_report):
    """Also those that the reader has never scrolled to, from a dark screen."""
    tab.open(panel_report / "case" / "incline-block.html", dark=True)
    tab.wait("document.documentElement.dataset.data === 'ready'")
    alone = "[...document.querySelectorAll('figure[data-chart]:not(:has(img))')]"
    light = (
        "c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;"
        " for (let k = 0; k < d.length; k += 4) n += d[k + 3] > 200 && Math.min(d[k], d[k + 1], d[k + 2]) > 215; return n; }"
    )
    tab.run(
        f"addEventListener('beforeprint', () => {{ window.printed = {alone}.map(f => f.querySelector('canvas'))"
        f".map(c => c && ({light})(c)); }})"
    )
    tab.call("Page.printToPDF")
    printed = tab.run("window.printed")
    assert len(printed) == 8
    assert set(printed) == {0}
    tab.wait(f"{alone}.some(f => ({light})(f.querySelector('canvas')) > 0)")
    tab.call("Emulation.setEmulatedMedia", media="print")
    heights = tab.run(f"{alone}.map(f => f.querySelector('canvas').getBoundingClientRect().height)")
    assert min(heights) > 100


def test_a_figure_for_a_paper(quiet, panel_report, panel_store):
    """SVG of what is shown, CSV of its very numbers, caption with versions; what is switched off is in none of them."""
    open_case(quiet, panel_report)
    spec = json.loads(quiet.run(f"document.querySelector('{CHART}').dataset.chart"))
    quiet.click('.legend button[data-key="yade"]')
    quiet.run(
        "window.saved = []; URL.createObjectURL = blob => { saved.push(blob.text()); return '#'; };"
        " HTMLAnchorElement.prototype.click = function () { this.remove(); }"
    )
    quiet.run(f"[...document.querySelectorAll('{CHART}')][0].querySelectorAll('.paper button').forEach(b => b.click())")
    svg, numbers = quiet.run("Promise.all(saved)")
    caption = quiet.run(f"document.querySelector('{CHART} .paper p').textContent")
    for text in (svg, numbers, caption):
        assert "Box2D 3.1" in text
        assert "commit 0123456789ab" in text
        assert "YADE" not in text
    drawn = quiet.run(
        "(d => [d.documentElement.nodeName, d.querySelectorAll('parsererror').length,"
        " [...d.querySelectorAll('path')].filter(p => p.getAttribute('d').length > 100).length])"
        f"(new DOMParser().parseFromString({json.dumps(svg)}, 'image/svg+xml'))"
    )
    assert drawn[:2] == ["svg", 0]
    assert drawn[2] >= 8  # four engines with numbers and the truth, and their errors
    legend = svg[svg.index(f">{spec['x_label']}</text>") :]
    assert legend.count("Box2D</text>") == 1
    assert "tolerances</text>" in legend
    head, *lines = numbers.splitlines()[1:]
    assert len(set(csv_cells(head))) == len(csv_cells(head))
    column = next(k for k, name in enumerate(csv_cells(head)) if name.startswith("Box2D: "))
    (run,) = (panel_store / "runs").iterdir()
    rows = [
        r
        for r in pq.read_table(run / "series.parquet").to_pylist()
        if (r["case"], r["variant"], r["engine"], r["quantity"])
        == ("incline-block", spec["variant"], "box2d", spec["quantity"])
    ]
    assert [float(line.split(",")[column]) for line in lines] == [row["value"] for row in rows]
    quiet.click('.legend button[data-key="yade"]')


def csv_cells(line):
    return next(csv.reader([line]))


def test_a_hostile_name_runs_no_script(quiet, tmp_path, write, small):
    hostile = '<img src=x onerror="window.hacked=1">\'"</script><script>window.hacked=1</script>'
    tables = small(engine=hostile, engine_name=hostile, reason=hostile, why=hostile, quantity=hostile, status="fail")
    for row in tables["series"] + tables["references"]:
        row |= {"quantity": hostile}
    write(tmp_path / "store", "a", tables)
    report = build_report(tmp_path / "store", tmp_path / "out").parent
    for page in sorted(report.rglob("*.html")):
        quiet.open(page)
        assert quiet.run("window.hacked === undefined")
    open_case(quiet, report, "demo-one")
    quiet.run(f"document.querySelector('{CHART}').focus()")
    quiet.key("End")
    quiet.wait(f"!document.querySelector('{CHART} .readout').hidden")
    assert hostile in quiet.run(f"document.querySelector('{CHART} .readout').textContent")
    assert quiet.run("window.hacked === undefined && !document.querySelector('img[src=x]')")


def test_these_checks_see_what_they_look_for(tab, panel_report, tmp_path):
    copy = tmp_path / "report"
    shutil.copytree(panel_report, copy)
    page = copy / "index.html"
    planted = (
        '<div style="width:3000px">wide</div><img src="http://example.org/a.png" alt="far">'
        '<script src="../outside.js"></script><script>console.error("planted")</script></main>'
    )
    page.write_text(page.read_text(encoding="utf-8").replace("</main>", planted), encoding="utf-8")
    tab.open(page, 1024)
    scroll, client = tab.run(SIZES)
    assert scroll > client
    # The page before may still ask for its own pictures.
    late = panel_report.resolve().as_uri()
    assert sorted(url for url in outside(tab.requests, copy.resolve()) if not url.startswith(late)) == [
        (tmp_path.resolve() / "outside.js").as_uri(),
        "http://example.org/a.png",
    ]
    assert any("planted" in complaint for complaint in tab.complaints)
