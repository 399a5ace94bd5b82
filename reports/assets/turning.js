"use strict";
/* Scenes in space: spheres, boxes and planes that turn under the pointer, as SVG, so that they print as they stand; stored configurations play. */
(() => {
  const SVG = "http://www.w3.org/2000/svg", TURN = 12, PLAY = 4; // seconds of a whole turn, and of a whole play
  const POLES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], MOST_POLES = 60; // spheres whose rotation is drawn
  const make = (name, text, parent) => { const made = document.createElement(name); made.textContent = text; parent.append(made); return made; };
  const draw = (name, parent, facts) => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(facts)) made.setAttribute(key, value);
    parent.append(made);
    return made;
  };
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const size = a => Math.hypot(...a);

  /* A vector turned by a rotation vector (Rodrigues). */
  const turned = (a, by) => {
    const angle = size(by);
    if (angle === 0) return a;
    const n = by.map(each => each / angle), c = Math.cos(angle), s = Math.sin(angle), along = dot(n, a) * (1 - c);
    return plus(plus(a.map(each => c * each), cross(n, a), s), n, along);
  };

  class Turning {
    constructor(figure) {
      this.figure = figure;
      this.scenes = ninedisk.data.head.spaces;
      this.yaw = 0.5;
      this.pitch = 0.35;
      this.at = 0;
      this.svg = draw("svg", figure, { viewBox: "-1 -1 2 2", tabindex: 0, role: "img" });
      figure.prepend(this.svg);
      const gradient = draw("radialGradient", draw("defs", this.svg, {}), { id: "ball", cx: 0.36, cy: 0.32, r: 0.75 });
      for (const [offset, colour] of [[0, "#f2f6fb"], [0.45, "#a9bdd3"], [1, "#4c6279"]]) draw("stop", gradient, { offset, "stop-color": colour });
      this.picture = draw("g", this.svg, {});
      const bar = make("div", "", figure);
      bar.className = "controls";
      this.button = make("button", "▶ Play", bar);
      this.button.type = "button";
      this.slider = document.createElement("input");
      Object.assign(this.slider, { type: "range", min: 0, step: 1, value: 0 });
      this.slider.setAttribute("aria-label", "Stored configuration");
      bar.append(this.slider);
      this.told = make("span", "", bar);
      this.told.className = "told";
      this.select = make("select", "", make("label", "Variant ", bar));
      for (const name of Object.keys(this.scenes)) make("option", name.replaceAll(/(\d\.\d{3})\d+/g, "$1"), this.select).value = name;
      this.select.value = figure.dataset.turning;
      this.engine = make("select", "", make("label", "Engine ", bar));
      this.select.addEventListener("change", () => this.open());
      this.engine.addEventListener("change", () => this.run(this.engine.value));
      this.slider.addEventListener("input", () => { this.playing = false; this.at = +this.slider.value; this.show(); });
      this.button.addEventListener("click", () => this.play());
      this.svg.addEventListener("pointerdown", event => { this.turning = false; this.svg.setPointerCapture(event.pointerId); });
      this.svg.addEventListener("pointermove", event => { if (event.buttons) this.turn(-event.movementX / 120, event.movementY / 120); });
      this.svg.addEventListener("keydown", event => {
        const way = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
        if (!way) return;
        event.preventDefault();
        this.turning = false;
        this.turn(...way);
      });
      figure.classList.add("drawn");
      this.open();
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
      const watch = new IntersectionObserver(found => { // one turn when it is first seen, from where it stands to there again
        if (!found.some(each => each.isIntersecting)) return;
        watch.disconnect();
        const from = this.yaw, begin = performance.now();
        this.turning = true;
        const step = now => {
          if (!this.turning) return;
          const part = Math.min((now - begin) / (1000 * TURN), 1);
          this.yaw = from + 2 * Math.PI * Math.max(part, 0);
          this.show();
          if (part < 1) requestAnimationFrame(step);
        };
        requestAnimationFrame(step);
      }, { threshold: 0.6 });
      watch.observe(this.svg);
    }

    /* A variant: the box is that of its set-up and of its first engine, whatever way it is seen. */
    open() {
      const scene = this.scenes[this.select.value];
      this.radius = ninedisk.data.arrays[scene.radius];
      const first = (scene.up + 1) % 3;
      this.axes = [first, (first + 1) % 3, scene.up]; // right-handed, the last one upright
      this.gravity = this.axes.map(axis => scene.gravity[axis]);
      const three = name => name in scene ? Array.from(this.radius, (_, i) => Array.from(ninedisk.data.arrays[scene[name]].slice(3 * i, 3 * i + 3))) : [];
      this.half = three("half");
      this.first = Array.from(this.radius, (_, i) => { // directions to the poles of a ball, to the faces of a box
        if (!this.isBox(i)) return POLES;
        const turn = ninedisk.data.arrays[scene.turn];
        return [0, 1, 2].flatMap(edge => [1, -1].map(side => this.axes.map(axis => side * turn[9 * i + 3 * edge + axis])));
      });
      const names = Object.keys(scene.engines);
      this.engine.replaceChildren();
      for (const id of names) make("option", ninedisk.data.head.engines.find(each => each.id === id).name, this.engine).value = id;
      this.engine.parentElement.hidden = names.length < 2;
      this.select.parentElement.hidden = Object.keys(this.scenes).length < 2;
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (const held of [scene.setup, ...names.slice(0, 1).map(id => scene.engines[id])])
        ninedisk.data.arrays[held.x].forEach((value, k) => {
          const r = this.radius[Math.floor(k / 3) % this.radius.length];
          low[k % 3] = Math.min(low[k % 3], value - r);
          high[k % 3] = Math.max(high[k % 3], value + r);
        });
      this.middle = this.axes.map(axis => (low[axis] + high[axis]) / 2);
      this.reach = 0.5 * size(plus(high, low, -1));
      this.run(names[0]);
    }

    run(id) {
      const scene = this.scenes[this.select.value], held = id === undefined ? scene.setup : scene.engines[id];
      const three = values => Array.from({ length: values.length / 3 }, (_, k) => this.axes.map(axis => values[3 * k + axis]));
      const array = name => ninedisk.data.arrays[held[name]];
      this.t = array("t");
      [this.x, this.angle, this.point, this.normal] = ["x", "angle", "wall_point", "wall_angle"].map(name => three(array(name)));
      const n = this.radius.length;
      // Orientations: rotations from one stored configuration to the next, exact while the axis of the spin stays.
      this.poles = [this.first];
      for (let k = 1; k < this.t.length && n <= MOST_POLES; k++)
        this.poles.push(this.poles[k - 1].map((poles, i) => poles.map(pole => turned(pole, this.step(k - 1, i)))));
      this.spins = n <= MOST_POLES && this.angle.some(each => size(each) > 0);
      this.playing = false;
      this.at = Math.min(this.at, this.t.length - 1);
      this.slider.max = this.t.length - 1;
      for (const each of [this.button, this.slider]) each.hidden = this.t.length < 2;
      this.show();
    }

    isBox(i) {
      return size(this.half[i] ?? [0, 0, 0]) > 0;
    }

    /* Bodies from the farthest on, where a face of a box that lies between two of them decides. */
    inOrder(bodies, near) {
      if (!this.half.length) return bodies;
      const least = (body, n) => dot(body.x, n) - (this.isBox(body.i) // the least height of a body along n
        ? [0, 1, 2].reduce((sum, edge) => sum + this.half[body.i][edge] * Math.abs(dot(body.poles[2 * edge], n)), 0) : this.radius[body.i]);
      const hides = (front, behind) => [[front, behind, -1], [behind, front, 1]].some(([box, other, way]) => this.isBox(box.i)
        && box.poles.some((n, f) => way * dot(n, near) > 1e-9 && least(other, n) > dot(box.x, n) + 0.98 * this.half[box.i][f >> 1]));
      const left = [...bodies], found = [];
      while (left.length) {
        const next = left.findIndex(one => !left.some(other => other !== one && hides(one, other)));
        found.push(...left.splice(Math.max(next, 0), 1));
      }
      return found;
    }

    /* Faces of a box that are seen, from its directions. */
    box(i, x, poles, near, flat) {
      for (let f = 0; f < 6; f++) {
        const facing = dot(poles[f], near), edge = f >> 1, [one, two] = [(edge + 1) % 3, (edge + 2) % 3];
        if (facing <= 1e-9) continue;
        const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([p, q]) => plus(plus(plus(x,
          poles[f], this.half[i][edge]), poles[2 * one], p * this.half[i][one]), poles[2 * two], q * this.half[i][two]));
        const told = corners.map(corner => flat(corner).map(each => each.toFixed(4)).join(",")).join(" ");
        const light = Math.round(45 + 40 * facing);
        draw("polygon", this.picture, { points: told, class: "box", fill: `hsl(212 28% ${light}%)` });
      }
    }

    step(k, i) {
      const n = this.radius.length;
      return plus(this.angle[(k + 1) * n + i], this.angle[k * n + i], -1);
    }

    turn(yaw, pitch) {
      this.yaw += yaw;
      this.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.pitch + pitch));
      this.show();
    }

    play() {
      this.playing = !this.playing;
      if (this.at >= this.t.length - 1) this.at = 0;
      const begin = performance.now(), from = this.at;
      const step = now => {
        if (!this.playing) return;
        this.at = Math.min(from + Math.max(now - begin, 0) / (1000 * PLAY) * (this.t.length - 1), this.t.length - 1);
        if (this.at >= this.t.length - 1) this.playing = false;
        this.show();
        requestAnimationFrame(step);
      };
      this.show();
      requestAnimationFrame(step);
    }

    /* Corners of a plane's part in the box: a square about the foot of the middle, cut off by the other planes. */
    patch(w, points, normals) {
      const n = normals[w], foot = plus(this.middle, n, dot(plus(points[w], this.middle, -1), n));
      const one = cross(n, Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]), a = one.map(each => each / size(one)), b = cross(n, a);
      let corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([p, q]) => plus(plus(foot, a, 0.8 * p * this.reach), b, 0.8 * q * this.reach));
      normals.forEach((other, k) => {
        if (k === w || Math.abs(dot(other, n)) > 1 - 1e-6) return;
        const height = corner => dot(plus(corner, points[k], -1), other);
        corners = corners.flatMap((corner, c) => {
          const next = corners[(c + 1) % corners.length], h = height(corner), g = height(next);
          const cut = h * g < 0 ? [plus(corner.map(each => each * g / (g - h)), next, -h / (g - h))] : [];
          return h >= 0 ? [corner, ...cut] : cut;
        });
      });
      return corners;
    }

    /* Draw as the scene stands; between stored configurations places are interpolated linearly. */
    show() {
      const [ca, sa, cb, sb] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
      const right = [ca, sa, 0], near = [sa * cb, -ca * cb, sb], up = [-sa * sb, ca * sb, cb];
      const k = Math.min(Math.floor(this.at), this.t.length - 1), next = Math.min(k + 1, this.t.length - 1), part = this.at - k;
      const n = this.radius.length, m = this.normal.length / this.t.length, scale = 0.8 / this.reach;
      const mix = (values, stride, i) => plus(values[k * stride + i].map(each => each * (1 - part)), values[next * stride + i], part);
      const flat = a => { const d = plus(a, this.middle, -1); return [scale * dot(d, right), -scale * dot(d, up)]; };
      const points = Array.from({ length: m }, (_, w) => mix(this.point, m, w));
      const normals = Array.from({ length: m }, (_, w) => { const a = mix(this.normal, m, w); return a.map(each => each / size(a)); });
      this.picture.replaceChildren();
      const plane = (w, behind) => {
        if (dot(normals[w], near) > 0 !== behind) return;
        const told = this.patch(w, points, normals).map(corner => flat(corner).map(each => each.toFixed(4)).join(",")).join(" ");
        draw("polygon", this.picture, { points: told, class: behind ? "plane" : "plane front" });
      };
      for (let w = 0; w < m; w++) plane(w, true);
      const balls = Array.from({ length: n }, (_, i) => { const x = mix(this.x, n, i); return { i, x, depth: dot(x, near) }; });
      balls.sort((a, b) => a.depth - b.depth);
      for (const each of balls) {
        const onward = next > k && this.poles.length > 1 ? this.step(k, each.i).map(angle => angle * part) : [0, 0, 0];
        each.poles = (this.poles[k] ?? this.poles[0])[each.i].map(pole => turned(pole, onward));
      }
      for (const { i, x, poles } of this.inOrder(balls, near)) {
        if (this.isBox(i)) {
          this.box(i, x, poles, near, flat);
          continue;
        }
        const [cx, cy] = flat(x), r = scale * this.radius[i];
        draw("circle", this.picture, { cx: cx.toFixed(4), cy: cy.toFixed(4), r: r.toFixed(4), class: "ball", fill: "url(#ball)" });
        if (!this.spins) continue;
        for (const at of poles) {
          const facing = dot(at, near);
          if (facing < 0.05) continue;
          const [px, py] = flat(plus(x, at, 0.97 * this.radius[i]));
          draw("circle", this.picture, { cx: px.toFixed(4), cy: py.toFixed(4), r: (0.09 * r * Math.sqrt(facing)).toFixed(4), class: "pole" });
        }
      }
      for (let w = 0; w < m; w++) plane(w, false);
      this.triad(right, up);
      if (!this.playing) this.slider.value = k;
      this.button.textContent = this.playing ? "❚❚ Pause" : "▶ Play";
      this.told.textContent = this.t.length < 2 ? "" : `t = ${+(this.t[k] * (1 - part) + this.t[next] * part).toPrecision(4)} s`;
      const degrees = angle => Math.round(angle * 180 / Math.PI);
      this.svg.setAttribute("aria-label", `${n} ${this.half.length ? "bod" : "sphere"}${this.half.length ? n === 1 ? "y" : "ies" : n === 1 ? "" : "s"} and ${m} plane${m === 1 ? "" : "s"}, turned by ${degrees(this.yaw) % 360}°, seen from ${degrees(this.pitch)}° above. ${this.told.textContent}`);
    }

    /* The axes, and the way down, in a corner. */
    triad(right, up) {
      const foot = [-0.8, 0.8], to = (a, s) => [foot[0] + s * dot(a, right), foot[1] - s * dot(a, up)];
      const line = (a, s, kind) => { const [x2, y2] = to(a, s); draw("line", this.picture, { x1: foot[0], y1: foot[1], x2: x2.toFixed(4), y2: y2.toFixed(4), class: kind }); };
      const word = (a, s, text, kind) => { const [x, y] = to(a, s); draw("text", this.picture, { x: x.toFixed(4), y: y.toFixed(4), class: kind }).textContent = text; };
      this.axes.forEach((axis, c) => {
        const unit = [0, 0, 0];
        unit[c] = 1;
        line(unit, 0.13, "axis");
        word(unit, 0.175, "xyz"[axis], "axis");
      });
      const g = size(this.gravity);
      if (!g) return;
      const down = this.gravity.map(each => each / g);
      line(down, 0.1, "down");
      word(down, 0.15, "g", "down");
    }
  }

  ninedisk.ready.push(() => {
    if (Object.keys(ninedisk.data.head.spaces ?? {}).length)
      for (const figure of document.querySelectorAll("figure[data-turning]")) new Turning(figure);
  });
})();
