"""Runs a driver several times in one process: standard input is a JSON object with ``driver`` (its path) and ``requests`` (texts).

Each run answers in its own file, or not at all where it fails. Plain Python, as it runs inside other programs.
"""

import contextlib
import io
import json
import os
import runpy
import sys
import traceback

job = json.load(sys.stdin)
if not getattr(sys.flags, "safe_path", False):
    sys.path[0] = os.path.dirname(job["driver"])  # as where it is the script itself
leave = os._exit
os._exit = sys.exit  # drivers end so, where their program's own end is not to be trusted
given = {
    name: value for name, value in globals().items() if not name.startswith("__")
}  # YADE gives its names to a script
for text in job["requests"]:
    sys.stdin = io.StringIO(text)
    try:
        with contextlib.suppress(SystemExit):
            runpy.run_path(job["driver"], init_globals=given, run_name="__main__")
    except Exception:
        traceback.print_exc()
sys.stdout.flush()
sys.stderr.flush()
leave(0)
