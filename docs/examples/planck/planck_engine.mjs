// Planck.js (Box2D in JavaScript, double precision) as an engine of ninedisk.
//
//   npm install                       in this folder: brings planck in the version that package.json names
//   ninedisk run binary-collision --engine-cmd 'node docs/examples/planck/planck_engine.mjs'
//
// One step of Planck finds contacts where disks are, solves for velocities by sequential impulses, then moves positions with
// the new velocities: semi-implicit Euler. Its lengths and speeds that are made for games are set on purpose, below.

import { readFileSync } from "node:fs";

const planck = await import("planck").catch(() => null);
const about = {
  wire_version: 1,
  id: "planck",
  name: "Planck.js",
  version: planck && JSON.parse(readFileSync(new URL("node_modules/planck/package.json", import.meta.url))).version,
  install: "npm install in docs/examples/planck",
  licence: "MIT",
  contact: "impulse",
  scheme: "semi-implicit-euler",
  capabilities: ["friction", "restitution", "gravity", "blocked-rotation", "disk-inertia"],
  options: {
    velocity_iterations: { default: 100, low: 1, whole: true, why: "one contact needs one; 100 serve a stack of a few disks" },
    position_iterations: { default: 10, low: 0, whole: true, why: "each takes out a fifth of an overlap, without momentum" },
  },
};

function run({ scene, numerics, watch, sampled_steps: sampled }) {
  const { World, Vec2, Circle, Box, Settings } = planck;
  const { disks, walls } = scene;
  const n = disks.mass.length;
  const { dt, options } = numerics;
  const spinning = disks.rotating.findIndex((free, i) => !free && disks.omega[i] !== 0);
  if (spinning >= 0) return { unsupported: `disk ${spinning} spins at a prescribed rate: Planck's blocked bodies have no rotation` };

  const iterations = ["velocity_iterations", "position_iterations"].map(
    (name) => options[`planck.${name}`] ?? about.options[name].default,
  );
  const smallest = Math.min(...disks.radius);
  const extent = Math.max(smallest, ...disks.x.flat().map(Math.abs), ...disks.v.flat().map((u) => Math.abs(u) * dt * numerics.n_steps));
  const touch = 1e-12 * extent; // bodies that touch are in contact whatever the rounding of their coordinates
  Settings.velocityThreshold = 0; // Planck's own, 1 m/s, makes slower impacts plastic in silence
  Settings.linearSlop = 1e-6 * smallest; // the overlap that stays; its own, 5 mm, is for furniture
  Settings.maxLinearCorrection = 0.2 * smallest;
  Settings.maxTranslation = 1e30; // its own cut velocities off in silence: 2 m and a quarter turn in a step
  Settings.maxRotation = 1e30;
  const world = new World({ gravity: new Vec2(...scene.gravity), allowSleep: false, continuousPhysics: false, warmStarting: true });

  const bodies = disks.mass.map((mass, i) => {
    const body = world.createBody({
      type: "dynamic",
      position: new Vec2(...disks.x[i]),
      linearVelocity: new Vec2(...disks.v[i]),
      angularVelocity: disks.omega[i],
      fixedRotation: !disks.rotating[i],
      userData: i,
    });
    body.createFixture({ shape: new Circle(disks.radius[i] + touch / 2), density: 0 });
    body.setMassData({ mass, I: disks.inertia[i], center: new Vec2(0, 0) });
    return body;
  });
  // A wall is a thick box; polygons have a skin of polygonRadius, by which its face lies below the wall's surface.
  const reach = 1e3 * extent;
  const skin = Settings.polygonRadius;
  walls.forEach((wall, k) => {
    const [nx, ny] = wall.normal;
    const deep = reach + skin - touch / 2;
    const body = world.createBody({
      type: "static",
      position: new Vec2(wall.point[0] - deep * nx, wall.point[1] - deep * ny),
      angle: Math.atan2(-nx, ny),
      userData: n + k,
    });
    body.createFixture({ shape: new Box(reach, reach) });
  });

  // Friction and restitution are the pair's own; Planck's combinations (geometric mean, larger one) have no say.
  const pairOf = (contact) => [contact.getFixtureA(), contact.getFixtureB()].map((f) => f.getBody().getUserData()).sort((a, b) => a - b);
  world.on("begin-contact", (contact) => {
    const [, j] = pairOf(contact);
    const law = j < n ? scene.disk_disk : walls[j - n].law;
    contact.setFriction(law.mu);
    contact.setRestitution(law.restitution ?? 0);
  });
  // On either body the tangential impulse is along the pair's own tangent, whichever of the two Planck calls A.
  let impulses = new Map();
  world.on("post-solve", (contact, impulse) => {
    impulses.set(String(pairOf(contact)), [impulse.normalImpulses[0], impulse.tangentImpulses[0]]);
  });

  const gapOf = ([i, j]) => {
    const { x, y } = bodies[i].getPosition();
    if (j < n) return Math.hypot(bodies[j].getPosition().x - x, bodies[j].getPosition().y - y) - disks.radius[i] - disks.radius[j];
    const { point, normal } = walls[j - n];
    return (x - point[0]) * normal[0] + (y - point[1]) * normal[1] - disks.radius[i];
  };
  const history = { step: [], t: [], x: [], v: [], angle: [], omega: [], gap: [], fn: [], fs: [], wall_point: [], wall_angle: [] };
  let advance = 0;
  for (let step = 0, row = 0; step <= numerics.n_steps; step++) {
    if (step > 0) {
      impulses = new Map();
      const begin = performance.now();
      world.step(dt, ...iterations);
      advance += performance.now() - begin;
    }
    if (sampled[row] !== step) continue;
    row++;
    history.step.push(step);
    history.t.push(step * dt);
    history.x.push(bodies.map((body) => [body.getPosition().x, body.getPosition().y]));
    history.v.push(bodies.map((body) => [body.getLinearVelocity().x, body.getLinearVelocity().y]));
    history.angle.push(bodies.map((body) => body.getAngle()));
    history.omega.push(bodies.map((body) => body.getAngularVelocity()));
    history.gap.push(watch.map(gapOf));
    const forces = watch.map((pair) => (step > 0 ? (impulses.get(String(pair)) ?? [0, 0]).map((p) => p / dt) : [null, null]));
    history.fn.push(forces.map(([fn]) => fn));
    history.fs.push(forces.map(([, fs]) => fs));
    history.wall_point.push(walls.map((wall) => wall.point));
    history.wall_angle.push(walls.map(({ normal: [nx, ny] }) => Math.atan2(ny, nx)));
  }
  const settings = {
    "planck.velocity_iterations": iterations[0],
    "planck.position_iterations": iterations[1],
    "planck.velocity_threshold": Settings.velocityThreshold,
    "planck.linear_slop": Settings.linearSlop,
    "planck.polygon_radius": skin,
    "planck.baumgarte": Settings.baumgarte,
    "planck.max_linear_correction": Settings.maxLinearCorrection,
    "planck.touch": touch,
    "planck.pair_coefficients": "the scene's own, set on each contact",
    "planck.allow_sleep": false,
    "planck.continuous_physics": false,
    "planck.warm_starting": true,
    wall_half_length: reach,
  };
  return {
    engine_version: about.version,
    timings: { setup: 0, warm_up: 0, advance: advance / 1000 },
    settings,
    history: { ...history, wall_force: null, force_meaning: "step-mean", energy: {} },
  };
}

const answer = process.argv[2] === "describe" ? about : { wire_version: 1, ...run(JSON.parse(readFileSync(0, "utf8"))) };
process.stdout.write(JSON.stringify(answer));
