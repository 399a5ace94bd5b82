"""An engine behind the wire protocol that misbehaves as given: ``python bad_engine.py MODE describe|run``.

Where it does not misbehave it moves every disk uniformly: a well-formed answer, right until disks touch.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

ABOUT: dict[str, Any] = {
    "wire_version": 1,
    "id": "bad",
    "version": "0.1",
    "contact": "impulse",
    "scheme": "none",
    "capabilities": ["restitution"],
    "options": {"effort": {"default": 3, "low": 1, "whole": True, "why": "three suffice"}},
}


def answer(request: dict[str, Any]) -> dict[str, Any]:
    disks, dt, steps = request["scene"]["disks"], request["numerics"]["dt"], request["sampled_steps"]
    t = [step * dt for step in steps]
    x = [
        [[p + u * now for p, u in zip(*both, strict=True)] for both in zip(disks["x"], disks["v"], strict=True)]
        for now in t
    ]
    unseen = dict.fromkeys(("gap", "fn", "fs", "wall_point", "wall_angle", "wall_force", "angle", "omega"))
    history = {"step": steps, "t": t, "x": x, "v": [disks["v"] for _ in t], "force_meaning": "step-mean", "energy": {}}
    return {
        "wire_version": 1,
        "engine_version": "0.1",
        "timings": {"setup": 0.0, "warm_up": 0.0, "advance": 0.0},
        "settings": {"effort": request["numerics"]["options"].get("bad.effort", 3)},
        "history": {**unseen, **history},
    }


def break_text(mode: str, text: str) -> str:
    return {
        "silent": "",
        "banner": "Welcome to the engine {v1}\n" + text,
        "trailing": text + "\ndone in 3 s\n",
        "garbage": "Segmentation fault (core dumped)",
        "cut": text[: len(text) // 2],
        "bare-nan": text.replace('"advance": 0.0', '"advance": -nan'),
        "list": f"[{text}]",
        "deep": "[" * 100_000,
        "binary": "\x00\x1b[2J" * 40,
    }.get(mode, text)


def break_answer(mode: str, given: dict[str, Any], folder: Path) -> dict[str, Any]:
    history = given["history"]
    if mode == "nan":
        history["x"][2][-1][0] = float("nan")
    if mode == "missing-key":
        del history["fs"]
    if mode == "extra-key":
        history["velocity"] = history["v"]
    if mode == "shape":
        history["v"] = [row[:1] for row in history["v"]]
    if mode == "ragged":
        history["x"][1] = history["x"][1][:1]
    if mode == "few-steps":
        history.update({key: value[:-1] for key, value in history.items() if isinstance(value, list)})
    if mode == "times":
        history["t"][3] += 1e-3
    if mode == "infinite":
        history["fn"] = [[float("inf")] for _ in history["t"]]
    if mode == "words":
        history["t"][1] = "0.01"
    if mode == "huge":
        history["t"][1] = 10**400
    if mode == "version":
        given["wire_version"] = 2
    if mode == "escape":
        given["engine_version"] = "\x1b[2J\ud800"
    if mode == "odd-settings":
        given["settings"] = {"a": float("nan"), "b": "\ud800\x1b[2J", "c": [[1], {"d": None}], "\ud800": 10**400}
    if mode == "gives-up":
        return {"wire_version": 1, "error": "cannot do \x1b[2J walls"}
    if mode == "unsupported":
        return {"wire_version": 1, "unsupported": "one disk only"}
    if mode.startswith("npz"):
        given["history"] = {"file": npz(mode, history, folder), "force_meaning": "step-mean"}
    return given


def npz(mode: str, history: dict[str, Any], folder: Path) -> str:
    import numpy as np

    if mode == "npz-nowhere":
        return "../history.npz"
    if mode == "npz-garbage":
        (folder / "history.npz").write_bytes(b"PK\x03\x04 no archive")
        return "history.npz"
    arrays = {key: np.array(history[key]) for key in ("step", "t", "x", "v")}
    arrays["energy.kinetic"] = np.ones(len(arrays["t"]))
    if mode == "npz-objects":
        arrays["x"] = np.array([{} for _ in arrays["t"]])
    if mode == "npz-names":
        arrays["velocity"] = arrays["v"]
    if mode == "npz-shape":
        arrays["v"] = arrays["v"][:, :1]
    np.savez(folder / "history.npz", **arrays)  # type: ignore[arg-type]
    return "history.npz"


def describe(mode: str) -> None:
    about = dict(ABOUT)
    if mode == "about-missing":
        del about["contact"]
    if mode == "about-capability":
        about["capabilities"] = ["friktion"]
    if mode == "about-id":
        about["id"] = "no id.at all"
    if mode == "about-option":
        about["options"] = {"effort": {"default": 0, "low": 1, "why": "none"}}
    if mode == "about-scheme":
        about["scheme"] = "moreau-jean"
    if mode == "about-sweeps":
        about["sweeps"] = "efort"
    if mode == "about-taken":
        about["id"] = "dem"
    text = json.dumps(about)
    if mode == "about-late":
        time.sleep(3600)
    if mode == "about-exit":
        sys.exit("no licence found")
    print(f"Hello\n{text}" if mode == "about-banner" else text)


def main() -> None:
    mode, verb = sys.argv[1:]
    if verb == "describe":
        describe(mode)
        return
    if mode == "late":
        print("about to hang", file=sys.stderr, flush=True)
        time.sleep(3600)
    if mode == "hog":
        held = [b"x" * 20_000_000 for _ in range(40)]  # no more, so that a limit that does not act harms nobody
        time.sleep(1.0)
        del held
    if mode == "killed":
        print("the machine runs out of memory", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
    if mode == "loud":
        print("\n".join(f"frame {k}: {'z' * 500}" for k in range(50)), "no licence found", sep="\n", file=sys.stderr)
        sys.exit(3)
    if mode == "exit":
        print("no licence found", file=sys.stderr)
        sys.exit(3)
    if mode in ("flood", "endless"):
        while mode == "endless":
            sys.stdout.write("y" * 65536)
        for _ in range(66 * 16):
            sys.stdout.write("y" * 65536)
        return
    request = json.load(sys.stdin)
    given = break_answer(mode, answer(request), Path(request["answer_file"]).parent)
    text = break_text(mode, json.dumps(given))
    if mode == "answer-file":
        print("Welcome to the engine")
        Path(request["answer_file"]).write_text(text, encoding="utf-8")
    else:
        print(text)


main()
