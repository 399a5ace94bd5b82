"""The table of statuses: ids and exit codes that stores and scripts rely on, words for each, and the same words in the terminal."""

from __future__ import annotations

import re
from typing import Any

import pytest
from typer.testing import CliRunner

from ninedisk.harness.audit import run as audit
from ninedisk.harness.bench import records
from ninedisk.harness.check_engine import outcomes
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.run import show_summary
from ninedisk.harness.results import schema
from ninedisk.harness.results.claims import judge_claims
from ninedisk.harness.results.statuses import TABLE, VERDICTS
from ninedisk.harness.run import converge
from ninedisk.harness.run.judge import exit_code

IDS = {
    "pass": 0,
    "fail": 1,
    "error": 3,
    "timeout": 3,
    "unsupported": 0,
    "not-installed": 0,
    "known-gap": 0,
    "gap-closed": 0,
    "known-difference": 0,
    "no-truth": 0,
    "not-observed": 0,
}
"""What stores, CSV, JUnit and exit codes have had all along."""


def test_ids_and_exit_codes_stay() -> None:
    assert tuple(TABLE) == tuple(IDS) == schema.STATUSES
    assert {word: each.exit_code for word, each in TABLE.items()} == IDS
    assert {word for word, code in IDS.items() if code == 0} == schema.EXCUSED
    assert {word: exit_code({"pass", word}) for word in TABLE} == IDS
    assert exit_code(["fail", "timeout", "pass"]) == 3
    assert exit_code(["a word that is no status"]) == 1
    assert exit_code([]) == 0
    assert set(schema.WORST_FIRST) == set(TABLE)


@pytest.mark.parametrize("word", TABLE)
def test_a_status_has_words_alone(word: str) -> None:
    status = TABLE[word]
    assert status.id == word
    assert len(status.symbol) == 1
    assert len(status.meaning) > 10
    assert "\n" not in status.meaning
    assert status.fails == (status.exit_code != 0)
    others = [each for each in TABLE.values() if each is not status]
    assert status.symbol not in [each.symbol for each in others]
    assert status.meaning not in [each.meaning for each in others]


def claim_verdicts() -> set[str]:
    """Those that `judge_claims` can give; it writes them as texts."""
    source = judge_claims.__globals__["_judge"].__code__.co_consts
    return {word for word in source if word in ("confirmed", "contradicted", "undecided")}


@pytest.mark.parametrize(
    ("name", "used"),
    [
        ("claims of the source", claim_verdicts()),
        ("findings", schema.FINDING_VERDICTS),
        ("compare", schema.CHANGE_VERDICTS),
        ("determinism", schema.DETERMINISM_VERDICTS),
        ("converge", converge.VERDICTS),
        ("audit", (audit.VIOLATED, audit.HOLDS, audit.UNDECIDED)),
        ("check-engine", (outcomes.PASS, outcomes.FAIL, outcomes.REFUSED, outcomes.UNSEEN)),
        ("bench", records.STATUSES),
    ],
)
def test_every_other_verdict_has_words(name: str, used: Any) -> None:
    assert set(VERDICTS[name]) == set(used)
    assert all(len(meaning) > 10 for meaning in VERDICTS[name].values())


def test_verdicts_stay_in_their_order() -> None:
    assert schema.CHANGE_VERDICTS == ("worse", "suspect", "lost", "not-comparable", "better", "new", "same")
    assert schema.DETERMINISM_VERDICTS == ("different", "broken", "round-off", "bitwise", "not applicable")
    assert schema.FINDING_VERDICTS == ("larger", "gone", "there", "not-measured")


def test_the_terminal_lists_them_with_their_meaning() -> None:
    done = CliRunner().invoke(app, ["list", "statuses"], prog_name="ninedisk")
    assert done.exit_code == 0, done.output
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for word, status in TABLE.items():
        failure = "yes" if status.fails else "no"
        assert f"{word} {failure} {status.exit_code} {status.meaning}" in lines
    for words in VERDICTS.values():
        for word, meaning in words.items():
            assert f"{word} {meaning}" in lines


@pytest.mark.parametrize("word", TABLE)
def test_the_end_of_a_run_has_the_word(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    def filled(columns: dict[str, str], **given: Any) -> dict[str, Any]:
        return {**{column: schema.EMPTY[kind] for column, kind in columns.items()}, **given}

    place = {"case": "demo/one", "variant": "k=1", "engine": "demo", "status": word, "reason": "why"}
    ran = word not in ("unsupported", "not-installed")
    numbers = {"quantity": "x", "truth": "analytic", "abs_error": 1.0, "atol": 0.5, "rtol": 0.0} if ran else {}
    cells, rows = [filled(schema.CELL_COLUMNS, **place)], [filled(schema.MEASUREMENT_COLUMNS, **place, **numbers)]
    show_summary(cells, rows, None)
    said = capsys.readouterr().out
    assert f"cells: 1 {word}" in said
    assert re.search(rf"^ ?{word}\b.*\bdemo\b", said, re.MULTILINE), said
    if ran:
        assert f"checks: 1 {word}" in said
