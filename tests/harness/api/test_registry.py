"""Ids, entry points and their mistakes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from typer.testing import CliRunner

from ninedisk.harness import run_matrix
from ninedisk.harness.api import registry
from ninedisk.harness.api.registry import BrokenEntryError, UnknownIdError, get_case, get_engine, match_cases
from ninedisk.harness.cli.app import app

pytestmark = pytest.mark.usefixtures("fakes")


@pytest.mark.parametrize("case_id", registry.BUILTIN_CASES)
def test_builtin_cases_load(case_id: str) -> None:
    assert get_case(case_id).id == case_id


@pytest.mark.parametrize("engine_id", registry.BUILTIN_ENGINES)
def test_builtin_engines_load_and_know_themselves(engine_id: str) -> None:
    engine = get_engine(engine_id)
    assert engine.info().id == engine.id == engine_id


def test_entry_points_join(fakes: ModuleType) -> None:
    assert get_case("fake/fall") is fakes.CASE
    assert get_case("fake/spin") is fakes.CASES[1]
    assert get_engine("fake-good").id == "fake-good"


def test_unknown_ids_name_the_close_ones() -> None:
    with pytest.raises(
        UnknownIdError, match=r"no case 'fake/fal'\. Did you mean 'fake/fall'.*`ninedisk list cases` shows all \d+$"
    ):
        get_case("fake/fal")
    with pytest.raises(UnknownIdError, match=r"no engine 'xyz'\. `ninedisk list engines` shows all \d+$"):
        get_engine("xyz")


def test_broken_entry() -> None:
    with pytest.raises(
        BrokenEntryError,
        match=r"'fake-broken' of ninedisk-fakes cannot be loaded from ninedisk_fakes:NOWHERE: AttributeErr.*uninstall ninedisk-fakes",
    ):
        get_engine("fake-broken")


def test_an_entry_under_a_wrong_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.BUILTIN_CASES, "wrong/name", "ninedisk_fakes:CASE")
    registry.case_table.cache_clear()
    with pytest.raises(
        BrokenEntryError, match="of ninedisk is registered as case 'wrong/name' but its id is 'fake/fall'"
    ):
        get_case("wrong/name")


@pytest.fixture
def third_party(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Installs a package with the given name and text of entry points, ahead of every other."""

    def install(name: str, entry_points: str) -> None:
        about = tmp_path / name / f"{name}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(entry_points)
        monkeypatch.syspath_prepend(str(tmp_path / name))
        registry.case_table.cache_clear()
        registry.engine_table.cache_clear()

    return install


def test_an_id_of_our_own_cannot_be_taken(third_party: Callable[[str, str], None]) -> None:
    third_party("thief", "[ninedisk.engines]\ndem = thief:ENGINE\nthief = thief:ENGINE\n")
    assert get_engine("dem").info().name == "ninedisk DEM"
    assert registry.engine_table()["thief"].origin == "thief"
    (problem,) = registry.entry_problems()
    assert problem.startswith("thief registers 'dem' under ninedisk.engines, an id of ninedisk's own")


def test_two_packages_with_one_id_get_neither(third_party: Callable[[str, str], None]) -> None:
    third_party("rival", "[ninedisk.cases]\nfake/fall = rival:CASE\n")
    with pytest.raises(
        BrokenEntryError, match=r"two packages register 'fake/fall'.*rival:CASE of rival.*of ninedisk-fakes"
    ):
        get_case("fake/fall")
    assert get_case("fake/spin").id == "fake/spin"
    assert any("two packages register 'fake/fall'" in problem for problem in registry.entry_problems())


def test_one_package_found_twice_counts_once(third_party: Callable[[str, str], None]) -> None:
    third_party("ninedisk-fakes", "[ninedisk.cases]\nfake/fall = newer:CASE\n")
    assert registry.case_table()["fake/fall"].where == "newer:CASE"
    assert registry.entry_problems() == ()


def test_unreadable_metadata_hide_nobody(third_party: Callable[[str, str], None]) -> None:
    third_party("damaged", "[ninedisk.engines]\nno sign of a value\n")
    assert get_engine("fake-good").id == "fake-good"
    (problem,) = registry.entry_problems()
    assert problem.startswith("the entry points of damaged cannot be read")


