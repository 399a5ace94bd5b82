"""Driver of LIGGGHTS: a request of the wire format on standard input, an answer file out.

It runs under the harness' Python, holds LIGGGHTS as a library and shares nothing with the harness but the wire format.
"""

import json
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps this folder off the path


def main():
    """Read the request, run it, write the answer; any exception becomes an ``error`` answer."""
    begin = time.perf_counter()
    request = json.load(sys.stdin)
    try:
        from lammps_history import history  # plain numpy, nothing of LAMMPS
        from liggghts_run import Run

        run = Run(request)
        run.start()
        setup = time.perf_counter() - begin
        advance = run.advance(request["sampled_steps"])
        answer = {
            "wire_version": 1,
            "engine_version": request["extra"]["version"],
            "timings": {"setup": setup, "warm_up": 0.0, "advance": advance},
            "settings": {"contact model": run.model + run.limit, "plate half-length [m]": run.reach},
            "history": history(run),
        }
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"wire_version": 1, "error": f"{type(error).__name__}: {error}"}
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))  # dump() would take the slow encoder
    sys.stderr.flush()
    os._exit(0)  # MPI's own exit would complain that it was not finalised


if __name__ == "__main__":
    main()
