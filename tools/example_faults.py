"""Plant one-token faults in an example engine and count what `ninedisk run` and `ninedisk check-engine` find.

    python tools/example_faults.py tools/example_faults/plane.toml
    python tools/example_faults.py tools/example_faults/space.toml --fault 'mass-*' --cases spheres/chung-ooi/1

A TOML file of faults has three keys and a list:

    source = "docs/examples/spring_dem.c"                            # the engine, from the root of the tree
    build = ["gcc", "-O2", "-o", "{engine}", "{source}", "-lm"]      # left out: the source is run by Python
    space = false                                                    # true: the cases of space are run

    [[fault]]
    name = "mass-first"                                              # unique
    what = "every disk has the mass of disk 0"
    old = "(k < 2 ? mass[i] : inertia[i])"                           # occurs exactly once in the source
    new = "(k < 2 ? mass[0] : inertia[i])"

Each fault is planted in a copy in a temporary folder. The exit code is 0 if `run` finds every fault and neither command
finds one in the engine as it is. The tool is no part of CI: every fault runs all cases.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import shlex
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from ninedisk.harness.api.registry import match_cases

ROOT = Path(__file__).resolve().parents[1]
CLEAN = {"name": "unchanged", "what": "the engine as it is", "old": "", "new": ""}


def ninedisk(folder: Path, *arguments: str) -> list[dict[str, str]]:
    """Rows of a command of ninedisk as its ``--json`` has them."""
    rows = folder / "rows.json"
    rows.unlink(missing_ok=True)
    command = [sys.executable, "-m", "ninedisk", *arguments, "--json", str(rows)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
    if not rows.exists():
        raise SystemExit(f"{shlex.join(command)} ended with {done.returncode}:\n{done.stderr}")
    found = json.loads(rows.read_text())
    listed: list[dict[str, str]] = found["findings"] if isinstance(found, dict) else found
    return listed


def planted(source: str, fault: dict[str, str]) -> str:
    """The source with the fault.

    Raises
    ------
    SystemExit
        If the text to replace does not occur exactly once.
    """
    if fault is CLEAN:
        return source
    if (count := source.count(fault["old"])) != 1:
        raise SystemExit(f"fault {fault['name']!r}: the text {fault['old']!r} occurs {count} times; it must occur once")
    return source.replace(fault["old"], fault["new"])


def engine_of(text: str, about: dict[str, list[str] | str], folder: Path) -> str:
    """The command of an engine with this source, built in the folder."""
    source = folder / Path(str(about["source"])).name
    source.write_text(text)
    if "build" not in about:
        return shlex.join([sys.executable, str(source)])
    engine = folder / "engine"
    subprocess.run([each.format(engine=engine, source=source) for each in about["build"]], check=True)
    return str(engine)


def run_found(folder: Path, engine: str, cases: list[str], jobs: str) -> tuple[int, str]:
    """How many checks of a run do not pass, and the case of the first."""
    store = folder / "results"
    rows = ninedisk(folder, "run", *cases, "--engine-cmd", engine, "--jobs", jobs, "--store", str(store))
    wrong = [row for row in rows if row["status"] in ("fail", "error", "timeout")]
    return len(wrong), wrong[0]["case"] if wrong else ""


def check_found(folder: Path, engine: str) -> tuple[int, str]:
    """How many rows of check-engine fail, and the first."""
    wrong = [
        row["check"] for row in ninedisk(folder, "check-engine", "--engine-cmd", engine) if row["status"] == "fail"
    ]
    return len(wrong), wrong[0] if wrong else ""


def main() -> int:
    """Run the command line; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("faults", type=Path, help="TOML file of faults")
    parser.add_argument(
        "--fault", action="append", metavar="GLOB", help="faults by name (default: all); repeat for several"
    )
    parser.add_argument("--cases", action="append", metavar="GLOB", help="cases to run (default: all of the dimension)")
    parser.add_argument("--only", choices=("run", "check-engine"), help="one of the two commands alone")
    parser.add_argument("--jobs", default="1", help="cells at once (default: 1)")
    given = parser.parse_args()
    about = tomllib.loads(given.faults.read_text())
    source = (ROOT / about["source"]).read_text()
    cases = [
        name for name in match_cases(given.cases or ()) if given.cases or name.startswith("spheres/") == about["space"]
    ]
    faults = [each for each in about["fault"] if any(fnmatch.fnmatch(each["name"], g) for g in given.fault or "*")]
    texts = [(each, planted(source, each)) for each in (CLEAN, *faults)]
    by_run = by_check = 0
    false_alarm = False
    print("| fault | what | fails in run | first case | fails in check-engine | first row |\n|---|---|---|---|---|---|")
    for fault, text in texts:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            engine = engine_of(text, about, folder)
            checked = (0, "-") if given.only == "run" else check_found(folder, engine)
            run = (0, "-") if given.only == "check-engine" else run_found(folder, engine, cases, given.jobs)
        cells = (fault["name"], fault["what"], *run, *checked)
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
        if fault is CLEAN:
            false_alarm = run[0] + checked[0] > 0
        else:
            by_run += run[0] > 0
            by_check += checked[0] > 0
    print(f"\n{len(faults)} faults: {by_run} found by run, {by_check} by check-engine")
    return 0 if by_run == len(faults) and not false_alarm else 1


if __name__ == "__main__":
    sys.exit(main())
