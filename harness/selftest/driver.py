"""Process of one engine: plants the edits, none for a right one, then runs every scene that it is given.

Standard input is a JSON object: ``engine`` (an id), ``edits`` (lists module, function, old, new) and ``requests`` (texts of the wire
format). Each request is answered in its own file; an engine that fails answers with its error. A request may ask for a run that stops
and is saved (``extra.save``: step and file), or for one that goes on from such a file (``extra.resume``).
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import Any

from ninedisk.harness.selftest.edits import Edit, plant


def preload() -> None:
    """Load what every run needs but the core, for the copies of this process: edits are planted before the core is loaded."""
    import gc
    import importlib

    for name in LOADED:
        importlib.import_module(name)
    gc.collect()
    gc.freeze()


LOADED = ("numba", "scipy.linalg", "scipy.sparse.linalg", "scipy.spatial", "ninedisk.harness.api.registry")
"""Modules that take a second to load."""


def main() -> None:
    """Serve the job on standard input."""
    job: dict[str, Any] = json.load(sys.stdin)
    plant([Edit(*edit) for edit in job["edits"]])
    # A wrong engine may well overflow; what it computes is judged elsewhere.
    warnings.simplefilter("ignore")
    from ninedisk.harness.api.registry import get_engine
    from ninedisk.harness.wire.protocol import WIRE_VERSION, Answer, decode_request, encode_answer

    engine: Any = get_engine(job["engine"])
    for text in job["requests"]:
        request = decode_request(text)
        try:
            if "save" in request.extra:
                engine.save(request.scene, request.numerics, request.watch, *request.extra["save"])
                continue
            if "resume" in request.extra:
                run = engine.resume(request.extra["resume"])
            else:
                run = engine.run(request.scene, request.numerics, request.watch)
            answer = encode_answer(Answer(run=run, engine_version=engine.info().version or ""))
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            answer = json.dumps({"wire_version": WIRE_VERSION, "error": said})
        Path(request.answer_file).write_text(answer, encoding="utf-8")


if __name__ == "__main__":
    main()
