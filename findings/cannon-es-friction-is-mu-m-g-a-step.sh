#!/usr/bin/env bash
# What: In cannon-es a sliding body loses the speed mu g [m/s^2] times one second in each step, whatever the length of the step and the
#   normal force: at 60 steps a second friction is 60 mu m g, at 600 it is 600 mu m g; pressed on the floor without gravity it is 0.
# Versions: cannon-es 0.20.0 (npm)
# Why a good guess misses: friction of a set coefficient is expected to be mu times the normal force, which the solver knows, for every
#   step; and slow bodies stop so early with any friction that nothing looks wrong.
# Documentation: cannon-es API, page "World": frictionGravity is said to approximate the largest friction from mass and gravity; page
#   "ContactMaterial" (friction): a coefficient. Nothing on the length of the step.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" cannon-es@0.20.0
cat > "$folder/run.mjs" <<'JS'
import * as Cannon from "cannon-es";

const [mu, mass, steps] = [0.5, 1, 12];

// Friction on a ball that cannot turn and slides fast on a floor, over mu times its normal force.
function share_of_coulomb(rate, gravity, pressed) {
  const world = new Cannon.World({ gravity: new Cannon.Vec3(0, -gravity, 0) });
  const material = new Cannon.Material();
  world.addContactMaterial(new Cannon.ContactMaterial(material, material, { friction: mu, restitution: 0 }));
  const floor = new Cannon.Body({ mass: 0, material, shape: new Cannon.Plane() });
  floor.quaternion.setFromEuler(-Math.PI / 2, 0, 0);
  world.addBody(floor);
  const position = new Cannon.Vec3(0, 0.499, 0);
  const ball = new Cannon.Body({ mass, material, shape: new Cannon.Sphere(0.5), position, linearDamping: 0, fixedRotation: true });
  ball.updateMassProperties();
  ball.velocity.set(200, 0, 0);
  world.addBody(ball);
  const seen = [];
  for (let step = 0; step < steps; step++) {
    ball.applyForce(new Cannon.Vec3(0, -pressed, 0));
    const before = ball.velocity.x;
    world.step(1 / rate);
    seen.push((before - ball.velocity.x) * rate);
  }
  return (Math.max(...seen) * mass) / (mu * (mass * gravity + pressed));
}
const asked = [[60, 9.81, 0], [600, 9.81, 0], [60, 9.81, 98.1], [60, 0, 1000]];
const found = asked.map((each) => share_of_coulomb(...each));
console.log("cannon-es 0.20.0: friction on a sliding ball over mu times its normal force");
asked.forEach(([rate, gravity, pressed], k) =>
  console.log(`  ${rate} steps a second, gravity ${gravity} m/s^2, pressed with ${pressed} N: ${found[k].toFixed(3)}`),
);
const expected = [60, 600, 60 / 11, 0];
const as_described = found.every((share, k) => Math.abs(share - expected[k]) <= 0.01 * expected[k] + 1e-6);
console.log(as_described ? "as described: mu m g in each step" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
