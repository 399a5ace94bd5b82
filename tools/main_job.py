"""The main job: run every case on every engine of this machine, build the page, say what came out.

The page is built whatever the checks say, since it is the place to look a failure up. A failed check is a finding, and so is a cell that
ends as an error or a timeout: the exit status is 0, unless ``--strict`` is given. Wrong usage, a run that is not stored and a page that is
not built are errors.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from ninedisk.harness.run.journal import journals
from ninedisk.harness.run.process_guard import guarded_environment

FAILURE, INTERRUPTED = 3, 130
BROKEN = ("error", "timeout")


def ninedisk(*arguments: str) -> int:
    """Run the command line of the environment that this script runs in; its exit code."""
    process = subprocess.Popen([sys.executable, "-m", "ninedisk", *arguments], env=guarded_environment())
    try:
        return process.wait()
    except KeyboardInterrupt:  # the command has heard it as well, and ends by itself
        return process.wait() or INTERRUPTED


def statuses(rows: Path) -> Counter[str]:
    """Statuses of the measurements in a file written by ``ninedisk run --json``; none where it wrote no file."""
    return (
        Counter(row["status"] for row in json.loads(rows.read_text(encoding="utf-8"))) if rows.exists() else Counter()
    )


def changed_verdicts(store: str) -> str:
    """What errors and cells did since the run before, in one line; timings are left to ``ninedisk compare``."""
    command = f"ninedisk compare latest~1 latest --store {shlex.quote(store)}"
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "changes.json"
        words = [sys.executable, "-m", "ninedisk", *shlex.split(command)[1:], "--json", str(found)]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        if not found.exists():
            why = done.stderr.strip().removeprefix("error: ").splitlines()
            return f"nothing to compare with: {why[0] if why else 'ninedisk compare failed'}"
        changes = json.loads(found.read_text(encoding="utf-8"))["changes"]
    counts = Counter(each["verdict"] for each in changes if each["kind"] != "timing" and each["verdict"] != "same")
    reported = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common()) or "nothing moved"
    return f"{reported} ({command})"


def main() -> int:
    """Run, report, summarise; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--store", default="results", help="folder of the results, kept from run to run")
    parser.add_argument("--out", default="report", help="folder of the page")
    parser.add_argument("--engine-cmd", action="append", default=[], help="an engine by its command, beside all others")
    parser.add_argument("--jobs", default="auto", help="cells at once; auto: one for each core")
    parser.add_argument("--strict", action="store_true", help="end with 3 if a cell ends as an error or a timeout")
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "measurements.json"
        more = [word for command in options.engine_cmd for word in ("--engine-cmd", command)]
        more += ["--jobs", options.jobs]
        if journals(Path(options.store)):
            more.append("--resume")
        run = ninedisk(
            "run", "--all-engines", "--profile", "both", *more, "--store", options.store, "--json", str(rows)
        )
        if run == INTERRUPTED:
            if journals(Path(options.store)):
                print("make report, run again, runs what is missing.", file=sys.stderr)
            return run
        counts = statuses(rows)
    page = ninedisk("report", "--store", options.store, "--out", options.out)

    # Code 3 also says that nothing could be stored, or that no cell of an engine could run.
    broken = [f"{counts[status]} {status}" for status in BROKEN if counts[status]]
    found = run == FAILURE and bool(broken) and not options.strict
    reported = ", ".join(f"{count} {status}" for status, count in counts.most_common()) or "none"
    print(f"\nMeasurements: {reported}")
    if run in (0, 1, 3):
        print(f"Since the run before: {changed_verdicts(options.store)}")
    if run == 1:
        print("Some checks fail: the page lists them first.")
    elif run == FAILURE and broken:
        print(f"Some cells ended without a result, {' and '.join(broken)}: the page lists them first.")
    elif run > 1:
        print(
            f"The run ended with exit code {run}: nothing was run or stored, or an engine can run no cell (see above)."
        )
    if page == 0:
        print(f"The page: {Path(options.out).resolve() / 'index.html'}")
    else:
        print(f"The page was not built: ninedisk report ended with exit code {page}.")
    return run if run > 1 and not found else page


if __name__ == "__main__":
    sys.exit(main())
