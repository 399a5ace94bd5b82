"""A third-party engine that speaks the wire format and can misbehave: ``python fake_engine.py MODE [FILE]``.

It moves every disk uniformly, which is the right answer for a scene without forces.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from typing import Any


def answer(request: dict[str, Any]) -> dict[str, Any]:
    disks, dt = request["scene"]["disks"], request["numerics"]["dt"]
    steps, n = request["sampled_steps"], len(disks["radius"])
    t = [step * dt for step in steps]
    x = [[[disks["x"][i][k] + disks["v"][i][k] * now for k in (0, 1)] for i in range(n)] for now in t]
    return {
        "wire_version": 1,
        "engine_version": "0.1",
        "timings": {"setup": 0.0, "warm_up": 0.0, "advance": 0.0},
        "settings": {"note": "uniform motion"},
        "history": {
            "step": steps,
            "t": t,
            "x": x,
            "v": [disks["v"] for _ in steps],
            "angle": [[w * now for w in disks["omega"]] for now in t],
            "omega": [disks["omega"] for _ in steps],
            "gap": None,
            "fn": None,
            "fs": None,
            "force_meaning": "instantaneous",
            "wall_point": None,
            "wall_angle": None,
            "wall_force": None,
            "energy": {},
        },
    }


def main() -> None:
    mode = sys.argv[1]
    print("Welcome to the fake engine {not an answer}")
    if mode == "hang":
        print("about to hang", file=sys.stderr, flush=True)
        time.sleep(3600)
    if mode == "abort":
        print("terminate called after something", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGABRT)
    if mode == "segfault":
        print("about to read address 0", file=sys.stderr, flush=True)
        ctypes.string_at(0)
    if mode == "killed":
        print("the machine runs out of memory", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
    if mode == "exit":
        print("no licence found", file=sys.stderr)
        sys.exit(7)
    if mode == "orphan":
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
        with open(sys.argv[2], "w", encoding="utf-8") as out:
            out.write(str(child.pid))
    if mode == "flood":
        for _ in range(3000):
            sys.stderr.write("x" * 999 + "\n")
            sys.stdout.write("y" * 999 + "\n")
    request = json.load(sys.stdin)
    given = answer(request)
    if mode == "nan":
        given["history"]["x"][2][-1][0] = float("nan")
    if mode == "gives-up":
        given = {"wire_version": 1, "error": "cannot do walls"}
    text = json.dumps(given)
    if mode == "garbage":
        text = "Segmentation fault (core dumped)"
    if mode == "truncated":
        text = text[: len(text) // 2]
    if mode != "silent":
        with open(request["answer_file"], "w", encoding="utf-8") as out:
            out.write(text)


main()
