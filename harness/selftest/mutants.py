"""All planted defects, and the engines as they are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.selftest import (
    cd_sources,
    dem_sources,
    faulty_engines,
    grain_sources,
    histories,
    setups,
    sphere_sources,
)
from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import Edit
from ninedisk.harness.selftest.panel import ENGINES

CLEAN = (
    *(
        Defect(name="unchanged", engine=engine, kind="clean", what="the engine as it is: every check must pass")
        for engine in ENGINES
    ),
    Defect(
        name="sorted",
        engine="dem",
        kind="clean",
        what="disks sorted and divided into stripes in every scene: every check must pass",
        edits=tuple(Edit(*edit) for edit in dem_sources.SORT_ALL),
    ),
)

MUTANTS: tuple[Defect, ...] = tuple(
    sorted(
        (
            *dem_sources.DEFECTS,
            *grain_sources.DEFECTS,
            *sphere_sources.DEFECTS,
            *cd_sources.DEFECTS,
            *setups.DEFECTS,
            *histories.DEFECTS,
            *faulty_engines.DEFECTS,
        ),
        key=lambda defect: ENGINES.index(defect.engine),
    )
)


def chosen_defects(globs: Sequence[str]) -> list[Defect]:
    """Defects whose id or name matches any of the patterns; all without a pattern.

    Raises
    ------
    UsageError
        If a pattern matches nothing.
    """
    for glob in globs:
        if not any(_matches(defect, glob) for defect in MUTANTS):
            known = [defect.id for defect in MUTANTS]
            raise UsageError(
                f"no planted defect matches {glob!r}.{close_matches(glob, known)} ninedisk selftest --list shows all "
                f"{len(known)} (quote patterns such as 'dem/torque-*')"
            )
    return [defect for defect in MUTANTS if not globs or any(_matches(defect, glob) for glob in globs)]


def repeated_ids(defects: Sequence[Defect]) -> list[str]:
    """Ids that occur more than once."""
    return [name for name, count in Counter(defect.id for defect in defects).items() if count > 1]


def _matches(defect: Defect, glob: str) -> bool:
    return fnmatchcase(defect.id, glob) or fnmatchcase(defect.name, glob)
