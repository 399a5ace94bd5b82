"""Driver that runs inside ESyS-Particle (``mpirun -np 2 esysparticle esys_driver.py``): a request on standard input, an answer
file out. It runs under the system's Python and knows the wire format only.
"""

import json
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))

from esys.lsm import LsmMpi
from esys_run import Run
from lammps_history import history  # plain numpy, nothing of LAMMPS


def main():
    """Read the request, run it, write the answer; any exception becomes an ``error`` answer."""
    begin = time.perf_counter()
    request = json.load(sys.stdin)
    engine = LsmMpi(numWorkerProcesses=1, mpiDimList=[1, 1, 1])
    try:
        run = Run(engine, request)
        run.start()
        setup = time.perf_counter() - begin
        advance = run.advance(request["sampled_steps"])
        answer = {
            "wire_version": 1,
            "engine_version": engine.getLsmVersion().strip(),
            "timings": {"setup": setup, "warm_up": 0.0, "advance": advance},
            "settings": {"grid spacing [m]": run.spacing, "verlet distance [m]": run.skin},
            "history": history(run),
        }
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"wire_version": 1, "error": f"{type(error).__name__}: {error}"}
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))  # dump() would take the slow encoder
    engine.exit()  # without it the worker process waits for ever


main()
