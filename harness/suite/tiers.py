"""How much of a case's matrix a test belongs to: ``-m smoke``, ``-m core`` or ``-m full``.

- ``smoke``: the first variant of each case, the one that its source shows first: does the engine speak at all?
- ``core``: those, and the variants that differ from the first in one parameter alone: one cause for each difference.
- ``full``: every variant.

Each tier holds the one before it.
"""

from __future__ import annotations

from collections.abc import Sequence

from ninedisk.harness.api.case import Variant

TIERS = {
    "smoke": "the first variant of each case",
    "core": "variants that differ from the first of their case in at most one parameter",
    "full": "every variant of every case",
}


def tiers(variants: Sequence[Variant]) -> dict[str, tuple[str, ...]]:
    """Names of the tiers of each variant, by its id; ``variants`` are those of one case in the order of its matrix."""
    found: dict[str, tuple[str, ...]] = {}
    names = tuple(TIERS)
    for variant in variants:
        first = variants[0].params
        differ = sum(value != first[name] for name, value in variant.params.items())
        found.setdefault(variant.id, names[min(differ, 2) :])
    return found
