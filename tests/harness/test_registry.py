"""Ids, entry points and their mistakes."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType

import pytest

from ninedisk.harness import registry
from ninedisk.harness.registry import BrokenEntryError, UnknownIdError, get_case, get_engine, match_cases

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
    with pytest.raises(UnknownIdError, match=r"no case 'fake/fal'\. Did you mean 'fake/fall'.*Known cases: nine-disk"):
        get_case("fake/fal")
    with pytest.raises(UnknownIdError, match=r"no engine 'yad'\. Did you mean 'yade'.*Known engines: dem, cd, yade"):
        get_engine("yad")


def test_broken_entry() -> None:
    with pytest.raises(
        BrokenEntryError, match="'fake-broken' cannot be loaded from ninedisk_fakes:NOWHERE: AttributeErr"
    ):
        get_engine("fake-broken")


def test_an_entry_under_a_wrong_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.BUILTIN_CASES, "wrong/name", "ninedisk_fakes:CASE")
    registry.case_table.cache_clear()
    with pytest.raises(BrokenEntryError, match="is registered as case 'wrong/name' but its id is 'fake/fall'"):
        get_case("wrong/name")


def test_two_packages_with_the_same_id(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.BUILTIN_CASES, "fake/fall", "elsewhere:CASE")
    registry.case_table.cache_clear()
    with pytest.raises(BrokenEntryError, match="two packages register 'fake/fall'"):
        get_case("fake/fall")


def test_patterns() -> None:
    assert match_cases(["fake/*"]) == ["fake/fall", "fake/spin"]
    assert match_cases(["fake/spin", "fake/fall", "fake/*"]) == ["fake/fall", "fake/spin"]
    assert match_cases([]) == list(registry.case_table())
    with pytest.raises(UnknownIdError, match="no case matches 'nine-disk'"):
        match_cases(["fake/*", "nine-disk"])


def test_ids_are_listed_without_importing_what_they_stand_for() -> None:
    code = (
        "import sys, ninedisk.harness, ninedisk.harness.registry as r; r.case_table(); r.engine_table(); "
        "print(*{'numpy', 'numba', 'pandas', 'pyarrow', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == ""
