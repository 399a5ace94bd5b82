"""The public site: a score is what its page and the store say, addresses stay, and one changed digit is found."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ninedisk.harness.results.schema import RunFacts
from ninedisk.reports.site import BADGE_COLOURS, Outcome, address, badge_svg, build_site, check_site, read_site

ERRORS = (1e-3, 3.25e-2, 7e-4)


def silent(*_: object) -> None:
    pass


@pytest.fixture(scope="module")
def site(synthetic, tmp_path_factory):
    """Three runs in two stores, the last of another version; headlines of one case."""
    folder = tmp_path_factory.mktemp("site")
    plan = synthetic.Plan(runs=3, variants=2, machines=("AMD EPYC",), engines={"dem": "DEM", "a/b": "<i>A</i>"})
    for number, store in enumerate(("old", "old", "new")):
        tables = synthetic.tables(plan, number)
        version = "2.0" if number == 2 else "1.0"
        for rows in tables.values():
            for row in rows:
                row["engine_version"] = version
        tables["headlines"] = [
            {**{k: row[k] for k in ("case", "variant", "engine", "engine_version")}, "headline": "distance after 1 s", "quantity": "x",
             "use": "sliding", "scale": 1.0, "value": 1.0, "expected": 1.0, "rel_error": ERRORS[number] * (1 + (row["variant"] == "k=1"))}
            for row in tables["cells"] if row["case"] == "incline-block"
        ]  # fmt: skip
        synthetic.write_run(folder / store, synthetic.about(plan, number), tables)
    stores = [folder / "old", folder / "new"]
    build_site(stores, folder / "site", silent)
    return stores, folder / "site"


def scores(page: Path) -> list[str]:
    return re.findall(r'<data value="([^"]*)">', page.read_text(encoding="utf-8"))


def test_a_score_is_what_its_page_its_data_and_the_store_say(site):
    _, out = site
    index = (out / "index.html").read_text(encoding="utf-8")
    links = re.findall(r'<a href="(engine/[^"]*\.html)#headlines"><span class="size"><data value="([^"]*)">', index)
    assert {value for _, value in links} == {repr(2.0 * ERRORS[2])}
    assert [link for link, _ in links] == ["engine/a~b/2.0/incline-block.html", "engine/dem/2.0/incline-block.html"]
    for link, value in links:
        assert scores(out / link)[0] == value
        assert value in scores(out / "case" / "incline-block.html")
        data = json.loads((out / link).with_suffix(".json").read_text(encoding="utf-8"))
        assert max(data["headlines"]["rel_error"]) == float(value)
        table = pq.read_table((out / link).with_suffix(".parquet")).to_pylist()
        assert max(row["rel_error"] for row in table if row["table"] == "headlines") == float(value)
        cite = (out / link.replace(".html", ".cite.html")).read_text(encoding="utf-8")
        assert value in cite
        assert "ninedisk run incline-block --engine" in cite
        assert "<i>A</i>" not in cite
    older = scores(out / "engine" / "dem" / "1.0" / "incline-block.html")
    assert older[0] == repr(2.0 * ERRORS[1])
    assert repr(2.0 * ERRORS[0]) in older, "the history has the run before"


def test_check_is_green_and_red_on_one_digit_anywhere(site, tmp_path):
    stores, out = site
    assert check_site(stores, out, silent) == ""
    place = "engine/dem/2.0/incline-block"
    for name in ("index.html", f"{place}.html", f"{place}.json", f"{place}.cite.html", "badge/dem.svg"):
        copy = tmp_path / name.replace("/", "-")
        shutil.copytree(out, copy)
        text = (copy / name).read_text(encoding="utf-8")
        digit = list(re.finditer(r"\d", text))[-1]
        (copy / name).write_text(
            text[: digit.start()] + str((int(digit[0]) + 1) % 10) + text[digit.end() :], encoding="utf-8"
        )
        assert check_site(stores, copy, silent).startswith(f"{name}: line ")
    copy = tmp_path / "parquet"
    shutil.copytree(out, copy)
    table = pq.read_table(copy / f"{place}.parquet")
    errors = [None if e is None else e * (1 + 1e-15) for e in table["rel_error"].to_pylist()]
    pq.write_table(
        table.set_column(table.schema.get_field_index("rel_error"), "rel_error", [errors]), copy / f"{place}.parquet"
    )
    assert check_site(stores, copy, silent).startswith(f"{place}.parquet: the stores give ")
    (copy / f"{place}.parquet").unlink()
    assert "lacks it" in check_site(stores, copy, silent)


def test_no_two_ids_share_an_address():
    names = ["a/b", "a~b", "a-b", "A-b", "a b", "..", ".", "", "x" * 200, "x" * 201, "é", "a_7e_b"]
    held = [address(name) for name in names]
    assert len(set(held)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9~_+-][A-Za-z0-9.~_+-]*", each) for each in held)


def test_a_badge_says_passes_and_error(site):
    stores, _ = site
    found = read_site(stores)
    held = [
        outcomes[-1] for (engine, version, _), outcomes in found.outcomes.items() if (engine, version) == ("dem", "2.0")
    ]
    passed = sum(each.passes[0] for each in held)
    assert f"{passed} of {passed} checks pass, median error 1.4e-3" in badge_svg(held)


def outcome(passed: int, judged: int, *, failed: int = 0, broken: tuple[str, ...] = (), cells: int = 10) -> Outcome:
    """A case with so many checks; what neither passes nor fails is a known gap."""
    statuses = ["pass"] * passed + ["fail"] * failed + ["known-gap"] * (judged - passed - failed)
    checks = [{"status": status} for status in statuses]
    return Outcome(
        RunFacts(run_id="r", started="", commit="", machine="", versions={}, command=""),
        [{"status": status} for status in [*["pass"] * (cells - len(broken)), *broken]],
        checks,
        [],
    )


@pytest.mark.parametrize(
    ("held", "left", "colour", "words"),
    [
        (outcome(2609, 2750, broken=("timeout",), cells=88), 0, "green", "87 of 88 cells run, 1 timeout"),
        (outcome(410, 585), 0, "amber", "410 of 585 checks pass"),
        (outcome(100, 100), 11, "amber", "10 of 21 cells run"),
        (outcome(999, 1000, failed=1), 0, "amber", "999 of 1000 checks pass, 1 fail"),
        (outcome(98, 100, failed=2), 0, "red", "98 of 100 checks pass"),
        (outcome(50, 100), 0, "red", "50 of 100 checks pass"),
        (outcome(100, 100, broken=("error",)), 0, "red", "1 error"),
        (outcome(0, 0, broken=("timeout", "timeout")), 0, "red", "2 timeouts"),
    ],
)
def test_a_badge_colour_is_that_of_passes_failures_and_coverage(held, left, colour, words):
    svg = badge_svg([held], left)
    assert words in svg
    assert BADGE_COLOURS[colour] in svg
    assert sum(each in svg for each in BADGE_COLOURS.values()) == 1
