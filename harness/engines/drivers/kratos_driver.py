"""Driver of Kratos DEM: a request of the wire format on standard input, an answer file out.

It runs under the harness' Python and shares nothing with the harness but the wire format. Kratos writes into the current folder and
much to standard output.
"""

import json
import os
import sys
import time
from importlib import metadata

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps this folder off the path


def main():
    """Read the request, run it, write the answer; any exception becomes an ``error`` answer."""
    begin = time.perf_counter()
    request = json.load(sys.stdin)
    try:
        from kratos_run import Run
        from lammps_history import history  # plain numpy, nothing of LAMMPS

        run = Run(request)
        run.start()
        setup = time.perf_counter() - begin
        advance = run.advance(request["sampled_steps"])
        answer = {
            "wire_version": 1,
            "engine_version": metadata.version("KratosDEMApplication"),
            "timings": {"setup": setup, "warm_up": 0.0, "advance": advance},
            "settings": {"contact law": run.law_name, "edge half-length [m]": run.reach},
            "history": history(run),
        }
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"wire_version": 1, "error": f"{type(error).__name__}: {error}"}
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))  # dump() would take the slow encoder


if __name__ == "__main__":
    main()
