#!/usr/bin/env bash
# What: Jolt replaces the inertia of a small body: a ball of water 2 cm across gets that of a ball of the same mass 2 m across, 1e4
#   times as much, so that friction and impacts hardly turn it. No error and no warning.
# Versions: jolt-physics 1.1.0 (npm)
# Why a good guess misses: mass and inertia follow from shape and density, the mass is right, and a ball 3 cm across turns as it should.
# Documentation: Jolt Physics, page "Architecture and API documentation", advises sizes of 0.1 to 10 m for dynamic bodies; it names no
#   limit of the inertia and no replacement.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" jolt-physics@1.1.0
cat > "$folder/run.mjs" <<'JS'
import init from "jolt-physics";

const Jolt = await init();
const settings = new Jolt.JoltSettings();
const pairs = new Jolt.ObjectLayerPairFilterTable(2);
const layers = new Jolt.BroadPhaseLayerInterfaceTable(2, 2);
for (const each of [0, 1]) {
  pairs.EnableCollision(each, 1);
  layers.MapObjectToBroadPhaseLayer(each, new Jolt.BroadPhaseLayer(each));
}
settings.mObjectLayerPairFilter = pairs;
settings.mBroadPhaseLayerInterface = layers;
settings.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(layers, 2, pairs, 2);
const jolt = new Jolt.JoltInterface(settings);
const world = jolt.GetPhysicsSystem();
world.SetGravity(new Jolt.Vec3(0, 0, 0));
const bodies = world.GetBodyInterface();

// A free ball of density 1000 kg/m^3 takes an angular impulse of (2/5) m r^2 times 1 rad/s: it should spin at 1 rad/s.
function spun(diameter) {
  const shape = new Jolt.SphereShape(0.5 * diameter);
  shape.SetDensity(1000);
  const at = new Jolt.RVec3(0, 0, 0);
  const made = new Jolt.BodyCreationSettings(shape, at, Jolt.Quat.prototype.sIdentity(), Jolt.EMotionType_Dynamic, 1);
  made.mAngularDamping = made.mLinearDamping = 0;
  made.mAllowSleeping = false;
  const body = bodies.CreateBody(made);
  bodies.AddBody(body.GetID(), Jolt.EActivation_Activate);
  const mass = 1 / body.GetMotionProperties().GetInverseMass();
  const inertia = 0.4 * mass * (0.5 * diameter) ** 2;
  body.AddAngularImpulse(new Jolt.Vec3(inertia, 0, 0));
  jolt.Step(1 / 600, 1);
  const found = { diameter, mass, inertia, spin: body.GetAngularVelocity().GetX() };
  bodies.RemoveBody(body.GetID());
  return found;
}
const found = [0.1, 0.03, 0.02, 0.01].map(spun);
console.log("jolt-physics 1.1.0: spin of a ball after the angular impulse (2/5) m r^2 times 1 rad/s");
for (const { diameter, mass, inertia, spin } of found)
  console.log(`  diameter ${diameter} m, mass ${mass.toPrecision(4)} kg, inertia ${inertia.toPrecision(3)} kg m^2: ${spin.toPrecision(4)} rad/s`);
const [large, middle, small, smaller] = found.map(({ spin }) => spin);
const near = (value, wanted) => Math.abs(value / wanted - 1) < 0.01;
const as_described = near(large, 1) && near(middle, 1) && near(small, 0.01 ** 2) && near(smaller, 0.005 ** 2);
console.log(as_described ? "as described: the small ones turn as if their radius were 1 m" : "changed");
process.exit(as_described ? 0 : 1);
JS
node "$folder/run.mjs"
