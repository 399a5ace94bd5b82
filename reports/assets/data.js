"use strict";
/* A case's numbers as the store holds them, unpacked from the page's data file, and what the page's reader has switched off. */
const ninedisk = {
  hidden: new Set(), // engines and references that are switched off, by legend key
  toggled: [], // called after a change of `hidden`
  ready: [], // called once the data are there
  data: null,
};

/* Text of a data file: base64 of zlib of [length of the head, head as JSON, arrays of float64 stored byte plane by byte plane]. */
ninedisk.load = async text => {
  if (!("DecompressionStream" in window)) return; // the pictures of the page stay
  const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = new DataView(raw.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(raw.subarray(4, 4 + size)));
  let at = 4 + size;
  const arrays = head.lengths.map(n => {
    const bytes = new Uint8Array(8 * n);
    for (let plane = 0; plane < 8; plane++)
      for (let k = 0; k < n; k++) bytes[8 * k + plane] = raw[at + plane * n + k];
    at += 8 * n;
    return new Float64Array(bytes.buffer);
  });
  const found = new Map();
  const keep = (kind, variant, quantity, curve) => {
    const key = JSON.stringify([variant, quantity]);
    if (!found.has(key)) found.set(key, { curves: [], references: [] });
    found.get(key)[kind].push(curve);
  };
  for (const [variant, engine, quantity, step, t, value, expected, truth, tolerance] of head.curves)
    keep("curves", head.variants[variant], quantity, {
      key: head.engines[engine].id, look: head.engines[engine], step: arrays[step], t: arrays[t], value: arrays[value],
      expected: arrays[expected], truth, tolerance,
    });
  for (const [variant, quantity, look, step, t, value] of head.references)
    keep("references", head.variants[variant], quantity, {
      key: `reference ${head.labels[look].name}`, look: head.labels[look], step: arrays[step], t: arrays[t], value: arrays[value],
    });
  ninedisk.data = { head, arrays, of: (variant, quantity) => found.get(JSON.stringify([variant, quantity])) };
  for (const call of ninedisk.ready) call();
  document.documentElement.dataset.data = "ready";
};

ninedisk.toggle = (key, off) => {
  if (off) ninedisk.hidden.add(key);
  else ninedisk.hidden.delete(key);
  for (const button of document.querySelectorAll(".legend button"))
    if (button.dataset.key === key) button.setAttribute("aria-pressed", String(!off));
  for (const call of ninedisk.toggled) call();
};

/* Legends become switches: one press takes an engine out of every chart of the page. */
addEventListener("DOMContentLoaded", () => {
  for (const item of document.querySelectorAll(".legend li[data-key]")) {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.key = item.dataset.key;
    button.setAttribute("aria-pressed", "true");
    button.append(...item.childNodes);
    button.addEventListener("click", () => ninedisk.toggle(button.dataset.key, button.getAttribute("aria-pressed") === "true"));
    item.append(button);
  }
});
