// Rapier (rigid bodies in Rust, single precision) as an engine of ninedisk, as far as its findings need it: motion, no contact forces.
//
//   npm install                       in this folder: brings rapier in the version that package.json names
//   ninedisk run chain/newton-cradle --engine-cmd 'node docs/examples/rapier/rapier_engine.mjs'
//
// A step is divided into substeps ("small steps"), as many as solver_iterations; restitution is applied after friction.

import { readFileSync } from "node:fs";

const rapier = await import("@dimforge/rapier2d-compat").then((module) => module.default).catch(() => null);
await rapier?.init();
const about = {
  wire_version: 1,
  id: "rapier",
  name: "Rapier",
  version: rapier && rapier.version(),
  install: "npm install in docs/examples/rapier",
  licence: "Apache-2.0",
  contact: "impulse",
  scheme: "semi-implicit-euler in substeps",
  capabilities: ["friction", "restitution", "gravity", "blocked-rotation", "disk-inertia"],
  options: { solver_iterations: { default: 4, low: 1, whole: true, why: "Rapier's own" } },
};

function run({ scene, numerics, watch, sampled_steps: sampled }) {
  const { RigidBodyDesc, ColliderDesc, CoefficientCombineRule, World } = rapier;
  const { disks, walls, gravity } = scene;
  const { dt, options } = numerics;
  const n = disks.mass.length;
  const iterations = options["rapier.solver_iterations"] ?? about.options.solver_iterations.default;
  const world = new World({ x: gravity[0], y: gravity[1] });
  world.timestep = dt;
  world.numSolverIterations = iterations;
  world.integrationParameters.normalizedAllowedLinearError = 0; // its own leaves overlaps of up to 5 mm; at rest, 0.07 mm are left with either

  // A pair has the smaller of its colliders' coefficients. Each disk has one collider that meets disks and one that meets walls,
  // whose coefficients the walls then decide.
  const [DISKS, WALLS, WALL] = [1, 2, 4];
  const add = (shape, body, member, meets, mu, restitution) =>
    world.createCollider(
      shape
        .setDensity(0)
        .setCollisionGroups((member << 16) | meets)
        .setFriction(mu)
        .setRestitution(restitution)
        .setFrictionCombineRule(CoefficientCombineRule.Min)
        .setRestitutionCombineRule(CoefficientCombineRule.Min),
      body,
    );
  const bodies = disks.mass.map((mass, i) => {
    const about = RigidBodyDesc.dynamic()
      .setTranslation(...disks.x[i])
      .setLinvel(...disks.v[i])
      .setAngvel(disks.omega[i])
      .setAdditionalMassProperties(mass, { x: 0, y: 0 }, disks.inertia[i])
      .setCanSleep(false);
    const body = world.createRigidBody(disks.rotating[i] ? about : about.lockRotations());
    add(ColliderDesc.ball(disks.radius[i]), body, DISKS, DISKS, scene.disk_disk.mu, scene.disk_disk.restitution ?? 0);
    add(ColliderDesc.ball(disks.radius[i]), body, WALLS, WALL, 1e6, 1);
    return body;
  });
  for (const { point, normal, law } of walls) {
    const body = world.createRigidBody(RigidBodyDesc.fixed().setTranslation(...point));
    add(ColliderDesc.halfspace({ x: normal[0], y: normal[1] }), body, WALL, WALLS, law.mu, law.restitution ?? 0);
  }

  const gapOf = ([i, j]) => {
    const { x, y } = bodies[i].translation();
    if (j < n) return Math.hypot(bodies[j].translation().x - x, bodies[j].translation().y - y) - disks.radius[i] - disks.radius[j];
    const { point, normal } = walls[j - n];
    return (x - point[0]) * normal[0] + (y - point[1]) * normal[1] - disks.radius[i];
  };
  const history = { step: [], t: [], x: [], v: [], angle: [], omega: [], gap: [], fn: [], fs: [], wall_point: [], wall_angle: [] };
  let advance = 0;
  for (let step = 0, row = 0; step <= numerics.n_steps; step++) {
    if (step > 0) {
      const begin = performance.now();
      world.step();
      advance += performance.now() - begin;
    }
    if (sampled[row] !== step) continue;
    row++;
    history.step.push(step);
    history.t.push(step * dt);
    history.x.push(bodies.map((body) => [body.translation().x, body.translation().y]));
    history.v.push(bodies.map((body) => [body.linvel().x, body.linvel().y]));
    history.angle.push(bodies.map((body) => body.rotation()));
    history.omega.push(bodies.map((body) => body.angvel()));
    history.gap.push(watch.map(gapOf));
    history.fn.push(watch.map(() => null));
    history.fs.push(watch.map(() => null));
    history.wall_point.push(walls.map(({ point }) => point));
    history.wall_angle.push(walls.map(({ normal: [nx, ny] }) => Math.atan2(ny, nx)));
  }
  return {
    engine_version: about.version,
    timings: { setup: 0, warm_up: 0, advance: advance / 1000 },
    settings: { "rapier.solver_iterations": iterations, "rapier.normalized_allowed_linear_error": 0, "rapier.can_sleep": false },
    history: { ...history, wall_force: null, force_meaning: "step-mean", energy: {} },
  };
}

const answer = process.argv[2] === "describe" ? about : { wire_version: 1, ...run(JSON.parse(readFileSync(0, "utf8"))) };
process.stdout.write(JSON.stringify(answer));
