// One world of an engine, driven over pipes: node host.mjs ENGINE.mjs FOLDER, FOLDER/node_modules holding the engine's package.
//
// The first line of standard input describes the world, see `ninedisk.harness.engines.javascript.session`; each further one asks for steps.
// Every line is answered by one line of JSON. ENGINE.mjs exports open(import, world), which gives an object with
//   version, settings   of the package, and by name;
//   step()              one step;
//   state(i)            [x, v, quaternion (x, y, z, w), spin] of body i, of three components each;
//   impulses(all)       [first, second, impulse on the first, place or null] of each contact of the last step; null: not known;
//   drive(body, x, q, v, w), push(i, force, torque)   prescribed motion of a body, "wall" or "body", and loads of the coming step.

import { readSync, writeSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [, , engine, folder] = process.argv;
const chunk = Buffer.alloc(1 << 16);
let rest = "";
function line() {
  for (;;) {
    const end = rest.indexOf("\n");
    if (end >= 0) {
      const found = rest.slice(0, end);
      rest = rest.slice(end + 1);
      return found;
    }
    const read = readSync(0, chunk);
    if (read === 0) return null;
    rest += chunk.toString("latin1", 0, read);
  }
}
function answer(data) {
  const text = Buffer.from(JSON.stringify(data) + "\n");
  for (let sent = 0; sent < text.length; ) sent += writeSync(1, text, sent);
}
const load = (path) => import(pathToFileURL(`${folder}/node_modules/${path}`));
load.path = (path) => `${folder}/node_modules/${path}`;

let world;
let turned = [];
let given;
function follow() {
  for (let i = 0; i < turned.length; i++) {
    const [, , q, w] = world.state(i);
    if (given.dimension === 3) for (let a = 0; a < 3; a++) turned[i][a] += given.dt * w[a];
    else {
      const more = 2 * Math.atan2(q[2], q[3]) - turned[i][2];
      turned[i][2] += more - 2 * Math.PI * Math.round(more / (2 * Math.PI));
    }
  }
}
function advance({ steps, drives, loads }) {
  const begin = process.cpuUsage();
  for (let step = 0; step < steps; step++) {
    for (const each of drives?.[step] ?? []) world.drive(...each);
    for (const each of loads?.[step] ?? []) world.push(...each);
    world.step();
    follow();
  }
  const { user, system } = process.cpuUsage(begin);
  return (user + system) / 1e6;
}
for (let text = line(); text !== null; text = line()) {
  const asked = JSON.parse(text);
  try {
    if (asked.steps !== undefined) {
      const cpu = asked.steps ? advance(asked) : 0;
      const state = turned.map((_, i) => world.state(i));
      answer({ cpu, state, turned, impulses: world.impulses() });
    } else {
      given = asked;
      world = await (await import(pathToFileURL(engine))).open(load, asked);
      turned = asked.bodies.map(({ turned }) => [...turned]);
      answer({ version: world.version, settings: world.settings });
    }
  } catch (error) {
    answer({ error: String(error?.message ?? error) });
  }
}
