#!/usr/bin/env bash
# What: In Rapier 3D a body whose z translation and x and y rotations are locked (motion in a plane) slides without any friction.
# Versions: @dimforge/rapier3d-compat 0.21.0 (npm)
# Why a good guess misses: each lock alone leaves friction as it is, and none of the locked axes takes part in the sliding. With all
#   three, friction across the sliding direction is lost together with the one along it.
# Documentation: Rapier's user guide, page "Rigid-bodies" (section "Locking translations/rotations"), says only that axes are locked.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" @dimforge/rapier3d-compat@0.21.0
cat > "$folder/run.mjs" <<'JS'
import RAPIER from "@dimforge/rapier3d-compat";

await RAPIER.init();
// A box slides along x on a floor with friction 0.5 at 2 m/s: it should stop after 2/(0.5 9.81) = 0.41 s. One second is run.
function speed_after(translations, rotations) {
  const world = new RAPIER.World({ x: 0, y: -9.81, z: 0 });
  const add = (body, shape) => {
    const made = world.createRigidBody(body);
    world.createCollider(shape.setFriction(0.5), made);
    return made;
  };
  add(RAPIER.RigidBodyDesc.fixed().setTranslation(0, -0.5, 0), RAPIER.ColliderDesc.cuboid(50, 0.5, 50));
  const box = add(
    RAPIER.RigidBodyDesc.dynamic()
      .setTranslation(0, 0.5, 0)
      .setLinvel(2, 0, 0)
      .setCanSleep(false)
      .enabledTranslations(...translations)
      .enabledRotations(...rotations),
    RAPIER.ColliderDesc.cuboid(0.5, 0.5, 0.5),
  );
  for (let step = 0; step < 60; step++) world.step();
  return box.linvel().x;
}
const all = [true, true, true];
const [no_z, only_z] = [[true, true, false], [false, false, true]];
const found = {
  "no lock": speed_after(all, all),
  "z translation locked": speed_after(no_z, all),
  "x, y rotations locked": speed_after(all, only_z),
  "both": speed_after(no_z, only_z),
};
console.log(`rapier3d ${RAPIER.version()}: speed of 2 m/s after 1 s with friction 0.5`);
for (const [name, speed] of Object.entries(found)) console.log(`  ${name}: ${speed.toFixed(4)} m/s`);
const { both, ...others } = found;
const as_described = both > 1.99 && Object.values(others).every((speed) => Math.abs(speed) < 0.01);
console.log(as_described ? "as described: no friction with both locks" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
