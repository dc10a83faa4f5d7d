// The keyboard and the pointer on attention maps. While a map has the focus, arrows move the query by a token, [ and ] go
// to the next site, digits choose a head; x shows the page without its change while it is held. The numbers of a map stand
// in its element, so the one under the pointer is told without asking the server.
(() => {
  const press = (key) => window.etnetSay("pick", key, 0, 0);
  const TOKEN = 8; // pixels on its side

  // A map keeps the focus while its HTML is replaced; a press or the focus elsewhere takes it away.
  let isOnMap = false;
  const focus = (is) => {
    isOnMap = is;
    document.documentElement.toggleAttribute("data-etv-map-focus", is);
  };
  const isMap = (element) => element?.closest?.("[data-etv-focus], [data-card='attention.atlas'], [data-card='attention.heads']") != null;
  document.addEventListener("pointerdown", (event) => focus(isMap(event.target)), true);
  document.addEventListener("focusin", (event) => event.target !== document.body && focus(isMap(event.target)));

  const query = () => document.querySelector("[data-etv-query]")?.dataset.etvQuery.split(",").map(Number);
  const moves = { ArrowLeft: [-TOKEN, 0], ArrowRight: [TOKEN, 0], ArrowUp: [0, -TOKEN], ArrowDown: [0, TOKEN] };
  const move = ([dx, dy]) => {
    const at = query();
    if (at) press(`at:${Math.max(at[0] + dx, 0)},${Math.max(at[1] + dy, 0)}`);
  };
  const head = (digit) => {
    const card = document.querySelector(`[data-testid='head-${digit}']`);
    if (card) press(`set:attention.head:${card.classList.contains("et-chosen") ? "none" : digit}`);
  };
  const isTyping = (event) => event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
  window.addEventListener(
    "keydown",
    (event) => {
      if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key.toLowerCase() === "x" && !event.repeat) press("inspect:original:on");
      if (!isOnMap || !document.querySelector("[data-etv-query]")) return;
      if (moves[event.key]) move(moves[event.key]);
      else if (event.key === "[" || event.key === "]") press(`attention:site:${event.key === "]" ? "+1" : "-1"}`);
      else if (/^[0-9]$/.test(event.key)) event.repeat || head(event.key);
      else if (event.key === "Escape") return void focus(false);
      else return;
      event.preventDefault();
      event.stopImmediatePropagation(); // digits and arrows mean something else where no map has the focus
    },
    true,
  );
  window.addEventListener("keyup", (event) => event.key.toLowerCase() === "x" && !isTyping(event) && press("inspect:original:off"), true);
  window.addEventListener("blur", () => document.querySelector("[data-etv-original]") && press("inspect:original:off"));

  // The number under the pointer. A map is read once for each picture of it.
  const read = new WeakMap();
  const numbers = (image) => {
    const text = image.dataset.etvValues;
    if (read.get(image)?.text !== text) {
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      read.set(image, { text, values: new Float32Array(bytes.buffer) });
    }
    return read.get(image).values;
  };
  const short = (value) => value.toLocaleString("en", { maximumSignificantDigits: 3, useGrouping: false }).replace("-", "−");
  const told = (image, event) => {
    const box = image.getBoundingClientRect();
    const columns = Number(image.dataset.etvMap);
    const values = numbers(image);
    const within = (f, n) => Math.min(Math.max(Math.floor(f * n), 0), n - 1);
    const column = within((event.clientX - box.left) / box.width, columns);
    const row = within((event.clientY - box.top) / box.height, values.length / columns);
    return `token ${column}, ${row} · ${short(values[row * columns + column])} ${image.dataset.etvUnit}`;
  };
  document.addEventListener("pointermove", (event) => {
    const image = event.target.closest?.("[data-etv-values]");
    const readout = image?.closest(".et-stage-map")?.querySelector("[data-etv-readout]");
    if (readout) readout.textContent = told(image, event);
  });

  // A row of a map is saved as a file.
  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-etv-save-text]");
    const text = button?.closest(".et, [data-testid]")?.querySelector("pre")?.textContent;
    if (!text) return;
    const address = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    Object.assign(document.createElement("a"), { href: address, download: button.dataset.etvSaveText }).click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
  });

  // Lines of code go into the clipboard, or are selected where that is not allowed.
  document.addEventListener("click", async (event) => {
    const button = event.target.closest?.("[data-etv-copy-text]");
    const code = button?.closest(".et, [data-testid]")?.querySelector("pre");
    if (!code) return;
    try {
      await navigator.clipboard.writeText(code.textContent);
      button.textContent = "Copied";
    } catch {
      getSelection().selectAllChildren(code);
      button.textContent = document.execCommand("copy") ? "Copied" : "Selected";
    }
  });
})();
