"use strict";
/* Moving scenes: the stored configurations of every engine, force chains where the contacts are springs. */
(() => {
  const style = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const make = (name, text, parent) => { const made = document.createElement(name); made.textContent = text; parent.append(made); return made; };
  const SECONDS = 4; // of a whole play

  class Player {
    constructor(figure) {
      this.figure = figure;
      this.scenes = ninedisk.data.head.scenes;
      const names = Object.keys(this.scenes);
      if (!names.length) return;
      this.canvas = make("canvas", "", figure);
      this.canvas.setAttribute("role", "img");
      const bar = make("div", "", figure);
      bar.className = "controls";
      this.button = make("button", "▶ Play", bar);
      this.button.type = "button";
      this.slider = document.createElement("input");
      Object.assign(this.slider, { type: "range", min: 0, step: 1, value: 0 });
      this.slider.setAttribute("aria-label", "Stored step");
      bar.append(this.slider);
      this.told = make("span", "", bar);
      this.told.className = "told";
      const choose = make("label", "Variant ", bar);
      this.select = make("select", "", choose);
      for (const name of names) { const option = make("option", name.replaceAll(/(\d\.\d{3})\d+/g, "$1"), this.select); option.value = name; }
      if (names.includes(figure.dataset.player)) this.select.value = figure.dataset.player;
      this.button.addEventListener("click", () => this.playing ? this.stop() : this.play());
      this.slider.addEventListener("input", () => { this.stop(); this.show(+this.slider.value); });
      this.select.addEventListener("change", () => { this.stop(); this.open(); });
      ninedisk.toggled.push(() => this.show(this.at));
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.at));
      new ResizeObserver(() => this.show(this.at)).observe(figure);
      figure.classList.add("drawn");
      this.at = Infinity; // begin with the last stored step
      this.open();
    }

    open() {
      const scene = this.scenes[this.select.value], array = k => ninedisk.data.arrays[k];
      this.radius = array(scene.radius);
      this.cell = scene.cell || null;
      this.edges = scene.edges.map(k => k === null ? null : array(k));
      this.engines = Object.entries(scene.engines).map(([id, held]) => ({
        id, look: ninedisk.data.head.engines.find(engine => engine.id === id), pairs: held.pairs,
        ...Object.fromEntries(["step", "t", "x", "angle", "wall_point", "wall_angle", "forces"].map(name => [name, array(held[name])])),
      }));
      const first = this.engines[0];
      this.count = first.step.length;
      this.slider.max = this.count - 1;
      const low = [Infinity, Infinity], high = [-Infinity, -Infinity], n = this.radius.length;
      const clear = this.engines.filter(engine => engine.step.length === this.count);
      // An engine that runs away must not shrink the picture: the box is that of the first engine, which leads the list.
      first.x.forEach((value, k) => {
        const axis = k % 2, r = this.radius[Math.floor(k / 2) % n];
        low[axis] = Math.min(low[axis], value - r);
        high[axis] = Math.max(high[axis], value + r);
      });
      if (this.cell) { // the cell of the lattice that leans least, at any time
        const end = first.t[this.count - 1], { size, motion } = this.cell;
        const wide = Math.max(size[0], size[0] + end * motion[0][0]), sheared = motion[0][1] ? 0.5 * wide : 0;
        Object.assign(low, [-sheared, 0]);
        Object.assign(high, [wide + sheared, Math.max(size[1], size[1] + end * motion[1][1])]);
      }
      const room = 0.06 * Math.max(high[0] - low[0], high[1] - low[1]);
      this.engines = clear;
      this.low = low.map(value => value - room);
      this.high = high.map(value => value + room);
      this.most = Math.max(0, ...this.engines.map(engine => engine.forces.reduce((a, b) => Math.max(a, b), 0)));
      this.show(Math.min(this.at, this.count - 1));
    }

    play() {
      this.playing = true;
      this.button.textContent = "❚❚ Pause";
      if (this.at >= this.count - 1) this.at = 0;
      const begin = performance.now(), from = this.at;
      const step = now => {
        if (!this.playing) return;
        const at = from + (now - begin) / (1000 * SECONDS) * (this.count - 1);
        if (at >= this.count - 1) { this.show(this.count - 1); this.stop(); return; }
        this.show(Math.max(at, 0));
        requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    }

    stop() {
      this.playing = false;
      this.button.textContent = "▶ Play";
    }

    /* Draw at a frame number; between stored ones everything is interpolated linearly, and the text says so. */
    show(at) {
      this.at = at;
      if (!this.engines) return;
      const k = Math.min(Math.floor(at), this.count - 1), next = Math.min(k + 1, this.count - 1), part = at - k;
      const width = Math.min(this.figure.clientWidth, 560), shape = (this.high[1] - this.low[1]) / (this.high[0] - this.low[0]);
      const tall = Math.min(560, Math.max(150, width * shape)), ratio = devicePixelRatio || 1;
      if (width < 10) return;
      Object.assign(this.canvas, { width: width * ratio, height: tall * ratio });
      Object.assign(this.canvas.style, { width: `${width}px`, height: `${tall}px` });
      const size = Math.min(width / (this.high[0] - this.low[0]), tall / (this.high[1] - this.low[1]));
      const middle = [(this.low[0] + this.high[0]) / 2, (this.low[1] + this.high[1]) / 2];
      const px = x => width / 2 + (x - middle[0]) * size, py = y => tall / 2 - (y - middle[1]) * size;
      const ctx = this.canvas.getContext("2d");
      ctx.scale(ratio, ratio);
      const shown = this.engines.filter(engine => !ninedisk.hidden.has(engine.id));
      shown.forEach((engine, order) => {
        const mix = (values, stride, index) => values[k * stride + index] * (1 - part) + values[next * stride + index] * part;
        const n = this.radius.length, m = engine.wall_angle.length / this.count;
        const place = i => [mix(engine.x, 2 * n, 2 * i), mix(engine.x, 2 * n, 2 * i + 1)];
        const cell = this.cell && this.lattice(mix(engine.t, 1, 0)), centre = cell ? i => cell.back(place(i)) : place;
        const walls = Array.from({ length: m }, (_, w) => {
          const a = mix(engine.wall_angle, m, w);
          return { p: [mix(engine.wall_point, 2 * m, 2 * w), mix(engine.wall_point, 2 * m, 2 * w + 1)], n: [Math.cos(a), Math.sin(a)] };
        });
        const line = (a, b) => { ctx.beginPath(); ctx.moveTo(px(a[0]), py(a[1])); ctx.lineTo(px(b[0]), py(b[1])); ctx.stroke(); };
        if (order === 0 && this.most > 0) {
          ctx.strokeStyle = style("--chain");
          ctx.lineCap = "round";
          engine.pairs.forEach(([i, j], pair) => {
            const force = mix(engine.forces, engine.pairs.length, pair);
            if (!(force > 0)) return;
            const a = centre(i), wall = walls[j - n];
            const depth = wall && (a[0] - wall.p[0]) * wall.n[0] + (a[1] - wall.p[1]) * wall.n[1];
            ctx.lineWidth = 12 * force / this.most;
            line(a, wall ? [a[0] - depth * wall.n[0], a[1] - depth * wall.n[1]] : centre(j));
          });
        }
        ctx.strokeStyle = engine.look.colour;
        ctx.lineCap = "butt";
        ctx.lineWidth = 1.4;
        ctx.setLineDash(engine.look.dash);
        for (const wall of walls) { const [a, b] = this.stretch(wall, walls); line(a, b); }
        if (cell) this.images(ctx, cell, n, centre, px, py, size, order === 0);
        for (let i = 0; i < n; i++) {
          const c = centre(i), angle = mix(engine.angle, n, i), r = this.radius[i];
          const edge = this.edges[i], cos = Math.cos(angle), sin = Math.sin(angle);
          const rim = j => [c[0] + edge[2 * j] * cos - edge[2 * j + 1] * sin, c[1] + edge[2 * j] * sin + edge[2 * j + 1] * cos];
          ctx.beginPath();
          if (!edge) ctx.arc(px(c[0]), py(c[1]), r * size, 0, 2 * Math.PI);
          else if (Number.isFinite(angle)) for (let j = 0; j < edge.length / 2; j++) { const [x, y] = rim(j); ctx[j ? "lineTo" : "moveTo"](px(x), py(y)); }
          ctx.stroke();
          if (Number.isFinite(angle)) line(c, edge ? rim(0) : [c[0] + r * Math.cos(angle), c[1] + r * Math.sin(angle)]);
        }
        ctx.setLineDash([]);
      });
      if (!this.playing) this.slider.value = k;
      const first = this.engines[0], stored = part === 0;
      this.told.textContent = stored ? `step ${first.step[k]}, t = ${+first.t[k].toPrecision(6)} s` : `between steps ${first.step[k]} and ${first.step[next]}`;
      this.canvas.setAttribute("aria-label", `Configuration ${this.told.textContent}, ${shown.length} engines: ${shown.map(engine => engine.look.name).join(", ")}.`);
    }

    /* The periodic cell at a time: edges a (along x) and b, the one of the lattice that leans least; where a point lies in it. */
    lattice(t) {
      const { size, motion } = this.cell, wide = size[0] + t * motion[0][0], high = size[1] + t * motion[1][1];
      const lean = t * motion[0][1] - Math.round(t * motion[0][1] / wide) * wide;
      const at = (p, q) => [p * wide + q * lean, q * high];
      const part = c => [(c[0] - lean * c[1] / high) / wide, c[1] / high];
      const back = c => { const [p, q] = part(c); return at(p - Math.floor(p), q - Math.floor(q)); };
      return { wide, high, at, part, back };
    }

    /* Images beside the cell, faint, and for the first engine the cell's edges. */
    images(ctx, cell, n, centre, px, py, size, edges) {
      ctx.save();
      ctx.globalAlpha = 0.3;
      for (let i = 0; i < n; i++) {
        const r = this.radius[i], [p, q] = cell.part(centre(i)), dp = 2 * r / cell.wide, dq = 2 * r / cell.high;
        for (const a of [-1, 0, 1]) for (const b of [-1, 0, 1]) {
          if (!a && !b || p + a < -dp || p + a > 1 + dp || q + b < -dq || q + b > 1 + dq) continue;
          const [x, y] = cell.at(p + a, q + b);
          ctx.beginPath();
          ctx.arc(px(x), py(y), r * size, 0, 2 * Math.PI);
          ctx.stroke();
        }
      }
      ctx.restore();
      if (!edges) return;
      ctx.save();
      ctx.setLineDash([]);
      ctx.lineWidth = 2;
      ctx.strokeStyle = style("--ink");
      ctx.beginPath();
      for (const [p, q] of [[0, 0], [1, 0], [1, 1], [0, 1]]) { const [x, y] = cell.at(p, q); ctx[p || q ? "lineTo" : "moveTo"](px(x), py(y)); }
      ctx.closePath();
      ctx.stroke();
      ctx.restore();
    }

    /* Ends of a wall's line: inside the picture and on the free side of the other walls. */
    stretch(wall, walls) {
      const along = [-wall.n[1], wall.n[0]], dot = (a, b) => a[0] * b[0] + a[1] * b[1], minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
      const reach = 0.5 * Math.hypot(...minus(this.high, this.low));
      const middle = dot(minus([(this.low[0] + this.high[0]) / 2, (this.low[1] + this.high[1]) / 2], wall.p), along);
      let first = middle - reach, last = middle + reach;
      for (const other of walls) {
        const slope = dot(along, other.n);
        if (other === wall || Math.abs(slope) < 1e-6) continue;
        const cut = dot(minus(other.p, wall.p), other.n) / slope;
        if (slope > 0) first = Math.max(first, cut);
        else last = Math.min(last, cut);
      }
      return [first, last].map(s => [wall.p[0] + s * along[0], wall.p[1] + s * along[1]]);
    }
  }

  ninedisk.ready.push(() => { for (const figure of document.querySelectorAll("figure[data-player]")) new Player(figure); });
})();
