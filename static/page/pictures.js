// Pictures: zoom (wheel), pan, swipe, one picture over the whole stage, and the value under the pointer. All of it
// happens in the browser; what it keeps stands in the document's root and in one style sheet, because the pictures
// themselves are replaced with every frame.
(() => {
  const MOST = 40; // times
  const WIDE = 200; // CSS pixels from which the wheel zooms a picture without Ctrl
  const root = document.documentElement;
  const sheet = document.head.appendChild(document.createElement("style"));
  const within = (value, low, high) => Math.min(Math.max(value, low), high);
  const workspace = () => document.querySelector("[data-etv-workspace]")?.dataset.etvWorkspace ?? "";
  const card = (element) => element?.closest?.("[data-card]")?.dataset.card ?? "";

  // ---- zoom: one for all pictures, or one a card ----
  const WHOLE = { scale: 1, x: 0, y: 0 };
  const zooms = new Map(); // by card; "" is the one that all share
  let isLocked = true;
  let large = null; // {card, workspace}
  const zoomOf = (name) => zooms.get(isLocked ? "" : name) ?? WHOLE;
  const rule = (selector, { scale, x, y }) => `${selector} { --zoom-by: ${scale}; --zoom-x: ${x}; --zoom-y: ${y}; }`;
  const draw = () => {
    const rules = [...zooms].map(([name, zoom]) => rule(name ? `[data-card="${CSS.escape(name)}"]` : ":root", zoom));
    if (large) {
      const here = `:root:has([data-etv-workspace="${large.workspace}"])`;
      const name = CSS.escape(large.card);
      rules.push(
        `${here} .etv-card:not([data-card="${name}"], [data-card="${name}.head"]) { display: none !important; }`,
        `${here} .etv-card[data-card="${name}"] { grid-area: ${document.querySelector(`[data-card="${name}.head"]`) ? 3 : 2} / 1 / -1 / -1 !important; margin: 0; }`,
        `${here} .etv-card[data-card="${name}.head"] { grid-column: 1 / -1 !important; }`,
      );
    }
    sheet.textContent = rules.join("\n");
    root.toggleAttribute("data-zoomed", [...zooms.values()].some((zoom) => zoom.scale > 1));
    root.toggleAttribute("data-unlocked", !isLocked);
    root.toggleAttribute("data-large", Boolean(large));
    for (const element of document.querySelectorAll("[data-etv-lock]")) element.ariaPressed = String(isLocked);
    requestAnimationFrame(read);
  };
  const setZoom = (name, { scale, x, y }) => {
    const most = 1 - 1 / scale;
    const key = isLocked ? "" : name;
    if (scale <= 1) zooms.delete(key);
    else zooms.set(key, { scale, x: within(x, 0, most), y: within(y, 0, most) });
    draw();
  };
  const showLarge = (name) => {
    large = large?.card === name ? null : { card: name, workspace: workspace() };
    draw();
  };
  const zoomable = (target) => target?.closest?.(".etv-card .et-picture");
  const place = (picture, event) => {
    const box = picture.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  document.addEventListener(
    "wheel",
    (event) => {
      const picture = zoomable(event.target);
      if (!picture || !(event.ctrlKey || picture.getBoundingClientRect().width >= WIDE)) return;
      event.preventDefault();
      const before = zoomOf(card(picture));
      const [u, v] = place(picture, event);
      const scale = within(before.scale * Math.exp(-event.deltaY / 300), 1, MOST);
      setZoom(card(picture), { scale, x: before.x + u / before.scale - u / scale, y: before.y + v / before.scale - v / scale });
    },
    { passive: false },
  );
  document.addEventListener("dblclick", (event) => {
    const picture = zoomable(event.target);
    if (!picture) return;
    if (zoomOf(card(picture)).scale > 1) setZoom(card(picture), WHOLE);
    else if (picture.closest(".etv-staged")) showLarge(card(picture));
  });

  // ---- pan and swipe: a drag of either kind chooses no pixel; a click without a drag does ----
  const FAR = 4; // CSS pixels from which a press is a drag
  let drag = null; // {picture, card, x, y, zoom, isSwipe, hasMoved}
  let isOurs = false;
  const swipeTo = (swipe, event) => {
    const box = swipe.getBoundingClientRect();
    root.style.setProperty("--swipe", `${100 * within((event.clientX - box.left) / box.width, 0, 1)}%`);
  };
  document.addEventListener(
    "pointerdown",
    (event) => {
      const picture = zoomable(event.target);
      if (isOurs || !picture || event.button > 1) return;
      const swipe = picture.closest(".et-swipe");
      const zoom = zoomOf(card(picture));
      if (!swipe && zoom.scale === 1) return;
      const line = swipe?.querySelector(":scope > i")?.getBoundingClientRect();
      const isSwipe = Boolean(line) && (zoom.scale === 1 || Math.abs(event.clientX - line.left - line.width / 2) < 24);
      drag = { card: card(picture), box: picture.getBoundingClientRect(), x: event.clientX, y: event.clientY, zoom, isSwipe, target: event.target };
      event.stopImmediatePropagation();
      event.preventDefault();
    },
    { capture: true },
  );
  document.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
    drag.hasMoved ||= Math.hypot(dx, dy) > FAR;
    if (!drag.hasMoved) return;
    const { zoom, box } = drag;
    if (drag.isSwipe) swipeTo({ getBoundingClientRect: () => box }, event);
    else setZoom(drag.card, { ...zoom, x: zoom.x - dx / box.width / zoom.scale, y: zoom.y - dy / box.height / zoom.scale });
  });
  for (const end of ["pointerup", "pointercancel"]) {
    document.addEventListener(end, (event) => {
      const done = drag;
      drag = null;
      if (!done || done.hasMoved || end === "pointercancel" || event.button !== 0) return;
      // A click: said to channel.js as if nobody had held it back. What was pressed may have been replaced meanwhile.
      const target = document.elementFromPoint(done.x, done.y);
      const sign = { bubbles: true, clientX: done.x, clientY: done.y, button: 0, pointerId: event.pointerId };
      isOurs = true;
      target?.dispatchEvent(new PointerEvent("pointerdown", sign));
      target?.dispatchEvent(new PointerEvent("pointerup", sign));
      isOurs = false;
    });
  }

  // ---- buttons and keys ----
  document.addEventListener("click", (event) => {
    const name = event.target.closest?.("[data-etv-large]")?.dataset.etvLarge;
    if (name) showLarge(name);
    if (event.target.closest?.("[data-etv-lock]")) {
      isLocked = !isLocked;
      const shared = zooms.get("");
      zooms.clear();
      if (isLocked && shared) zooms.set("", shared);
      draw();
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && large) showLarge(large.card);
  });

  // ---- the value under the pointer ----
  const one = Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
  const layer = document.body.appendChild(document.createElement("div"));
  layer.className = "etv-values";
  layer.ariaHidden = "true";
  let pointer = null; // {x, y} on the screen
  const colourAt = (image, u, v) => {
    one.clearRect(0, 0, 1, 1);
    one.drawImage(image, Math.floor(u * image.naturalWidth), Math.floor(v * image.naturalHeight), 1, 1, 0, 0, 1, 1);
    return one.getImageData(0, 0, 1, 1).data;
  };
  const numbers = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  // Where on a ramp of colours the nearest point lies, 0 … 1.
  const along = (stops, colour) => {
    let best = [Infinity, 0];
    for (let i = 0; i + 1 < stops.length; i++) {
      const [from, to] = [stops[i], stops[i + 1]];
      const way = to.map((value, k) => value - from[k]);
      const length = way.reduce((sum, value) => sum + value * value, 0) || 1;
      const t = within(way.reduce((sum, value, k) => sum + value * (colour[k] - from[k]), 0) / length, 0, 1);
      const apart = way.reduce((sum, value, k) => sum + (from[k] + t * value - colour[k]) ** 2, 0);
      if (apart < best[0]) best = [apart, (i + t) / (stops.length - 1)];
    }
    return best[1];
  };
  const worded = (share, low, high) => {
    const value = low + (high - low) * share;
    const digits = Math.max(Math.abs(low), Math.abs(high)) >= 20 ? 0 : Math.abs(high - low) < 0.05 ? 4 : 2;
    const edge = share >= 1 ? "≥ " : share <= 0 ? "≤ " : "";
    return edge + value.toFixed(digits).replace("-", "−");
  };
  // "grey:low:high:gamma" and "ramp:low:high:#rrggbb,…:unit" say what a colour stands for; without either only the place is.
  const valueAt = (image, u, v) => {
    const [kind, low, high, scale, unit] = (image.closest(".et-picture").dataset.reads ?? "").split(":");
    if (!kind) return "";
    const colour = colourAt(image, u, v);
    if (kind === "grey") return worded((colour[0] / 255) ** Number(scale), Number(low), Number(high));
    if (colour[3] === 0) return "";
    const value = worded(along(scale.split(",").map(numbers), colour), Number(low), Number(high));
    return unit ? `${value} ${unit}` : value;
  };
  const write = (image, text, isOwn) => {
    const box = image.closest(".et-picture").getBoundingClientRect();
    const element = layer.appendChild(document.createElement("span"));
    element.textContent = text;
    element.className = isOwn ? "etv-own" : "";
    Object.assign(element.style, { right: `${innerWidth - box.right + 6}px`, top: `${box.top + 6}px` }); // chips lie along the lower edge
  };
  const shares = (image) => image.naturalWidth / image.naturalHeight;
  function read() {
    layer.replaceChildren();
    if (!pointer) return;
    const under = document.elementFromPoint(pointer.x, pointer.y);
    const picture = under?.closest?.(".et-picture");
    const swipe = picture?.closest(".et-swipe");
    const isLeft = swipe && pointer.x < swipe.querySelector(":scope > i").getBoundingClientRect().left;
    const image = (isLeft ? swipe.querySelector(":scope > div:last-of-type") : picture)?.querySelector("img");
    if (!image?.naturalWidth || image.dataset.etvValues || document.querySelector(".etv-tour, [role=dialog][data-modal-content]")) return;
    const box = image.getBoundingClientRect();
    const [u, v] = [(pointer.x - box.left) / box.width, (pointer.y - box.top) / box.height];
    if (u < 0 || v < 0 || u >= 1 || v >= 1) return;
    const sides = [image.getAttribute("width") || image.naturalWidth, image.getAttribute("height") || image.naturalHeight];
    const [x, y, width, height] = (image.dataset.area?.split(",") ?? [0, 0, ...sides]).map(Number);
    const own = valueAt(image, u, v);
    if (box.width < 90 && !own) return;
    const at = `x ${Math.floor(x + u * width)}, y ${Math.floor(y + v * height)}`.replaceAll("-", "−");
    write(image, own ? `${at} · ${own}` : at, true);
    if (!isLocked || !picture.closest(".etv-staged")) return;
    for (const other of document.querySelectorAll(".etv-staged .et-picture > img")) {
      const isSeen = other !== image && other.naturalWidth && other.checkVisibility() && other.parentNode.clientWidth >= WIDE;
      if (!isSeen || other.closest(".et-swipe")?.contains(image) || Math.abs(shares(other) / shares(image) - 1) > 0.02) continue;
      const value = valueAt(other, u, v);
      if (value) write(other, value, false);
    }
  }
  let asked = false;
  document.addEventListener("pointermove", (event) => {
    const isOver = Boolean(event.target.closest?.(".et-picture"));
    if (!isOver && !pointer) return;
    pointer = isOver && event.pointerType !== "touch" ? { x: event.clientX, y: event.clientY } : null;
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => ((asked = false), read()));
  });
  document.addEventListener("pointerleave", () => ((pointer = null), read()));
  setInterval(() => pointer && read(), 250); // pictures change under a pointer that rests

  // Pieces of the page that come later have to show what holds now.
  new MutationObserver(() => {
    for (const element of document.querySelectorAll("[data-etv-lock]")) {
      if (element.ariaPressed !== String(isLocked)) element.ariaPressed = String(isLocked);
    }
    if (large && large.workspace !== workspace()) {
      large = null;
      draw();
    }
  }).observe(document.body, { childList: true, subtree: true });
})();
