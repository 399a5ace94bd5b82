#!/usr/bin/env bash
# What: In cannon-es a ball that is dropped on a floor with restitution 1, without damping, rises to 1.7 times the height within ten
#   bounces, now higher, now lower.
# Versions: cannon-es 0.20.0 (npm)
# Why a good guess misses: restitution 1 suggests the height of the fall, less a little, and the same change at each bounce.
# Documentation: cannon-es API, page "ContactMaterial": the restitution is a coefficient of the pair; nothing on energy.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" cannon-es@0.20.0
cat > "$folder/run.mjs" <<'JS'
import * as Cannon from "cannon-es";

const radius = 0.5;
const world = new Cannon.World({ gravity: new Cannon.Vec3(0, -9.81, 0) });
const material = new Cannon.Material();
world.addContactMaterial(new Cannon.ContactMaterial(material, material, { friction: 0, restitution: 1 }));
const floor = new Cannon.Body({ mass: 0, material, shape: new Cannon.Plane() });
floor.quaternion.setFromEuler(-Math.PI / 2, 0, 0);
world.addBody(floor);
const ball = new Cannon.Body({
  mass: 1,
  material,
  shape: new Cannon.Sphere(radius),
  position: new Cannon.Vec3(0, 1 + radius, 0),
  linearDamping: 0,
});
world.addBody(ball);
const heights = [];
for (let step = 0; step < 600; step++) {
  const before = ball.velocity.y;
  world.step(1 / 60);
  if (before > 0 && ball.velocity.y <= 0) heights.push(ball.position.y - radius);
}
console.log("cannon-es 0.20.0: heights of the bounces of a ball dropped from 1 m, restitution 1");
console.log(`  ${heights.map((height) => height.toFixed(3)).join(" ")} m`);
const as_described = Math.max(...heights) > 1.4 && Math.min(...heights) < 1;
console.log(as_described ? "as described: it gains height" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
