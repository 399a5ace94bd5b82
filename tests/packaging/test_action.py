"""The GitHub Action: its steps, literally, with the example engine, with engines that have one fault each, and what is annotated."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from ninedisk.harness.api.capabilities import Capability, wire_name
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.api.support import OF_SLIP_AT
from ninedisk.harness.wire.command import spring_needs

yaml = pytest.importorskip("yaml")  # no dependency of ours

ROOT = Path(__file__).parents[2]
TIER = 60.0
"""Seconds that the smoke tier may take, see action.yml; here of processors, since other tests run beside it."""


def processors() -> float:
    """Seconds that processes which have ended took of processors."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_steps(inputs: dict[str, str], folder: Path, without: str = "") -> tuple[dict[str, str], int, float]:
    """Output of each ``run`` step, the last one's exit code, processors' seconds of check and run; uploading is GitHub's."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    given = {name: about.get("default", "") for name, about in action["inputs"].items()} | inputs
    outputs: dict[tuple[str, str], str] = {}
    said, code, took = {}, 0, 0.0

    def filled(text: str) -> str:
        text = re.sub(r"\$\{\{ inputs\.([a-z-]+) \}\}", lambda m: given[m[1]], text)
        return re.sub(r"\$\{\{ steps\.([a-z]+)\.outputs\.([a-z]+) \}\}", lambda m: outputs[m[1], m[2]], text)

    for step in action["runs"]["steps"]:
        if "run" not in step or step["name"] in ("Install", without):  # this very environment has it installed
            continue
        told = folder / f"outputs-{step['name']}"
        told.touch()
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        own = {name: filled(str(value)) for name, value in step.get("env", {}).items()}
        begin = processors()
        done = subprocess.run(["bash", "-eo", "pipefail", "-c", step["run"]], cwd=folder, capture_output=True, text=True, check=False,
                              env={**os.environ, "PATH": path, "GITHUB_OUTPUT": str(told), **own})  # fmt: skip
        took += processors() - begin if step["name"] in ("Check", "Run") else 0.0
        said[step["name"]], code = done.stdout + done.stderr, done.returncode
        for line in told.read_text().splitlines():
            name, _, value = line.partition("=")
            outputs[step["id"], name] = value
        if code:
            break
    return said, code, took


LEAST = "linear-contact shear-spring friction contact-damping gravity disk-inertia lever-arm-radius"
"""Capabilities without which no engine of springs with friction gets a scene; all that the engines here declare."""

FAULTS = {
    "friction torque reversed": ("load[body][2] += arm * fs", "load[body][2] -= arm * fs"),
    "friction torque halved": ("load[body][2] += arm * fs", "load[body][2] += 0.5 * arm * fs"),
    "friction torque with the other arm": ("((i, 1.0, arms[0]), (j, -1.0, arms[1]))", "((i, 1.0, arms[1]), (j, -1.0, arms[0]))"),
    "friction a fifth too small": ('-law["mu"] * fn, min(law["mu"] * fn,', '-0.8 * law["mu"] * fn, min(0.8 * law["mu"] * fn,'),
    "friction squared": ('-law["mu"] * fn, min(law["mu"] * fn,', '-law["mu"]**2 * fn, min(law["mu"]**2 * fn,'),
    "friction without a cap": ('max(-law["mu"] * fn, min(law["mu"] * fn, shear - law["ks"] * slip))', 'shear - law["ks"] * slip'),
    "slip without the spin of the second body": ("+ arms[0] * wi + arms[1] * wj", "+ arms[0] * wi"),
    "gravity a twentieth too strong": ("mass * g for g in", "1.05 * mass * g for g in"),
    "gravity along y alone": ('(*scene["gravity"], 0.0)', '(0.0, scene["gravity"][1], 0.0)'),
    "weight of the first disk for all": ("mass * g for g in", "m[0] * g for g in"),
    "mass of the first disk for all": ("gain * load[i][k] / m[i]", "gain * load[i][k] / m[0]"),
    "inertia of the first disk for all": ('disks["inertia"][i]', 'disks["inertia"][0]'),
    "inertia of a sphere": ('/ disks["inertia"][i]', '/ (0.8 * disks["inertia"][i])'),
    "radius of the first disk for all": ("v[j], R[j],", "v[j], R[0],"),
    "dashpot of the first mass": ("1.0 / m[i] + 1.0 / m[j]", "2.0 / m[i]"),
    "dashpot a tenth too weak": ('2.0 * law["beta"]', '1.8 * law["beta"]'),
    "spins at the start ignored": ('zip(disks["v"], disks["omega"], strict=True)', '((u, 0.0) for u in disks["v"])'),
    "velocities damped": ('scene["xi"]', '0.01 + scene["xi"]'),
    "velocities of the half step before": ("0.5 * (v[i][k] + after[i][k])", "v[i][k]"),
    "spins reported clockwise": ('"omega": [u[2] for u in at_t]', '"omega": [-u[2] for u in at_t]'),
    "shear forces reported with the other sign": ('"fs": [found[i, j][2]', '"fs": [-found[i, j][2]'),
    "forces reported twice as large": ('"fn": [found[i, j][1]', '"fn": [2.0 * found[i, j][1]'),
    "gaps two millimetres too large": ('"gap": [found[i, j][0] for', '"gap": [found[i, j][0] + 2e-3 for'),
    "walls two millimetres deeper": ("(x[i][1] - py) * ny - R[i]", "(x[i][1] - py) * ny - R[i] + 2e-3"),
}  # fmt: skip
"""What is wrong, and the edit of the example engine that makes it so; some are those of `ninedisk.harness.selftest.faulty_engines`."""


def least_engine(fault: str = "") -> str:
    """Source of the example engine that declares `LEAST` alone, with a fault."""
    source = (ROOT / "docs/examples/spring_dem.py").read_text(encoding="utf-8")
    declared = re.sub(r'(?s)(?<=CAPABILITIES = """).*?(?=""")', LEAST, source)
    assert declared != source
    if not fault:
        return declared
    old, new = FAULTS[fault]
    assert declared.count(old) == 1, f"{fault}: {old!r} is there {declared.count(old)} times"
    return declared.replace(old, new)


def engine_in(folder: Path, source: str) -> dict[str, str]:
    """Inputs of the action for an engine of this source."""
    (folder / "engine.py").write_text(source, encoding="utf-8")
    return {"engine-cmd": f"{sys.executable} engine.py", "engine-file": "engine.py"}


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["", *FAULTS])
def test_an_engine_with_one_fault_is_never_green(tmp_path: Path, fault: str) -> None:
    """Third-party engines that declare as little as they can: the right one is green, every other is not."""
    said, code, _ = run_steps(engine_in(tmp_path, least_engine(fault)), tmp_path, "Pages")
    failed = sorted(set(re.findall("title=ninedisk ([^:]*)", said["Annotate"])))
    print(f"{fault or 'none'} | exit code {code} | {', '.join(failed)}")
    assert code == (1 if fault else 0), said
    assert bool(failed) == bool(fault)


def test_each_fault_can_be_planted() -> None:
    sources = {least_engine(fault) for fault in ("", *FAULTS)}
    assert len(sources) == len(FAULTS) + 1 > 20
    for source in sources:
        compile(source, "engine.py", "exec")


def test_the_smoke_tier_asks_for_no_more_than_the_least() -> None:
    """Each of its cases has a variant that an engine with the least declaration runs."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    names = {wire_name(each): each for each in Capability}
    least = {names[name] for name in LEAST.split()} | OF_SLIP_AT
    for case in action["inputs"]["cases"]["default"].split():
        setups = [get_case(case).build(resolve(get_case(case), row).params) for row in get_case(case).matrix()]
        assert any(spring_needs(setup.scene, setup.numerics) <= least for setup in setups), case


@pytest.mark.parametrize("broken", [pytest.param(False, marks=pytest.mark.slow), True])
def test_its_steps_judge_annotate_and_keep_the_pages(tmp_path: Path, broken: bool) -> None:
    engine = tmp_path / "engine.py"
    source = (ROOT / "docs/examples/spring_dem.py").read_text()
    assert source.count("mass * g for g in") == 1
    engine.write_text(source.replace("mass * g for g in", "1.05 * mass * g for g in") if broken else source)
    inputs = {"engine-cmd": f"{sys.executable} engine.py"}
    inputs |= {"engine-file": "engine.py", "cases": "slip-to-roll"} if broken else {}
    said, code, took = run_steps(inputs, tmp_path, "" if broken else "Pages")  # made where they are needed most
    assert took < TIER
    assert code == (1 if broken else 0), said
    assert ("::error file=engine.py,line=1,title=ninedisk " in said["Annotate"]) == broken
    if broken:
        assert "title=ninedisk check-engine::" in said["Annotate"]
        assert "found " in said["Annotate"]
        assert (tmp_path / "ninedisk-results/report/index.html").is_file()
        assert list((tmp_path / "ninedisk-results/site/badge").glob("*.svg"))


@pytest.mark.parametrize(("checked", "ran", "verdict"), [(0, 0, 0), (1, 0, 1), (0, 1, 1), (1, 3, 3), (2, 1, 2)])
def test_the_verdict_is_the_worst_of_both(checked: int, ran: int, verdict: int) -> None:
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    (step,) = [step for step in action["runs"]["steps"] if step["name"] == "Verdict"]
    codes = {"CHECKED": str(checked), "RAN": str(ran)}
    assert subprocess.run(["bash", "-c", step["run"]], env={**os.environ, **codes}, check=False).returncode == verdict


def test_a_case_that_the_engine_cannot_run_is_not_green(tmp_path: Path) -> None:
    """An engine without friction: nothing of rolling was tested, which has to be said, or allowed."""
    smooth = least_engine().replace(LEAST, "linear-contact contact-damping gravity")
    inputs = {**engine_in(tmp_path, smooth), "cases": "spinning-disk"}
    said, code, _ = run_steps(inputs, tmp_path, "Pages")
    assert code == 3, said
    assert "can run no variant of spinning-disk: it lacks " in said["Run"]
    _, code, _ = run_steps({**inputs, "allow-unsupported": "true"}, tmp_path, "Pages")
    assert code == 0
