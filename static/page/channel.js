// The page's end of app/session/channel.py: what viser's widgets cannot say. Every message is a text "kind|…|counter".
(() => {
  let counter = Date.now();
  const say = (...parts) => {
    const page = window.__viserMutable;
    if (!page || !window.etnetChannel) return;
    const value = [...parts, ++counter].join("|");
    page.sendMessage({ type: "GuiUpdateMessage", uuid: window.etnetChannel, updates: { value } });
  };

  // One number a tab, kept while the tab lives: a reload finds its own view again, a second tab has another.
  const tab = () => {
    try {
      const kept = sessionStorage.getItem("etnet-tab");
      const number = kept ?? String(Math.floor(Math.random() * 256));
      sessionStorage.setItem("etnet-tab", number);
      return number;
    } catch {
      return "0";
    }
  };
  const size = () => [window.innerWidth, window.innerHeight];
  window.etnetHello = () => say("hello", tab(), ...size());

  // Clicks; and dragging, over an image for a pixel and along an axis for a moment: at most 30 values a second, the last
  // one always. What is dragged keeps its place on the screen, though its HTML is replaced meanwhile.
  const isPixel = (element) => element?.dataset.k === "pixel" || element?.dataset.k.startsWith("cut:");
  const inside = (f) => Math.min(Math.max(f, 0), 0.99999);
  let held = null; // {key, box, isAxis}
  let last = 0;
  let owed = 0;
  const pick = (event) => {
    const u = inside((event.clientX - held.box.left) / held.box.width);
    const v = inside((event.clientY - held.box.top) / held.box.height);
    if (held.isAxis) document.documentElement.style.setProperty("--drag-x", `${100 * u}%`);
    last = event.timeStamp;
    say("pick", held.key, u.toFixed(5), v.toFixed(5));
  };
  document.addEventListener("pointerdown", (event) => {
    const element = event.target.closest?.("[data-pick]");
    if (!element || event.button !== 0) return;
    const isAxis = element.dataset.drag !== undefined;
    held = { key: element.dataset.k, box: element.getBoundingClientRect(), isAxis };
    pick(event);
    if (!isAxis && !isPixel(element)) held = null;
    else event.preventDefault();
  });
  document.addEventListener("pointermove", (event) => {
    if (!held) return;
    clearTimeout(owed);
    if (event.timeStamp - last >= 33) pick(event);
    else owed = setTimeout(() => held && pick(event), 33);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    document.addEventListener(end, (event) => {
      if (!held) return;
      clearTimeout(owed);
      if (end === "pointerup" && held.isAxis) pick(event);
      held = null;
      setTimeout(() => held || document.documentElement.style.removeProperty("--drag-x"), 400);
    });
  }

  // Along an axis the pointer's time is shown; the wheel looks closer at a part of it.
  const hover = document.createElement("div");
  hover.className = "etv-hover";
  hover.hidden = true;
  document.body.append(hover);
  document.addEventListener("pointermove", (event) => {
    const axis = event.target.closest?.(".et-axis");
    hover.hidden = !axis;
    if (!axis) return;
    const box = axis.getBoundingClientRect();
    hover.textContent = `${(Number(axis.dataset.start) + inside((event.clientX - box.left) / box.width) * Number(axis.dataset.duration)).toFixed(3)} s`;
    Object.assign(hover.style, { left: `${event.clientX}px`, top: `${box.top - 4}px` });
  });
  let zoom = 1;
  let from = 0;
  document.addEventListener(
    "wheel",
    (event) => {
      const strip = event.target.closest?.(".et-strip");
      if (!strip) return;
      event.preventDefault();
      const box = strip.getBoundingClientRect();
      const at = (event.clientX - box.left) / box.width;
      const fixed = from + at / zoom;
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) from += (event.deltaX || event.deltaY) / box.width / zoom;
      else {
        zoom = Math.min(Math.max(zoom * Math.exp(-event.deltaY / 300), 1), 200);
        from = fixed - at / zoom;
      }
      from = Math.min(Math.max(from, 0), 1 - 1 / zoom);
      document.documentElement.style.setProperty("--zoom", zoom);
      document.documentElement.style.setProperty("--from", from);
    },
    { passive: false },
  );

  // In public the show lets go of the page at the first touch, wherever it is.
  let touched = 0;
  const touch = (event) => {
    if (!event.isTrusted || event.timeStamp - touched < 500 || !document.querySelector("[data-etv-public]")) return;
    touched = event.timeStamp;
    say("touch");
  };
  for (const kind of ["pointerdown", "keydown", "wheel"]) {
    document.addEventListener(kind, touch, { capture: true, passive: true });
  }

  // Small selects and numbers of our own: what is chosen is a key with the choice at its end.
  document.addEventListener("change", (event) => {
    const key = event.target.dataset?.set;
    if (!key || event.target.value === "") return;
    say("pick", `${key}:${event.target.value.replaceAll("|", "")}`, 0, 0);
    event.target.blur();
  });

  // Keys that viser's commands do not know. Not while something is being typed.
  const keys = { ",": "comma", ".": "period", "?": "question" };
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
    if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey && keys[event.key]) say("key", keys[event.key]);
  });

  // viser's canvas lies over the slot of its card, wherever that stands and as long as it can be seen.
  let placed = "";
  const place = () => {
    const slot = document.querySelector(".etv-scene-slot");
    const box = slot?.checkVisibility() ? slot.getBoundingClientRect() : null;
    const now = box && box.width > 20 ? [box.left, box.top, box.width, box.height].map(Math.round).join() : "";
    if (now === placed) return;
    placed = now;
    const style = document.documentElement.style;
    for (const [i, side] of ["left", "top", "width", "height"].entries()) {
      if (now) style.setProperty(`--scene-${side}`, `${now.split(",")[i]}px`);
      else style.removeProperty(`--scene-${side}`);
    }
    window.dispatchEvent(new Event("resize")); // viser measures its canvas then
  };
  setInterval(place, 100);
  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => (place(), say("size", ...size())), 150);
  });

  // The list of recordings: what is typed leaves out what does not match; a choice, Escape or a click elsewhere closes it.
  const list = () => document.querySelector(".etv-recordings[open]");
  document.addEventListener("input", (event) => {
    if (!event.target.closest?.(".etv-list")) return;
    const words = event.target.value.toLowerCase().split(" ");
    for (const row of event.target.closest(".etv-list").querySelectorAll("button")) {
      row.hidden = !words.every((word) => row.innerText.toLowerCase().includes(word));
    }
  });
  document.addEventListener("click", (event) => {
    const open = list();
    if (open && (!open.contains(event.target) || event.target.closest("[data-k]"))) open.open = false;
    else if (open) open.querySelector("input").focus();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && list()) list().open = false;
  });

  // A moment as a link: C copies the address of what is on show. The address that this page was opened by is told
  // once; on a reload the page rather returns to where it was.
  const copy = async () => {
    const moment = document.querySelector("[data-etv-moment]")?.dataset.etvMoment;
    if (!moment) return;
    const address = `${location.origin}${location.pathname}?moment=${moment}`;
    try {
      await navigator.clipboard.writeText(address);
      say("copied", 1);
    } catch {
      const field = document.createElement("textarea");
      field.value = address;
      document.body.append(field);
      field.select();
      const isDone = document.execCommand("copy");
      field.remove();
      say("copied", isDone ? 1 : 0);
    }
  };
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
    const plain = !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat;
    if (!typing && plain && event.key.toLowerCase() === "c") copy();
  });
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-etv-copy]")) copy();
  });
  const follow = () => {
    const moment = new URLSearchParams(location.search).get("moment");
    const kind = performance.getEntriesByType("navigation")[0]?.type;
    if (moment && !(kind === "reload" && sessionStorage.getItem("etnet-moment") === moment)) say("link", moment);
    try {
      sessionStorage.setItem("etnet-moment", moment ?? "");
    } catch {
      // a page that may keep nothing follows its address each time
    }
  };

  document.title = "ET-Net viewer"; // viser sets its own once it runs
  place();
  window.etnetHello();
  follow();
  for (const name of ["tour", "upload", "tidy", "keys", "pictures"]) {
    const script = document.createElement("script");
    script.src = `/static/${name}.js`;
    document.head.append(script);
  }
})();
