"use strict";
/* Charts over the stored numbers: zoom by dragging, values under the pointer, everything by keyboard as well. */
(() => {
  const charts = new Set();
  const PAPER = { "--ink": "#000", "--soft": "#444", "--line": "#ccc" };
  let printing = false;
  const style = name => printing ? PAPER[name] : getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const decade = value => `1e${Math.round(Math.log10(value))}`;
  const short = value => {
    const size = Math.abs(value);
    return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(3).replace(/\.?0+e/, "e").replace("+", "") : String(+value.toPrecision(6));
  };

  /* Decades of a log axis, at most seven of them; where one or none lies inside, round numbers. */
  const decades = (u, axis, low, high) => {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9), every = Math.ceil((last - first + 1) / 7) || 1;
    const marks = [];
    for (let k = first; k <= last; k += every) marks.push(10 ** k);
    if (marks.length > 1) return marks;
    const below = 10 ** Math.floor(Math.log10(low)), round = marks.length ? [1, 2, 5, 10, 20, 50] : [2, 3, 5, 7];
    return round.map(m => m * below).filter(value => value >= low && value <= high);
  };
  const power = value => Math.abs(Math.log10(value) - Math.round(Math.log10(value))) < 1e-9 ? decade(value) : short(value);

  /* Labels of the marks of a horizontal axis that do not run into each other: the last one stays. */
  const apart = (u, values) => {
    let free = Infinity;
    return values.map(value => [value, u.valToPos(value, "x")]).reverse().map(([value, at]) => {
      if (free - at < 42) return "";
      free = at;
      return short(+value.toPrecision(3)); // marks at measured places, steps halved for instance, have as many digits as a double
    }).reverse();
  };

  /* Names beside the ends of curves: those that end together share a label, and none covers another. */
  const APART = 11, LABEL = 16;
  function endLabels(places, height) {
    let groups = [];
    for (const place of [...places].sort((a, b) => a.y - b.y)) {
      const last = groups[groups.length - 1];
      if (last && place.y - last[last.length - 1].y <= 3.5) last.push(place);
      else groups.push([place]);
    }
    while (groups.length > Math.max(1, Math.floor(height / APART))) {
      let at = 0, least = Infinity;
      for (let k = 0; k + 1 < groups.length; k++) {
        const gap = groups[k + 1][0].y - groups[k][groups[k].length - 1].y;
        if (gap < least) [least, at] = [gap, k];
      }
      groups.splice(at, 2, [...groups[at], ...groups[at + 1]]);
    }
    const at = [];
    for (const group of groups) {
      const middle = group.reduce((sum, place) => sum + place.y, 0) / group.length;
      at.push(Math.max(middle, at.length ? at[at.length - 1] + APART : 5));
    }
    for (let k = at.length - 1, most = height - 3; k >= 0; k--, most -= APART) at[k] = most = Math.min(at[k], most);
    return groups.map((group, k) => {
      const names = [...new Set(group.filter(place => !place.truth).map(place => place.name))], truth = group.some(place => place.truth);
      const all = names.join(", "), one = names.length < 2 || all.length <= LABEL ? all : `${names.length} engines`;
      return { y: at[k], text: truth ? (names.length ? `truth + ${names.length}` : "truth") : one, colour: names.length === 1 && !truth ? group.find(place => !place.truth).colour : null };
    });
  }

  /* Ends of what a plot shows, in CSS pixels from its top; beyond the plot they are at its edge. */
  function endsOf(u, shown) {
    const top = u.bbox.top / devicePixelRatio, height = u.bbox.height / devicePixelRatio, places = [];
    shown.forEach((s, index) => {
      if (s.guide || !u.series[index + 1].show) return;
      let k = u.data[0].length - 1;
      while (k >= 0 && (u.data[index + 1][k] === null || u.data[index + 1][k] === undefined || u.data[0][k] > u.scales.x.max)) k--;
      if (k < 0) return;
      const y = u.valToPos(u.data[index + 1][k], "y");
      places.push({ name: s.short || s.name, colour: s.colour, truth: s.key.startsWith("reference "), y: Math.min(height, Math.max(0, y)) });
    });
    return endLabels(places, height).map(label => ({ ...label, y: label.y + top }));
  }

  /* Curves of a history on the union of their steps; the last `last` steps of each, counted from their beginning. */
  function history(spec) {
    const held = ninedisk.data.of(spec.variant, spec.quantity);
    if (!held) return null;
    const stored = spec.references ? held.references : [];
    const end = Math.max(...held.curves.map(curve => curve.step.length ? curve.step[curve.step.length - 1] : 0));
    const begin = spec.last === null ? 0 : Math.max(0, end - spec.last), rows = new Map();
    for (const curve of [...held.curves, ...stored])
      curve.step.forEach((step, k) => { if (step >= begin && !rows.has(step)) rows.set(step, spec.x === "cycle" ? step - begin : curve.t[k]); });
    const steps = [...rows.keys()].sort((a, b) => a - b), place = new Map(steps.map((step, k) => [step, k]));
    const column = (curve, read) => {
      const made = new Array(steps.length).fill(null);
      curve.step.forEach((step, k) => { const value = read(k); if (place.has(step) && Number.isFinite(value)) made[place.get(step)] = value; });
      return made;
    };
    const series = [];
    const add = (curve, error) => series.push({
      key: curve.key, name: curve.look.name, colour: curve.look.colour, dash: curve.look.dash, width: curve.look.width, shape: curve.look.shape, phase: curve.look.phase,
      y: column(curve, k => curve.value[k]), error, tolerance: curve.tolerance, line: true,
    });
    for (const curve of stored) add(curve, null);
    const best = new Map(stored.length ? [] : held.curves.filter(curve => curve.truth && curve.expected.some(Number.isFinite)).map(curve => [curve.truth, curve]));
    for (const [truth, curve] of best) {
      const look = ninedisk.data.head.labels.find(label => label.name === `best truth (${truth})`);
      if (look) add({ ...curve, value: curve.expected, key: `reference ${look.name}`, look, tolerance: null }, null);
    }
    for (const curve of held.curves) add(curve, column(curve, k => Math.abs(curve.value[k] - curve.expected[k])));
    return { x: steps.map(step => rows.get(step)), series };
  }

  /* Points of several series on the union of their places. */
  function points(given) {
    const x = [...new Set(given.flatMap(s => s.x))].sort((a, b) => a - b), place = new Map(x.map((at, k) => [at, k]));
    const column = (s, values) => {
      const made = new Array(x.length).fill(null);
      values.forEach((value, k) => { made[place.get(s.x[k])] = value; });
      return made;
    };
    return { x, series: given.map(s => ({ ...s, y: column(s, s.y), names: column(s, s.names || []), told: s.names || [], heights: s.y })) };
  }

  /* A curve that speaks at scattered samples only loses its gaps, any other keeps them. */
  const scattered = y => {
    let held = 0, alone = 0;
    y.forEach((value, k) => { if (value !== null) { held++; if ((y[k - 1] ?? null) === null && (y[k + 1] ?? null) === null) alone++; } });
    return 2 * alone > held;
  };

  /* Marks of a series: at every point, or at a few places of a history, staggered so that coinciding curves stay apart. */
  const MARKS = 7;
  const marks = (s, history) => (u, index, first, last) => {
    const fill = new Path2D(), y = u.data[index], x = u.data[0], shape = new Path2D(s.shape), size = devicePixelRatio * (history ? 0.9 : 1.25);
    const at = history ? Array.from({ length: MARKS }, (_, k) => first + Math.floor((k + s.phase) / MARKS * (last - first + 1))) : x.map((_, k) => k);
    for (const k of at) {
      if (k < first || k > last || y[k] === null || y[k] === undefined) continue;
      const px = u.valToPos(x[k], "x", true), py = u.valToPos(y[k], "y", true);
      fill.addPath(shape, new DOMMatrix([size, 0, 0, size, px - 16 * size, py - 5 * size]));
    }
    return { stroke: null, fill, clip: null, flags: 3 };
  };

  /* The line of a series of points in the order that they were given in, which need not be that of the axis. */
  const joined = s => u => {
    const stroke = new Path2D();
    s.x.forEach((x, k) => stroke[k ? "lineTo" : "moveTo"](u.valToPos(x, "x", true), u.valToPos(s.heights[k], "y", true)));
    return { stroke, fill: null, clip: null, flags: 3 };
  };

  /* Where the point leads to that is nearest to the pointer, if any is near it. */
  const NEAR = 16;
  function nearest(u, event) {
    const corner = u.over.getBoundingClientRect(), at = [event.clientX - corner.left, event.clientY - corner.top];
    let link = null, least = NEAR;
    u.shown.forEach((s, index) => {
      if (s.guide || !u.series[index + 1].show) return;
      (s.links || []).forEach((each, k) => {
        const far = Math.hypot(u.valToPos(s.x[k], "x") - at[0], u.valToPos(s.heights[k], "y") - at[1]);
        if (far < least) [least, link] = [far, each];
      });
    });
    return link;
  }

  /* Go to a place of this page, also inside what is folded. */
  function follow(link) {
    if (!link) return;
    const place = document.getElementById(decodeURIComponent(link.slice(1)));
    for (let fold = place && place.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    if (location.hash === link) location.hash = "";
    location.hash = link;
  }

  const GUTTER = 88; // beside a chart, for the names of its curves

  class Chart {
    constructor(figure) {
      this.figure = figure;
      this.spec = JSON.parse(figure.dataset.chart);
      this.held = this.spec.kind === "history" ? history(this.spec) : points(this.spec.points);
      if (!this.held || !this.held.x.length) return;
      this.window = null;
      this.lines = this.held.series.some(s => s.line && !s.guide);
      this.full = [this.held.x[0], this.held.x[this.held.x.length - 1]];
      if (this.spec.limits && this.spec.limits.x) this.full = this.spec.limits.x;
      if (this.full[0] === this.full[1]) this.full = [this.full[0] - 1, this.full[1] + 1];
      this.box = document.createElement("div");
      this.box.className = "plot";
      const title = document.createElement("div");
      title.className = "title";
      title.textContent = this.spec.title;
      this.readout = document.createElement("div");
      this.readout.className = "readout";
      this.readout.hidden = true;
      this.readout.setAttribute("role", "status");
      this.box.append(title);
      figure.append(this.box, this.readout);
      figure.classList.add("drawn");
      figure.tabIndex = 0;
      figure.setAttribute("role", "group");
      figure.setAttribute("aria-label", `${figure.dataset.alt} Arrow keys read values, plus and minus zoom, 0 shows everything.`);
      const below = this.spec.error;
      this.plots = [this.plot(below ? 190 : 240, this.held.series.map(s => s.y), this.spec.y, this.spec.ylog, this.spec.title === this.spec.y_label ? undefined : this.spec.y_label, !below)];
      if (below) {
        const floor = this.spec.floor;
        this.plots.push(this.plot(185, this.held.series.map(s => s.error && s.error.map(e => e === null ? null : Math.max(e, floor))), this.spec.error, true, this.spec.error_label, true));
      }
      if (this.spec.note) {
        const note = document.createElement("p");
        note.className = "note";
        note.textContent = this.spec.note;
        this.box.append(note);
      }
      ninedisk.paper?.(figure, this);
      figure.addEventListener("keydown", event => this.key(event));
      figure.addEventListener("blur", () => { this.readout.hidden = true; });
      new ResizeObserver(() => this.resize()).observe(this.box);
      charts.add(this);
    }

    plot(height, columns, limits, log, label, last) {
      const chart = this, xlog = this.spec.xlog, ink = () => style("--ink"), grid = { stroke: () => style("--line"), width: 1 };
      const font = "11px system-ui, sans-serif";
      const shown = this.held.series.map((s, k) => ({ ...s, y: columns[k] })).filter(s => s.y);
      const range = (u, low, high) => {
        if (!chart.window || low === null || !Number.isFinite(low)) return limits;
        if (log) return [Math.max(limits[0], low / 2), high * 2];
        const room = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1e-12;
        return [low - room, high + room];
      };
      const options = {
        width: this.width(), height, legend: { show: false }, padding: [null, this.lines && !this.spec.bare ? GUTTER : null, null, null],
        scales: { x: { time: false, distr: xlog ? 3 : 1, range: () => chart.window || chart.full }, y: { distr: log ? 3 : 1, range } },
        axes: [
          { stroke: ink, grid, ticks: grid, font, size: last ? 40 : 6, label: last ? this.spec.x_label : undefined, labelFont: font, labelSize: 14, values: (u, v) => v.map(last ? short : () => ""), ...(xlog ? { splits: (u, axis, low, high) => chart.spec.marks || decades(u, axis, low, high), values: apart, filter: (u, v) => v } : {}) },
          { stroke: ink, grid, ticks: grid, font, size: 58, label, labelFont: font, labelSize: 16, values: (u, v) => v.map(log ? power : short), ...(log ? { splits: decades, filter: (u, v) => v } : {}) },
        ],
        series: [{}, ...shown.map(s => ({
          label: s.name, show: !ninedisk.hidden.has(s.key), stroke: s.colour, width: s.width * (s.key.startsWith("reference ") ? 1 : 1.1), dash: s.dash.length ? s.dash : undefined,
          alpha: s.key.startsWith("reference ") ? 0.6 : 1, spanGaps: scattered(s.y),
          ...(this.spec.kind === "history" ? {} : { paths: s.line ? joined(s) : () => null }), points: { show: Boolean(s.shape), fill: s.colour, width: 0, paths: marks(s, this.spec.kind === "history") },
        }))],
        cursor: { drag: { x: true, y: false, setScale: false }, points: { size: 6 }, bind: { dblclick: () => () => { chart.zoom(null); return null; } } },
        hooks: {
          ready: [u => chart.square(u)],
          setSize: [u => chart.square(u)],
          setCursor: [u => chart.point(u)],
          setSelect: [u => { if (u.select.width > 4) chart.zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]); u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false); }],
          draw: [
            ...(this.spec.kind === "points" ? [u => chart.guides(u)] : log ? [u => chart.tolerances(u, shown)] : []),
            ...(this.lines && !this.spec.bare ? [u => chart.ends(u, shown)] : []),
          ],
        },
      };
      const made = new uPlot(options, [this.held.x, ...shown.map(s => s.y)], this.box);
      made.keys = shown.map(s => s.key);
      made.shown = shown;
      made.label = label;
      made.over.addEventListener("mouseleave", () => { this.readout.hidden = true; });
      if (shown.some(s => s.links && s.links.length)) {
        made.over.style.cursor = "pointer";
        let from = null;
        made.over.addEventListener("mousedown", event => { from = [event.clientX, event.clientY]; });
        made.over.addEventListener("click", event => {
          if (!from || Math.hypot(event.clientX - from[0], event.clientY - from[1]) < 4) follow(nearest(made, event));
        });
      }
      return made;
    }

    /* Names of the curves beside their ends. */
    ends(u, shown) {
      const { ctx, bbox } = u, ratio = devicePixelRatio;
      ctx.save();
      Object.assign(ctx, { font: `${10 * ratio}px system-ui, sans-serif`, textAlign: "left", textBaseline: "middle" });
      for (const { y, text, colour } of endsOf(u, shown)) {
        ctx.fillStyle = colour || style("--ink");
        ctx.fillText(text, bbox.left + bbox.width + 4 * ratio, y * ratio, (GUTTER - 6) * ratio);
      }
      ctx.restore();
    }

    /* The same scale on both axes, where a chart asks for it and is not too flat or too tall for that. */
    square(u) {
      if (!this.spec.equal) return;
      const tall = u.bbox.height / devicePixelRatio, wide = u.bbox.width / devicePixelRatio, { x } = this.spec.limits, { y } = this.spec;
      const fit = Math.min(2, Math.max(0.3, (y[1] - y[0]) / (x[1] - x[0]))) * wide;
      if (Math.abs(fit - tall) > 1) queueMicrotask(() => u.setSize({ width: u.width, height: Math.round(u.height + fit - tall) })); // within a draw it is lost
    }
    width() { return Math.max(200, this.box.clientWidth); }
    resize() { for (const u of this.plots || []) if (Math.abs(u.width - this.width()) > 1) u.setSize({ width: this.width(), height: u.height }); }
    zoom(window) {
      this.window = window;
      for (const u of this.plots) u.setScale("x", { min: 0, max: 1 });
    }
    update() { for (const u of this.plots || []) u.keys.forEach((key, k) => { if (u.series[k + 1].show === ninedisk.hidden.has(key)) u.setSeries(k + 1, { show: !ninedisk.hidden.has(key) }); }); }
    redraw() { for (const u of this.plots || []) u.redraw(false, true); }

    /* Each visible engine's tolerance as a tick at the right edge. */
    tolerances(u, shown) {
      const { ctx, bbox } = u;
      for (const s of shown) {
        if (!(s.tolerance > 0) || ninedisk.hidden.has(s.key)) continue;
        const y = Math.round(u.valToPos(s.tolerance, "y", true));
        if (y < bbox.top || y > bbox.top + bbox.height) continue;
        ctx.fillStyle = s.colour;
        ctx.fillRect(bbox.left + 0.94 * bbox.width, y - 1, 0.06 * bbox.width, 2 * devicePixelRatio);
      }
    }

    /* Names of the lines to compare with, at their ends: the lowest below its line, the others above. */
    guides(u) {
      const { ctx } = u, named = this.held.series.filter(s => s.guide && s.name), end = s => s.heights[s.heights.length - 1];
      const low = Math.min(...named.map(end));
      ctx.save();
      Object.assign(ctx, { font: `${10 * devicePixelRatio}px system-ui, sans-serif`, fillStyle: style("--soft"), strokeStyle: style("--card"), lineWidth: 4 * devicePixelRatio, lineJoin: "round", textAlign: "right" });
      for (const s of named) {
        const below = end(s) === low, apart = (below ? 6 : -6) * devicePixelRatio; // clear of marks on the line
        ctx.textBaseline = below ? "top" : "bottom";
        const place = [s.name, u.valToPos(s.x[s.x.length - 1], "x", true), u.valToPos(end(s), "y", true) + apart];
        ctx.strokeText(...place);
        ctx.fillText(...place);
      }
      ctx.restore();
    }

    /* Exact values at the sample under the pointer, the largest error first. */
    point(u) {
      const k = u.cursor.idx;
      if (k === null || k === undefined) { this.readout.hidden = true; return; }
      this.at = k;
      for (const other of this.plots || []) if (other !== u) other.setCursor({ left: u.cursor.left, top: -10 }, false);
      const rows = this.held.series.filter(s => s.y && s.y[k] !== null && !s.guide && !ninedisk.hidden.has(s.key));
      rows.sort((a, b) => (b.error ? b.error[k] ?? -1 : -2) - (a.error ? a.error[k] ?? -1 : -2));
      const table = document.createElement("table");
      const line = (cells, key, colour) => {
        const row = table.insertRow();
        if (key) row.dataset.key = key;
        cells.forEach((text, column) => {
          const cell = row.insertCell();
          if (colour && column === 0) { const dot = document.createElement("i"); dot.style.background = colour; cell.append(dot); }
          cell.append(text);
        });
      };
      const unit = this.spec.unit ? ` [${this.spec.unit}]` : "";
      line([`${this.spec.x_label} ${this.held.x[k]}`, `value${unit}`, ...(this.spec.error ? ["|error|"] : [])]);
      const told = new Set();
      for (const s of rows) {
        const same = JSON.stringify([s.key, s.y[k]]); // a truth that some engines share with others by its label
        if (told.has(same)) continue;
        told.add(same);
        line([s.names && s.names[k] ? `${s.name}: ${s.names[k]}` : s.name, String(s.y[k]), ...(this.spec.error ? [s.error && s.error[k] !== null ? s.error[k].toExponential(2) : ""] : [])], s.key, s.colour);
      }
      this.readout.replaceChildren(table);
      this.readout.hidden = false;
    }

    key(event) {
      const x = this.held.x, [low, high] = this.window || this.full, middle = x[this.at ?? 0];
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (move) this.at = Math.min(x.length - 1, Math.max(0, (this.at ?? -move) + move * (event.shiftKey ? 10 : 1)));
      else if (event.key === "Enter") {
        const s = this.held.series.find(s => !s.guide && !ninedisk.hidden.has(s.key) && s.links && s.x.includes(x[this.at ?? 0]));
        if (s) follow(s.links[s.x.indexOf(x[this.at ?? 0])]);
        return;
      }
      else if (event.key === "Home") this.at = 0;
      else if (event.key === "End") this.at = x.length - 1;
      else if (event.key === "+" || event.key === "-") {
        const half = (high - low) * (event.key === "+" ? 0.25 : 1), from = Math.max(this.full[0], middle - half), to = Math.min(this.full[1], middle + half);
        this.zoom(from <= this.full[0] && to >= this.full[1] ? null : [from, to]);
      } else if (event.key === "0" || event.key === "Escape") this.zoom(null);
      else return;
      event.preventDefault();
      const u = this.plots[0];
      u.setCursor({ left: u.valToPos(x[this.at ?? 0], "x"), top: u.over.clientHeight / 2 });
    }
  }

  ninedisk.charts = { endsOf, decades, power, short, apart, GUTTER };

  function start() {
    const waiting = new Set([...document.querySelectorAll("figure[data-chart]")].filter(figure => ninedisk.data || !figure.dataset.chart.startsWith('{"kind": "history"')));
    const draw = figure => { seen.unobserve(figure); waiting.delete(figure); new Chart(figure); };
    const seen = new IntersectionObserver(entries => {
      for (const entry of entries) if (entry.isIntersecting) draw(entry.target);
    }, { rootMargin: "300px" });
    for (const figure of waiting) seen.observe(figure);
    /* Paper: every chart that has no picture is drawn, also in folded groups, and in dark ink whatever the screen has. */
    const print = on => {
      printing = on;
      const alone = figure => !figure.querySelector("img");
      for (const fold of document.querySelectorAll(on ? "details:not([open])" : "details[data-unfolded]"))
        if ([...fold.querySelectorAll("figure[data-chart]")].some(alone)) { fold.open = on; fold.toggleAttribute("data-unfolded", on); }
      if (on) for (const figure of [...waiting].filter(alone)) draw(figure);
      for (const chart of charts) if (alone(chart.figure)) { chart.resize(); chart.redraw(); }
    };
    addEventListener("beforeprint", () => print(true));
    addEventListener("afterprint", () => print(false));
    ninedisk.toggled.push(() => { for (const chart of charts) chart.update(); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const chart of charts) chart.redraw(); });
  }
  if (document.querySelector("script[data-numbers]") && "DecompressionStream" in window) ninedisk.ready.push(start);
  else addEventListener("DOMContentLoaded", start);
})();
