"use strict";
/* The rest of a long table comes from the page's data file when it is opened, with a box that keeps matching rows. */
(() => {
  const MOST = 400; // rows drawn at once
  function fill(place) {
    const rows = ninedisk.data.head.tables[place.dataset.rows] || [];
    const label = document.createElement("label"), input = document.createElement("input"), told = document.createElement("span");
    label.className = "filter";
    input.type = "search";
    input.placeholder = "engine, variant, quantity, status";
    told.setAttribute("role", "status");
    label.append("Keep rows with ", input, told);
    const table = place.querySelector("table"), body = table.createTBody();
    place.prepend(label);
    const texts = rows.map(row => row.join(" ").toLowerCase());
    const draw = () => {
      const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
      const kept = rows.filter((row, k) => words.every(word => texts[k].includes(word)));
      body.replaceChildren();
      for (const [status, word, shade, ratio, ...cells] of kept.slice(0, MOST)) {
        const row = body.insertRow();
        const add = (text, name) => { const cell = row.insertCell(); cell.textContent = text; if (name) cell.className = name; return cell; };
        const note = cells.pop();
        add(word, `st st-${status.replace(/[^a-z-]/g, "")}`);
        add(ratio, `n ${shade}`);
        cells.forEach((text, k) => add(text, k > 2 && k < 8 ? "n" : ""));
        const link = document.createElement("a");
        link.href = `#why-${note}`;
        link.textContent = `[${note}]`;
        row.lastElementChild.append(" ", link);
      }
      told.textContent = ` ${kept.length} of ${rows.length}${kept.length > MOST ? `, the first ${MOST} shown` : ""}`;
    };
    input.addEventListener("input", draw);
    draw();
    place.classList.add("drawn");
  }
  ninedisk.ready.push(() => {
    for (const place of document.querySelectorAll("[data-rows]")) {
      const fold = place.closest("details");
      if (fold.open) fill(place);
      else fold.addEventListener("toggle", () => fill(place), { once: true });
    }
  });
})();
