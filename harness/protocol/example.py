"""The request of one variant of a case, for trying an engine by hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ninedisk.harness.engines._spring import contact_steps
from ninedisk.harness.params import resolve
from ninedisk.harness.registry import get_case
from ninedisk.harness.wire import Request, encode_request

ANSWER_FILE = "answer.json"


def example_request(case_id: str, params: Mapping[str, Any]) -> str:
    """Text of the request, as an engine with contact springs gets it; others ignore ``contact_dt``.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown case or parameter, a value out of range, an impossible scene.
    """
    case = get_case(case_id)
    setup = case.build(resolve(case, params).params)
    numerics = setup.numerics.replace(contact_dt=contact_steps(setup.scene, setup.numerics)[1])
    return encode_request(Request(scene=setup.scene, numerics=numerics, watch=setup.watch, answer_file=ANSWER_FILE))
