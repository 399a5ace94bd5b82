"""What a failed check tells: all that one needs to judge it, to see it drawn and to run it again."""

from __future__ import annotations

import re

from ninedisk.harness.results.schema import row_tolerance
from ninedisk.harness.results.tables import Row
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.repeat import run_command


def failure_text(name: str, row: Row) -> str:
    """Value, reference, error, tolerance and its reason of a failed check."""
    unit = row["unit"] if row["unit"] not in ("", "-") else ""
    lines = [
        f"{name}: {row['quantity']} against {row['truth']}: {row['reason']}",
        f"  value      {row['value']!r} {unit}".rstrip()
        + (f" at step {row['worst_step']}" if row["worst_step"] >= 0 else ""),
        f"  reference  {row['expected']!r} {unit}".rstrip() + f" (+- {row['uncertainty']:.3g}; {row['source']})",
        f"  error      {row['abs_error']:.6g} {unit}".rstrip() + f" (relative {row['rel_error']:.3g})",
        f"  tolerance  {row_tolerance(row):.6g} {unit}".rstrip()
        + f" = {row['atol']:g} + {row['rtol']:g} x {row['scale']:.6g}",
        f"  because    {row['why']}",
    ]
    if row["first_divergence_step"] >= 0:
        lines.append(f"  diverges   first at step {row['first_divergence_step']}")
    return "\n".join(lines)


def where_to_look(cell: Cell) -> str:
    """The case in words, its page in a report, and the command that runs the cell again."""
    return "\n".join(
        (
            f"  case       ninedisk list cases {cell.case.id}; {page(cell.case.id)} of a report",
            f"  again      {run_command(cell)}",
        )
    )


def page(case_id: str) -> str:
    """Place of a case's errors, relative to the folder of a report."""
    slug = re.sub(r"[^a-z0-9]+", "-", case_id.lower()).strip("-")[:60]
    return f"case/{slug}.html#errors"
