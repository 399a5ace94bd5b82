"""The tests that outsiders see: ids, outcomes and what a failure says."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ninedisk.harness.dry_run import check_ids

MODULE = """
def test_check(ninedisk_check):
    ninedisk_check.verify()
"""
PLUGIN = ("-p", "ninedisk.harness.pytest_plugin")
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


def test_a_failure_tells_everything(suite: pytest.Pytester) -> None:
    done = run(suite, *FALL, "--engine", "fake-wrong", "-k", "x-analytic")
    done.assert_outcomes(failed=2, deselected=4)
    done.stdout.fnmatch_lines(
        [
            "fake/fall?a=1? on fake-wrong: x against analytic: error 0.001 m exceeds the tolerance 5e-10*",
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
    assert done.ret == pytest.ExitCode.USAGE_ERROR or done.ret == pytest.ExitCode.INTERRUPTED
    assert any("Did you mean" in line for line in [*done.outlines, *done.errlines])


def test_workers_share_the_cells_of_a_group(
    suite: pytest.Pytester, fake_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("xdist")
    monkeypatch.setenv("PYTHONPATH", str(fake_folder))
    flags = ("--engine", "fake-good", "--engine", "fake-wrong", "-n", "2", "--dist", "loadgroup")
    done = suite.runpytest_subprocess(*PLUGIN, *FALL, *flags, timeout=60)
    done.assert_outcomes(passed=8, failed=4)


def test_ids_of_equal_checks_are_numbered() -> None:
    pairs = [("x", "analytic"), ("x", "published"), ("x", "published"), ("x", "analytic")]
    assert check_ids(pairs) == ["x-analytic", "x-published", "x-published-2", "x-analytic-2"]
