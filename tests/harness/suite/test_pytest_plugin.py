"""The tests that outsiders see: ids, outcomes and what a failure says."""

from __future__ import annotations

import os
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ninedisk.harness.api.registry import BUILTIN_CASES
from ninedisk.harness.run.gaps import KnownGap, matches
from ninedisk.harness.run.runner import check_ids
from ninedisk.harness.suite import plugin as pytest_plugin
from ninedisk.harness.suite.items import TIERS, page
from ninedisk.reports.panel.text import Slugs

MODULE = """
def test_check(ninedisk_check):
    ninedisk_check.verify()
"""
PLUGIN = ("-p", "ninedisk.harness.suite.plugin")
FALL = ("--case", "fake/fall")


pytestmark = pytest.mark.usefixtures("fakes")


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    pytester.makepyfile(MODULE)
    return pytester


def run(suite: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return suite.runpytest_inprocess(*PLUGIN, "-p", "no:cacheprovider", "-p", "no:hypothesispytest", *arguments)


def test_ids(suite: pytest.Pytester) -> None:
    lines = run(suite, *FALL, "--engine", "fake-good", "--collect-only", "-q").outlines
    names = [line.partition("::")[2] for line in lines if "::" in line]
    assert names == [
        f"test_check[fake/fall[a={a}]-fake-good-{check}]"
        for a in (1, 2)
        for check in ("x-analytic", "x_final-analytic", "cell")
    ]


def test_collecting_runs_no_engine(suite: pytest.Pytester) -> None:
    done = run(suite, *FALL, "--engine", "fake-slow", "--collect-only", "-q")
    assert any("6 tests collected" in line for line in done.outlines)


def test_outcomes(suite: pytest.Pytester) -> None:
    engines = ("good", "wrong", "crash", "timeout", "absent", "incapable", "uninstalled", "broken")
    done = run(suite, *FALL, *(part for name in engines for part in ("--engine", f"fake-{name}")))
    # good 3; wrong: cell passes, two checks fail; crash and timeout fail in all three; uninstalled skips in all three
    done.assert_outcomes(passed=2 * 4, failed=2 * (2 + 3 + 3 + 1), skipped=2 * (1 + 1 + 3))


def test_selection_by_name(suite: pytest.Pytester) -> None:
    done = run(suite, *FALL, "--engine", "fake-good", "--engine", "fake-wrong", "-k", "good and x_final")
    done.assert_outcomes(passed=2, deselected=10)


def test_a_failure_reports_everything(suite: pytest.Pytester) -> None:
    done = run(suite, *FALL, "--engine", "fake-wrong", "-k", "x-analytic")
    done.assert_outcomes(failed=2, deselected=4)
    done.stdout.fnmatch_lines(
        [
            "fake/fall?a=1? on fake-wrong: x against analytic: found *, expected *: error 0.001 m exceeds the tolerance 5e-10*",
            "  value      0.0810* m at step 4",
            "  reference  0.080* m (+- 0; mechanics)",
            "  error      0.001 m (relative 0.002)",
            "  tolerance  5e-10 m = 0 + 1e-09 x 0.5",
            "  because    round-off",
            "  diverges   first at step 4",
        ]
    )
    assert not any("Traceback" in line for line in done.outlines)


def test_known_gaps_are_expected_failures(
    suite: pytest.Pytester, fakes: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [{"truth": truth} for truth in ("gap", "nan", "none", "broken")]
    monkeypatch.setattr(fakes.FallingDisk, "matrix", lambda _: rows)
    done = run(suite, *FALL, "--engine", "fake-wrong", "-rs")
    # gap: two xfail and the cell; nan: x skipped, x_final fails, the cell; none: the cell is skipped; broken: it fails
    done.assert_outcomes(xfailed=2, passed=2, skipped=2, failed=2)
    done.stdout.fnmatch_lines(["*no-truth: no truth binds this engine on this variant*"])


def test_checks_that_depend_on_the_numbers_are_found(
    suite: pytest.Pytester, fakes: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = fakes.FallingDisk.checks

    def some(self: Any, params: Any, setup: Any, observed: Any, engine: Any) -> Any:
        found = checks(self, params, setup, observed, engine)
        return found[:1] if observed.scalars["x_final"][1] > 0.6 else found

    monkeypatch.setattr(fakes.FallingDisk, "checks", some)
    done = run(suite, *FALL, "--engine", "fake-good")
    done.assert_outcomes(passed=4, failed=2)
    done.stdout.fnmatch_lines(
        ["*x_final-analytic was collected but not measured", "*depend on what the engine computed*"]
    )


@pytest.mark.parametrize("arguments", [("--engine", "fake-god"), ("--case", "fake/fal")])
def test_unknown_ids_are_usage_errors(suite: pytest.Pytester, arguments: tuple[str, str]) -> None:
    done = run(suite, *arguments)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    assert not any("Traceback" in line or "collection" in line for line in [*done.outlines, *done.errlines])
    assert any("Did you mean" in line for line in [*done.outlines, *done.errlines])


def test_workers_share_the_cells_of_a_group(
    suite: pytest.Pytester, fake_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("xdist")
    monkeypatch.setenv("PYTHONPATH", str(fake_folder))
    flags = ("--engine", "fake-good", "--engine", "fake-wrong", "-v", "-n", "2", "--dist", "loadgroup")
    done = suite.runpytest_subprocess(*PLUGIN, *FALL, *flags, timeout=120)
    done.assert_outcomes(passed=8, failed=4)
    ran = re.findall(r"^\[(gw\d)\] .*test_check\[(fake/fall\[a=\d\]-fake-\w+)-", "\n".join(done.outlines), re.MULTILINE)
    assert len(ran) == 12
    assert len(set(ran)) == 4, "a cell's tests ran in two processes"


GAP = """
[[gap]]
id = "{id}"
quantity = "x"
engine = "fake-wrong"
reason = "it is planted"
"""


def test_known_gaps_are_strict(suite: pytest.Pytester) -> None:
    (suite.path / "gaps.toml").write_text(GAP.format(id="fake/fall[a=1]") + GAP.format(id="fake/spin"))
    arguments = (*FALL, "--engine", "fake-wrong", "--known-gaps", "gaps.toml")
    done = run(suite, *arguments)
    done.assert_outcomes(xfailed=1, failed=3, passed=2)
    done.stdout.fnmatch_lines(["known gap without a check here: fake/spin x on fake-wrong"])


def test_a_closed_gap_is_reported(suite: pytest.Pytester) -> None:
    (suite.path / "gaps.toml").write_text(GAP.format(id="fake/*").replace("fake-wrong", "fake-good"))
    done = run(suite, *FALL, "--engine", "fake-good", "--known-gaps", "gaps.toml")
    done.assert_outcomes(failed=2, passed=4)
    done.stdout.fnmatch_lines(["*x against analytic: it passes: remove this entry*gaps.toml, gap 1, *(it is planted)"])


@pytest.mark.parametrize("engine", ["fake-crash", "fake-nan"])
def test_a_gap_excuses_neither_a_crash_nor_a_missing_number(suite: pytest.Pytester, engine: str) -> None:
    (suite.path / "gaps.toml").write_text(GAP.format(id="fake/fall").replace("fake-wrong", engine))
    done = run(suite, *FALL, "--engine", engine, "--known-gaps", "gaps.toml", "-k", "x-analytic")
    done.assert_outcomes(failed=2, deselected=4)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[gap]]\nid = 'a'\nquantity = 'x'\n", "gap 1 lacks 'reason'"),
        ("[[gap]]\nid = 'a'\nquantity = 'x'\nreason = 'r'\nwhen = 'now'\n", "unknown key(s) when"),
        ("[[gap]]\nid = 'a'\nquantity = 'x'\nreason = 3\n", "reason = 3 is not allowed"),
        ("[[gap\n", "is no TOML"),
        ("[gaps]\n", "and nothing else"),
        ("[[gap]]\nid = 'fake/fal'\nquantity = 'x'\nreason = 'r'\n", "no case 'fake/fal'. Did you mean 'fake/fall'"),
    ],
)
def test_a_file_of_gaps_that_is_wrong(suite: pytest.Pytester, text: str, said: str) -> None:
    (suite.path / "gaps.toml").write_text(text)
    done = run(suite, *FALL, "--engine", "fake-good", "--known-gaps", "gaps.toml")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    assert any(said in line for line in [*done.outlines, *done.errlines])


def test_brackets_of_an_id_represent_themselves() -> None:
    assert matches("case[mu=0.3,*]", "case[mu=0.3,dt=0.1]")
    assert not matches("case[mu]", "casem")
    gap = KnownGap(id="case", quantity="f?", reason="r")
    assert gap.explains("case", "any", "engine", "fs", "analytic")
    assert not gap.explains("case", "any", "engine", "fss", "analytic")


def test_tiers(suite: pytest.Pytester, fakes: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [{"a": 1.0}, {"a": 2.0}, {"a": 2.0, "steps": 5}]
    monkeypatch.setattr(fakes.FallingDisk, "matrix", lambda _: rows)
    for tier, variants in (("smoke", 1), ("core", 2), ("full", 3)):
        done = run(suite, *FALL, "--engine", "fake-good", "-m", tier, "--strict-markers")
        done.assert_outcomes(passed=3 * variants, deselected=3 * (3 - variants))


def test_a_failure_says_where_to_look(suite: pytest.Pytester) -> None:
    done = run(suite, *FALL, "--engine", "fake-wrong", "-k", "x-analytic")
    done.stdout.fnmatch_lines(
        [
            "  case       ninedisk list cases fake/fall; case/fake-fall.html#errors of a report",
            "  again      ninedisk run fake/fall --engine fake-wrong --set a=2",
        ]
    )


@pytest.mark.parametrize("case_id", BUILTIN_CASES)
def test_the_page_is_that_of_the_report(case_id: str) -> None:
    assert page(case_id) == f"case/{Slugs()(case_id)}.html#errors"


def test_the_tiers_of_the_plugin_are_those_of_the_suite() -> None:
    assert tuple(TIERS) == pytest_plugin.TIERS


def test_a_name_that_another_plugin_has(
    suite: pytest.Pytester, fake_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "import pytest, other, ninedisk.harness.suite.plugin as own; pytest.main({}, plugins=[other, own])"
    (suite.path / "other.py").write_text("def pytest_addoption(parser):\n    parser.addoption('--engine')\n")
    arguments = ["-p", "no:cacheprovider", *FALL, "--ninedisk-engine", "fake-good", "--engine", "its own"]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(fake_folder), os.environ.get("PYTHONPATH", "")]))
    done = suite.runpython_c(code.format(arguments))
    done.assert_outcomes(passed=6)


@pytest.mark.parametrize("arguments", [(), ("-n", "2", "--dist", "loadgroup"), ("--co",), ("-k", "x_final")])
def test_the_suite_by_its_module_name(
    pytester: pytest.Pytester, fake_folder: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    if "-n" in arguments:
        pytest.importorskip("xdist")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(fake_folder), os.environ.get("PYTHONPATH", "")]))
    chosen = (*FALL, "--engine", "fake-good", *arguments)
    done = pytester.runpytest_subprocess(*PLUGIN, "--pyargs", "ninedisk.harness.suite", *chosen, timeout=120)
    if "--co" in arguments:
        assert any("6 tests collected" in line for line in done.outlines)
    elif "-k" in arguments:
        done.assert_outcomes(passed=2, deselected=4)
    else:
        done.assert_outcomes(passed=6)


def test_ids_of_equal_checks_are_numbered() -> None:
    pairs = [("x", "analytic"), ("x", "published"), ("x", "published"), ("x", "analytic")]
    assert check_ids(pairs) == ["x-analytic", "x-published", "x-published-2", "x-analytic-2"]
