"""Driver of an engine that is a Python package: ``package_driver.py module:Session``, request on stdin.

It runs under the harness' own Python. The session's module may name an ``ENGINE_VERSION``; the session, its ``settings`` and,
where its forces are no means over a step, their ``FORCE_MEANING``.
"""

import importlib
import json
import sys

from ninedisk.core.errors import CoreError
from ninedisk.harness.api.engine import EngineError, run_session
from ninedisk.harness.wire.protocol import WIRE_VERSION, Answer, decode_request, encode_answer


def preload() -> None:
    """Load the session, in a process of which runs are copies."""
    importlib.import_module(sys.argv[1].partition(":")[0])


def main() -> None:
    """Read the request, drive the session, write the answer file."""
    request = decode_request(sys.stdin.read())
    module, name = sys.argv[1].split(":")
    home = importlib.import_module(module)
    try:
        session = getattr(home, name)
        meaning = getattr(session, "FORCE_MEANING", "step-mean")
        run = run_session(session, request.scene, request.numerics, request.watch, force_meaning=meaning)
        text = encode_answer(Answer(run=run, engine_version=str(getattr(home, "ENGINE_VERSION", "unknown"))))
    except (CoreError, EngineError) as error:
        text = json.dumps({"wire_version": WIRE_VERSION, "error": str(error)})
    with open(request.answer_file, "w", encoding="utf-8") as out:
        out.write(text)


if __name__ == "__main__":
    main()
