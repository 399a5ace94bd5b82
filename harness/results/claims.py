"""Verdicts on the cases' claims: confirmed, contradicted or undecided, for each engine of a run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress

from ninedisk.harness.api.claims import Claim, UndecidedError, claims_of
from ninedisk.harness.api.registry import BrokenEntryError, UnknownIdError, get_case
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult

_RAN = frozenset({"pass", "fail", "known-gap", "gap-closed", "known-difference", "no-truth", "not-observed"})


def judge_claims(results: Sequence[CaseResult]) -> list[Row]:
    """A row of `schema.CLAIM_COLUMNS` for each claim of the run's cases and each engine that was to run them."""
    by_case: dict[str, dict[str, list[CaseResult]]] = {}
    for result in results:
        by_case.setdefault(result.cell["case"], {}).setdefault(result.cell["engine"], []).append(result)
    rows = []
    for case_id, engines in by_case.items():
        with suppress(BrokenEntryError, UnknownIdError):  # such a case's cells say so
            for claim in claims_of(get_case(case_id)):
                rows += [_judge(claim, case_id, engine, cells) for engine, cells in engines.items()]
    return rows


def _judge(claim: Claim, case_id: str, engine: str, cells: Sequence[CaseResult]) -> Row:
    ran = [cell for cell in cells if cell.status in _RAN and cell.observed is not None]
    verdict = "undecided"
    if ran:
        try:
            confirmed, evidence = claim.rule(ran)
            verdict = "confirmed" if confirmed else "contradicted"
        except UndecidedError as reason:
            evidence = str(reason)
    else:
        evidence = f"{cells[0].status}: {cells[0].reason}"
    return {
        "claim": claim.id,
        "place": claim.place,
        "text": claim.text,
        "case": case_id,
        "engine": engine,
        "verdict": verdict,
        "evidence": evidence,
        "derivation": json.dumps(claim.derivation),
    }
