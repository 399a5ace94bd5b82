"use strict";
/* What the matrix shows is remembered in the address; one engine can be looked at alone. */
(() => {
  const place = document.querySelector(".overview"), table = place.querySelector("table"), only = document.getElementById("only");
  const told = place.querySelector(".more"), frame = place.querySelector(".scroll");
  const read = () => {
    const asked = new URLSearchParams(location.hash.slice(1));
    const mode = document.getElementById(`show-${asked.get("show")}`);
    if (mode) mode.checked = true;
    const engine = [...only.options].find(option => option.dataset.engine === asked.get("engine"));
    if (asked.has("engine") && engine) only.value = engine.value;
    draw();
  };
  const draw = () => {
    const kept = Number(only.value);
    table.classList.toggle("one", kept > 0);
    for (const row of table.rows) for (let k = 1; k < row.cells.length; k++) row.cells[k].hidden = kept > 0 && k !== kept;
    width();
  };
  const width = () => {
    const cut = frame.scrollWidth > frame.clientWidth + 1;
    told.hidden = !cut;
    told.textContent = cut ? "The table is wider than the window: scroll it sideways, or choose one engine." : "";
  };
  place.addEventListener("change", () => {
    const words = new URLSearchParams({ show: place.querySelector("input:checked").value });
    if (only.value) words.set("engine", only.selectedOptions[0].dataset.engine);
    history.replaceState(null, "", `#${words}`);
    draw();
  });
  addEventListener("hashchange", read);
  addEventListener("resize", width);
  read();
})();
