"use strict";
/* For papers: a chart as it is shown as SVG, its numbers as CSV, and a caption that says what they come from. */
(() => {
  const INK = "#000", SOFT = "#555", LINE = "#ddd", FONT = 10;
  const escape = text => String(text).replace(/[&<>"]/g, c => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
  const short = value => String(+value.toFixed(1));
  const held = () => JSON.parse(document.querySelector("[data-cite]")?.dataset.cite || "null");
  const visible = chart => chart.held.series.filter(s => !ninedisk.hidden.has(s.key));

  /* What the figure shows, by which versions, and whom to cite; its heading, where the title does not say as much. */
  const told = chart => {
    const from = held(), { title, note, engine } = chart.spec;
    if (!from) return title;
    const above = [...document.querySelectorAll("main h2")].filter(h2 => h2.compareDocumentPosition(chart.figure) & Node.DOCUMENT_POSITION_FOLLOWING).pop()?.textContent;
    const engines = [...new Set([engine, ...visible(chart).map(s => s.key)])].map(key => from.engines[key]).filter(Boolean);
    return [above && above !== title ? `${above}.` : "", `${title}.`, note, engines.length ? `Engines: ${engines.join(", ")}.` : "", `Case ${from.case}, ${from.run}.`, `Cite: ${from.text}`].filter(Boolean).join(" ");
  };

  /* Round marks of a linear axis, about five of them. */
  const round = (low, high) => {
    const raw = (high - low) / 5, size = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find(m => m * size >= raw) * size, found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(+(k * step).toPrecision(12));
    return found;
  };

  /* The plots of a chart in its present window, without what is switched off, in dark ink on nothing. */
  ninedisk.svg = chart => {
    const { endsOf, decades, power, short: plain } = ninedisk.charts, ratio = devicePixelRatio, parts = [];
    const text = (x, y, words, more = "") => parts.push(`<text x="${short(x)}" y="${short(y)}" ${more}>${escape(words)}</text>`);
    let top = 22, width = 0;
    text(4, 14, chart.spec.title, `font-size="12"`);
    chart.plots.forEach((u, number) => {
      const left = u.bbox.left / ratio, wide = u.bbox.width / ratio, above = u.bbox.top / ratio, tall = u.bbox.height / ratio, log = u.scales.y.distr === 3;
      const px = x => left + u.valToPos(x, "x"), py = y => top + u.valToPos(y, "y"), clip = `${file(chart)}-${number}`, base = top + tall;
      width = Math.max(width, u.width);
      parts.push(`<clipPath id="${clip}"><rect x="${short(left)}" y="${short(top)}" width="${short(wide)}" height="${short(tall)}"/></clipPath>`);
      const { min, max } = u.scales.y;
      for (const y of log ? decades(u, 1, min, max) : round(min, max)) {
        parts.push(`<path d="M${short(left)} ${short(py(y))}h${short(wide)}" stroke="${LINE}"/>`);
        text(left - 5, py(y) + 3.5, (log ? power : plain)(y), `text-anchor="end"`);
      }
      const x = u.scales.x, marks = chart.spec.xlog ? chart.spec.marks || decades(u, 0, x.min, x.max) : round(x.min, x.max);
      for (const at of marks) {
        parts.push(`<path d="M${short(px(at))} ${short(top)}v${short(tall)}" stroke="${LINE}"/>`);
        if (number === chart.plots.length - 1) text(px(at), base + 13, (chart.spec.xlog ? power : plain)(at), `text-anchor="middle"`);
      }
      parts.push(`<path d="M${short(left)} ${short(top)}v${short(tall)}h${short(wide)}" fill="none" stroke="${INK}"/>`);
      if (u.label) parts.push(`<text transform="translate(11 ${short(top + tall / 2)}) rotate(-90)" text-anchor="middle">${escape(u.label)}</text>`);
      parts.push(`<g clip-path="url(#${clip})">`);
      u.shown.forEach((s, index) => {
        if (!u.series[index + 1].show) return;
        const y = u.data[index + 1], spots = [], joins = u.series[index + 1].spanGaps, history = chart.spec.kind === "history";
        const line = s.x && !history ? s.x.map((at, k) => [px(at), py(s.heights[k])]) : u.data[0].map((at, k) => y[k] === null || y[k] === undefined ? null : [px(at), py(y[k])]);
        let path = "", gap = true;
        for (const spot of line) {
          if (!spot) { gap = gap || !joins; continue; }
          path += `${gap ? "M" : "L"}${short(spot[0])} ${short(spot[1])}`;
          gap = false;
        }
        const dash = s.dash.length ? ` stroke-dasharray="${s.dash.join(" ")}"` : "", faint = s.key.startsWith("reference ") ? ` opacity="0.6"` : "";
        if (s.line) parts.push(`<path d="${path}" fill="none" stroke="${s.colour}" stroke-width="${s.width}"${dash}${faint}/>`);
        if (!s.shape) return;
        if (history) { const real = line.filter(Boolean); for (let k = 0; k < 7 && real.length; k++) spots.push(real[Math.min(real.length - 1, Math.floor((k + s.phase) / 7 * real.length))]); }
        else spots.push(...line);
        const size = history ? 0.9 : 1.25;
        for (const [a, b] of spots) parts.push(`<path d="${s.shape}" fill="${s.colour}" transform="translate(${short(a - 16 * size)} ${short(b - 5 * size)}) scale(${size})"/>`);
      });
      if (chart.spec.kind === "history" && log) for (const [index, s] of u.shown.entries()) {
        if (s.tolerance > 0 && u.series[index + 1].show) parts.push(`<path d="M${short(left + 0.94 * wide)} ${short(py(s.tolerance))}h${short(0.06 * wide)}" stroke="${s.colour}" stroke-width="2"/>`);
      }
      parts.push("</g>");
      if (chart.lines && !chart.spec.bare) for (const { y, text: words, colour } of endsOf(u, u.shown)) text(left + wide + 4, y - above + top + 3.5, words, colour ? `fill="${colour}"` : "");
      const guides = u.shown.filter(s => s.guide && s.name), end = s => s.heights[s.heights.length - 1], least = Math.min(...guides.map(end));
      for (const s of guides) text(px(s.x[s.x.length - 1]), py(end(s)) + (end(s) === least ? 11 : -3), s.name, `text-anchor="end" fill="${SOFT}"`);
      top = base + 14;
    });
    const last = chart.plots[chart.plots.length - 1];
    text((last.bbox.left + last.bbox.width / 2) / ratio, top + 14, chart.spec.x_label, `text-anchor="middle"`);
    /* Who is who: names in rows below, each once. */
    const people = new Map();
    for (const u of chart.plots) u.shown.forEach((s, index) => { if (!s.guide && u.series[index + 1].show) people.set(`${s.key}|${s.name}`, s); });
    let right = 4, row = top + 30;
    for (const s of people.values()) {
      const long = 26 + 5.6 * s.name.length;
      if (right + long > width && right > 4) { right = 4; row += 14; }
      const dash = s.dash.length ? ` stroke-dasharray="${s.dash.join(" ")}"` : "";
      if (s.line) parts.push(`<path d="M${short(right)} ${short(row - 3.5)}h20" stroke="${s.colour}" stroke-width="${s.width}"${dash}/>`);
      if (s.shape) parts.push(`<path d="${s.shape}" fill="${s.colour}" transform="translate(${short(right - 6)} ${short(row - 8.5)})"/>`);
      text(right + 24, row, s.name);
      right += long + 12;
    }
    if (chart.spec.kind === "history" && chart.spec.error) text(4, row += 14, "short bars at the right: tolerances", `fill="${SOFT}"`);
    const tall = Math.ceil(row + 8), about = told(chart);
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${tall}" viewBox="0 0 ${width} ${tall}" font-family="system-ui, sans-serif" font-size="${FONT}" fill="${INK}"><title>${escape(chart.spec.title)}</title><desc>${escape(about)}</desc>${parts.join("")}</svg>\n`;
  };

  /* Names of columns, a number behind those that stand for several series. */
  const apart = names => names.map((name, k) => names.indexOf(name) === names.lastIndexOf(name) ? name : `${name} (${names.slice(0, k + 1).filter(other => other === name).length})`);

  const cell = value => value === null || value === undefined ? "" : /[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value);

  /* The numbers behind the chart in its present window, exactly as stored; comment lines say what they are. */
  ninedisk.csv = chart => {
    const { spec } = chart, [low, high] = chart.window || [-Infinity, Infinity], shown = visible(chart).filter(s => !s.guide);
    const lines = [`# ${told(chart)}`.replaceAll("\n", " ")];
    if (spec.kind === "points") {
      lines.push(["series", "point", spec.x_label, spec.y_label].map(cell).join(","));
      for (const s of shown) s.x.forEach((x, k) => { if (x >= low && x <= high) lines.push([s.name, s.told[k], x, s.heights[k]].map(cell).join(",")); });
    } else {
      lines.push(apart([spec.x_label, ...shown.flatMap(s => s.error ? [`${s.name}: ${spec.y_label}`, `${s.name}: ${spec.error_label || "error"}`] : [`${s.name}: ${spec.y_label}`])]).map(cell).join(","));
      chart.held.x.forEach((x, k) => { if (x >= low && x <= high) lines.push([x, ...shown.flatMap(s => s.error ? [s.y[k], s.error[k]] : [s.y[k]])].map(cell).join(",")); });
    }
    return `${lines.join("\n")}\n`;
  };

  const save = (name, kind, text) => {
    const link = document.createElement("a"), address = URL.createObjectURL(new Blob([text], { type: kind }));
    Object.assign(link, { href: address, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  };
  /* Figures of a page that share a title are told apart by their number. */
  const file = chart => {
    const alike = [...document.querySelectorAll("figure[data-chart]")].filter(figure => JSON.parse(figure.dataset.chart).title === chart.spec.title);
    const which = alike.length > 1 ? `-${alike.indexOf(chart.figure) + 1}` : "";
    return `${held()?.slug || "ninedisk"}-${chart.spec.title}`.toLowerCase().replaceAll(/[^a-z0-9.=]+/g, "-").slice(0, 90) + which;
  };

  ninedisk.paper = (figure, chart) => {
    const bar = document.createElement("div"), about = document.createElement("p");
    bar.className = "paper";
    about.hidden = true;
    const add = (name, label, call) => {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: name });
      button.setAttribute("aria-label", `${label}: ${chart.spec.title}`);
      button.addEventListener("click", () => call(button));
      bar.append(button);
    };
    add("SVG", "Save the picture as SVG", () => save(`${file(chart)}.svg`, "image/svg+xml", ninedisk.svg(chart)));
    add("CSV", "Save the numbers shown as CSV", () => save(`${file(chart)}.csv`, "text/csv", ninedisk.csv(chart)));
    add("caption", "Show a caption with versions", button => {
      about.hidden = !about.hidden;
      button.setAttribute("aria-expanded", String(!about.hidden));
      about.textContent = told(chart);
    });
    bar.append(about);
    figure.append(bar);
  };
})();
