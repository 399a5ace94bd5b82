"""What the checks of an adapter say to a reader: what is wrong first, then what was not tested, then what to run next."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from ninedisk.harness.api.capabilities import Capability, capabilities_asked
from ninedisk.harness.api.engine import Engine, EngineInfo, SupportLevel
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.api.support import support_of
from ninedisk.harness.api.text import count_noun, one_line
from ninedisk.harness.check_engine.outcomes import FAIL, PASS, REFUSED, UNSEEN, Fault, Outcome
from ninedisk.harness.terminal import console, table

FORM = ("scenes", "facts", "form", "sampling", "warm-up")
"""Checks without which no number of the others means anything."""

CASE_OF: Mapping[Capability, str] = {
    Capability.LINEAR_CONTACT: "binary-collision",
    Capability.SHEAR_SPRING: "contact/retraced-loop",
    Capability.FRICTION: "slip-to-roll",
    Capability.CONTACT_DAMPING: "binary-collision",
    Capability.RESTITUTION: "impact/bouncing-disk",
    Capability.GLOBAL_DAMPING_CENTRAL: "nine-disk/compression",
    Capability.MOVING_WALLS: "contact/moving-wall",
    Capability.ROTATING_WALLS: "invariance/objectivity",
    Capability.CURVED_WALL_MOTION: "contact/driven-wall",
    Capability.GRAVITY: "impact/bouncing-disk",
    Capability.BLOCKED_ROTATION: "incline-block",
    Capability.HELD_MOTION: "impact/held-disk",
    Capability.QUASI_STATIC: "sliding/quasistatic",
    Capability.PRELOAD: "slip-to-roll",
    Capability.DISK_INERTIA: "slip-to-roll",
    Capability.LEVER_ARM_OVERLAP: "contact/retraced-loop",
    Capability.SLIP_MIDDLE: "contact/retraced-loop",
    Capability.SLIP_END: "contact/retraced-loop",
    Capability.MATERIALS: "contact/materials",
    Capability.BODY_FORCES: "motion/forces",
    Capability.ROLLING_CONSTANT: "rolling/resistance",
    Capability.ROLLING_VISCOUS: "rolling/resistance",
    Capability.ROLLING_SPRING: "rolling/resistance",
    Capability.COHESION: "impact/cohesion",
    Capability.PERIODIC_CELL: "cell/lattice",
    Capability.ENERGY_BUDGET: "energy/budget",
    Capability.OUTLINES: "nurbs/overlap",
    Capability.SPHERES: "spheres/rolling",
    Capability.HERTZ_MINDLIN: "spheres/chung-ooi/1",
    Capability.UNLOADING_FORCE: "spheres/thornton",
    Capability.TWISTING_CONSTANT: "spheres/top",
    Capability.TWISTING_SPRING: "spheres/top",
    Capability.SURFACE_JKR: "spheres/jkr",
}
"""A case that is about a capability, where there is one."""


def print_verdict(engine: Engine, info: EngineInfo, outcomes: Sequence[Outcome], given: Sequence[str]) -> None:
    """Print the verdict; ``given`` is the engine as the command line has it, an option and its value."""
    out = console()
    for line in _headline(info, outcomes):
        out.print(one_line(line), soft_wrap=True)
    wrong = _failures(outcomes)
    if wrong:
        out.print()
        for line in _first(engine, outcomes, wrong[0], given):
            out.print(one_line(line), soft_wrap=True)
    if others := wrong[1:]:
        shown = table("also failing", "found", "mend")
        for each in others:
            more = f" (and {len(each.faults) - 1} more)" if len(each.faults) > 1 else ""
            fault = _most_specific_first(each)[0]
            shown.add_row(*map(one_line, (each.check, _fault_text(fault) + more, fault.mend)))
        out.print(shown)
    out.print()
    for line in _untested(outcomes):
        out.print(one_line(line), soft_wrap=True)
    if not wrong:
        out.print(f"next: ninedisk run {shlex.join(given)}", soft_wrap=True)


def _headline(info: EngineInfo, outcomes: Sequence[Outcome]) -> Iterator[str]:
    names = {status: [each.check for each in outcomes if each.status == status] for status in (FAIL, PASS)}
    ran = len(names[FAIL]) + len(names[PASS])
    yield (
        f"{info.id} {info.version}: {len(names[FAIL])} of {ran} checks fail"
        if names[FAIL]
        else f"{info.id} {info.version}: nothing wrong was found, {count_noun(ran, 'check')} pass{'es' if ran == 1 else ''}"
    )
    if names[PASS]:
        yield f"pass: {', '.join(names[PASS])}"


def _failures(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """What fails, the most informative first, each fault once although several checks may run its scene.

    What all checks rest on comes first, then scenes that ask for little: what is wrong there spoils the others. Among alike, a
    capability that no passing check uses, and a number that is a simple multiple of the right one. Conduct, which spoils no
    physics, comes last.
    """
    ranked = sorted(
        (each for each in outcomes if each.status == FAIL),
        key=lambda each: (
            each.check not in FORM,
            not each.needs and not each.check.startswith("units"),
            len(each.needs),
            _capability_of(each) not in _suspects(each, outcomes),
            not _most_specific_first(each)[0].likeness,
        ),
    )
    distinct: dict[tuple[Fault, ...], Outcome] = {}
    for each in ranked:
        distinct.setdefault(each.faults, each)
    return list(distinct.values())


def _capability_of(outcome: Outcome) -> Capability | None:
    """The capability that a check is about, if it is about one."""
    return Capability.__members__.get(outcome.check.removeprefix("supports: "))


def _suspects(outcome: Outcome, outcomes: Sequence[Outcome]) -> frozenset[Capability]:
    """What the scene of a check asks for and no passing check does."""
    return outcome.needs.difference(*(each.needs for each in outcomes if each.status == PASS))


def _most_specific_first(outcome: Outcome) -> list[Fault]:
    """The faults of a check, simple multiples of the right number first."""
    return sorted(outcome.faults, key=lambda fault: not fault.likeness)


def _fault_text(fault: Fault) -> str:
    return f"{fault.found}: {fault.likeness}" if fault.likeness else fault.found


def _first(engine: Engine, outcomes: Sequence[Outcome], first: Outcome, given: Sequence[str]) -> Iterator[str]:
    yield f"look at this first: {first.check}"
    for fault in _most_specific_first(first):
        yield f"  found: {_fault_text(fault)}"
    if first.mend:
        yield f"  mend: {first.mend}"
    if suspects := sorted(each.name for each in _suspects(first, outcomes)):
        yield f"  suspect: {', '.join(suspects)}, which no passing check uses"
    yield f"  again: ninedisk check-engine {shlex.join(_engine_id(given))} --check {shlex.quote(first.check)}"
    asked = _capability_of(first)
    wanted = sorted(first.needs) if asked is None else [asked]
    case = next(filter(None, (_case(engine, each) for each in wanted)), "")
    yield f"  next: {' '.join(filter(None, ['ninedisk run', case, shlex.join(given)]))}"


def _engine_id(given: Sequence[str]) -> Sequence[str]:
    """An engine as check-engine takes it: an id without its option."""
    return given[1:] if given[0] == "--engine" else given


def _case(engine: Engine, asked: Capability) -> str:
    """The case about a capability, if the engine runs a variant that asks for it; else nothing."""
    if asked not in CASE_OF:
        return ""
    case = get_case(CASE_OF[asked])
    for changes in case.matrix():
        params = {each.name: each.default for each in case.parameters} | dict(changes)
        with suppress(Exception):  # a scene that this engine's numbers cannot have, or a broken `supports`
            setup = case.build(params)
            if asked in capabilities_asked(setup.scene, setup.numerics) and (
                support_of(engine, setup.scene, setup.numerics).level is not SupportLevel.NO
            ):
                return case.id
    return ""


def _untested(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """What no check has tested, and why: what is declared first."""
    tested = frozenset[Capability]().union(*(each.needs for each in outcomes if each.status in (PASS, FAIL)))
    refused = {each.check.removeprefix("supports: "): each for each in outcomes if each.status == REFUSED}
    for name, each in refused.items():
        if each.declared:
            how = "only in scenes of other checks" if Capability[name] in tested else "NOWHERE"
            yield f"declared, tested {how}: {name} ({each.found})"
    unseen: dict[str, list[str]] = {}
    for each in outcomes:
        for quantity in each.unseen:
            unseen.setdefault(quantity, []).append(each.check)
    for quantity, checks in unseen.items():
        yield f"not observed: {quantity} (in {', '.join(checks)})"
    for each in outcomes:
        if each.status == UNSEEN:
            yield f"ran, and none of its numbers is observed: {each.check}"
        if each.status == REFUSED and each.check.removeprefix("supports: ") not in Capability.__members__:
            yield f"not run: {each.check} ({each.found})"
    if left := [name for name, each in refused.items() if not each.declared and name in Capability.__members__]:
        yield f"not declared, so not tested ({len(left)}): {', '.join(left)}"
