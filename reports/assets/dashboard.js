// Exact values of a chart under the pointer, or under the arrow keys of a focused one. All text is set as text.
"use strict";
(() => {
  const runs = JSON.parse(document.getElementById("runs").textContent);
  const tip = document.getElementById("tip");
  const place = new WeakMap();

  // Words that are the same as at the point before are left out of the page.
  const held = new Map();
  for (const chart of document.querySelectorAll("svg[data-points]")) {
    let words = ["", "", ""];
    held.set(chart, JSON.parse(chart.dataset.points).map(([x, y, run, ...said]) => {
      words = said.map((word, k) => word ?? words[k]);
      return [x, y ?? chart.viewBox.baseVal.height / 2, run, ...words];
    }));
  }

  function show(chart, number) {
    const [x, y, run, value, version, reason] = held.get(chart)[number];
    place.set(chart, number);
    let ring = chart.querySelector(".here");
    if (!ring) {
      ring = document.createElementNS("http://www.w3.org/2000/svg", "circle");
      ring.setAttribute("class", "here");
      ring.setAttribute("r", "5");
      chart.append(ring);
    }
    ring.setAttribute("cx", x);
    ring.setAttribute("cy", y);
    const facts = runs[run];
    const lines = [
      value,
      reason,
      `${facts.date}, commit ${facts.commit || "unknown"}`,
      `ninedisk ${facts.ninedisk}${version ? `, engine ${version}` : ""}`,
      facts.changed.length ? `since the run before: ${facts.changed.join(", ")}` : "",
      facts.id,
    ];
    tip.textContent = lines.filter(Boolean).join("\n");
    tip.hidden = false;
    const box = chart.getBoundingClientRect();
    const scale = box.width / chart.viewBox.baseVal.width;
    const left = box.left + x * scale + 12;
    const top = box.top + y * scale + 12;
    tip.style.left = `${Math.max(4, Math.min(left, innerWidth - tip.offsetWidth - 4))}px`;
    tip.style.top = `${Math.max(4, Math.min(top, innerHeight - tip.offsetHeight - 4))}px`;
  }

  function hide(chart) {
    chart.querySelector(".here")?.remove();
    tip.hidden = true;
  }

  for (const [chart, points] of held) {
    const count = points.length;
    const point = event => {
      const box = chart.getBoundingClientRect();
      const x = (event.clientX - box.left) * chart.viewBox.baseVal.width / box.width;
      const apart = points.map(point => Math.abs(point[0] - x));
      show(chart, apart.indexOf(Math.min(...apart)));
    };
    chart.addEventListener("pointermove", point);
    chart.addEventListener("pointerdown", point);
    chart.addEventListener("pointerleave", () => hide(chart));
    chart.addEventListener("blur", () => hide(chart));
    chart.addEventListener("keydown", event => {
      const step = { ArrowLeft: -1, ArrowRight: 1, Home: -count, End: count }[event.key];
      if (event.key === "Escape") hide(chart);
      if (step === undefined) return;
      event.preventDefault();
      show(chart, Math.max(0, Math.min(count - 1, (place.get(chart) ?? (step > 0 ? -1 : count)) + step)));
    });
  }
})();
