#!/usr/bin/env bash
# What: In Jolt a box with a long and a short side that slides at 45 degrees leaves its straight line by 4 % of its path, and does not turn.
#   A box with a square face goes straight. More solver steps and shorter time steps leave the 4 % as they are.
# Versions: jolt-physics 1.1.0 (npm)
# Why a good guess misses: Jolt bounds the two tangential impulses of a contact together, by a circle and not by a pyramid, and along the
#   axes the box stops where it should.
# Documentation: Jolt Physics, page "Architecture and API documentation", on friction: coefficients and how they are combined, no direction.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" jolt-physics@1.1.0
cat > "$folder/run.mjs" <<'JS'
import init from "jolt-physics";

const Jolt = await init();
const setup = new Jolt.JoltSettings();
const pairs = new Jolt.ObjectLayerPairFilterTable(2);
const layers = new Jolt.BroadPhaseLayerInterfaceTable(2, 2);
for (const each of [0, 1]) {
  pairs.EnableCollision(each, 1);
  layers.MapObjectToBroadPhaseLayer(each, new Jolt.BroadPhaseLayer(each));
}
setup.mObjectLayerPairFilter = pairs;
setup.mBroadPhaseLayerInterface = layers;
setup.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(layers, 2, pairs, 2);
const jolt = new Jolt.JoltInterface(setup);
const world = jolt.GetPhysicsSystem();
world.SetGravity(new Jolt.Vec3(0, 0, -9.81));
const bodies = world.GetBodyInterface();
function add(shape, z, moves, layer, turn = new Jolt.Quat(0, 0, 0, 1)) {
  const made = new Jolt.BodyCreationSettings(shape, new Jolt.RVec3(0, 0, z), turn, moves, layer);
  made.mLinearDamping = made.mAngularDamping = 0;
  made.mAllowSleeping = false;
  made.mFriction = 0.3;
  const body = bodies.CreateBody(made);
  bodies.AddBody(body.GetID(), Jolt.EActivation_Activate);
  return body;
}
add(new Jolt.PlaneShape(new Jolt.Plane(new Jolt.Vec3(0, 0, 1), 0), null, 100), 0, Jolt.EMotionType_Static, 0);

// A box, its long side 20 degrees off x, slides at 1.5 m/s in a direction until it rests; how far along it and across.
function slide(half, degrees, steps, dt) {
  const settings = world.GetPhysicsSettings();
  settings.mNumVelocitySteps = steps;
  world.SetPhysicsSettings(settings);
  const yaw = (10 * Math.PI) / 180;
  const box = add(new Jolt.BoxShape(new Jolt.Vec3(...half), 0), half[2], Jolt.EMotionType_Dynamic, 1, new Jolt.Quat(0, 0, Math.sin(yaw), Math.cos(yaw)));
  const [c, s] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  box.SetLinearVelocity(new Jolt.Vec3(1.5 * c, 1.5 * s, 0));
  for (let t = 0; t < 1; t += dt) jolt.Step(dt, 1);
  const [x, y] = [box.GetPosition().GetX(), box.GetPosition().GetY()];
  const found = { half, degrees, steps, dt, along: x * c + y * s, across: y * c - x * s, turned: box.GetRotation().GetZ() - Math.sin(yaw) };
  bodies.RemoveBody(box.GetID());
  return found;
}
const [long, square] = [[0.5, 0.35, 0.2], [0.5, 0.5, 0.2]];
const found = [slide(long, 0, 10, 1 / 200), slide(long, 45, 10, 1 / 200), slide(long, 45, 100, 1 / 1000), slide(square, 45, 10, 1 / 200)];
console.log("jolt-physics 1.1.0: a box that slides with friction 0.3 (v0^2/(2 mu g) is 0.382 m)");
for (const { half, degrees, steps, dt, along, across, turned } of found)
  console.log(`  half sizes ${half}, ${degrees} degrees, ${steps} velocity steps, dt ${dt}: along ${along.toFixed(4)} m, across ${across.toFixed(4)} m, turned ${turned.toExponential(0)}`);
const [straight, askew, finer, even] = found.map(({ along, across }) => across / along);
const as_described = Math.abs(straight) < 1e-3 && askew > 0.03 && finer > 0.03 && Math.abs(even) < 1e-3 && found.every(({ turned }) => Math.abs(turned) < 1e-4);
console.log(as_described ? "as described: 4 % off the line, without turning" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
