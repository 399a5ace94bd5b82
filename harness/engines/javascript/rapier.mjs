// A scene in Rapier, 3D or 2D. A pair has the smaller of its colliders' coefficients: each body has one collider that meets bodies and one
// that meets walls, whose coefficients the walls then decide.


export const opener = (package_, space) => async (load, given) => {
  const rapier = (await load(`${package_}/dist/rapier.mjs`)).default;
  const log = console.log;
  console.log = console.warn = () => {}; // standard output is the host's
  await rapier.init();
  console.log = log;
  const { RigidBodyDesc, ColliderDesc, CoefficientCombineRule, World } = rapier;
  const { dt, stock, options, between, bodies, walls } = given;
  const n = bodies.length;
  const vector = ([x, y, z]) => (space ? { x, y, z } : { x, y });
  const angle = ([, , z, w]) => 2 * Math.atan2(z, w);
  const turn = (q) => (space ? { x: q[0], y: q[1], z: q[2], w: q[3] } : angle(q));
  const spin = (w) => (space ? vector(w) : w[2]);
  const three = ({ x, y, z }) => [x, y, z ?? 0];

  const world = new World(vector(given.gravity));
  world.timestep = dt;
  const own = world.integrationParameters;
  if (!stock) {
    own.numSolverIterations = options.substeps;
    own.numInternalPgsIterations = options.sweeps;
    own.normalizedAllowedLinearError = 2 * given.touch;
    own.normalizedPredictionDistance = given.touch;
  }
  const [BODIES, WALLS, WALL] = [1, 2, 4];
  const number = new Map();
  function attach(shape, body, i, member, meets, mu, e) {
    const made = world.createCollider(
      shape
        .setDensity(0)
        .setCollisionGroups((member << 16) | meets)
        .setFriction(mu)
        .setRestitution(e)
        .setFrictionCombineRule(CoefficientCombineRule.Min)
        .setRestitutionCombineRule(CoefficientCombineRule.Min),
      body,
    );
    number.set(made.handle, i);
    return made;
  }
  const moving = { free: () => RigidBodyDesc.dynamic(), fixed: () => RigidBodyDesc.fixed(), driven: () => RigidBodyDesc.kinematicVelocityBased() };
  const colliders = [];
  const made = bodies.map((body, i) => {
    const about = moving[body.moves]()
      .setTranslation(...body.x.slice(0, space ? 3 : 2))
      .setRotation(turn(body.q))
      .setCanSleep(stock);
    if (body.moves === "free") {
      const { mass, inertia } = body;
      if (space) about.setAdditionalMassProperties(mass, vector([0, 0, 0]), vector(inertia), turn([0, 0, 0, 1]));
      else about.setAdditionalMassProperties(mass, vector([0, 0]), inertia[2]);
      if (!body.rotating) about.lockRotations();
    }
    const found = world.createRigidBody(about);
    const shape = () => (body.half ? ColliderDesc.cuboid(...body.half) : ColliderDesc.ball(body.radius));
    attach(shape(), found, i, BODIES, BODIES, between.mu, between.e);
    colliders.push(attach(shape(), found, i, WALLS, WALL, 1e6, 1));
    if (body.moves !== "fixed") {
      found.setLinvel(vector(body.v), true);
      found.setAngvel(spin(body.w), true);
    }
    return found;
  });
  const faces = walls.map((wall, k) => {
    const about = (wall.moving ? RigidBodyDesc.kinematicVelocityBased() : RigidBodyDesc.fixed()).setTranslation(...wall.point.slice(0, space ? 3 : 2));
    const found = world.createRigidBody(about.setRotation(turn(wall.turn)));
    attach(new ColliderDesc(new rapier.HalfSpace(space ? vector([0, 0, 1]) : vector([0, 1]))), found, n + k, WALL, WALLS, wall.mu, wall.e);
    return found;
  });

  // Impulse on the body of the first collider. Of friction in space Rapier gives two numbers and not their directions.
  function contacts() {
    const found = [];
    world.colliders.forEach((one) => {
      world.contactPairsWith(one, (two) => {
        if (one.handle > two.handle) return;
        world.contactPair(one, two, (manifold, flipped) => {
          const sign = flipped ? -1 : 1;
          const [x, y, z] = three(manifold.normal());
          for (let k = 0; k < manifold.numContacts(); k++) {
            const along = -sign * manifold.contactImpulse(k);
            const across = space ? 0 : -sign * manifold.contactTangentImpulse(k);
            if (along === 0 && across === 0) continue;
            found.push([number.get(one.handle), number.get(two.handle), [along * x - across * y, along * y + across * x, along * z], null]);
          }
        });
      });
    });
    return found;
  }
  const names = ["numSolverIterations", "numInternalPgsIterations", "normalizedAllowedLinearError", "normalizedPredictionDistance", "contact_erp", "lengthUnit"];
  return {
    version: rapier.version(),
    settings: {
      ...Object.fromEntries(names.map((name) => [name, own[name]])),
      can_sleep: stock,
      combine_rules: "min, each body with a collider for bodies and one for walls",
      locked_axes: "none in a plane: z and both turns locked together switch friction off",
    },
    step: () => world.step(),
    state(i) {
      const q = made[i].rotation();
      const w = made[i].angvel();
      const turned = space ? [q.x, q.y, q.z, q.w] : [0, 0, Math.sin(q / 2), Math.cos(q / 2)];
      return [three(made[i].translation()), three(made[i].linvel()), turned, space ? three(w) : [0, 0, w]];
    },
    impulses: contacts,
    drive(kind, k, x, q, v, w) {
      const body = (kind === "wall" ? faces : made)[k];
      body.setTranslation(vector(x), true);
      body.setRotation(turn(q), true);
      body.setLinvel(vector(v), true);
      body.setAngvel(spin(w), true);
    },
    push(i, force, torque) {
      made[i].resetForces(true);
      made[i].resetTorques(true);
      made[i].addForce(vector(force), true);
      made[i].addTorque(space ? vector(torque) : torque[2], true);
    },
  };
};
