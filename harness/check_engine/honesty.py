"""Whether `supports` tells the truth: what it declares is held against a probe of each capability."""

from __future__ import annotations

from ninedisk.harness.api.capabilities import SLIP_AT, Capability, capabilities_needed
from ninedisk.harness.api.engine import Support, SupportLevel
from ninedisk.harness.check_engine.claims import Probe
from ninedisk.harness.check_engine.findings import FAIL, PASS, REFUSED, Bench, Finding, finding


def capability(bench: Bench, probe: Probe, asked: Capability) -> Finding:
    """One capability: refused for a reason, or matched by the run of its probe."""
    name = f"supports: {asked.name}"
    support = bench.engine.supports(probe.setup.scene, probe.setup.numerics)
    if support.level is SupportLevel.NO:
        return _refusal(name, bench, support, asked)
    lacking = capabilities_needed(probe.setup.scene, probe.setup.numerics) - bench.info.capabilities
    if lacking and support.level is not SupportLevel.APPROXIMATE and not support.notes:
        lacks = ", ".join(sorted(each.name for each in lacking))
        mend = "declare it in info(), or answer NO or APPROXIMATE, or say in a note why this scene does not need it"
        return finding(name, [(f"the scene is {support.level} although info() lacks {lacks}", mend)])
    # An engine may lack the place of the slip and run the scene all the same, if it says so: that place is no claim of its own.
    may_lack = support.level is SupportLevel.APPROXIMATE or (
        asked in SLIP_AT.values() and support.level is SupportLevel.EQUIVALENT
    )
    return judged(name, bench, probe, support, claimed=asked in bench.info.capabilities or not may_lack)


def judged(name: str, bench: Bench, probe: Probe, support: Support, *, claimed: bool = True) -> Finding:
    """The run of a probe against its closed form, coarsely where it is graded approximate."""
    history = bench.run(probe).history
    coarse = support.level is SupportLevel.APPROXIMATE
    if not claimed:
        return Finding(check=name, status=PASS, found=f"{probe.name}: not claimed, runs as {support.level}")
    wrong = [claim for claim in probe.claims(history) if not claim.holds(coarse=coarse)]
    faults = [(f"{probe.name}: {claim.text()}", claim.mend) for claim in wrong]
    return finding(name, faults, f"{probe.name}: {support.level}")


def _refusal(name: str, bench: Bench, support: Support, asked: Capability) -> Finding:
    missing = ", ".join(each.name for each in support.missing)
    if not support.missing and not support.notes:
        mend = "a refusal names the missing capabilities, or says in a note what stands against this scene"
        return Finding(check=name, status=FAIL, found="refused without a reason", mend=mend)
    declared = sorted(each.name for each in support.missing if each in bench.info.capabilities)
    if declared and not support.notes:
        mend = "take it out of info().capabilities, or say in a note what stands against this scene"
        return Finding(
            check=name, status=FAIL, found=f"refused for {', '.join(declared)}, which info() declares", mend=mend
        )
    why = f"lacks {missing}" if missing else "; ".join(support.notes)
    claimed = " (declared, but not in this scene)" if asked in bench.info.capabilities else ""
    return Finding(check=name, status=REFUSED, found=why + claimed)
