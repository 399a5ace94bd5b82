"""Verdicts on the source's claims: confirmed, contradicted or undecided, for each engine of a run."""

from __future__ import annotations

from collections.abc import Sequence

from ninedisk.harness.results.claim_rules import RULES, UndecidedError
from ninedisk.harness.results.tables import CaseResult, Row
from ninedisk.references.claims import Claim, load_claims

_RAN = frozenset({"pass", "fail", "known-gap", "gap-closed", "no-truth"})


def judge_claims(results: Sequence[CaseResult]) -> list[Row]:
    """A row of `records.CLAIM_COLUMNS` for each claim and engine of the run.

    A claim whose case the run does not hold has one row without an engine, undecided, with that reason.
    """
    rows = []
    for claim in load_claims():
        cells = [result for result in results if result.cell["case"] == claim.case]
        engines = list(dict.fromkeys(str(result.cell["engine"]) for result in cells))
        if not engines:
            rows.append(_row(claim, "", "undecided", f"the case {claim.case!r} is not part of this run"))
        for engine in engines:
            rows.append(_judge(claim, engine, [cell for cell in cells if cell.cell["engine"] == engine]))
    return rows


def _judge(claim: Claim, engine: str, cells: Sequence[CaseResult]) -> Row:
    ran = [cell for cell in cells if cell.status in _RAN and cell.observed is not None]
    if not ran:
        return _row(claim, engine, "undecided", f"{cells[0].status}: {cells[0].reason}")
    if claim.id not in RULES:
        return _row(claim, engine, "undecided", "no rule decides this claim")
    try:
        confirmed, evidence = RULES[claim.id](ran)
    except UndecidedError as reason:
        return _row(claim, engine, "undecided", str(reason))
    return _row(claim, engine, "confirmed" if confirmed else "contradicted", evidence)


def _row(claim: Claim, engine: str, verdict: str, evidence: str) -> Row:
    return {
        "claim": claim.id,
        "place": claim.place,
        "text": claim.text,
        "case": claim.case,
        "engine": engine,
        "verdict": verdict,
        "evidence": evidence,
    }
