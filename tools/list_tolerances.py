"""List every check whose tolerance exceeds 2 % of the effect that it is about, with the reason: ``docs/reference/tolerances.md``.

    python tools/list_tolerances.py [STORE ...]

Without a store the checks are those of the engines of this process on the whole matrix; nothing is run. With stores they are those of
the stored rows, of all engines in them. The effect is the largest value of a check's reference (`allowed_shares`).
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.params import settings_of_other_engines
from ninedisk.harness.api.registry import case_table
from ninedisk.harness.api.support import support_of
from ninedisk.harness.results.reader import read_about, read_rows, run_ids
from ninedisk.harness.results.schema import Row, allowed_shares
from ninedisk.harness.run.judge import blank_history, compare
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.runner import all_checks

ENGINES = ("dem", "cd", "pymunk")
"""One of each kind of contact: springs, contact dynamics, impulses."""

LEAST = 0.02
"""Share of the effect from which a tolerance is listed."""

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "tolerances.md"

HEAD = f"""# Wide tolerances

Every check whose tolerance exceeds {100 * LEAST:g} % of the effect that its case is about, with its derivation. An engine may pass such a
check and be off by the given share. `python tools/list_tolerances.py` writes this page from the checks of {", ".join(ENGINES)}, one engine
of each kind of contact. With stores as arguments it lists what they hold.

The effect is the largest value of the reference, or if that is zero, of the quantity in other variants of the case. Of several truths the
tightest counts. Numbers are those of the widest variant. An engine whose scheme has its own name is not bound by exact steps, and may be
off by more.

| case | engine | share: quantities | why |
|---|---|---|---|
"""


def dry_rows() -> Iterable[Row]:
    """Checks of the whole matrix, over histories without numbers."""
    for cell in plan_matrix(list(case_table()), list(ENGINES), {}):
        setup, engine = cell.setup, cell.engine
        if not isinstance(setup, Setup) or isinstance(engine, Exception):
            continue
        if settings_of_other_engines(cell.case, cell.variant.params, engine.info().contact):
            continue
        if support_of(engine, setup.scene, setup.numerics).level == "no":
            continue
        observed = cell.case.observe(cell.variant.params, setup, blank_history(setup))
        for check in all_checks(cell, setup, observed, engine.info(), None):
            found = compare(check, observed)
            if found.spoken and not check.gap_reason:
                yield {
                    "case": cell.case.id, "variant": cell.variant.id, "engine": cell.engine_id, "quantity": check.quantity,
                    "unit": found.unit, "atol": check.atol, "rtol": check.rtol, "scale": found.scale, "why": check.why,
                    "truth": check.truth,
                }  # fmt: skip


def stored_rows(stores: Iterable[Path]) -> Iterable[Row]:
    """Measurements of all runs of some stores."""
    for store in stores:
        for run_id in run_ids(store):
            for row in read_rows(store, read_about(store, run_id), "measurements"):
                if row["quantity"] and row["status"] not in ("no-truth", "not-observed", "known-gap", "gap-closed"):
                    yield row


def wide(rows: Iterable[Row]) -> dict[tuple[str, str, str], tuple[float, Row]]:
    """The widest check of each case, quantity and engine above `LEAST`; a series and its final value are one."""
    held = list(rows)
    tight: dict[tuple[str, ...], tuple[float, Row]] = {}
    for row, share in zip(held, allowed_shares(held), strict=True):
        cell = tuple(row[name] for name in ("case", "variant", "engine", "quantity"))
        if share < tight.get(cell, (math.inf, row))[0]:
            tight[cell] = share, row
    found: dict[tuple[str, str, str], tuple[float, Row]] = {}
    for share, row in tight.values():
        key = row["case"], row["quantity"].removesuffix("_final"), row["engine"]
        if share > LEAST and share > found.get(key, (0.0, row))[0]:
            found[key] = share, row
    return found


def page(found: dict[tuple[str, str, str], tuple[float, Row]]) -> str:
    """The page in Markdown: one row for each case and reason, with the engines that share it."""
    lines = [HEAD]
    for case in sorted({case for case, _, _ in found}):
        shares: dict[tuple[str, str], dict[str, list[str]]] = {}
        why: dict[tuple[str, str], str] = {}
        for (name, quantity, engine), (share, row) in sorted(found.items()):
            if name == case:
                key = engine, _shape(row["why"])
                shares.setdefault(key, {}).setdefault(_percent(share), []).append(quantity)
                why[key] = row["why"].replace("|", "/")
        engines: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for key, listed in sorted(shares.items()):
            text = "; ".join(f"{share}: {', '.join(quantities)}" for share, quantities in listed.items())
            engines.setdefault((text, key[1]), []).append(key)
        lines += [
            f"| {case} | {', '.join(engine for engine, _ in keys)} | {text} | {why[keys[0]]} |\n"
            for (text, _), keys in engines.items()
        ]
    return "".join(lines)


def _shape(why: str) -> str:
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", why)


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 1.0 else f"{100.0 * share:.0f} %"


if __name__ == "__main__":
    stores = [Path(each) for each in sys.argv[1:]]
    listed = wide(stored_rows(stores) if stores else dry_rows())
    PAGE.write_text(page(listed), encoding="utf-8")
    print(f"{len(listed)} checks by case, quantity and engine allow more than {100 * LEAST:g} %: {PAGE}")
