#!/usr/bin/env bash
# What: Havok (for Babylon.js) brakes a free body slower than 0.1 m/s by 0.3 m/s^2 until it stands still, with all damping 0, no gravity,
#   no contact, and the body set to be always active. At 0.101 m/s it flies on for ever.
# Versions: @babylonjs/havok 1.3.10 (npm)
# Why a good guess misses: damping is 0, and what slows bodies before they sleep is expected to end with "always active".
# Documentation: HavokPhysics.d.ts of the package (HP_Body_SetLinearDamping, HP_Body_SetActivationControl): nothing on it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" @babylonjs/havok@1.3.10
cat > "$folder/run.mjs" <<'JS'
import { readFileSync } from "node:fs";
import init from "@babylonjs/havok";

const wasmBinary = readFileSync(new URL("HavokPhysics.wasm", import.meta.resolve("@babylonjs/havok")));
const havok = await init({ wasmBinary });
const [, world] = havok.HP_World_Create();
havok.HP_World_SetGravity(world, [0, 0, 0]);

// Speed of a free ball of 1 kg after each of some times.
function speeds(begin, times) {
  const [, body] = havok.HP_Body_Create();
  const [, shape] = havok.HP_Shape_CreateSphere([0, 0, 0], 0.5);
  havok.HP_Body_SetShape(body, shape);
  havok.HP_Body_SetMotionType(body, havok.MotionType.DYNAMIC);
  havok.HP_Body_SetMassProperties(body, [[0, 0, 0], 1, [0.1, 0.1, 0.1], [0, 0, 0, 1]]);
  havok.HP_Body_SetLinearDamping(body, 0);
  havok.HP_Body_SetAngularDamping(body, 0);
  havok.HP_World_AddBody(world, body, false);
  havok.HP_Body_SetActivationControl(body, havok.ActivationControl.ALWAYS_ACTIVE);
  havok.HP_Body_SetLinearVelocity(body, [begin, 0, 0]);
  const found = [];
  for (let step = 1; step <= Math.max(...times) * 60; step++) {
    havok.HP_World_Step(world, 1 / 60);
    if (times.includes(step / 60)) found.push(havok.HP_Body_GetLinearVelocity(body)[1][0]);
  }
  const active = havok.HP_Body_GetActivationState(body)[1] === havok.ActivationState.ACTIVE;
  havok.HP_World_RemoveBody(world, body);
  return { begin, found, active };
}
const times = [0.1, 0.2, 1];
const runs = [0.2, 0.101, 0.099, 0.05].map((begin) => speeds(begin, times));
console.log(`@babylonjs/havok 1.3.10: speed of a free ball after ${times.join(", ")} s`);
for (const { begin, found, active } of runs)
  console.log(`  ${begin} m/s: ${found.map((speed) => speed.toFixed(4)).join(", ")} m/s, ${active ? "active" : "asleep"}`);
const as_described = runs.every(
  ({ begin, found, active }) => active && (begin > 0.1 ? found.every((speed) => Math.abs(speed / begin - 1) < 1e-4) : found.at(-1) === 0),
);
console.log(as_described ? "as described: slow bodies stop" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
