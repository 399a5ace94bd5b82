"""Show that a change of the code changes no question, no truth and no engine's claim: before and after, nothing is run.

    python tools/same_answers.py write FILE.json     what the code at hand asks and expects
    python tools/same_answers.py compare BEFORE.json AFTER.json

Written are, for every case, variant and engine: the SHA-256 of the request as an engine behind a command gets it, what ``supports()``
answers, and every check (quantity, truth, source, atol, rtol, reason) over a history without numbers; and the JSON schemas. `compare`
prints what differs and ends with 1; support that grew and schemas with additions are printed, but are no difference.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.registry import case_table, engine_table
from ninedisk.harness.api.support import support_of
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.runner import all_checks
from ninedisk.harness.wire.protocol import Request, encode_request
from ninedisk.harness.wire.schemas import NAMES, schema_text

LEVELS = ("no", "approximate", "equivalent", "exact")


def hashed(value: Any) -> str:
    """SHA-256 of plain data, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def written() -> dict[str, Any]:
    """The rows of the code at hand, by ``case variant engine``."""
    rows: dict[str, Any] = {}
    for cell in plan_matrix(list(case_table()), list(engine_table()), {}):
        name = f"{cell.case.id} {cell.variant.id} {cell.engine_id}"
        setup, engine = cell.setup, cell.engine
        if not isinstance(setup, Setup) or isinstance(engine, Exception):
            rows[name] = {"error": str(engine if isinstance(setup, Setup) else setup)}
            continue
        request = Request(scene=setup.scene, numerics=setup.numerics, watch=tuple(setup.watch), answer_file="answer")
        row = rows[name] = {"request": hashed(json.loads(encode_request(request)))}
        try:
            support = support_of(engine, setup.scene, setup.numerics)
        except EngineError as error:
            row["support"] = str(error)
            continue
        row["support"] = str(support.level)
        row["because"] = sorted([*map(str, support.missing), *support.notes])
        if support.level == "no":
            continue
        observed = cell.case.observe(cell.variant.params, setup, blank_history(setup))
        row["checks"] = {
            f"{n} {check.quantity} {check.truth}": [
                check.source,
                check.atol,
                check.rtol,
                check.why,
                hashed(check.expected),
            ]
            for n, check in enumerate(all_checks(cell, setup, observed, engine.info(), None))
        }
    return {"rows": rows, "schemas": {name: json.loads(schema_text(name)) for name in NAMES}}


def has_more(before: Any, after: Any) -> bool:
    """Whether a schema only got additions."""
    if isinstance(before, dict) and isinstance(after, dict):
        return all(key in after and has_more(value, after[key]) for key, value in before.items())
    if isinstance(before, list) and isinstance(after, list):
        return all(value in after for value in before)
    return bool(before == after)


def differences(before: dict[str, Any], after: dict[str, Any]) -> tuple[list[str], list[str]]:
    """What differs, and what only grew."""
    wrong, more = [], []
    for name in sorted({*before["rows"], *after["rows"]}):
        old, new = before["rows"].get(name), after["rows"].get(name)
        if old is None or new is None:
            wrong.append(f"{name}: {'new' if old is None else 'gone'}")
            continue
        for key in sorted({*old, *new}):
            if old.get(key) == new.get(key):
                continue
            levels = [LEVELS.index(each[key]) if each.get(key) in LEVELS else -1 for each in (old, new)]
            if key == "support" and 0 <= levels[0] < levels[1]:
                more.append(f"{name}: support grew from {old[key]} to {new[key]}")
            elif isinstance(old.get(key), dict) and isinstance(new.get(key), dict):
                changed = [each for each in {*old[key], *new[key]} if old[key].get(each) != new[key].get(each)]
                wrong += [f"{name}: {each}: {old[key].get(each)} -> {new[key].get(each)}" for each in sorted(changed)]
            elif not any(line.startswith(f"{name}: support grew") for line in more):
                wrong.append(f"{name}: {key}: {old.get(key)} -> {new.get(key)}")
    for name in sorted({*before["schemas"], *after["schemas"]}):
        old, new = before["schemas"].get(name), after["schemas"].get(name)
        if old != new:
            (more if old is None or has_more(old, new) else wrong).append(f"schema {name} differs")
    return wrong, more


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "write":
        found = written()
        Path(sys.argv[2]).write_text(json.dumps(found, sort_keys=True, default=str), encoding="utf-8")
        print(
            f"{len(found['rows'])} cells, {sum(len(row.get('checks', ())) for row in found['rows'].values())} checks: {sys.argv[2]}"
        )
    elif len(sys.argv) == 4 and sys.argv[1] == "compare":
        wrong, more = differences(*(json.loads(Path(each).read_text(encoding="utf-8")) for each in sys.argv[2:]))
        print("\n".join([*more, *wrong, f"{len(wrong)} differences, {len(more)} additions"]))
        sys.exit(1 if wrong else 0)
    else:
        sys.exit(__doc__)
