"""How to cite what a page shows: software, version and commit from the package's metadata and the run's record."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, metadata
from typing import Any

from ninedisk.harness.results.schema import Row
from ninedisk.reports.panel.model import CaseData, Panel

AUTHORS = "the ninedisk developers"
"""As in LICENSE."""


def run_of(panel: Panel) -> tuple[str, str, str]:
    """Version and commit of ninedisk and the id of the newest run; empty where it has none."""
    run: Row = panel.stored.runs[0] if panel.stored.runs else {}
    facts = run.get("provenance")
    facts = facts if isinstance(facts, dict) else {}
    return str(facts.get("ninedisk") or ""), str(facts.get("commit") or "")[:12], str(run.get("run_id") or "")


def cite(panel: Panel) -> tuple[str, str]:
    """The reference in words and as BibTeX; it has no DOI, since there is none."""
    version, commit, run = run_of(panel)
    year = run[:4] if run[:4].isdigit() else ""
    try:
        about = metadata("ninedisk")
        title = f"ninedisk: {about['Summary']}"
    except PackageNotFoundError:
        title = "ninedisk"
    release = ", ".join(
        part for part in (f"version {version}" if version else "", f"commit {commit}" if commit else "") if part
    )
    words = (
        ". ".join(part for part in (AUTHORS.capitalize() + (f" ({year})" if year else ""), title, release) if part)
        + "."
    )
    fields = {"author": f"{{{AUTHORS.capitalize()}}}", "title": title, "version": version, "year": year}
    fields["note"] = ", ".join(
        part for part in (f"commit {commit}" if commit else "", f"run {run}" if run else "") if part
    )
    body = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items() if value)
    return words, f"@software{{ninedisk,\n{body}\n}}"


def caption_facts(panel: Panel, case: CaseData) -> dict[str, Any]:
    """What the captions of a case's figures need: engines with versions, the run, and whom to cite."""
    version, commit, run = run_of(panel)
    made = f"ninedisk {version}".strip() + (f", commit {commit}" if commit else "") + (f", run {run}" if run else "")
    ran = {cell["engine"]: cell["engine_version"] for cell in case.cells}
    engines = {
        name: f"{panel.engines[name].name} {held or panel.engines[name].version}".strip() for name, held in ran.items()
    }
    return {
        "case": f"{case.id} (version {case.version})",
        "slug": case.slug,
        "engines": engines,
        "run": made,
        "text": cite(panel)[0],
    }