def test_a_broken_case_leaves_the_others_alone(third_party: Callable[[str, str], None]) -> None:
    third_party("broken", "[ninedisk.cases]\nbroken/case = nowhere.at_all:CASE\n")
    results = run_matrix(["broken/case", "fake/spin"], ["fake-good"])
    assert [result.status for result in results] == ["error", "pass"]
    assert "'broken/case' of broken cannot be loaded from nowhere.at_all:CASE: ModuleNotFoundError" in results[0].reason


@pytest.mark.parametrize(
    "text",
    [
        "import sys\nsys.exit(4)\n",
        "raise BaseException('no more')\n",
        "class Engine:\n    @property\n    def id(self):\n        raise SystemExit(4)\nENGINE = Engine()\n",
    ],
)
@pytest.mark.parametrize("kind", ["engine", "case"])
def test_a_package_that_exits_is_named_and_leaves_the_others_alone(
    kind: str,
    text: str,
    third_party: Callable[[str, str], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    third_party("leaver", f"[ninedisk.{kind}s]\nleaver = leaver_{kind}:ENGINE\n")
    (tmp_path / "leaver" / f"leaver_{kind}.py").write_text(text)
    monkeypatch.delitem(sys.modules, f"leaver_{kind}", raising=False)
    (tmp_path / "leaver" / "findings.py").write_text(text)
    shown = CliRunner().invoke(app, ["list", f"{kind}s"])
    assert shown.exit_code == 0
    assert f"the {kind} 'leaver' of leaver cannot be loaded" in " ".join(shown.stdout.split())
    assert ("fake-good" if kind == "engine" else "fake/fall") in shown.stdout
    others = ["fake/fall", *(["leaver"] if kind == "case" else [])]
    engines = ["-e", "fake-good", *(["-e", "leaver"] if kind == "engine" else [])]
    run = CliRunner().invoke(app, ["run", *others, *engines, "--store", "store"])
    assert run.exit_code == 3
    assert "pass" in run.stdout
    assert "leaver" in run.output


def test_an_engine_that_cannot_report_its_facts_is_named() -> None:
    for arguments in (
        ["list", "engines", "fake-shy"],
        ["check-engine", "fake-shy"],
        ["converge", "fake/fall", "-e", "fake-shy"],
    ):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 3, done.output
        assert (
            "info() of the engine 'fake-shy' must not fail, it says RuntimeError: no facts; mend its adapter"
            in " ".join(done.output.split())
        )
        assert "internal error" not in done.output


def test_lists_report_where_things_come_from(
    third_party: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    from ninedisk.harness.cli.list import show_case, show_cases, show_engine, show_engines

    third_party("thief", "[ninedisk.engines]\ndem = thief:ENGINE\nthief = thief:ENGINE\n")
    show_case("fake/fall")
    show_engine("fake-good")
    assert capsys.readouterr().out.count("from: ninedisk-fakes\n") == 2
    show_cases()
    show_engines()
    shown = capsys.readouterr()
    rows = {line.split()[0]: line for line in shown.out.splitlines() if line.strip()}
    assert "(from" not in rows["incline-block"]
    assert "(from ninedisk-fakes)" in rows["fake/fall"]
    assert rows["thief"].split()[1] == "broken:"
    assert "(from thief)" in " ".join(shown.out.split())
    assert shown.err.count("warning: thief registers 'dem'") == 2


def test_patterns() -> None:
    assert match_cases(["fake/*"]) == ["fake/fall", "fake/spin"]
    assert match_cases(["fake/spin", "fake/fall", "fake/*"]) == ["fake/fall", "fake/spin"]
    assert match_cases([]) == list(registry.case_table())
    with pytest.raises(UnknownIdError, match="no case matches 'nine-disk'"):
        match_cases(["fake/*", "nine-disk"])


def test_ids_are_listed_without_importing_what_they_represent() -> None:
    code = (
        "import sys, ninedisk.harness, ninedisk.harness.api.registry as r; r.case_table(); r.engine_table(); "
        "print(*{'numpy', 'numba', 'pandas', 'pyarrow', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == ""
