#!/usr/bin/env bash
# What: a Box2D world with sleep switched off puts bodies to sleep half a second after they rest; only the flag of each body keeps it awake.
# Versions: Box2D 2.3.10 (PyPI, pybox2d)
# Why a good guess misses: doSleep=False and world.allowSleeping=False both read back as False. Contacts of a sleeping body report no
#   impulse, so a scale under a resting body shows 0.
# Documentation: pybox2d manual, b2World: doSleep and allowSleeping as the switch of the world; b2BodyDef: allowSleep.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install Box2D==2.3.10 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import sys

import Box2D as b2


def awake_after_two_seconds(of_world, of_body):
    """Whether a disk that lies on the ground is awake after 2 s, and what the world says of sleep."""
    world = b2.b2World(gravity=(0, -10), doSleep=of_world)
    world.allowSleeping = of_world
    world.CreateStaticBody(position=(0, -1), shapes=b2.b2PolygonShape(box=(50, 1)))
    body = world.CreateDynamicBody(position=(0, 0.51), allowSleep=of_body)
    body.CreateCircleFixture(radius=0.5, density=1)
    for _ in range(120):
        world.Step(1 / 60, 6, 2)
    return body.awake, world.allowSleeping


print(f"Box2D {b2.__version__}: a disk at rest on the ground, after 2 s")
found = {}
for of_world in (True, False):
    for of_body in (True, False):
        awake, says = awake_after_two_seconds(of_world, of_body)
        found[of_world, of_body] = awake
        print(f"  world.allowSleeping {says}, the body's allowSleep {of_body}: {'awake' if awake else 'asleep'}")
as_described = found == {(True, True): False, (True, False): True, (False, True): False, (False, False): True}
print("as described: the world's switch does nothing" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py"
