"""The GitHub Action: its steps, literally, with the example engine; failing cells are annotated."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")  # no dependency of ours

ROOT = Path(__file__).parents[2]
TIER = 60.0
"""Seconds that the smoke tier may take, see action.yml; here of processors, since other tests run beside it."""


def processors() -> float:
    """Seconds that processes which have ended took of processors."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_steps(inputs: dict[str, str], folder: Path, without: str = "") -> tuple[dict[str, str], int, float]:
    """Output of each ``run`` step, the last one's exit code, processors' seconds of the run itself; uploading is GitHub's."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    given = {name: about.get("default", "") for name, about in action["inputs"].items()} | inputs
    outputs: dict[str, str] = {}
    said, code, took = {}, 0, 0.0

    def filled(text: str) -> str:
        text = re.sub(r"\$\{\{ inputs\.([a-z-]+) \}\}", lambda m: given[m[1]], text)
        return re.sub(r"\$\{\{ steps\.run\.outputs\.([a-z]+) \}\}", lambda m: outputs[m[1]], text)

    for step in action["runs"]["steps"]:
        if "run" not in step or step["name"] in ("Install", without):  # this very environment has it installed
            continue
        told = folder / "outputs"
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        own = {name: filled(str(value)) for name, value in step.get("env", {}).items()}
        begin = processors()
        done = subprocess.run(["bash", "-eo", "pipefail", "-c", step["run"]], cwd=folder, capture_output=True, text=True, check=False,
                              env={**os.environ, "PATH": path, "GITHUB_OUTPUT": str(told), **own})  # fmt: skip
        took += processors() - begin if step["name"] == "Run" else 0.0
        said[step["name"]], code = done.stdout + done.stderr, done.returncode
        outputs |= dict(line.split("=", 1) for line in told.read_text().splitlines())
        if code:
            break
    return said, code, took


@pytest.mark.parametrize("broken", [False, True])
def test_its_steps_judge_annotate_and_keep_the_pages(tmp_path: Path, broken: bool) -> None:
    engine = tmp_path / "engine.py"
    source = (ROOT / "docs/examples/spring_dem.py").read_text()
    assert source.count("mass * g for g in") == 1
    engine.write_text(source.replace("mass * g for g in", "1.05 * mass * g for g in") if broken else source)
    inputs = (
        {"engine-cmd": f"{sys.executable} engine.py", "engine-file": "engine.py", "cases": "slip-to-roll"}
        if broken
        else {"engine-cmd": f"{sys.executable} engine.py"}
    )
    said, code, took = run_steps(inputs, tmp_path, "" if broken else "Pages")  # made where they are needed most
    assert took < TIER
    assert code == (1 if broken else 0), said
    assert ("::error file=engine.py,line=1,title=ninedisk " in said["Annotate"]) == broken
    if broken:
        assert (tmp_path / "ninedisk-results/report/index.html").is_file()
        assert list((tmp_path / "ninedisk-results/site/badge").glob("*.svg"))
