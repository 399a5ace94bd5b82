"""The request of one variant of a case, for trying an engine by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ninedisk.harness.api.engine import Engine, SupportLevel, facts_of
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.api.support import contact_steps, support_of
from ninedisk.harness.run.plan import plan_case
from ninedisk.harness.run.runner import unsupported_reason
from ninedisk.harness.wire.command import CommandEngine
from ninedisk.harness.wire.protocol import Request, encode_request

ANSWER_FILE = "answer.json"


def example_request(
    case_id: str,
    params: Mapping[str, Any],
    engine: Engine | None = None,
    options: Mapping[str, Any] | None = None,
    notify: Callable[[str], None] = lambda _: None,
) -> str:
    """Text of the request as an engine gets it, its ``options`` in it; ``notify`` hears if a run does not ask it.

    Without an engine it is that of an engine with contact springs; others ignore ``contact_dt``.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown case, parameter or option, a value out of range, or an impossible scene.
    EngineError
        If the engine does not say what it is.
    """
    if engine is not None:
        setup = plan_case(case_id, engine, params, options).setup
        if isinstance(setup, Exception):
            raise setup
        support = support_of(engine, setup.scene, setup.numerics)
        if support.level is SupportLevel.NO:
            notify(f"a run does not ask {engine.id} for this: {unsupported_reason(facts_of(engine), support)}")
        scene, numerics = setup.scene, setup.numerics
        if isinstance(engine, CommandEngine):
            scene, numerics = engine.asked(scene, numerics)
        elif facts_of(engine).contact == "spring":
            numerics = numerics.replace(contact_dt=contact_steps(scene, numerics)[1])
    else:
        if options:
            raise UsageError("--option belongs to an engine: add --engine ID or --engine-cmd COMMAND")
        case = get_case(case_id)
        setup = case.build(resolve(case, params).params)
        scene, numerics = setup.scene, setup.numerics.replace(contact_dt=contact_steps(setup.scene, setup.numerics)[1])
    return encode_request(Request(scene=scene, numerics=numerics, watch=setup.watch, answer_file=ANSWER_FILE))
