"""Extreme values of every parameter of every case: none that is allowed asks for absurd time or memory, none fails unforeseen."""

from __future__ import annotations

import math
import time

import pytest

from ninedisk.core.errors import CoreError
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import Parameter, ParameterError
from ninedisk.harness.api.registry import BUILTIN_CASES, get_case
from ninedisk.harness.run.plan import plan_case

EXTREMES = (1e-30, 1e-6, 1e6, 1e30, 1e99)

STEPS, CONTACT_STEPS, NUMBERS = 1e6, 1e7, 1e8
"""What a run of minutes takes, and 0.8 GB hold."""
SECONDS = 20.0
"""Of this process to build one variant. An idle machine needs a second at most, a slow and busy one several; what grows with a value as
far out as `EXTREMES` takes minutes or all memory."""


def extremes(parameter: Parameter) -> list[float]:
    """Ends of the range and values far out; none for words and switches."""
    if isinstance(parameter.default, bool) or parameter.choices:
        return []
    ends = [end for end in (parameter.low, parameter.high) if math.isfinite(end)]
    return sorted({*ends, *(value for value in EXTREMES if parameter.low <= value <= parameter.high)})


def contact_steps(numerics: Numerics) -> float:
    return numerics.n_steps * (1.0 if numerics.contact_dt is None else round(numerics.dt / numerics.contact_dt))


def fault(case_id: str, name: str, value: float) -> str:
    """What is wrong with a value; empty where it is refused by name or leads to a run of a sensible size."""
    begin = time.process_time()
    said = ""
    try:
        cell = plan_case(case_id, "dem", {name: value})
    except (ParameterError, CoreError) as error:
        if f"{name} =" not in str(error) and f"{name}=" not in str(error):
            said = f"the error does not name it: {error}"
    else:
        if isinstance(cell.setup, Exception):
            return f"{type(cell.setup).__name__}: {cell.setup}"
        numerics, scene = cell.setup.numerics, cell.setup.scene
        last = numerics.n_steps if numerics.sample_until is None else min(numerics.sample_until, numerics.n_steps)
        samples = 3 + max(0, last - numerics.sample_from) // numerics.sample_every  # not counted one by one
        numbers = samples * (7 * len(scene.bodies) + 5 * len(scene.walls) + 3 * len(cell.setup.watch))
        if numerics.n_steps > STEPS or contact_steps(numerics) > CONTACT_STEPS or numbers > NUMBERS:
            said = f"{numerics.n_steps:.3g} steps, {contact_steps(numerics):.3g} contact steps, {numbers:.3g} numbers"
    took = time.process_time() - begin
    return said or (f"building takes {took:.1f} s" if took > SECONDS else "")


def test_there_are_cases_and_parameters() -> None:
    assert len(BUILTIN_CASES) >= 26
    assert sum(len(extremes(p)) for case_id in BUILTIN_CASES for p in get_case(case_id).parameters) >= 400


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case_id", list(BUILTIN_CASES))
def test_extreme_values_are_refused_by_name_or_cost_little(case_id: str) -> None:
    faults = [
        f"{parameter.name} = {value:g}: {said}"
        for parameter in get_case(case_id).parameters
        for value in extremes(parameter)
        if (said := fault(case_id, parameter.name, value))
    ]
    assert not faults, "\n".join(faults)
