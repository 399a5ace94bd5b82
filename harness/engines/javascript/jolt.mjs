// A scene in Jolt. Friction and restitution are those of each pair, set as its contact is found.

import { readFileSync } from "node:fs";

export async function open(load, given) {
  const Jolt = await (await load("jolt-physics/dist/jolt-physics.wasm.js")).default({
    wasmBinary: readFileSync(load.path("jolt-physics/dist/jolt-physics.wasm.wasm")),
  });
  const { dt, stock, bodies, walls, options, touch } = given;
  const n = bodies.length;
  const [RESTS, MOVES] = [0, 1];
  const setup = new Jolt.JoltSettings();
  const pairs = new Jolt.ObjectLayerPairFilterTable(2);
  const layers = new Jolt.BroadPhaseLayerInterfaceTable(2, 2);
  for (const each of [RESTS, MOVES]) {
    pairs.EnableCollision(each, MOVES);
    layers.MapObjectToBroadPhaseLayer(each, new Jolt.BroadPhaseLayer(each));
  }
  setup.mObjectLayerPairFilter = pairs;
  setup.mBroadPhaseLayerInterface = layers;
  setup.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(layers, 2, pairs, 2);
  const jolt = new Jolt.JoltInterface(setup);
  const world = jolt.GetPhysicsSystem();
  const making = world.GetBodyInterface();
  const vector = ([x, y, z]) => new Jolt.Vec3(x, y, z);
  const place = ([x, y, z]) => new Jolt.RVec3(x, y, z);
  const turn = ([x, y, z, w]) => new Jolt.Quat(x, y, z, w);
  const numbers = (v) => [v.GetX(), v.GetY(), v.GetZ()];
  world.SetGravity(vector(given.gravity));

  const knobs = given.given; // of a stock run
  const own = world.GetPhysicsSettings();
  const members = {
    velocity_steps: "mNumVelocitySteps",
    position_steps: "mNumPositionSteps",
    restitution_threshold: "mMinVelocityForRestitution",
    penetration_slop: "mPenetrationSlop",
    speculative_distance: "mSpeculativeContactDistance",
  };
  for (const [name, member] of Object.entries(members)) if (name in knobs) own[member] = knobs[name];
  if (Object.keys(knobs).length) world.SetPhysicsSettings(own);
  if (!stock) {
    own.mNumVelocitySteps = options.velocity_steps;
    own.mNumPositionSteps = options.position_steps;
    own.mSpeculativeContactDistance = touch;
    own.mPenetrationSlop = 2 * touch;
    own.mMinVelocityForRestitution = 0;
    own.mLinearCastThreshold = 1e6;
    own.mUseBodyPairContactCache = false;
    own.mManifoldTolerance = 1e-4;
    own.mMaxPenetrationDistance = 1e6;
    own.mAllowSleeping = false;
    world.SetPhysicsSettings(own);
  }

  function add(shape, moves, { x, q, v, w, layer }, change = () => {}) {
    const made = new Jolt.BodyCreationSettings(shape, place(x), turn(q), moves, layer);
    made.mLinearVelocity = vector(v);
    made.mAngularVelocity = vector(w);
    if (!stock) {
      made.mLinearDamping = made.mAngularDamping = 0;
      made.mMaxLinearVelocity = made.mMaxAngularVelocity = 1e15;
      made.mAllowSleeping = false;
      made.mApplyGyroscopicForce = true;
    }
    if ("damping" in knobs) made.mLinearDamping = made.mAngularDamping = knobs.damping;
    change(made);
    const body = making.CreateBody(made);
    making.AddBody(body.GetID(), Jolt.EActivation_Activate);
    return body;
  }
  const rounded = knobs.convex_radius ?? 0.05;
  const skin = (half) => (stock ? Math.min(rounded, 0.5 * Math.min(...half)) : 0);
  const box = (half) => new Jolt.BoxShape(vector(half), skin(half));
  const number = new Map();
  const made = bodies.map((body, i) => {
    const shape = body.half ? box(body.half) : new Jolt.SphereShape(body.radius);
    const moves = { free: Jolt.EMotionType_Dynamic, fixed: Jolt.EMotionType_Static, driven: Jolt.EMotionType_Kinematic }[body.moves];
    const found = add(shape, moves, { ...body, layer: body.moves === "fixed" ? RESTS : MOVES }, (settings) => {
      if (body.moves !== "free") return;
      const { mass, inertia } = body;
      settings.mOverrideMassProperties = Jolt.EOverrideMassProperties_MassAndInertiaProvided;
      settings.mMassPropertiesOverride.mMass = mass;
      settings.mMassPropertiesOverride.mInertia = Jolt.Mat44.prototype.sScale(vector(inertia));
      const plane = given.dimension === 2;
      settings.mAllowedDOFs = Jolt.EAllowedDOFs_TranslationX | Jolt.EAllowedDOFs_TranslationY;
      if (!plane) settings.mAllowedDOFs |= Jolt.EAllowedDOFs_TranslationZ;
      if (body.rotating) settings.mAllowedDOFs |= Jolt.EAllowedDOFs_RotationZ;
      if (body.rotating && !plane) settings.mAllowedDOFs |= Jolt.EAllowedDOFs_RotationX | Jolt.EAllowedDOFs_RotationY;
    });
    if (body.moves === "free" && body.rotating && !stock) {
      const inverse = body.inertia.map((each, a) => (given.dimension === 2 && a < 2 ? 0 : 1 / each));
      found.GetMotionProperties().SetInverseInertia(vector(inverse), turn([0, 0, 0, 1]));
    }
    number.set(found.GetID().GetIndexAndSequenceNumber(), i);
    return found;
  });
  // Jolt's planes rest: a wall that moves is the face of a box.
  const thick = given.thickness;
  const faces = walls.map((wall, k) => {
    let shape;
    if (wall.moving) {
      const half = [given.reach, given.reach, thick];
      const settings = new Jolt.BoxShapeSettings(vector(half), stock ? rounded : 0.5 * thick);
      shape = new Jolt.RotatedTranslatedShapeSettings(vector([0, 0, -thick]), turn([0, 0, 0, 1]), settings).Create().Get();
    } else shape = new Jolt.PlaneShape(new Jolt.Plane(vector([0, 0, 1]), 0), null, given.reach);
    const rests = wall.moving ? Jolt.EMotionType_Kinematic : Jolt.EMotionType_Static;
    const found = add(shape, rests, { x: wall.point, q: wall.turn, v: [0, 0, 0], w: [0, 0, 0], layer: wall.moving ? MOVES : RESTS });
    number.set(found.GetID().GetIndexAndSequenceNumber(), n + k);
    return found;
  });

  const listener = new Jolt.ContactListenerJS();
  const lawful = (one, two, _, settings) => {
    const found = [one, two].map((each) => number.get(Jolt.wrapPointer(each, Jolt.Body).GetID().GetIndexAndSequenceNumber()));
    const law = Math.max(...found) < n ? given.between : walls[Math.max(...found) - n];
    const contact = Jolt.wrapPointer(settings, Jolt.ContactSettings);
    contact.mCombinedFriction = law.mu;
    contact.mCombinedRestitution = law.e;
  };
  listener.OnContactAdded = listener.OnContactPersisted = lawful;
  listener.OnContactValidate = () => Jolt.ValidateResult_AcceptAllContactsForThisBodyPair;
  listener.OnContactRemoved = () => {};
  world.SetContactListener(listener);
  world.OptimizeBroadPhase();

  const names = [
    "mNumVelocitySteps", "mNumPositionSteps", "mBaumgarte", "mSpeculativeContactDistance", "mPenetrationSlop", "mMinVelocityForRestitution",
    "mManifoldTolerance", "mMaxPenetrationDistance", "mLinearCastThreshold", "mUseBodyPairContactCache", "mAllowSleeping",
    "mConstraintWarmStart", "mDeterministicSimulation",
  ];
  const settings = Object.fromEntries(names.map((name) => [name, world.GetPhysicsSettings()[name]]));
  const plain = new Jolt.BodyCreationSettings();
  const damped = (name) => (stock ? (knobs.damping ?? plain[name]) : 0);
  Object.assign(settings, { mLinearDamping: damped("mLinearDamping"), mAngularDamping: damped("mAngularDamping") });
  settings.mApplyGyroscopicForce = !stock;
  settings.convex_radius_of_boxes = stock ? `${rounded}, at most half of the smallest half size` : 0;
  settings.inertia_set_again_by_SetInverseInertia = !stock;

  return {
    version: JSON.parse(readFileSync(load.path("jolt-physics/package.json"))).version,
    settings,
    step: () => jolt.Step(dt, 1),
    state(i) {
      const q = made[i].GetRotation();
      return [
        numbers(made[i].GetPosition()),
        numbers(made[i].GetLinearVelocity()),
        [q.GetX(), q.GetY(), q.GetZ(), q.GetW()],
        numbers(made[i].GetAngularVelocity()),
      ];
    },
    impulses: () => null,
    drive(kind, k, x, q, v, w) {
      const body = (kind === "wall" ? faces : made)[k];
      making.SetPositionAndRotation(body.GetID(), place(x), turn(q), Jolt.EActivation_Activate);
      making.SetLinearAndAngularVelocity(body.GetID(), vector(v), vector(w));
    },
    push(i, force, torque) {
      made[i].AddForce(vector(force));
      made[i].AddTorque(vector(torque));
    },
  };
}
